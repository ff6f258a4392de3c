"""The marks of a scale as a panel gives them: angle and value each, one way along the dial, in one turn where it wraps.

A part of the panel format, see `decoder.panel`; `decoder.scale` reads values off them.
"""

from __future__ import annotations

from itertools import pairwise

from decoder.description import Number

FULL_CIRCLE_DEG = 360.0

Marks = tuple[tuple[Number, Number], ...]


def monotone(scale: Marks) -> Marks:
    """The marks by angle; ValueError where there are too few, or the values turn round along the dial."""
    if len(scale) < 2:  # noqa: PLR2004 - a line needs two points
        raise ValueError("needs at least two [angle, value] marks")
    marks = sorted(scale)
    turns = {after[0] > before[0] for before, after in pairwise(marks)}
    steps = {(after[1] > before[1]) - (after[1] < before[1]) for before, after in pairwise(marks)}
    if turns != {True} or steps not in ({1}, {-1}):
        raise ValueError(
            "must be monotone: each mark at another angle, values only rising or only falling along the dial"
        )
    return tuple(marks)


def check_turn(scale: Marks, wraps: float) -> None:
    """ValueError unless the marks lie in one turn, and leave something of its value for the way back to the first."""
    (first_deg, first), (last_deg, last) = scale[0], scale[-1]
    if last_deg - first_deg == FULL_CIRCLE_DEG and abs(last - first) == wraps:
        return
    if last_deg - first_deg >= FULL_CIRCLE_DEG or abs(last - first) >= wraps:
        raise ValueError(
            f"`scale` does not fit `wraps: {wraps:g}`: its marks must lie within one turn and one turn's value"
        )
