"""The flight decoder: from a flight file to flight data, one batch of frames in memory at a time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from decoder.imaging.picture_block import TopOfFrame, batch_frames
from decoder.imaging.pictures import FramePicture
from decoder.instruments.frame_batch import Batch, Outcome, RawFrame, ReadBatches, Unread, batches, read_here
from decoder.instruments.panel_reader import PanelReader
from decoder.learning.fit import fit_to_flight
from decoder.learning.flight_sample import FlightSample, Tell, nobody
from decoder.learning.in_between import learn_in_between
from decoder.learning.thresholds import SAMPLE_FRAMES
from decoder.panel.errors import FlightUnreadable, PictureError
from decoder.panel.panel import NEEDLE_SUFFIXES, Panel
from decoder.timeseries.flight_data import FlightData, FlightDataBuilder
from decoder.timeseries.flight_part import FlightPart
from decoder.timeseries.gaps import fill_gaps
from decoder.timeseries.gps import resampled
from decoder.timeseries.health import doubted, gauge_health
from flight_file.frame import Frame, GpsFix
from flight_file.reader import Flight

Progress = Callable[[Iterator[Frame]], Iterator[Frame]]


def decode_flight(
    flight: Flight,
    reader: PanelReader,
    progress: Progress,
    *,
    read: ReadBatches = read_here,
    part: FlightPart | None = None,
    tell: Tell = nobody,
) -> FlightData:
    """Decode a flight.

    Parameters
    ----------
    flight
        Opened; a sample of it is read first.
    reader
        With the panel's own templates and pivots; it is fitted to the flight here.
    progress
        Wraps the frames as they are taken from the file.
    read
        Reads the batches, in this process or in others.
    part
        The frames to read; None for all. The reader is fitted to the whole flight in any case, so that a frame's
        readings are the same whichever part is asked for.
    tell
        Called with a description of the work before frames are taken, and with "" once they are.

    Raises
    ------
    FlightUnreadable
        If no frame at all can be read with this panel, with the commonest reason; for a whole flight, already if a
        sample spread over it does not show the panel.
    """
    sample = FlightSample(flight, reader.placer.rows_at_first(), tell=tell)
    fitted = fit_to_flight(reader, sample, tell=tell)
    fitted = replace(fitted, reader=learn_in_between(fitted.reader, sample, tell=tell))
    tell("")
    if part is None and not fitted.sampled and 0 < len(sample.opened) < flight.count():
        looked = len(sample.opened)
        refused = Counter(filter(None, (_refusal(reader, frame) for frame in sample(SAMPLE_FRAMES))))
        if refused.total() == looked:  # none was even searched
            raise FlightUnreadable(_why(flight.paths[0].name, looked, refused))
        raise FlightUnreadable(_nowhere(flight, fitted.panel, looked))
    height, width = reader.source.picture.shape
    frames_of_part = progress(flight.shown(None if part is None else part.ranks))
    cut = batches(frames_of_part, batch_frames((width, height)), sample.given_up)
    builder = _gathered(fitted.panel, read(fitted.reader, cut), flight)
    built = replace(
        builder.build(fitted.sigma_deg),
        moved_pivots_px=fitted.moved_px,
        warnings=fitted.reader.warnings,
        part=part,
        time_of_day=flight.session.time_of_day,
        columns=fitted.panel.columns,
        budgets=fitted.budgets,
    )
    data = with_gps(fill_gaps(built), flight.fixes())
    data, doubts = doubted(data, fitted.allowed_sigma_deg)
    findings = {gauge: (*found, *doubts.get(gauge, ())) for gauge, found in fitted.findings.items()}
    return replace(data, health=gauge_health(data, findings))


def _gathered(panel: Panel, read: Iterable[tuple[Batch, list[Outcome]]], flight: Flight) -> FlightDataBuilder:
    """Collect the readings of all frames; raise the commonest reason if none could be read."""
    builder = FlightDataBuilder(panel)
    reasons: Counter[str] = Counter()
    frames = 0
    for batch, outcomes in read:
        for frame, outcome in zip(batch, outcomes, strict=True):
            _add(builder, frame, outcome)
            if isinstance(outcome, Unread):
                reasons[outcome.reason] += 1
        frames += len(batch)
    if sum(reasons.values()) == frames:
        raise FlightUnreadable(_why(flight.paths[0].name, frames, reasons))
    return builder


def with_gps(data: FlightData, fixes: Iterable[GpsFix]) -> FlightData:
    """Add the camera's GPS columns; if a needle has the same name as one, the needle wins, with a warning."""
    found = resampled(fixes, data.time_ns)
    if found is None:
        return data
    names = [series.quantity.name for series in data.series]
    taken = {name + suffix for name in names for suffix in NEEDLE_SUFFIXES}
    gps = found.without(taken)
    left_out = [column.name for column in found.columns if column not in gps.columns]
    warnings = tuple(f"the panel has a needle called {name}; what the GPS says of it is left out" for name in left_out)
    return replace(data, gps=gps, warnings=data.warnings + warnings)


def _add(builder: FlightDataBuilder, frame: RawFrame, outcome: Outcome) -> None:
    if isinstance(outcome, Unread):
        builder.add_missing(frame.sequence, frame.captured_ns, outcome.reason, outcome.failed)
    else:
        builder.add(frame.sequence, frame.captured_ns, outcome)


def _refusal(reader: PanelReader, frame: FramePicture | TopOfFrame) -> str | None:
    """Return why a frame is not searched at all; None if it is."""
    try:
        reader.aligner.optics.zoom(frame.focal_length_mm, (frame.pixels.shape[1], frame.height_px))
    except PictureError as error:
        return str(error)
    return None


def _nowhere(flight: Flight, panel: Panel, looked: int) -> str:
    """Say that the panel was not found in a sample, and what was searched for."""
    names = [anchor.name for anchor in panel.anchors]
    anchors = f"its {len(names)} anchors ({', '.join(names)}) were" if len(names) > 1 else f"its anchor {names[0]} was"
    return (
        f"{flight.paths[0].name}: the panel {panel.name!r} is in none of {looked} frames spread over the flight's"
        f" {flight.count()}: {anchors} looked for, and the whole picture; is it the panel of this cockpit?"
        " If it is in sight for a short time only, say when with --from and --to"
    )


def _why(name: str, frames: int, reasons: Counter[str]) -> str:
    if not frames:
        return f"{name}: holds no frames"
    reason, _ = reasons.most_common(1)[0]
    return f"{name}: none of its {frames} frames fits this panel: {reason}; is it the panel of this cockpit?"
