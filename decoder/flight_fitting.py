"""Fitting a reader to a flight: needles and dials as its own frames show them, and pivots where its needles turn.

Also what is left of both: what readings are uncertain by beyond what their own frames tell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from decoder.alignment import Alignment
from decoder.arrays import Floats
from decoder.dial_plane import DialPlane
from decoder.flight_placing import LOOKED_AT, Sample, frames_wanted, placed_for
from decoder.flight_tuning import MIN_CUTS, lit_views, taken, tune_on, unwrapped
from decoder.frame_placer import UnwrappedFrame
from decoder.gauge import Gauge
from decoder.many_frames import UnwrappedGauges
from decoder.panel_needles import DrawnGauge, drawn_gauges
from decoder.panel_reader import PanelReader
from decoder.panel_tuning import tuning_from_panel
from decoder.pivot_path import PivotPath
from decoder.pivot_rounds import any_lift_is_off, ended, further, is_off, lifts_missing
from decoder.pivots import Pivot, pivot_of
from decoder.pivots_together import pooled
from decoder.reading import Reading, Status
from decoder.seen_faces import with_seen_faces
from decoder.uncertainty import QuantityUncertainty, quantity_uncertainties
from decoder.unwrapped_panel import UnwrappedPanel

ROUNDS = 8
# A needle that is missing in more of the sampled frames than this is not known as it is.
MISSING_PART = 0.5


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
class _Learned:
    """What a sample tells in one round.

    Attributes
    ----------
    before, reader
        The reader that the sample was first read with, and the one that was tuned on it.
    found
        By frame the readings.
    drawn
        The gauges of the panel picture; none where dials move: at other depths it is another view of them.
    pivots
        By the gauges' order in the panel.
    """

    before: PanelReader
    reader: PanelReader
    found: Sequence[Mapping[str, Reading]]
    drawn: Sequence[DrawnGauge]
    pivots: tuple[Pivot, ...]


def fit_to_flight(reader: PanelReader, sample: Sample, *, rounds: int = ROUNDS) -> FittedReader:
    """The reader fitted to the flight of which `sample` gives some frames, in so many rounds at most."""
    source = reader.source
    drawn = source.panel.gauges
    reader, samples = placed_for(reader, sample)
    paths = [PivotPath()] * len(drawn)
    learned = _learned(reader, samples, paths)
    first = learned.pivots
    for _ in range(rounds - 1):
        paths = further(paths, learned.pivots)
        moved = _with_pivots_moved(learned, paths)
        if moved is None:
            break
        del learned, reader, samples  # they need not lie in memory beside those of the next round
        reader, samples = moved, unwrapped(moved, sample(frames_wanted(moved.tuning)))
        learned = _learned(reader, samples, paths)
    dials_move = learned.reader.tuning.dials_move
    zeros = [gauge.readings for gauge in learned.drawn or drawn_gauges(learned.reader)]
    pivots = [
        ended(pivot, step.offset_px, path) if path.was_moved else pivot
        for path, step, pivot in zip(paths, first, learned.pivots, strict=True)
    ]
    return FittedReader(
        reader=_completed(learned, sample, pivots),
        uncertainties=quantity_uncertainties(source, pivots, zeros, dials_move=dials_move),
        moved_px=_moved_px(learned.reader, drawn),
        unsettled=_unsettled(learned, paths),
    )


def _learned(reader: PanelReader, samples: Sequence[UnwrappedFrame], paths: Sequence[PivotPath]) -> _Learned:
    """The reader tuned on a sample, and what the sample tells with it."""
    views = lit_views(reader, samples)
    gauges = [UnwrappedGauges(sample.gauges, sample.whole) for sample in samples]
    found = reader.found_on(gauges)
    seen = with_seen_faces(reader, views, found)
    if seen is not reader:
        reader, found = seen, seen.found_on(gauges)
    tuned = tune_on(reader, samples, views, found)
    if tuned.tuning.dials_move or _any_missing(found):  # then each tilt counts; else its fit needs no better guess
        found = tuned.found_on(gauges)
    drawn = () if tuned.tuning.dials_move else drawn_gauges(tuned)
    pivots = pooled(_pivots(tuned, samples, found, drawn), [path.moved_px for path in paths])
    return _Learned(reader, tuned, found, drawn, pivots)


def _with_pivots_moved(learned: _Learned, paths: Sequence[PivotPath]) -> PanelReader | None:
    """A reader, not tuned yet, with pivots and lifts as they were learned; None where they are right already."""
    source, tuning = learned.before.source, learned.before.tuning
    lifts = tuning.lifts or (0.0,) * len(paths)
    missing = lifts_missing(lifts, learned.pivots) if tuning.dials_move else ()  # then none has a lift
    steps = [path.step_px for path in paths]
    if not any(steps) and not any_lift_is_off(missing):
        return None
    own = source.optics.own
    of_gauges = list(zip(source.panel.gauges, _planes(learned.reader), steps, strict=True))
    gauges = tuple(gauge if step is None else _around(gauge, plane, own, step) for gauge, plane, step in of_gauges)
    planes = tuple(plane if plane is None or step is None else plane.around(step) for _, plane, step in of_gauges)
    moved = replace(source, panel=source.panel.model_copy(update={"gauges": gauges}), planes=planes)
    drawn = UnwrappedPanel(moved)
    first = replace(
        tuning_from_panel(drawn),
        usual=learned.reader.tuning.usual,
        dials_move=tuning.dials_move,
        anchors_agree=tuning.anchors_agree,
        lifts=tuple(lift + more for lift, more in zip(lifts, missing, strict=False)),
    )
    return PanelReader(moved, learned.before.method, first, drawn)


def _completed(learned: _Learned, sample: Sample, pivots: Sequence[Pivot]) -> PanelReader:
    """The tuned reader, told what else the sample says of needles and alignments."""
    reader = learned.reader
    tuning = replace(reader.tuning, doubted=_doubted(learned.found))
    if tuning.dials_move:
        return reader.tuned(replace(tuning, pivots=tuple(pivots)))
    noise = reader.placer.alignment_noise(list(taken(sample(LOOKED_AT))))
    return reader.tuned(replace(tuning, alignment_noise=noise))


def _moved_px(reader: PanelReader, drawn: Sequence[Gauge]) -> dict[str, tuple[float, float]]:
    """By gauge, for those whose pivot was moved: how far, (x, y)."""
    return {
        gauge.name: (gauge.centre[0] - before.centre[0], gauge.centre[1] - before.centre[1])
        for gauge, before in zip(reader.source.panel.gauges, drawn, strict=True)
        if gauge.centre != before.centre
    }


def _unsettled(learned: _Learned, paths: Sequence[PivotPath]) -> tuple[str, ...]:
    """The gauges whose pivots were moved, and are still not right."""
    of_gauges = zip(learned.reader.source.panel.gauges, paths, learned.pivots, strict=True)
    return tuple(gauge.name for gauge, path, pivot in of_gauges if path.was_moved and is_off(pivot, was_moved=True))


def _doubted(found: Sequence[Mapping[str, Reading]]) -> frozenset[str]:
    """The needles that are missing in most of the sampled frames, of enough of them to tell."""
    if len(found) < MIN_CUTS:
        return frozenset()
    return frozenset(
        name
        for name in found[0]
        if sum(readings[name].status is Status.MISSING for readings in found) > MISSING_PART * len(found)
    )


def _any_missing(found: Sequence[Mapping[str, Reading]]) -> bool:
    return any(reading.status is Status.MISSING for readings in found for reading in readings.values())


def _pivots(
    reader: PanelReader,
    samples: Sequence[UnwrappedFrame],
    found: Sequence[Mapping[str, Reading]],
    drawn: Sequence[DrawnGauge],
) -> tuple[Pivot, ...]:
    """By the tuned needles, near where they were found, and where the panel picture has them."""
    return tuple(
        pivot_of(
            gauge,
            grid,
            face,
            reader.tuning.templates,
            [
                (sample.gauges[index], readings, sample.dial_shifts_px[index] if sample.dial_shifts_px else (0.0, 0.0))
                for sample, readings in zip(samples, found, strict=True)
            ]
            + [(gauge.strip, gauge.readings, (0.0, 0.0)) for gauge in drawn[index : index + 1]],
        )
        for index, (gauge, grid, face) in enumerate(
            zip(reader.source.panel.gauges, reader.grids, reader.tuning.faces, strict=True)
        )
    )


def _planes(reader: PanelReader) -> Sequence[DialPlane | None]:
    return reader.source.planes or (None,) * len(reader.grids)


def _around(gauge: Gauge, plane: DialPlane | None, own: Alignment, step_px: tuple[float, float]) -> Gauge:
    """The gauge around its true pivot, which is told in the dial's own plane."""
    if plane is None:
        (x, y), (right, down) = gauge.centre, step_px
        return gauge.model_copy(update={"centre": (x + right, y + down)})
    there = plane.to_panel(np.array(step_px)[:, None])[:, 0]
    return gauge.model_copy(update={"centre": own.to_frame((float(there[0]), float(there[1])))})
