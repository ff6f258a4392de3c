"""Scales: what the numerals around a pivot mean together, or that they do not agree.

A single numeral is a recognizer's guess. A scale is proposed if several are in order around the pivot: rising or
falling by whole steps, with gradually changing turns from one to the next. Full dials are stricter still: the digits of
an altimeter, the hours of a clock and the letters of a compass have fixed places.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.panel.scale import FULL_CIRCLE_DEG
from decoder.setup.drawn_plane import away
from decoder.setup.finding.thresholds import LEAST_RUN, MOST_BEND, MOST_TURN_DEG, NEAR_DEG, OFF_DEG, RING_PART

# The cost of a numeral out of order, relative to one in order.
STRANGER = 1.0


@dataclass(frozen=True, slots=True)
class Numeral:
    """A number, or a compass's letter, seen from the pivot."""

    said: str
    value: float
    angle_deg: float
    radius_px: float
    sure: float
    is_letter: bool = False
    at: tuple[float, float] = (0.0, 0.0)
    height_px: float = 1.0


@dataclass(frozen=True, slots=True)
class Family:
    """Numerals at fixed places all around.

    Attributes
    ----------
    turn
        The value of a turn, as numbered.
    step
        From one numbered mark to the next.
    needs
        How many of them identify it.
    """

    name: str
    turn: float
    step: float
    needs: int
    has_letters: bool = False


FAMILIES = (
    Family("compass", 36.0, 3.0, 5, has_letters=True),
    Family("compass in degrees", 360.0, 10.0, 6, has_letters=True),
    Family("altimeter", 10.0, 1.0, 5),
    Family("clock", 12.0, 1.0, 3),
)
LETTERS = {"N": 0.0, "E": 9.0, "S": 18.0, "W": 27.0}


@dataclass(frozen=True, slots=True)
class Fit:
    """Numerals in order.

    Attributes
    ----------
    numerals
        That agree, clockwise.
    values
        Of each, with its sign.
    strangers
        Numbers on the same ring, within the scale, that do not agree.
    beyond
        Numbers on the same ring, beyond its ends.
    family
        Of a dial that is numbered all the way round.
    is_centred
        Whether it rises to both sides of 0, so that nothing printed tells which is positive.
    """

    numerals: tuple[Numeral, ...]
    values: tuple[float, ...]
    strangers: tuple[Numeral, ...]
    family: Family | None = None
    is_centred: bool = False
    beyond: tuple[Numeral, ...] = ()

    @property
    def weight(self) -> float:
        """The weight of its evidence."""
        return sum(each.sure for each in self.numerals) - STRANGER * len(self.strangers)

    @property
    def radius_px(self) -> float:
        """The radius of its numerals."""
        return float(np.median([each.radius_px for each in self.numerals]))


def fits(numerals: Sequence[Numeral]) -> list[Fit]:
    """List the scales that numerals around a pivot may form, one for each ring of them, best first."""
    found: list[Fit] = []
    for ring in _rings(numerals):
        here = [fit for fit in (*_full(ring), *_runs(ring)) if fit is not None]
        here = [fit for fit in here if not _is_straight(fit)]
        if here:
            found.append(max(here, key=_explained))
    found.sort(key=lambda fit: -fit.weight)
    kept: list[Fit] = []
    for fit in found:
        if not any(set(fit.numerals) & set(other.numerals) for other in kept):
            kept.append(fit)
    return kept


def _explained(fit: Fit) -> float:
    """How much of its ring a scale explains; numbers that it does not explain count against it wherever they are."""
    return (fit.weight - STRANGER * len(fit.beyond)) * (1.5 if fit.family is not None else 1.0)


def _is_straight(fit: Fit) -> bool:
    """Whether numerals stand in a line, as those of a straight scale do, rather than around a pivot."""
    away_px = np.array([each.at for each in fit.numerals])
    away_px -= away_px.mean(axis=0)
    _, _, (_, across) = np.linalg.svd(away_px, full_matrices=False)
    return bool(np.abs(away_px @ across).max() < HALF * min(each.height_px for each in fit.numerals))


def _rings(numerals: Sequence[Numeral]) -> Iterator[list[Numeral]]:
    """Group numerals at about one distance; a ring for each that may be in its middle."""
    seen = set()
    for middle in numerals:
        ring = [
            each
            for each in numerals
            if abs(each.radius_px - middle.radius_px) <= RING_PART * middle.radius_px
            and 1 / MOST_BEND <= each.height_px / middle.height_px <= MOST_BEND
        ]
        key = frozenset(id(each) for each in ring)
        if len(ring) >= LEAST_RUN and key not in seen:
            seen.add(key)
            yield sorted(ring, key=lambda each: each.angle_deg)


def _full(ring: Sequence[Numeral]) -> Iterator[Fit | None]:
    letters = [each for each in ring if each.is_letter]
    for family in FAMILIES:
        if bool(letters) and not family.has_letters:
            continue
        yield _all_round(ring, family)


def _all_round(ring: Sequence[Numeral], family: Family) -> Fit | None:
    degrees = FULL_CIRCLE_DEG / family.turn
    letter = family.turn / 36.0

    def value_of(each: Numeral) -> float:
        return each.value * letter if each.is_letter else each.value

    def place(each: Numeral) -> float:
        return each.angle_deg - degrees * value_of(each)

    best: list[Numeral] = []
    for one in ring:
        agree = [each for each in ring if abs(away(place(each), place(one))) <= NEAR_DEG]
        if sum(each.sure for each in agree) > sum(each.sure for each in best):
            best = agree
    values = [value_of(each) for each in best]
    fitting = all(0 <= value <= family.turn and value % family.step == 0 for value in values)
    if family.name == "clock":
        fitting = fitting and any(value == family.turn for value in values)
    if len({round(value % family.turn, 3) for value in values}) < family.needs or not fitting:
        return None
    gaps = np.diff(sorted(each.angle_deg for each in best), append=min(e.angle_deg for e in best) + 360)
    if gaps.max() > MOST_TURN_DEG:
        return None
    strangers = tuple(each for each in ring if each not in best)
    if len(strangers) * 2 > len(best):
        return None
    return Fit(tuple(best), tuple(value % family.turn for value in values), strangers, family)


def _runs(ring: Sequence[Numeral]) -> Iterator[Fit | None]:
    """Find the longest runs in order: rising or falling clockwise, or rising to both sides of a zero."""
    numbers = [each for each in ring if not each.is_letter]
    yield _longest(numbers, [each.value for each in numbers], centred=False)
    for zero in (each for each in numbers if each.value == 0):
        signed = [math.copysign(each.value, away(each.angle_deg, zero.angle_deg)) for each in numbers]
        yield _longest(numbers, signed, centred=True)


def _longest(numbers: Sequence[Numeral], values: Sequence[float], *, centred: bool) -> Fit | None:
    best: tuple[float, tuple[int, ...]] = (0.0, ())
    count = len(numbers)
    for start in range(count):
        order = [(start + step) % count for step in range(count)]
        for sign in (1.0, -1.0):
            weight, run = _run(numbers, values, order, sign)
            if weight > best[0]:
                best = (weight, run)
    run = best[1]
    if len(run) < LEAST_RUN:
        return None
    own = [values[index] for index in run]
    if centred and not min(own) < 0 < max(own):
        return None
    first, span = numbers[run[0]].angle_deg, (numbers[run[-1]].angle_deg - numbers[run[0]].angle_deg) % 360.0
    strangers = tuple(
        each
        for index, each in enumerate(numbers)
        if index not in run and 0 < (each.angle_deg - first) % FULL_CIRCLE_DEG < span
    )
    beyond = tuple(each for index, each in enumerate(numbers) if index not in run and each not in strangers)
    return Fit(tuple(numbers[index] for index in run), tuple(own), strangers, None, centred, beyond)


def _run(
    numbers: Sequence[Numeral], values: Sequence[float], order: Sequence[int], sign: float
) -> tuple[float, tuple[int, ...]]:
    """Find the heaviest run in an order whose values change gradually."""
    at = [(numbers[index].angle_deg - numbers[order[0]].angle_deg) % FULL_CIRCLE_DEG for index in order]
    is_value = [sign * values[index] for index in order]
    # By the last two of a run: its weight and the place before them.
    runs: dict[tuple[int, int], tuple[float, tuple[int, ...]]] = {}
    for second in range(len(order)):
        for first in range(second):
            rise, turn = is_value[second] - is_value[first], at[second] - at[first]
            if rise <= 0 or not OFF_DEG < turn < MOST_TURN_DEG:
                continue
            rate = turn / rise
            skipped = STRANGER * (second - first - 1)
            found: tuple[float, tuple[int, ...]]
            found = numbers[order[first]].sure + numbers[order[second]].sure - skipped, (order[first], order[second])
            for before in range(first):
                earlier = runs.get((before, first))
                if earlier is None:
                    continue
                other = (at[first] - at[before]) / (is_value[first] - is_value[before])
                weight = earlier[0] + numbers[order[second]].sure - skipped
                if 1 / MOST_BEND <= rate / other <= MOST_BEND and weight > found[0]:
                    found = weight, (*earlier[1], order[second])
            runs[first, second] = found
    return max(runs.values(), default=(0.0, ()))
