"""The fit of a reader to a flight: align a sample, learn appearance, estimate pivots; repeated until it stays.

Each round unwraps the sample around the pivots as they are, and tells how far they still are from where needles turn.
What is left in the end is added to the readings' uncertainty.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from decoder.imaging.alignment import Alignment
from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.pictures import FramePicture, GreyPicture
from decoder.imaging.planes import DialPlane
from decoder.instruments.appearance import Instrument
from decoder.instruments.kinds import kind_of
from decoder.instruments.method import Method
from decoder.instruments.panel_reader import PanelReader, unwrapped
from decoder.instruments.reading import Reading, Status
from decoder.learning.flight_appearance import learn_appearance, lit_views
from decoder.learning.flight_sample import Sample, align_sample, frames_wanted, with_usual_place
from decoder.learning.panel_appearance import appearance_from_panel
from decoder.learning.pivots import (
    PivotPath,
    Vector,
    any_lift_is_off,
    care_px,
    estimate_pivots,
    lifts_missing,
)
from decoder.learning.seen_faces import with_seen_faces
from decoder.learning.thresholds import MIN_SAMPLES, MISSING_PART
from decoder.learning.uncertainty import QuantityUncertainty, quantity_uncertainties
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.registration.frame_placer import UnwrappedFrame, UnwrappedPanel
from decoder.registration.placement import Pivot, Placement

ROUNDS = 8
# The nearer a needle is cut to its pivot, the more surely that is found.
FAR_ROUNDS = 3


@dataclass(frozen=True, slots=True)
class FittedReader:
    """A reader fitted to a flight.

    Attributes
    ----------
    uncertainties
        By quantity: what its readings are uncertain by beyond what their frames tell.
    moved_px
        By gauge, for those whose needles turn elsewhere than the panel says: (x, y).
    unsettled
        The gauges whose needles turn where no round had them.
    """

    reader: PanelReader
    uncertainties: Mapping[str, QuantityUncertainty]
    moved_px: Mapping[str, tuple[float, float]]
    unsettled: tuple[str, ...]

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the flight leaves wanting, a sentence each."""
        return tuple(
            f"{name}: its needles turn beside the centre that the panel gives, and where was not found surely; sigma"
            " allows for that. Is the gauge drawn right?"
            for name in self.unsettled
        )

    def sigma_deg(self, name: str, angles_deg: Floats) -> Floats:
        """(N,): what readings of a quantity at these angles are uncertain by beyond what their frames tell."""
        return self.uncertainties[name].sigma_deg(angles_deg)


@dataclass(frozen=True, slots=True)
class _Round:
    """What one round tells: the reader with what it learned, its readings by frame, and by gauge the pivot."""

    reader: PanelReader
    found: Sequence[Mapping[str, Reading]]
    pivots: tuple[Pivot, ...]


def fit_to_flight(reader: PanelReader, sample: Sample, *, rounds: int = ROUNDS) -> FittedReader:
    """Fit a reader to the flight of which `sample` gives some frames, in so many rounds at most."""
    source, gauges = reader.source, reader.source.panel.gauges
    reader, samples = align_sample(reader, sample)
    reader, samples, paths = _around_far_pivots(reader, samples, sample)
    last = _learned(reader, samples, paths)
    first = last.pivots
    for _ in range(rounds - 1):
        paths = [path.next(pivot) for path, pivot in zip(paths, last.pivots, strict=True)]
        around = _around_pivots(last, [path.step_px for path in paths])
        if around is None:
            break
        del reader, samples, last  # they need not lie in memory beside those of the next round
        reader, samples = around, unwrapped(around, sample(frames_wanted(around.placement)))
        last = _learned(reader, samples, paths)
    pivots = [path.with_doubt(*both) for path, *both in zip(paths, last.pivots, first, strict=True)]
    parts = list(zip(gauges, last.reader.source.panel.gauges, paths, last.pivots, strict=True))
    return FittedReader(
        reader=_completed(last, pivots),
        uncertainties=quantity_uncertainties(
            source, pivots, care_px=care_px(paths, pivots), dials_move=last.reader.placement.dials_move
        ),
        moved_px={
            gauge.name: (gauge.centre[0] - drawn.centre[0], gauge.centre[1] - drawn.centre[1])
            for drawn, gauge, path, _ in parts
            if path.was_moved
        },
        unsettled=tuple(gauge.name for _, gauge, path, pivot in parts if path.was_moved and not path.is_right(pivot)),
    )


def tune(reader: PanelReader, frames: Iterable[GreyPicture | FramePicture]) -> PanelReader:
    """Learn from a sample of a flight what it tells; with too few usable frames the reader stays as it was."""
    samples = unwrapped(reader, frames)
    found = _read(reader, samples)
    return with_usual_place(learn_appearance(reader, lit_views(reader, samples), found), samples)


def _learned(reader: PanelReader, samples: Sequence[UnwrappedFrame], paths: Sequence[PivotPath]) -> _Round:
    """Learn appearance from an aligned sample, and estimate pivots with it."""
    views, found = lit_views(reader, samples), _read(reader, samples)
    bared = with_seen_faces(reader, views, found)
    if bared is not reader:
        reader, found = bared, _read(bared, samples)
    reader = with_usual_place(learn_appearance(reader, views, found), samples)
    missing = any(reading.status is Status.MISSING for readings in found for reading in readings.values())
    if reader.placement.dials_move or missing:  # then each tilt counts; else its fit needs no better guess
        found = _read(reader, samples)
    return _Round(reader, found, estimate_pivots(reader, samples, found, paths))


def _read(reader: PanelReader, samples: Sequence[UnwrappedFrame]) -> list[Mapping[str, Reading]]:
    """Read a sample, by frame."""
    return [frame.readings for frame in reader.read_unwrapped(samples)]


def _around_far_pivots(
    reader: PanelReader, samples: list[UnwrappedFrame], sample: Sample
) -> tuple[PanelReader, list[UnwrappedFrame], list[PivotPath]]:
    """Unwrap a sample around the pivots of gauges whose centres are drawn far from them, and tell how far."""
    gauges = reader.source.panel.gauges
    paths = [PivotPath()] * len(gauges)
    for _ in range(FAR_ROUNDS):
        views = lit_views(reader, samples)
        parts = zip(gauges, reader.grids, reader.appearance.faces, reader.own_gauges, views, paths, strict=True)
        steps = [
            None
            if path.is_found
            else kind_of(gauge).far_pivot(
                Instrument(index, gauge, grid, face), own, [view for view in seen if view is not None]
            )
            for index, (gauge, grid, face, own, seen, path) in enumerate(parts)
        ]
        paths = [path.from_afar(step) for path, step in zip(paths, steps, strict=True)]
        if not any(steps):
            break
        reader = _unwrapped_around(reader, steps)
        samples = unwrapped(reader, sample(frames_wanted(reader.placement)))
    return reader, samples, paths


def _around_pivots(last: _Round, steps: Sequence[Vector | None]) -> PanelReader | None:
    """Unwrap the panel around its pivots as they were estimated; None where they and the lifts are right already."""
    placed = last.reader.placement
    lifts = placed.lifts or (0.0,) * len(steps)
    missing = lifts_missing(lifts, last.pivots) if placed.dials_move else ()  # then none has a lift
    if not any(steps) and not any_lift_is_off(missing):
        return None
    return _unwrapped_around(last.reader, steps, missing)


def _unwrapped_around(
    reader: PanelReader, steps: Sequence[Vector | None], lifts_missing: Sequence[float] = ()
) -> PanelReader:
    """Return a reader of the panel with its pivots some steps on, which has learned nothing around them yet."""
    source, placed, own = reader.source, reader.placement, reader.source.optics.own
    lifts = placed.lifts or (0.0,) * len(steps)
    planes = source.planes or (None,) * len(steps)
    of_gauges = list(zip(source.panel.gauges, planes, steps, strict=True))
    gauges = tuple(gauge if step is None else _around(gauge, plane, own, step) for gauge, plane, step in of_gauges)
    moved = replace(
        source,
        panel=source.panel.model_copy(update={"gauges": gauges}),
        planes=tuple(plane if plane is None or step is None else plane.around(step) for _, plane, step in of_gauges),
    )
    drawn = UnwrappedPanel(moved)
    placement = Placement(
        usual=placed.usual,
        dials_move=placed.dials_move,
        anchors_agree=placed.anchors_agree,
        lifts=tuple(lift + more for lift, more in zip(lifts, lifts_missing, strict=False)),
    )
    return PanelReader.of(moved, reader.method, appearance_from_panel(drawn), placement, drawn)


def _around(gauge: Gauge, plane: DialPlane | None, own: Alignment, step_px: Vector) -> Gauge:
    """Move the gauge's centre by a step that is told in the dial's own plane."""
    if plane is None:
        (x, y), (right, down) = gauge.centre, step_px
        return gauge.model_copy(update={"centre": (x + right, y + down)})
    there = plane.to_panel(np.array(step_px)[:, None])[:, 0]
    return gauge.model_copy(update={"centre": own.to_frame((float(there[0]), float(there[1])))})


def _completed(last: _Round, pivots: Sequence[Pivot]) -> PanelReader:
    """Tell the reader which needles are doubted and, where dials move, where needles turn."""
    doubted = _doubted(last.found)
    reader = last.reader
    if doubted:
        reader = reader.with_appearance(replace(reader.appearance, doubted=doubted))
    if reader.placement.dials_move:
        reader = reader.with_placement(replace(reader.placement, pivots=tuple(pivots)))
    return reader


def _doubted(found: Sequence[Mapping[str, Reading]]) -> frozenset[str]:
    """Name the needles that are missing in most of the sampled frames, of enough of them to tell."""
    if len(found) < MIN_SAMPLES:
        return frozenset()
    return frozenset(
        name
        for name in found[0]
        if sum(readings[name].status is Status.MISSING for readings in found) > MISSING_PART * len(found)
    )


def reader_from_panel(source: PanelPictures, method: Method) -> PanelReader:
    """Make a reader that knows its needles and dials as the panel gives them.

    Raises
    ------
    PanelError
        If a template, an anchor or the level edge does not fit the panel picture.
    """
    drawn = UnwrappedPanel(source)
    return PanelReader.of(source, method, appearance_from_panel(drawn), Placement(), drawn)
