"""The fit of a reader to a flight: align a sample, learn appearance, estimate pivots; repeated until it converges.

Each round unwraps the sample around the current pivots, and estimates how far they are from where needles turn. What
remains of that distance is added to the readings' uncertainty.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from decoder.imaging.alignment import Alignment, Point
from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.pictures import FramePicture, GreyPicture
from decoder.imaging.planes import DialPlane, Squeeze
from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import UnwrappedGauge
from decoder.instruments.appearance import Appearance, Instrument, LearnedPicture
from decoder.instruments.colours import in_panels_colours
from decoder.instruments.kind_table import kind_of
from decoder.instruments.missing import finds_more, is_lost, is_unread, missing_part, mostly_missing
from decoder.instruments.needle_learner import Readings
from decoder.instruments.panel_reader import PanelReader, appearance_from_panel, unwrapped
from decoder.instruments.reading import Reading, Status
from decoder.instruments.thresholds import FRAMES_TO_LEARN
from decoder.learning.budget import Budget, budgets
from decoder.learning.drawn_points import (
    PRIOR_LOG_ODDS,
    backward_findings,
    is_beyond_a_hand,
    log_odds_of_points,
    seen_from_pivots,
    slip_findings,
    uneven_deg,
)
from decoder.learning.flight_appearance import (
    as_likely,
    kept_where_better,
    learn_appearance,
    learn_hidden_looks,
    learn_likely_needles,
    lit_views,
    read_sample,
)
from decoder.learning.flight_colours import in_best_colours
from decoder.learning.flight_focus import as_sharp_as_frames
from decoder.learning.flight_sample import Sample, Tell, align_sample, frames_wanted, nobody, with_usual_place
from decoder.learning.obliqueness import squeezes_seen
from decoder.learning.pivot_path import PivotPath, Vector
from decoder.learning.pivots import (
    any_lift_is_off,
    care_part,
    estimate_pivots,
    lifts_missing,
)
from decoder.learning.seen_faces import least_at_home, may_be_lost, of_gauges, with_seen_faces, with_usual_dials
from decoder.learning.thresholds import MOST_MARK_PART
from decoder.learning.uncertainty import QuantityUncertainty, quantity_uncertainties
from decoder.learning.unexplained import (
    mistaken_needles,
    needles_by_motion,
    unexplained_gauges,
    with_moved,
    without_print,
)
from decoder.matching.faces import LitViews
from decoder.matching.thresholds import FAR_PART, MIN_VIEWS, REACH_PART
from decoder.panel.arrays import Floats
from decoder.panel.errors import PanelError
from decoder.panel.gauge import Gauge
from decoder.panel.panel import Panel
from decoder.panel.units import contrary_units
from decoder.panel.vocabulary import Method
from decoder.registration.aligner import Aligner
from decoder.registration.frame_placer import UnwrappedFrame, UnwrappedPanel
from decoder.registration.pivot import Pivot
from decoder.registration.placement import Placement

ROUNDS = 8
# Repeated, since the nearer to its pivot a needle is cut, the more surely the pivot is found.
FAR_ROUNDS = 3


def mistakes(gauge: Gauge) -> Iterator[str]:
    """Say what seems mistyped or mixed up in a gauge's description, which drawing it elsewhere would not mend."""
    yield from slip_findings(gauge)
    yield from backward_findings(gauge)
    yield from contrary_units((quantity.name, quantity.unit) for quantity in gauge.quantities)


@dataclass(frozen=True, slots=True)
class FittedReader:
    """A reader fitted to a flight.

    Attributes
    ----------
    panel
        As drawn, with angles corrected for the pivots.
    uncertainties
        By quantity: uncertainty of its readings beyond that from their frames.
    moved_px
        For each gauge whose needles turn elsewhere than the panel says: (x, y).
    unsettled
        Gauges whose pivots did not converge.
    unexplained
        Gauges on which something moves that their needles do not explain.
    by_motion
        Needles learned from where the flight shows that they moved.
    squeezes
        For each gauge in the panel's order, how the view squeezes it, if it was squared up; else None.
    allowed
        In the same order: how the view squeezes the gauges that were not squared up, if the flight shows it.
    has_points
        Whether angles were taken as points around the drawn centres.
    sampled
        Number of the sample's frames in which the panel was found.
    """

    reader: PanelReader
    panel: Panel
    uncertainties: Mapping[str, QuantityUncertainty]
    moved_px: Mapping[str, tuple[float, float]]
    unsettled: tuple[str, ...]
    unexplained: frozenset[str]
    by_motion: frozenset[str]
    squeezes: tuple[Squeeze | None, ...]
    allowed: tuple[Squeeze | None, ...]
    has_points: bool
    sampled: int

    @property
    def findings(self) -> dict[str, tuple[str, ...]]:
        """Findings by gauge for the person who drew it."""
        mistaken = mistaken_needles(self.reader)
        return {gauge.name: tuple(self._found(gauge, mistaken)) for gauge in self.panel.gauges}

    def _found(self, gauge: Gauge, mistaken: Mapping[str, float]) -> Iterator[str]:
        x, y = self.moved_px.get(gauge.name, (0.0, 0.0))
        mixture = self.reader.grids[self.panel.gauges.index(gauge)].mixture
        if mixture is not None:
            yield f"read in {mixture}, where what moves on it shows better or more surely than in grey"
        index = self.panel.gauges.index(gauge)
        yield from _aside(self.squeezes[index], self.allowed[index])
        yield from _upright(gauge, self.squeezes[index] or self.allowed[index])
        yield from kind_of(gauge).findings(gauge, self.reader.appearance)
        if gauge.name in self.unsettled:
            yield (
                "turns about another point than the drawn centre, but it is unsure which: sigma allows for that; is"
                " the gauge drawn right?"
            )
        elif math.hypot(x, y) > FAR_PART * gauge.radius[1]:
            yield (
                f"turns {abs(x):.1f} px {'left' if x < 0 else 'right'} of and {abs(y):.1f} px"
                f" {'above' if y < 0 else 'below'} the drawn centre, corrected"
                f"{' with its marks: draw it there with `decode setup`' if self.has_points else '; its marks stay'}"
            )
        if gauge.name in self.unexplained:
            yield (
                "shows something that moves and is none of its needles: are its centre and all of its needles drawn"
                " right? A needle that stands still there is not read"
            )
        yield from self._needles_found(gauge, mistaken)
        off_deg = max((uneven_deg(quantity) for quantity in gauge.quantities), default=0.0)
        if is_beyond_a_hand(off_deg):
            yield (
                f"has marks {off_deg:.1f} degrees off even spacing, though a scale that goes all the way round is even:"
                " sigma allows for that; is it seen from the side, or were they drawn from off their ring's middle?"
            )
        yield from mistakes(gauge)

    def _needles_found(self, gauge: Gauge, mistaken: Mapping[str, float]) -> Iterator[str]:
        for needle in gauge.turning:
            if needle.name in mistaken:
                yield (
                    f"{needle.name} is not read: what the flight shows as the needle lies"
                    f" {mistaken[needle.name]:.0f} degrees from it in the panel picture; has the needle a `tail`?"
                    " Does its template hold all of its tip?"
                )
            elif needle.name in self.by_motion:
                yield (
                    f"{needle.name} was learned from where the flight shows that it moved, since as drawn it is not"
                    " found: choose a panel picture that shows it clearly"
                )
            own, template = self.uncertainties[needle.name], self.reader.appearance.templates.get(needle.name)
            if template is not None and own.beside_deg > own.drawn_deg:
                way = "clockwise" if template.beside_deg > 0.0 else "anticlockwise"
                yield (
                    f"{needle.name} lies {abs(template.beside_deg):.1f} degrees {way} of where it is drawn: sigma"
                    " allows for that; draw its middle line with `decode setup`"
                )

    def sigma_deg(self, name: str, angles_deg: Floats) -> Floats:
        """(N,): uncertainty of a quantity's readings at these angles beyond that from their frames."""
        return self.uncertainties[name].sigma_deg(angles_deg)

    @property
    def budgets(self) -> dict[str, Budget]:
        """By quantity: the causes of that uncertainty, over its values."""
        quantities = [quantity for gauge in self.panel.gauges for quantity in gauge.quantities]
        return budgets(quantities, self.panel.combinations, lambda name, at: self.uncertainties[name].parts_deg(at))

    def allowed_sigma_deg(self, name: str, angles_deg: Floats) -> Floats:
        """(N,): the part of that which is an allowance, not estimated from this panel or flight."""
        return np.full_like(angles_deg, self.uncertainties[name].allowed_deg)


def _aside(corrected: Squeeze | None, allowed: Squeeze | None) -> Iterator[str]:
    """Say from how far aside a dial is seen, and what to draw if that is not known well."""
    for squeeze, what in ((corrected, "corrected"), (allowed, "sigma allows for that")):
        if squeeze is not None and squeeze.part > MOST_MARK_PART:
            is_known = squeeze is corrected and 0.0 < squeeze.doubt < MOST_MARK_PART
            advice = "" if is_known else ": draw its `rim`, or the panel's reference points, with `decode setup`"
            yield f"is seen from about {squeeze.aside_deg:.0f} degrees aside, {what}{advice}"


def _upright(gauge: Gauge, squeeze: Squeeze | None) -> Iterator[str]:
    """Say which values depend on a dial's upright that nobody drew, if it is seen from aside."""
    names = [quantity.name for quantity in gauge.quantities if quantity.has_upright_zero]
    if names and squeeze is not None and squeeze.part > MOST_MARK_PART:
        yield (
            f"{' and '.join(names)} is read straight up, which seen from aside may not be the dial's upright: sigma"
            " allows for that; draw its `index` with `decode setup`"
        )


@dataclass(frozen=True, slots=True)
class _Round:
    """The result of a round: the reader that has learned, its readings by frame, and the pivots by gauge.

    `by_motion` are the needles that were learned from where they moved.
    """

    reader: PanelReader
    found: Sequence[Mapping[str, Reading]]
    pivots: tuple[Pivot, ...]
    by_motion: frozenset[str]


def fit_to_flight(reader: PanelReader, sample: Sample, *, rounds: int = ROUNDS, tell: Tell = nobody) -> FittedReader:
    """Fit a reader to the flight from which `sample` takes frames, in at most this many rounds."""
    source = reader.source
    seen, likely = squeezes_seen(source)
    begun, last = _best_begun(_squared_up_as_seen(reader, seen), sample, tell)
    reader, samples, paths, log_odds = begun.reader, begun.samples, begun.paths, begun.log_odds
    gauges, allowed = begun.drawn, _allowed(begun, last, likely)
    del begun
    first, known = last.pivots, _known(last, paths)
    for round_ in range(1, rounds):
        before, log_odds = log_odds, _log_odds(reader, samples, gauges, paths)
        paths = [path.next(pivot) for path, pivot in zip(paths, last.pivots, strict=True)]
        told = seen_from_pivots(gauges, paths, log_odds)
        is_retold = (before > 0.0) != (log_odds > 0.0)
        around = _around_pivots(last, [path.step_px for path in paths], told, is_retold=is_retold)
        if around is None:
            break
        tell(f"finding where needles turn, round {round_}")
        del reader, samples, last  # frees memory for those of the next round
        reader, samples = around, unwrapped(around, sample(frames_wanted(around.placement)))
        last = _learned(reader, samples, paths)
        known = _known(last, paths, known)
    back = [best.back_from(now) for best, now in zip(known, _known(last, paths), strict=True)]
    if any(path.step_px for path in back):
        tell("going back to where needles turned before they were lost")
        told = seen_from_pivots(gauges, back, log_odds)
        around = around_pivots(last.reader, [path.step_px for path in back], drawn=told)
        del reader, samples, last
        reader, samples, paths = around, unwrapped(around, sample(frames_wanted(around.placement))), back
        last = _learned(reader, samples, paths)
    last = _settled(last, samples)
    pivots = [path.with_doubt(*both) for path, *both in zip(paths, last.pivots, first, strict=True)]
    told = seen_from_pivots(gauges, paths, log_odds)
    unexplained = unexplained_gauges(last.reader, lit_views(last.reader, samples), last.found)
    parts = list(zip(gauges, last.reader.source.panel.gauges, paths, last.pivots, strict=True))
    return FittedReader(
        reader=_completed(last, unexplained),
        panel=source.panel.model_copy(update={"gauges": told}),
        uncertainties=quantity_uncertainties(
            source,
            told,
            pivots,
            paths=paths,
            log_odds=log_odds,
            care_part=care_part(paths, pivots, gauges),
            dials_move=last.reader.placement.dials_move,
            found=last.found,
            templates=last.reader.appearance.templates,
            squeezes=allowed,
            squared_up=_corrected(last.reader.source),
        ),
        moved_px={gauge.name: _beside(drawn, gauge) for drawn, gauge, path, _ in parts if path.was_moved},
        unsettled=tuple(gauge.name for _, gauge, path, pivot in parts if path.was_moved and not path.is_right(pivot)),
        unexplained=frozenset(unexplained),
        by_motion=last.by_motion,
        squeezes=_corrected(last.reader.source),
        allowed=allowed,
        has_points=log_odds > 0.0,
        sampled=len(samples),
    )


def _beside(drawn: Gauge, moved: Gauge) -> Vector:
    """(x, y), pixels: how far a gauge was moved from where it is drawn."""
    return moved.centre[0] - drawn.centre[0], moved.centre[1] - drawn.centre[1]


@dataclass(frozen=True, slots=True)
class _Known:
    """A pivot's path, and the part of a sample's frames in which its gauge was missing there."""

    path: PivotPath
    missing: float

    def back_from(self, now: _Known) -> PivotPath:
        """Return the path back to this pivot if the gauge was lost after it moved on, else the path `now`.

        There is no way back if it was missing in many frames here as well: it may have been read wrongly in the rest.
        """
        is_better = self.missing <= HALF * HALF and now.missing > HALF
        return now.path.back_to(self.path) if is_better else replace(now.path, step_px=None)


def _known(last: _Round, paths: Sequence[PivotPath], before: Sequence[_Known] = ()) -> list[_Known]:
    """For each gauge, return the latest of the paths on which it was missing least."""
    gauges = last.reader.source.panel.gauges
    now = [_Known(path, missing_part(gauge, last.found)) for gauge, path in zip(gauges, paths, strict=True)]
    return [min(new, old, key=lambda each: each.missing) for new, old in zip(now, before or now, strict=True)]


def _best_begun(reader: PanelReader, sample: Sample, tell: Tell) -> tuple[_Recentred, _Round]:
    """Learn a first time, then again in better colours, with lost dials squared up."""
    gauges = reader.source.panel.gauges
    placed, samples = align_sample(reader, sample)
    placed = as_sharp_as_frames(placed, samples)
    begun, last = _begun(placed, samples, sample, tell)
    lost = [index for index, gauge in enumerate(gauges) if may_be_lost(gauge, last.found)]
    before = last.found
    unread = frozenset(index for index in lost if is_unread(gauges[index], before))
    missed = unread.union(index for index in lost if _is_missed_often(gauges[index], before))
    coloured = in_best_colours(placed, lost, missed, sample)
    # A quarter is enough: more may be missing because something else lies over the dial.
    wanted = [
        known is None and missing_part(gauge, before) > HALF * HALF
        for known, gauge in zip(_corrected(begun.reader.source), gauges, strict=True)
    ]
    squeezes = _squeezes(begun, wanted, is_lost=True)
    if coloured is placed and not any(squeezes):
        return begun, last
    del begun, last, samples  # frees memory for what is unwrapped later
    tell("choosing colours that show what moves, and squaring dials up")

    def again(coloured: PanelReader, squeezes: Sequence[Squeeze | None]) -> tuple[_Recentred, _Round]:
        better = squared_up(coloured, squeezes) if any(squeezes) else coloured
        return _begun(better, unwrapped(better, sample(frames_wanted(placed.placement))), sample, tell)

    begun, last = again(coloured, squeezes)
    gained = {index for index, gauge in enumerate(gauges) if finds_more(gauge, before, last.found)}
    helpful = tuple(own if index in gained else None for index, own in enumerate(squeezes))
    kept = in_best_colours(placed, lost, unread | (missed & gained), sample) if missed - unread - gained else coloured
    if helpful != squeezes or kept.source.mixtures != coloured.source.mixtures:  # some of these did not help
        del begun, last
        begun, last = again(kept, helpful)
    return begun, last


def _is_missed_often(gauge: Gauge, found: Sequence[Readings]) -> bool:
    """Whether the only needle of a dial is missing in several frames: one of more may be hidden by another."""
    return len(gauge.over_face) == 1 and missing_part(gauge, found) * len(found) >= MIN_VIEWS


def _squared_up_as_seen(reader: PanelReader, seen: Sequence[Squeeze | None]) -> PanelReader:
    """Square up the dials of a panel that are seen obliquely."""
    squeezes = [own if own is not None and own.part > MOST_MARK_PART else None for own in seen]
    return squared_up(reader, squeezes) if any(squeezes) else reader


def _allowed(begun: _Recentred, last: _Round, seen: Sequence[Squeeze | None]) -> tuple[Squeeze | None, ...]:
    """For each gauge that is read without being squared up, estimate its squeeze, so that sigma allows for it."""
    wanted = [
        squeeze is None and not is_lost(gauge, last.found)
        for gauge, squeeze in zip(begun.drawn, _corrected(begun.reader.source), strict=True)
    ]
    learned = _squeezes(begun, wanted, is_lost=False)
    return tuple(
        own or (known if is_wanted else None) for own, known, is_wanted in zip(learned, seen, wanted, strict=True)
    )


def _corrected(source: PanelPictures) -> tuple[Squeeze | None, ...]:
    """For each gauge, return the squeeze with which it was squared up, or None."""
    return source.squeezes or (None,) * len(source.panel.gauges)


def _squeezes(begun: _Recentred, wanted: Sequence[bool], *, is_lost: bool) -> tuple[Squeeze | None, ...]:
    """Estimate the squeeze of the wanted gauges: `is_lost` is passed on to their kinds; None for the others."""
    if not any(wanted):
        return (None,) * len(wanted)
    return tuple(
        kind_of(instrument.gauge).squeeze(instrument, views, is_lost=is_lost) if own else None
        for own, (instrument, _, views) in zip(wanted, _seen(begun.reader, begun.samples), strict=True)
    )


def _begun(reader: PanelReader, samples: list[UnwrappedFrame], sample: Sample, tell: Tell) -> tuple[_Recentred, _Round]:
    """Find pivots that are far off, and learn a first time."""
    aligned = _around_far_pivots(reader, samples, sample)
    tell(f"learning from {len(aligned.samples)} frames what the instruments look like")
    return aligned, _learned(aligned.reader, aligned.samples, aligned.paths)


def tune(reader: PanelReader, frames: Iterable[GreyPicture | FramePicture]) -> PanelReader:
    """Learn from a sample of a flight; with too few usable frames the reader stays as it was."""
    samples = unwrapped(reader, frames)
    found = read_sample(reader, samples)
    return with_usual_place(learn_appearance(reader, lit_views(reader, samples), found), samples)


def _learned(reader: PanelReader, samples: Sequence[UnwrappedFrame], paths: Sequence[PivotPath]) -> _Round:
    """Learn appearance from an aligned sample, and estimate pivots with it."""
    reader = with_usual_place(reader, samples)
    views, found = lit_views(reader, samples), read_sample(reader, samples)
    reader, found = with_seen_faces(reader, views, found, lambda bared: read_sample(bared, samples))
    reader, found = with_usual_dials(reader, views, found, lambda usual: read_sample(usual, samples))
    reader, found = learn_hidden_looks(reader, samples, views, found)
    learned = learn_appearance(reader, views, found)
    missing = any(reading.status is Status.MISSING for readings in found for reading in readings.values())
    if reader.placement.dials_move or missing:  # then every tilt is used; else the fit's guess is good enough
        learned, found = kept_where_better(reader, learned, samples, views, found)
    first = reader.appearance
    reader, found = learn_likely_needles(learned, samples, views, found)
    reader, found, by_motion = _learn_moving_needles(reader, first, samples, views, found)
    return _Round(reader, found, estimate_pivots(reader, samples, found, paths), by_motion)


def _settled(last: _Round, samples: Sequence[UnwrappedFrame]) -> _Round:
    """Learn what is not worth learning anew in each round, now that no pivot moves any more."""
    reader = last.reader
    if len(last.found) < FRAMES_TO_LEARN:
        return last
    known = reader.appearance.pictures
    pictures: dict[str, LearnedPicture] = {}
    for instrument, _, views in _seen(reader, samples):
        pictures |= kind_of(instrument.gauge).settled_pictures(instrument, views, known)
    if not pictures:
        return last
    reader = reader.with_appearance(replace(reader.appearance, pictures={**known, **pictures}))
    return replace(last, reader=reader, found=read_sample(reader, samples))


def _learn_moving_needles(
    reader: PanelReader,
    first: Appearance,
    samples: Sequence[UnwrappedFrame],
    views: LitViews,
    found: Sequence[Readings],
) -> tuple[PanelReader, Sequence[Readings], frozenset[str]]:
    """Learn needles that are lost from where frames show that they moved.

    A needle that the panel picture shows over print, or hardly shows at all, cannot be found with what was cut there.
    Readings of print do not count, and what was learned from them gives way to what was known at `first`.

    Returns
    -------
    The reader, its readings, and the names of the needles.
    """
    gauges, counted = reader.source.panel.gauges, without_print(reader, views, found)
    likely = without_print(reader, views, as_likely(gauges, found))
    moved = needles_by_motion(reader, first.templates, views, likely)
    told = with_moved(likely, moved.values())
    while moved:
        look = of_gauges(moved, gauges, reader.appearance, first.faces, first.templates)
        again = reader.with_appearance(look)
        for _ in range(2):  # at first only what shows within the outline of what was cut
            again = learn_appearance(again, views, told, moved)
            read = read_sample(again, samples)
            now = without_print(again, views, read)
            better = {index: own for index, own in moved.items() if finds_more(gauges[index], counted, now)}
            if len(better) == len(moved):
                return again, read, frozenset(own.name for own in moved.values())
        moved = better
    return reader, found, frozenset()


@dataclass(frozen=True, slots=True)
class _Recentred:
    """A reader that has not learned yet, around pivots that are far from the drawn centres.

    `samples` are unwrapped by it, `paths` are by gauge how far its pivot was moved, and `log_odds` is how likely marks
    are points rather than angles. The angles of the gauges in `drawn` already allow for squeezes.
    """

    reader: PanelReader
    samples: list[UnwrappedFrame]
    paths: list[PivotPath]
    log_odds: float
    drawn: tuple[Gauge, ...]


def _around_far_pivots(reader: PanelReader, samples: list[UnwrappedFrame], sample: Sample) -> _Recentred:
    """Search for pivots far from the drawn centres, and unwrap a sample around them."""
    drawn = reader.source.panel.gauges
    paths = [PivotPath()] * len(drawn)
    if len(samples) < FRAMES_TO_LEARN:
        return _Recentred(reader, samples, paths, PRIOR_LOG_ODDS, drawn)
    if reader.placement.dials_move:  # a raised needle's ridges miss its pivot, so leave gauges that are read to tilts
        found = read_sample(reader, samples)
        paths = [
            path if missing_part(gauge, found) > HALF * HALF else replace(path, is_found=True)
            for path, gauge in zip(paths, drawn, strict=True)
        ]
    for _ in range(FAR_ROUNDS):
        paths = [
            path
            if path.is_found
            else path.from_afar(kind_of(gauge).far_pivot(instrument, views), REACH_PART * gauge.radius[1])
            for path, gauge, (instrument, _, views) in zip(paths, drawn, _seen(reader, samples), strict=True)
        ]
        if all(path.is_found for path in paths):
            break
        reader = around_pivots(reader, [path.step_px for path in paths], drawn=drawn)
        samples = unwrapped(reader, sample(frames_wanted(reader.placement)))
    if not any(path.is_far for path in paths):
        return _Recentred(reader, samples, paths, PRIOR_LOG_ODDS, drawn)
    log_odds = _log_odds(reader, samples, drawn, paths)
    told = seen_from_pivots(drawn, paths, log_odds)
    if told != drawn:
        reader = around_pivots(reader, [None] * len(drawn), drawn=told)
        samples = unwrapped(reader, sample(frames_wanted(reader.placement)))
    return _Recentred(reader, samples, paths, log_odds, drawn)


def _log_odds(
    reader: PanelReader, samples: Sequence[UnwrappedFrame], drawn: Sequence[Gauge], paths: Sequence[PivotPath]
) -> float:
    """Return the log odds that a panel's angles are points, from its scales and needles with far-off pivots."""
    is_far = [
        math.hypot(*path.beside_px) > FAR_PART * gauge.radius[1] for path, gauge in zip(paths, drawn, strict=True)
    ]
    seen_deg = (
        [
            kind_of(gauge).seen_deg(replace(instrument, gauge=gauge), own, views) if far else ()
            for gauge, far, (instrument, own, views) in zip(drawn, is_far, _seen(reader, samples), strict=True)
        ]
        if any(is_far)
        else [()] * len(drawn)
    )
    return log_odds_of_points(drawn, paths, seen_deg)


def _seen(
    reader: PanelReader, samples: Sequence[UnwrappedFrame]
) -> Iterator[tuple[Instrument, UnwrappedGauge, list[UnwrappedGauge]]]:
    """Iterate over the gauges: instrument, panel picture, and the sample's frames in its light."""
    drawn = zip(reader.source.panel.gauges, reader.grids, reader.appearance.faces, strict=True)
    parts = zip(drawn, reader.own_gauges, lit_views(reader, samples), strict=True)
    for index, (instrument, own, views) in enumerate(parts):
        yield Instrument(index, *instrument), own, [view for view in views if view is not None]


def _around_pivots(
    last: _Round, steps: Sequence[Vector | None], drawn: Sequence[Gauge], *, is_retold: bool
) -> PanelReader | None:
    """Unwrap the panel around the estimated pivots; None if they and the lifts are right already.

    `is_retold`: whether angles have become points, or points angles.
    """
    placed = last.reader.placement
    lifts = placed.lifts or (0.0,) * len(steps)
    missing = lifts_missing(lifts, last.pivots) if placed.dials_move else ()  # otherwise none has a lift
    if not any(steps) and not any_lift_is_off(missing) and not is_retold:
        return None
    return around_pivots(last.reader, steps, drawn=drawn, lifts_missing=missing)


def _completed(last: _Round, unexplained: Mapping[str, frozenset[str]]) -> PanelReader:
    """Mark needles in the reader of which some matches are doubtful, or all."""
    doubted = mostly_missing(last.found) if len(last.found) >= FRAMES_TO_LEARN else frozenset[str]()
    least = dict[str, float]()
    for gauge in last.reader.source.panel.gauges:
        least |= least_at_home(gauge, last.found)
    likely_print = frozenset(mistaken_needles(last.reader)).union(*unexplained.values())
    if not doubted and not least and not likely_print:
        return last.reader
    return last.reader.with_appearance(
        replace(last.reader.appearance, doubted=doubted, least_at_home=least, likely_print=likely_print)
    )


def reader_from_panel(source: PanelPictures, method: Method, aligner: Aligner | None = None) -> PanelReader:
    """Make a reader with needles and dials as in the panel; `aligner` is by its anchors, if there is one already.

    Raises
    ------
    PanelError
        If a template, an anchor or the level edge does not fit the panel picture.
    """
    drawn = UnwrappedPanel(in_panels_colours(source), aligner)
    others = {name: source.pictures[name] for name in source.panel.pictures[1:]}
    if others:
        drawn = UnwrappedPanel(replace(drawn.source, places=drawn.aligner.found_in(others)), drawn.aligner)
    return PanelReader.of(source, method, appearance_from_panel(drawn), Placement(), drawn)


def around_pivots(
    reader: PanelReader,
    steps_px: Sequence[Vector | None],
    *,
    drawn: Sequence[Gauge],
    lifts_missing: Sequence[float] = (),
) -> PanelReader:
    """Return a reader of the panel with its pivots moved by these steps; it has not learned around them yet.

    Parameters
    ----------
    steps_px
        By gauge, in its dial's own plane; None for a pivot that stays.
    drawn
        The gauges, with angles as seen from their pivots; their centres are ignored.
    lifts_missing
        By gauge: correction of its needles' lift above the dial; none if nothing is missing.
    """
    source, placed, own = reader.source, reader.placement, reader.source.optics.own
    lifts = placed.lifts or (0.0,) * len(steps_px)
    planes = source.planes or (None,) * len(steps_px)
    gauges = [
        each.model_copy(update={"centre": gauge.centre if step is None else _moved(gauge.centre, plane, own, step)})
        for each, gauge, plane, step in zip(drawn, source.panel.gauges, planes, steps_px, strict=True)
    ]
    placement = replace(
        placed,
        motions=(),
        rows=None,
        lifts=tuple(lift + more for lift, more in zip(lifts, lifts_missing, strict=False)),
    )
    moved = tuple(_planes_around(source, gauges, steps_px))
    panel = source.panel.model_copy(update={"gauges": tuple(gauges)})
    return _redrawn(reader, replace(source, panel=panel, planes=moved), placement)


def _planes_around(
    source: PanelPictures, gauges: Sequence[Gauge], steps_px: Sequence[Vector | None]
) -> Iterator[DialPlane | None]:
    """Move planes with their pivots by these steps, to the centres of these gauges.

    A rim about a centre that is drawn far beside it looks like perspective. So if a pivot is far off, its rim's plane
    is found again about it, and the one that needs less perspective is taken: raised needles may also turn beside
    their rim's middle.
    """
    planes = source.planes or (None,) * len(gauges)
    for index, (gauge, plane, step) in enumerate(zip(gauges, planes, steps_px, strict=True)):
        moved = plane if plane is None or step is None else plane.around(step)
        is_far = step is not None and math.hypot(*step) > FAR_PART * gauge.radius[1]
        if moved is not None and is_far and gauge.rim is not None:
            with suppress(PanelError):  # about this pivot, the rim is no circle
                moved = min(moved, source.plane_of(index, gauge) or moved, key=lambda each: each.perspective)
        yield moved


def squared_up(reader: PanelReader, squeezes: Sequence[Squeeze | None]) -> PanelReader:
    """Return a reader of the panel as drawn with more dials squared up; it has not learned them again yet."""
    gauges = tuple(
        gauge if squeeze is None else gauge.squared_up(squeeze.square_on_deg, squeeze.square_on_size)
        for gauge, squeeze in zip(reader.source.panel.gauges, squeezes, strict=True)
    )
    panel = reader.source.panel.model_copy(update={"gauges": gauges})
    known = zip(squeezes, _corrected(reader.source), strict=True)
    source = replace(reader.source, panel=panel, planes=None, squeezes=tuple(new or old for new, old in known))
    return _redrawn(reader, source.with_planes(), reader.placement)


def _redrawn(reader: PanelReader, source: PanelPictures, placement: Placement) -> PanelReader:
    """Return a reader of the panel with its gauges drawn differently; it knows them from the panel's pictures only."""
    drawn, method = UnwrappedPanel(source, reader.drawn.aligner), reader.method
    now, before = (
        list(zip(each.panel.gauges, each.planes or (None,) * len(each.panel.gauges), strict=True))
        for each in (source, reader.source)
    )
    stay = [index for index, own in enumerate(now) if not own[0].turning and own == before[index]]
    appearance = appearance_from_panel(drawn, reader.appearance, stay=stay)
    return PanelReader.of(source, method, appearance, placement, drawn)


def _moved(centre: Point, plane: DialPlane | None, own: Alignment, step_px: Vector) -> Point:
    """Move a gauge's centre by a step in the dial's own plane."""
    if plane is None:
        return centre[0] + step_px[0], centre[1] + step_px[1]
    there = plane.to_panel(np.array(step_px)[:, None])[:, 0]
    return own.to_frame((float(there[0]), float(there[1])))
