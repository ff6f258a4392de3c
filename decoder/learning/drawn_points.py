"""Whether the marks of gauges with a wrong centre were clicked as points, or given as angles.

Somebody who clicks on a mark, and on a wrong centre, gives the mark's direction as seen from that centre. Seen from the
right one, it differs by up to half a degree for each hundredth of the radius. Somebody who reads angles off the dial
gives the right ones. A panel does not say which, but its needles and scales give it away. Each needle is drawn where
the panel picture shows it, as seen from one centre or the other; and most scales are even around only one of the two,
since evenly spaced marks seen from off-centre are closer together on one side. The answer is the same for all gauges of
a panel, because the same person drew them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from decoder.imaging.planes import Squeeze
from decoder.imaging.sorting import MAD_TO_SIGMA
from decoder.imaging.thresholds import HALF
from decoder.learning.pivot_path import PivotPath, Vector
from decoder.learning.thresholds import HAND_PX, MOST_MARK_PART
from decoder.matching.thresholds import OUTLIER_SPREADS
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.panel.parameters import CLOCKWISE, parameter_of
from decoder.panel.scale import FULL_CIRCLE_DEG, Quantity, Scale

# How precisely people usually draw needles and marks, and how precisely the panel picture shows needles.
ANGLE_DEG = 1.5
# Prior: angles are more likely. A needle above its dial appears to turn elsewhere although its angles are right.
PRIOR_LOG_ODDS = -3.0
# With fewer marks than these, a panel is assumed to be drawn with ordinary care.
ORDINARY_MARKS = 5
Seen = Sequence[tuple[float, float]]
"""Of a gauge's needles: at which angle each is drawn, and where the panel picture shows it around its pivot."""


def log_odds_of_points(gauges: Sequence[Gauge], paths: Sequence[PivotPath], seen: Sequence[Seen]) -> float:
    """Estimate the log odds that a panel's angles are points as seen from its centres, by its needles and scales."""
    return PRIOR_LOG_ODDS + sum(
        _of_needles(gauge, path, own) + log_odds_of_scales(gauge, path)
        for gauge, path, own in zip(gauges, paths, seen, strict=True)
        if path.was_moved
    )


def _of_needles(gauge: Gauge, path: PivotPath, seen: Seen) -> float:
    return sum(
        log_odds_of_point(
            _short_way(seen_deg - drawn_deg) / ANGLE_DEG,
            (seen_from(path.beside_px, gauge.radius[1], drawn_deg) - drawn_deg) / ANGLE_DEG,
        )
        for drawn_deg, seen_deg in seen
    )


def log_odds_of_scales(gauge: Gauge, path: PivotPath) -> float:
    """Estimate the log odds that a gauge's marks are points, from its scales as drawn and how far its pivot moved."""
    return sum(
        log_odds_of_even(_beside_even(angles_deg, values, turn), _beside_even(carried_deg, values, turn))
        for angles_deg, values, turn in _scales(gauge)
        for carried_deg in ([seen_from(path.beside_px, gauge.radius[1], angle_deg) for angle_deg in angles_deg],)
    )


def _scales(gauge: Gauge) -> Iterator[tuple[Sequence[float], Sequence[float], float | None]]:
    """Yield each scale's angles, its values, and the value of a turn."""
    for marks, turn in dict.fromkeys((each.marks, each.wraps) for each in gauge.quantities if each.is_measured):
        angles_deg, values = zip(*marks, strict=True)
        yield angles_deg, values, turn


def uneven_deg(quantity: Quantity) -> float:
    """Return how far a scale's marks are from even spacing: their standard deviation, or half of the worst if larger.

    Only a scale whose full turn has a known value is known to be even; for others it is zero.
    """
    if quantity.wraps is None or not quantity.is_measured:
        return 0.0
    angles_deg, values = (np.array(each, np.float64) for each in zip(*quantity.marks, strict=True))
    beside_deg = angles_deg - _pace_deg(values, quantity.wraps) * values
    beside_deg -= beside_deg.mean()
    spread_deg = math.sqrt(float(beside_deg @ beside_deg) / (len(beside_deg) - 1))
    return max(spread_deg, float(np.abs(beside_deg).max()) / 2)  # two sigma have to cover the worst


def squeeze_of(gauge: Gauge) -> Squeeze | None:
    """Return how the view squeezes a dial, by the marks that were drawn where they appear all the way round it.

    From beside their middle, even marks are uneven by a wave once around; seen obliquely, by one twice around. None if
    a careless hand may have drawn the latter, or there are too few marks to tell.
    """
    scale = max((each for each in gauge.quantities if each.wraps is not None), key=lambda each: len(each.marks))
    angles, values = (np.array(each, np.float64) for each in zip(*scale.marks, strict=True))
    turns = [np.ones_like(angles), *(wave(np.radians(n * angles)) for n in (1, 2) for wave in (np.cos, np.sin))]
    if scale.wraps is None or len(angles) <= len(turns) + 1:
        return None
    beside = np.radians(angles - _pace_deg(values, scale.wraps) * values)
    (*_, askew, behind), (left,), *_ = np.linalg.lstsq(np.stack(turns, axis=1), beside, rcond=None)
    missed = max(math.sqrt(left / (len(angles) - len(turns))), MOST_MARK_PART)
    is_clear = math.hypot(askew, behind) > OUTLIER_SPREADS * missed * math.sqrt(2.0 / len(angles))
    return Squeeze(float(-behind), float(askew)) if is_clear else None


def is_beyond_a_hand(off_deg: float) -> bool:
    """Tell whether marks are further off than a careless hand misses them by."""
    return abs(off_deg) > 3 * math.degrees(MOST_MARK_PART)


def slips_deg(quantity: Quantity) -> Floats:
    """(M,): how far each mark is off what its neighbours' spacing makes of it from both sides; 0 if a hand explains it.

    A mark where the spacing changes fits one of its sides, and a scale that is a curve lies between the two. A mark
    that fits neither has a mistyped value, or was clicked at another mark. Where only one side goes on, it has to be
    off by twice as much. A scale that goes all the way round is even, see `uneven_deg`; with fewer than four marks,
    nothing tells.
    """
    angles_deg, values = (np.array(each, np.float64) for each in zip(*quantity.marks, strict=True))
    slips = np.zeros_like(angles_deg)
    if quantity.wraps is not None or not quantity.is_measured:
        return slips
    paces_deg = np.diff(angles_deg) / np.diff(values)
    for mark in range(1, len(slips) - 1):
        beyond = [*paces_deg[max(mark - 2, 0) : mark - 1], *paces_deg[mark + 1 : mark + 2]]
        if beyond:
            least, most = min(beyond), max(beyond)
            sides = [
                _outside(
                    angles_deg[mark] - angles_deg[beside], (values[mark] - values[beside]) * np.array([least, most])
                )
                for beside in (mark - 1, mark + 1)
            ]
            slip_deg = min(sides, key=abs) if sides[0] * sides[1] > 0.0 else 0.0
            if is_beyond_a_hand(slip_deg * len(beyond) / 2):
                slips[mark] = slip_deg
    return slips


def slip_findings(gauge: Gauge) -> Iterator[str]:
    """Name each mark that does not fit its neighbours, for the person who drew it."""
    needles = {needle.name for needle in gauge.turning}
    scales = {quantity.marks: quantity for quantity in gauge.quantities if quantity.name in needles}
    for quantity in scales.values():
        for (_, value), slip_deg in zip(quantity.marks, slips_deg(quantity), strict=True):
            if slip_deg:
                yield (
                    f"has a mark {value:g} that stands {abs(slip_deg):.1f} degrees off what its neighbours' spacing"
                    " makes of it: sigma allows for that; check its value and its place with `decode setup`"
                )


def backward_findings(gauge: Gauge) -> Iterator[str]:
    """Name each needle whose values fall clockwise although they rise on the dials of all makers."""
    needles = {needle.name for needle in gauge.turning}
    for quantity in gauge.quantities:
        (_, first), *_, (_, last) = quantity.marks
        shown = parameter_of(quantity.name)
        if quantity.name in needles and shown in CLOCKWISE and last < first:
            yield (
                f"has values of {quantity.name} that fall clockwise, where {shown} rises on the dials of all makers:"
                " are its marks numbered the wrong way round?"
            )


def _outside(place: float, ends: Floats) -> float:
    """Return how far a place is below (negative) or above the stretch between two ends; 0 within it."""
    return place - float(np.clip(place, ends.min(), ends.max()))


def marks_missed_px(gauges: Sequence[Gauge]) -> float:
    """Estimate the standard deviation of drawing errors of marks in excess of HAND_PX, from how uneven scales are.

    The same person drew all scales of a panel, so a few marks where a scale's spacing changes do not matter. A panel
    with few marks is assumed to be drawn with about ordinary care, as if it had ORDINARY_MARKS more of that kind.
    """
    scales = [(gauge.radius[1], scale) for gauge in gauges for scale in _scales(gauge)]
    beside_px = [abs(radius_px * beside) for radius_px, scale in scales for beside in _beside_neighbours(*scale)]
    ordinary_px = [HAND_PX / MAD_TO_SIGMA] * ORDINARY_MARKS
    beyond_px2 = (MAD_TO_SIGMA * float(np.median([*beside_px, *ordinary_px]))) ** 2 - HAND_PX**2
    return math.sqrt(max(beyond_px2, 0.0))


def _beside_neighbours(angles_deg: Sequence[float], values: Sequence[float], turn: float | None) -> Iterator[float]:
    """Yield for each mark how far it is off its two neighbours, minus the same of the next, in radians.

    Each is scaled to one mark's error. Because of the difference, neither a curved scale nor a view from off-centre
    counts. Nor do marks at which the spacing changes by half, since some scales are made so; and two marks of a full
    turn are always even. If only one mark has two neighbours, its own deviation is yielded.
    """
    if len(values) < 3:  # noqa: PLR2004 - one between two
        return
    scale = Scale.of(tuple(zip(angles_deg, values, strict=True)), turn)
    steps, moves = np.diff(scale.angles_deg), np.diff(scale.values)
    share = moves[:-1] / (moves[:-1] + moves[1:])
    beside = np.zeros((len(share), len(scale.values)))
    for column, weight in enumerate((share - 1.0, np.ones_like(share), -share)):
        beside[np.arange(len(share)), np.arange(len(share)) + column] = weight
    is_even = np.abs(np.diff(np.log(np.abs(steps / moves)))) <= math.log1p(HALF)
    if len(share) > 1:
        beside, is_even = np.diff(beside, axis=0), is_even[1:] & is_even[:-1]
    missed = beside @ np.radians(scale.angles_deg) / np.linalg.norm(beside, axis=1)
    yield from missed[is_even].tolist()


def _beside_even(angles_deg: Sequence[float], values: Sequence[float], turn: float | None) -> Floats:
    """(N - 2,) or (N - 1,): residuals of marks from an even scale; one that goes all the way round has a known pace."""
    angles, steps = np.array(angles_deg, np.float64), np.array(values, np.float64)
    columns = np.stack([np.ones_like(steps), steps], axis=1)
    if turn is not None:
        angles = angles - _pace_deg(values, turn) * steps
        columns = columns[:, :1]
    across, _ = np.linalg.qr(columns, mode="complete")
    beside: Floats = across[:, columns.shape[1] :].T @ angles
    return beside


def _pace_deg(values: Sequence[float] | Floats, turn: float) -> float:
    """Return how many degrees a unit is; negative where values rise anticlockwise."""
    return math.copysign(FULL_CIRCLE_DEG / turn, values[-1] - values[0])


def log_odds_of_even(drawn_deg: Floats, carried_deg: Floats) -> float:
    """Weigh how far a scale is from even as it was drawn against how far if its marks were points.

    Residuals are normally distributed with an unknown spread of at least `ANGLE_DEG`, so a scale that is uneven either
    way counts for little.
    """
    drawn, carried = (ANGLE_DEG**2 + float(beside @ beside) for beside in (drawn_deg, carried_deg))
    return len(drawn_deg) / 2 * math.log(drawn / carried)


def log_odds_of_point(off: float, moved: float) -> float:
    """Weigh a needle seen `off` from where it is drawn, if a point would have moved by `moved`; in sigmas.

    Drawing errors are assumed to follow a Cauchy distribution, so that one needle drawn quite wrongly decides nothing.
    """
    return math.log((1.0 + off**2) / (1.0 + (off - moved) ** 2))


def seen_from(offset_px: Vector, radius_px: float, angle_deg: float) -> float:
    """Return the angle of a point as seen from elsewhere, in the same turn.

    Parameters
    ----------
    offset_px
        Of the place it is seen from, (x, y) from the centre.
    radius_px, angle_deg
        Of the point, around the centre.
    """
    angle = math.radians(angle_deg)
    x, y = radius_px * math.cos(angle) - offset_px[0], radius_px * math.sin(angle) - offset_px[1]
    return angle_deg + _short_way(math.degrees(math.atan2(y, x)) - angle_deg)


def _short_way(angle_deg: float) -> float:
    return (angle_deg + FULL_CIRCLE_DEG / 2) % FULL_CIRCLE_DEG - FULL_CIRCLE_DEG / 2


def seen_from_pivots(gauges: Sequence[Gauge], paths: Sequence[PivotPath], log_odds: float) -> tuple[Gauge, ...]:
    """Convert gauges' angles to those around their pivots, if they are more likely points seen from drawn centres."""
    if log_odds <= 0.0:
        return tuple(gauges)
    return tuple(
        gauge.at_angles(partial(seen_from, path.beside_px, gauge.radius[1])) if path.was_moved else gauge
        for gauge, path in zip(gauges, paths, strict=True)
    )
