"""Scales: the marks that a panel gives, the values at angles between them, and how hands share one value.

A part of the panel format, see `decoder.panel.panel`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from decoder.panel.arrays import Degrees, Floats, Mask, Number
from decoder.panel.thresholds import CONFIDENCE_SIGMAS, LEAST_DEG, LEAST_VALUE
from decoder.panel.written import ValueType, Written

FULL_CIRCLE_DEG = 360.0
# A coarse hand must distinguish turns even if it is off by this many of its sigmas.
SURE_SIGMAS = 2.0

MOST_POINTS = 1000  # marked on one thing; no dial has as many ticks

Marks = Annotated[tuple[tuple[Degrees, Number], ...], Field(max_length=MOST_POINTS)]


def monotone(scale: Marks) -> Marks:
    """Sort marks by angle; ValueError if there are too few, or values are not monotonic along the dial."""
    if len(scale) < 2:  # noqa: PLR2004 - a line needs two points
        raise ValueError("needs at least two [angle, value] marks")
    marks = sorted(scale)
    turns = {after[0] > before[0] for before, after in pairwise(marks)}
    rises = [after[1] - before[1] for before, after in pairwise(marks)]
    steps = {(rise > 0) - (rise < 0) for rise in rises}
    if turns != {True} or steps not in ({1}, {-1}):
        raise ValueError(
            "must be monotone: each mark at another angle, values only rising or only falling along the dial"
        )
    if any(
        after[0] - before[0] < LEAST_DEG or abs(after[1] - before[1]) < LEAST_VALUE for before, after in pairwise(marks)
    ):
        raise ValueError(f"has two marks less than {LEAST_DEG:g} degrees or {LEAST_VALUE:g} apart; remove one")
    return tuple(marks)


DialMarks = Annotated[Marks, AfterValidator(monotone)]
"""Marks of a dial that somebody drew."""


def marks_at(scale: Marks, true_deg: Callable[[float], float]) -> Marks:
    """Replace the angles of marks, keeping their values."""
    return tuple((true_deg(angle_deg), value) for angle_deg, value in scale)


def turned(scale: Sequence[Sequence[float]], turn_deg: float) -> list[list[float]]:
    """Turn the marks of a draft's scale."""
    return [[round(angle_deg + turn_deg, 4), value] for angle_deg, value in scale]


def check_turn(scale: Marks, wraps: float) -> None:
    """Raise ValueError unless the marks lie in one turn, and leave part of its value for the way back to the first."""
    (first_deg, first), (last_deg, last) = scale[0], scale[-1]
    if last_deg - first_deg == FULL_CIRCLE_DEG and abs(last - first) == wraps:
        return
    is_open = len(scale) == 2 and last_deg - first_deg == FULL_CIRCLE_DEG / 2 and abs(last - first) == wraps / 2  # noqa: PLR2004
    if is_open and last < first:
        raise ValueError(
            "two marks half a turn apart leave open which way values rise; write the full turn's value in place of the"
            " lowest, or add a third mark"
        )
    if last_deg - first_deg >= FULL_CIRCLE_DEG or abs(last - first) >= wraps:
        raise ValueError(
            f"`scale` does not fit `wraps: {wraps:g}`: its marks must lie within one turn and one turn's value"
        )


@dataclass(frozen=True, slots=True)
class Scale:
    """Tick marks of one gauge: angles in degrees rising, values in its unit rising or falling with them.

    Between marks the value is interpolated linearly; beyond the outermost it is extrapolated along the last two
    (thesis 3.2.2). With `wraps`, the value of a full turn, the scale goes all the way round: after its last mark comes
    the first again, a turn on, and values lie in [0, wraps).
    """

    angles_deg: Floats
    values: Floats
    wraps: float | None = None

    @classmethod
    def of(cls, marks: Sequence[tuple[float, float]], wraps: float | None = None) -> Scale:
        """Make a scale of (angle, value) marks, sorted by angle."""
        angles_deg, values = np.array(marks, np.float64).T
        if wraps is not None and angles_deg[-1] - angles_deg[0] < FULL_CIRCLE_DEG:
            angles_deg = np.append(angles_deg, angles_deg[0] + FULL_CIRCLE_DEG)
            values = np.append(values, values[0] + math.copysign(wraps, values[-1] - values[0]))
        return cls(angles_deg, values, wraps)

    def values_at(self, angles_deg: Floats) -> Floats:
        """Read the values at angles; NaN stays NaN."""
        values = self._within(self._in_turn(angles_deg))
        return values if self.wraps is None else in_turn(values, self.wraps)

    def _within(self, angles_deg: Floats) -> Floats:
        """(...): the values at angles of the first turn."""
        part = self._part(self.angles_deg, angles_deg)
        values: Floats = self.values[part] + (angles_deg - self.angles_deg[part]) * self._slopes[part]
        return values

    def slopes_at(self, angles_deg: Floats) -> Floats:
        """Return units per degree at angles; negative where values fall clockwise."""
        slopes: Floats = self._slopes[self._part(self.angles_deg, self._in_turn(angles_deg))]
        return slopes

    def steepest_at(self, angles_deg: Floats, sigmas_deg: Floats) -> Floats:
        """Return units per degree at angles (...) with this uncertainty in degrees, on the steeper side.

        A needle on a flat part of the scale may be beyond the next mark, where a degree is worth more.
        """
        reach_deg = np.clip(CONFIDENCE_SIGMAS * sigmas_deg, LEAST_DEG, FULL_CIRCLE_DEG)
        here = self._going_on(angles_deg)
        sides = [np.abs(self._going_on(angles_deg + side * reach_deg) - here) for side in (-1.0, 1.0)]
        steepest: Floats = np.maximum(*sides) / reach_deg
        return steepest

    def bends_deg(self, angles_deg: Floats) -> Floats:
        """(N,): how far values may be from the straight lines between marks, in degrees, if the scale is a curve.

        On a logarithmic scale, a degree is worth more from mark to mark, and so also between marks. If the slope
        changes at one mark only, that is taken as a kink between two straight parts; if it changes to and fro, as
        errors of drawing. A scale that grows both ways from a mark, such as a vertical speed's, is assumed to continue
        as it does further out. How a curve continues beyond the outermost marks is unknown; it is followed for as far
        again as these are from the next. Values may go on there at any pace that the scale has between its marks: an
        airspeed indicator's are crowded below its first.
        """
        if len(self.values) <= 3:  # noqa: PLR2004 - one change
            return np.zeros_like(angles_deg)
        steps_deg, part = np.diff(self.angles_deg), self._part(self.angles_deg, angles_deg)
        growth = 2.0 * np.diff(np.log(np.abs(self._slopes))) / (steps_deg[1:] + steps_deg[:-1])  # at inner marks
        both = np.minimum(np.abs(growth[1:]), np.abs(growth[:-1]))
        both = np.where(np.sign(growth[1:]) == np.sign(growth[:-1]), np.sign(growth[1:]) * both, 0.0)
        mirrored = both[:-3] * both[3:] < 0.0
        bent = np.concatenate([both[:1], both, both[-1:]])
        bent[2:-3][mirrored], bent[3:-2][mirrored] = both[:-3][mirrored], both[3:][mirrored]
        grown = (bent * steps_deg)[part]
        way = np.clip((angles_deg - self.angles_deg[part]) / steps_deg[part], -1.0, 2.0)
        curved = np.divide(np.expm1(grown * way), np.expm1(grown), out=way.copy(), where=grown != 0.0)
        beyond_deg = np.maximum(self.angles_deg[0] - angles_deg, angles_deg - self.angles_deg[-1])
        paces = np.abs(self._slopes[:, None] / self._slopes[part] - 1.0).max(axis=0)
        bends: Floats = np.maximum(np.abs(curved - way) * steps_deg[part], paces * beyond_deg)
        return bends

    def bowed_deg(self, angles_deg: Floats, bow_per_deg: float) -> Floats:
        """(N,): how far values may be from the straight lines between marks, in degrees, if all of it is bowed."""
        part = self._part(self.angles_deg, angles_deg)
        before, after = angles_deg - self.angles_deg[part], self.angles_deg[part + 1] - angles_deg
        bowed: Floats = bow_per_deg * np.abs(before * after)
        return bowed

    def _going_on(self, angles_deg: Floats) -> Floats:
        """(...): the values at angles, continuing beyond the first turn."""
        if self.wraps is None:
            return self._within(angles_deg)
        within = self._in_turn(angles_deg)
        turns = np.round((angles_deg - within) / FULL_CIRCLE_DEG)
        return self._within(within) + turns * math.copysign(self.wraps, self.values[-1] - self.values[0])

    def angles_of(self, values: Floats) -> Floats:
        """Compute the angles at which the needle shows values."""
        sign = 1.0 if self.values[-1] > self.values[0] else -1.0
        if self.wraps is not None:
            values = self.values[0] + sign * in_turn(sign * (values - self.values[0]), self.wraps)
        part = self._part(sign * self.values, sign * np.asarray(values, np.float64))
        angles_deg: Floats = self.angles_deg[part] + (values - self.values[part]) / self._slopes[part]
        return angles_deg

    def _in_turn(self, angles_deg: Floats) -> Floats:
        if self.wraps is None:
            return angles_deg
        within: Floats = self.angles_deg[0] + in_turn(angles_deg - self.angles_deg[0], FULL_CIRCLE_DEG)
        return within

    @property
    def _slopes(self) -> Floats:
        slopes: Floats = np.diff(self.values) / np.diff(self.angles_deg)
        return slopes

    @staticmethod
    def _part(edges: Floats, places: Floats) -> NDArray[np.intp]:
        return np.clip(np.searchsorted(edges, places) - 1, 0, len(edges) - 2)


def in_turn(values: Floats, turn: float, lowest: float = 0.0) -> Floats:
    """Bring values into [lowest, lowest + turn) by whole turns."""
    inside = np.mod(values - lowest, turn)
    below: Floats = np.where(inside == turn, 0.0, inside)  # the remainder of a tiny negative number rounds to a turn
    return below + lowest


def shortest(differences: Floats, turn: float | None) -> Floats:
    """Return differences the short way round, in [-turn / 2, turn / 2]; unchanged if nothing wraps."""
    return differences if turn is None else differences - turn * np.round(differences / turn)


@dataclass(frozen=True, slots=True)
class Quantity:
    """What one column of values means.

    Attributes
    ----------
    name, gauge, unit
        Of the column, of the gauge it comes from, and of its values.
    marks
        (angle, value) each, sorted by angle.
    wraps
        The value of a full turn, if values start again after it: they lie in [lowest, lowest + wraps).
    covered_by
        The needle that turns above this one.
    max_rate
        How fast the value can change, in its unit per second, if known.
    limits
        The lowest and the highest possible value, if these do not follow from the marks.
    written
        How its values are written if they are not measured; they then change in steps.
    is_drawn
        Whether its marks are places that somebody drew.
    has_drawn_zero
        Whether it is read relative to a place that somebody drew besides its marks (where a pointer was cut, a card's
        index), so that all values share the error of that place.
    has_upright_zero
        Whether it is read relative to straight up, as nobody drew where: the camera's roll then affects all values.
    goes_on
        Whether its values go on beyond the outermost marks.
    is_shift
        Whether it is read from how far something has shifted from the pivot, rather than turned around it.
    bow_per_deg
        How far it may be bowed between two marks, for each degree from one and each from the other.
    """

    name: str
    gauge: str
    unit: str
    marks: Marks
    wraps: float | None
    covered_by: str | None
    max_rate: float | None
    lowest: float = 0.0
    limits: tuple[float, float] | None = None
    written: Written | None = None
    is_drawn: bool = True
    has_drawn_zero: bool = False
    has_upright_zero: bool = False
    goes_on: bool = False
    is_shift: bool = False
    bow_per_deg: float = 0.0

    @classmethod
    def stepped(cls, name: str, gauge: str, unit: str, written: Written) -> Quantity:
        """Return one whose values are written; a reading's angle is the value itself."""
        return cls(
            name, gauge, unit, ((0.0, 0.0), (1.0, 1.0)), None, None, None, limits=written.limits, written=written
        )

    @property
    def is_measured(self) -> bool:
        """Whether it is a number with a sigma, not a state or a text."""
        return self.written is None or self.written.type is ValueType.NUMBER

    @property
    def full_scale(self) -> float:
        """The span of values between the outermost marks, or of a full turn."""
        low, high = self.range
        return high - low

    @property
    def range(self) -> tuple[float, float]:
        """The lowest and the highest value of the scale."""
        if self.wraps is not None:
            return self.lowest, self.lowest + self.wraps
        if self.limits is not None:
            return self.limits
        values = [value for _, value in self.marks]
        return min(values), max(values)


@dataclass(frozen=True, slots=True)
class Combination:
    """How a quantity follows from others.

    Attributes
    ----------
    quantity
        The combined one.
    parts
        The names of the pointers, the finest first.
    turn
        The value of a turn of the coarsest.
    tolerance
        In turns of the finer of two pointers.
    """

    quantity: Quantity
    parts: tuple[str, ...]
    turn: float
    tolerance: float


@dataclass(frozen=True, slots=True)
class Gearing:
    """How the hands of one dial, the finest first, follow from its value, as in an altimeter or a clock.

    Each hand shows the value modulo its turn. The coarsest shows the whole value roughly; each finer one must point,
    within the panel's tolerance, to where the coarser one puts it, and then refines the value.

    Attributes
    ----------
    quantity, names
        The value, and the names of the hands.
    scales
        Of the hands.
    turns
        The value of a turn of each hand.
    off
        By how much each hand's value exceeds that of the finer ones because of errors in drawing it and its marks.
    tolerance
        In turns of the finer of two hands.
    """

    quantity: Quantity
    names: tuple[str, ...]
    scales: tuple[Scale, ...]
    turns: tuple[float, ...]
    off: tuple[float, ...]
    tolerance: float

    @classmethod
    def of(cls, quantities: Sequence[Quantity], combination: Combination, drawn_deg: Mapping[str, float]) -> Self:
        """Make the gearing of a combined value from its hands, and from where they are drawn in the panel picture.

        There all hands show one value, so a contradiction between them within the tolerance is an error of drawing. A
        hand with a picture of its own is not drawn there, and its error is unknown.
        """
        by_name = {quantity.name: quantity for quantity in quantities}
        parts = [by_name[name] for name in combination.parts]
        scales = tuple(Scale.of(part.marks, part.wraps) for part in parts)
        turns = tuple(part.wraps or 0.0 for part in parts)
        off = [0.0] * len(parts)
        if drawn_deg.keys() >= set(combination.parts):
            at_deg = [drawn_deg[part.name] for part in parts]
            told = [float(scale.values_at(np.array(at))) for scale, at in zip(scales, at_deg, strict=True)]
            for hand, finer in enumerate(turns[:-1], 1):
                more = float(shortest(np.array(told[hand] - (told[hand - 1] - off[hand - 1])), finer))
                off[hand] = more if abs(more) <= combination.tolerance * finer else 0.0
        return cls(combination.quantity, combination.parts, scales, turns, tuple(off), combination.tolerance)

    def without(self, name: str) -> Gearing:
        """Return the gearing of all hands but one."""
        kept = [hand for hand, own in enumerate(self.names) if own != name]
        names, turns = tuple(self.names[hand] for hand in kept), tuple(self.turns[hand] for hand in kept)
        scales, off = tuple(self.scales[hand] for hand in kept), tuple(self.off[hand] for hand in kept)
        return replace(self, names=names, scales=scales, turns=turns, off=off)

    @property
    def name(self) -> str:
        """The name of the value."""
        return self.quantity.name

    @property
    def share(self) -> float:
        """The ratio of one turn of the finest hand to the value's circle."""
        return self.turns[0] / self.turn

    @property
    def turn(self) -> float:
        """The value of a turn of the coarsest hand."""
        return self.turns[-1]

    def values(self, finest_deg: Floats) -> Floats:
        """(..., T): all values at which the finest hand points in these directions, (...)."""
        within = self.within(0, finest_deg)[..., None] + self.turns[0] * np.arange(round(self.turn / self.turns[0]))
        return in_turn(within, self.turn, self.quantity.lowest)

    def within(self, hand: int, angles_deg: Floats) -> Floats:
        """Return the value that a hand shows by itself, within one turn of it."""
        return self.scales[hand].values_at(angles_deg) - self.off[hand]

    def angles_deg(self, hand: int, values: Floats) -> Floats:
        """Return where a hand points at these values."""
        return self.scales[hand].angles_of(values + self.off[hand])

    def tolerance_deg(self, hand: int) -> float:
        """Return how far a hand may be from where the next finer one puts it."""
        return self.tolerance * FULL_CIRCLE_DEG * self.turns[max(hand - 1, 0)] / self.turns[hand]

    def counted(self, angles_deg: Floats) -> Floats:
        """(...): the values of all hands (..., K) together: the whole from the coarsest, refined by each finer one."""
        hands = angles_deg.shape[-1]
        values = self.within(hands - 1, angles_deg[..., -1])
        for hand in range(hands - 2, -1, -1):
            values = self.measured(hand, angles_deg, values)
        return values

    def measured(self, hand: int, angles_deg: Floats, values: Floats) -> Floats:
        """(...): the values nearest to given ones, (...), at which a hand would point as that hand of (..., K) does."""
        return in_turn(values + self._stray(hand, angles_deg, values), self.turn, self.quantity.lowest)

    def agrees(self, values: Floats, angles_deg: Floats, sigmas_deg: Floats, seen: Mask) -> Mask:
        """(...): whether all visible hands (..., K) point where the values put them, and distinguish turns."""
        agrees = np.ones(np.shape(values), bool)
        for hand in range(1, seen.shape[-1]):
            finer = self.turns[hand - 1]
            off = np.abs(self._stray(hand, angles_deg, values))
            doubt = off + SURE_SIGMAS * self.sigma(hand, angles_deg, sigmas_deg)
            agrees &= ~(seen[..., hand] & ((off > self.tolerance * finer) | (doubt > finer / 2)))
        return agrees

    def variances(self, hand: int, angles_deg: Floats, values: Floats) -> tuple[float, float]:
        """Return by how much a hand (N,) moves, and by how much it strays from where values (N,) put it, degrees^2."""
        off_deg = angles_deg - self.angles_deg(hand, values)
        moved, strayed = (np.var(shortest(each - each[0], FULL_CIRCLE_DEG)) for each in (angles_deg, off_deg))
        return float(moved), float(strayed)

    def _stray(self, hand: int, angles_deg: Floats, values: Floats) -> Floats:
        """(...): how far values are from the one that a hand shows by itself, the short way round."""
        return shortest(self.within(hand, angles_deg[..., hand]) - values, self.turns[hand])

    def sigma(self, hand: int, angles_deg: Floats, sigmas_deg: Floats) -> Floats:
        """(...): the uncertainty of the value that one of the hands (..., K) shows by itself."""
        sigmas: Floats = np.abs(self.scales[hand].slopes_at(angles_deg[..., hand])) * sigmas_deg[..., hand]
        return sigmas

    def circle_deg(self, value: float) -> float:
        """Return a value as an angle, from the lowest on, on the circle that is one turn of the coarsest hand."""
        return (value - self.quantity.lowest) / self.turn * FULL_CIRCLE_DEG

    def value_at(self, circle_deg: Floats) -> Floats:
        """Return the values at angles on that circle; reverses `circle_deg`."""
        values: Floats = self.quantity.lowest + circle_deg / FULL_CIRCLE_DEG * self.turn
        return values
