"""Scales fitted to their ticks: each numeral's own mark, or why no scale is proposed.

The numerals give the values, the ticks the angles. Both have to agree: a mark at every numeral; on an even scale, at
equal turns; on an uneven one, at long marks with as many small ones in between as the values require.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.panel.arrays import Floats
from decoder.panel.scale import FULL_CIRCLE_DEG
from decoder.setup.drawn_plane import away
from decoder.setup.finding.robust import Trust, robust
from decoder.setup.finding.scales import Fit, Numeral
from decoder.setup.finding.thresholds import ALIKE, ENOUGH, LEAST_APART_DEG, LEAST_RUN, MOST_BEND, NEAR_DEG, OFF_DEG
from decoder.setup.finding.ticks import Comb, Tick


@dataclass(frozen=True, slots=True)
class Mark:
    """A numeral with its tick: the value in the scale, and where both are in the picture."""

    angle_deg: float
    value: float
    numeral: Numeral
    off_deg: float


@dataclass(frozen=True, slots=True)
class Marked:
    """A scale, clockwise with rising angles.

    Attributes
    ----------
    marks
        Each numeral with its tick.
    turn
        The value of a full turn, if it goes all the way round.
    is_even
        Whether equal turns have equal values.
    doubt
        Why it cannot be trusted; empty if it can.
    """

    fit: Fit
    marks: tuple[Mark, ...]
    turn: float | None
    is_even: bool
    doubt: str


def marked(fit: Fit, comb: Comb) -> Marked:
    """Find the tick of each numeral of a fit."""
    if fit.family is not None:
        return _all_round(fit, comb)
    angles = _unwound(fit.numerals)
    values = np.array(fit.values)
    return _even(fit, comb, angles, values) or _uneven(fit, comb, angles, values)


def _unwound(numerals: Sequence[Numeral]) -> Floats:
    turns = np.array([each.angle_deg for each in numerals])
    found: Floats = turns[0] + np.concatenate([[0.0], np.cumsum(np.diff(turns) % FULL_CIRCLE_DEG)])
    return found


def _nearest(comb: Comb, angle_deg: float, reach_deg: float) -> Tick | None:
    near = [tick for tick in comb.ticks if abs(away(tick.angle_deg, angle_deg)) <= reach_deg]
    return min(near, key=lambda tick: abs(away(tick.angle_deg, angle_deg)), default=None)


def _all_round(fit: Fit, comb: Comb) -> Marked:
    """Fit the places of a full dial to its ticks; only the dial's rotation is unknown."""
    if fit.family is None:
        raise ValueError("not numbered all the way round")
    degrees = FULL_CIRCLE_DEG / fit.family.turn
    values = np.array(fit.values)
    offs = [away(each.angle_deg, degrees * value) for each, value in zip(fit.numerals, values, strict=True)]
    begin = offs[0] + float(np.median([away(off, offs[0]) for off in offs]))
    places = sorted(range(len(values)), key=lambda index: float((degrees * values[index]) % FULL_CIRCLE_DEG))
    all_places = begin + degrees * np.arange(round(fit.family.turn / fit.family.step)) * fit.family.step
    moved = _onto_ticks(comb, all_places)
    near = [_nearest(comb, place + moved, OFF_DEG) for place in all_places]
    hit = [
        away(tick.angle_deg, place + moved) for tick, place in zip(near, all_places, strict=True) if tick is not None
    ]
    begin += moved + (float(np.median(hit)) if hit else 0.0)
    marks = []
    for index in places:
        at = begin + degrees * values[index]
        marks.append(Mark(at, float(values[index]), fit.numerals[index], away(fit.numerals[index].angle_deg, at)))
    doubt = "" if len(hit) * 3 >= 2 * len(all_places) else "its numerals go all the way round, its ticks do not"
    return Marked(fit, tuple(marks), fit.family.turn, is_even=True, doubt=doubt)


def _onto_ticks(comb: Comb, places_deg: Floats) -> float:
    """Turn places onto nearby ticks: onto long ones, and no further than to the first that fit.

    A step further on, fine ticks fit as well, or even better if something over the dial hides a long one.
    """
    ticks, lengths = (np.array([getattr(tick, name) for tick in comb.ticks]) for name in ("angle_deg", "length_px"))
    long = np.sort(lengths)[-min(len(places_deg), len(lengths))]
    turns = np.arange(-NEAR_DEG / 2, NEAR_DEG / 2 + 0.01, 0.1)
    onto = np.empty(len(turns))
    for index, turn in enumerate(turns):
        miss = np.abs((ticks - places_deg[:, None] - turn + 180.0) % FULL_CIRCLE_DEG - 180.0)
        parts = np.minimum(lengths[miss.argmin(axis=1)] / long, 1.0)
        onto[index] = (parts * np.maximum(1.0 - (miss.min(axis=1) / OFF_DEG) ** 2, 0.0)).sum()
    serve = turns[onto >= ALIKE * onto.max()]
    return float(serve[np.abs(serve).argmin()])


def _doubt_of(fit: Fit, with_tick: int) -> str:
    if with_tick < ENOUGH:
        said = ", ".join(each.said for each in fit.numerals)
        return f"only {with_tick} numerals with a mark of their own ({said})"
    if len(fit.strangers) * 6 > len(fit.numerals):
        return "numbers between its numerals do not fit: " + ", ".join(each.said for each in fit.strangers)
    return ""


def _even(fit: Fit, comb: Comb, angles: Floats, values: Floats) -> Marked | None:
    """Fit equal turns to the ticks; None if the numerals are not at equal turns."""
    slope, start = np.polyfit(values, angles, 1)
    if np.abs(slope * values + start - angles).max() > NEAR_DEG:
        return None
    own: list[Tick | None] = []
    for _ in range(3):
        own = [_nearest(comb, slope * value + start, NEAR_DEG / 2) for value in values]
        there = [index for index, tick in enumerate(own) if tick is not None]
        if len(there) < LEAST_RUN:
            return None
        at = [
            slope * values[index] + start + away(tick.angle_deg, slope * values[index] + start)
            for index, tick in enumerate(own)
            if tick is not None
        ]
        slope, start = _line(values[there], np.array(at))
    off = [away(tick.angle_deg, slope * values[index] + start) for index, tick in enumerate(own) if tick is not None]
    close = [abs(each) <= OFF_DEG for each in off]
    if sum(close) < len(close) or sum(close) * 4 < len(values) * 3:
        return None
    marks = []
    for value, numeral, tick in zip(values, fit.numerals, own, strict=True):
        there_deg = slope * value + start
        angle = there_deg if tick is None else there_deg + away(tick.angle_deg, there_deg)
        marks.append(Mark(float(angle), float(value), numeral, away(numeral.angle_deg, angle)))
    marks = _both_ends(fit, comb, marks)
    doubt = _doubt_of(fit, len(off))
    against = [each for each in fit.beyond if not _goes_on(each, slope, start)]
    if not doubt and len(against) * 6 > len(marks):
        doubt = "numbers beyond its ends do not fit: " + ", ".join(each.said for each in against)
    return Marked(fit, tuple(marks), None, is_even=True, doubt=doubt)


def _both_ends(fit: Fit, comb: Comb, marks: Sequence[Mark]) -> list[Mark]:
    """Add the other end of a scale around zero, if both ends share a numeral: a tick as far on the other side."""
    kept = list(marks)
    zero = next((mark for mark in marks if mark.value == 0), None)
    if not fit.is_centred or zero is None:
        return kept
    for end, place in ((marks[0], len(kept)), (marks[-1], 0)):
        if any(mark.value == -end.value for mark in marks):
            continue
        angle = 2 * zero.angle_deg - end.angle_deg
        tick = _nearest(comb, angle, 2 * OFF_DEG)
        if (
            tick is not None
            and abs(kept[-1].angle_deg - kept[0].angle_deg) + abs(angle - kept[min(place, len(kept) - 1)].angle_deg)
            < FULL_CIRCLE_DEG
        ):
            kept.insert(place, Mark(angle + away(tick.angle_deg, angle), -end.value, end.numeral, end.off_deg))
    return kept


def _goes_on(numeral: Numeral, slope: float, start: float) -> bool:
    """Whether a scale extended beyond its ends has a number there, or the other side of zero has it."""
    return any(abs(away(slope * sign * numeral.value + start, numeral.angle_deg)) <= NEAR_DEG for sign in (1.0, -1.0))


def _line(values: Floats, angles: Floats) -> tuple[float, float]:
    (slope, start), _, _ = robust(np.stack([values, np.ones_like(values)], axis=1), angles, Trust(0.3, 1.5, power=2))
    return float(slope), float(start)


def _uneven(fit: Fit, comb: Comb, angles: Floats, values: Floats) -> Marked:
    """Assign the likeliest of the nearby marks to each numeral: long ones, near ones."""
    lengths = np.array([tick.length_px for tick in comb.ticks])
    long = float(np.percentile(lengths, 85))
    marks, with_tick = [], []
    for numeral, angle_deg, value in zip(fit.numerals, angles, values, strict=True):
        near = [tick for tick in comb.ticks if abs(away(tick.angle_deg, angle_deg)) <= NEAR_DEG]
        tick = min(
            near,
            key=lambda each: abs(away(each.angle_deg, angle_deg)) / NEAR_DEG + 2 * max(1 - each.length_px / long, 0.0),
            default=None,
        )
        if tick is None:
            continue
        off = away(tick.angle_deg, float(angle_deg))
        marks.append(Mark(float(angle_deg + off), float(value), numeral, -off))
        with_tick.append(tick)
    marks = _trimmed(marks)
    if len(marks) < ENOUGH:
        return Marked(fit, tuple(marks), None, is_even=False, doubt=_doubt_of(fit, len(marks)))
    doubt = _doubt_of(fit, len(marks))
    steps = np.diff([mark.value for mark in marks])
    turns = np.diff([mark.angle_deg for mark in marks])
    if not doubt and not (turns > 0).all():
        doubt = "two numerals would share one mark"
    if not doubt and _zigzags(turns, np.abs(steps)):
        doubt = "its numerals' marks are irregularly spaced: one may have another's mark"
    usual = _usual_step(marks)
    for (one, other), step in zip(pairwise(marks), np.abs(steps), strict=True):
        # On an uneven scale, divisions may change at a numeral that was not read.
        if not doubt and step >= 2 * usual and _has_long(comb, one.angle_deg, other.angle_deg, HALF * long):
            doubt = f"between {one.numeral.said} and {other.numeral.said} a numeral may not have been read"
    between = [_between(comb, one.angle_deg, other.angle_deg) for one, other in pairwise(marks)]
    ratio = (np.array(between) + 1) / np.abs(steps)
    if not doubt and np.mean(np.abs(ratio / np.median(ratio) - 1) < 0.3) < HALF:  # noqa: PLR2004
        doubt = "its numerals do not have equal numbers of ticks between them"
    return Marked(fit, tuple(marks), None, is_even=False, doubt=doubt)


def _zigzags(turns: Floats, steps: Floats) -> bool:
    """Whether the turn per unit is somewhere much larger, or smaller, than on both sides; scales bend one way."""
    bends = np.diff(np.log(np.maximum(turns, LEAST_APART_DEG) / steps), 2)
    return bool(bends.size and np.abs(bends).max() > math.log(MOST_BEND))


def _usual_step(marks: Sequence[Mark]) -> float:
    """Return the commonest step between numerals; a scale may start with a smaller one, as on a tachometer."""
    sizes, counts = np.unique(np.abs(np.diff([mark.value for mark in marks])), return_counts=True)
    return float(sizes[counts.argmax()])


def _trimmed(marks: Sequence[Mark]) -> list[Mark]:
    """Drop ends further off than numerals usually are: either one in between was not read, or it is not a numeral."""
    kept = list(marks)
    for end in (0, -1):
        while len(kept) > ENOUGH and abs(kept[end].value - kept[1 if end == 0 else -2].value) > _usual_step(kept):
            kept.pop(end)
    return kept


def _has_long(comb: Comb, first_deg: float, last_deg: float, length_px: float) -> bool:
    """Whether a mark about as long as the numbered ones lies between two of them."""
    span = (last_deg - first_deg) % FULL_CIRCLE_DEG
    within = [
        tick for tick in comb.ticks if NEAR_DEG < (tick.angle_deg - first_deg) % FULL_CIRCLE_DEG < span - NEAR_DEG
    ]
    return any(tick.length_px > length_px for tick in within)


def _between(comb: Comb, first_deg: float, last_deg: float) -> int:
    span = (last_deg - first_deg) % FULL_CIRCLE_DEG
    return sum(OFF_DEG < (tick.angle_deg - first_deg) % FULL_CIRCLE_DEG < span - OFF_DEG for tick in comb.ticks)
