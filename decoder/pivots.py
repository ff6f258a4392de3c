"""Pivots: where the needles of a flight really turn, told by the needles themselves.

A needle lies on a line through its pivot. If the dial is unwrapped around a point beside the pivot, the needle's inner
end is turned further than its tip, and how far changes as the needle goes round: over a flight that gives the pivot to
some hundredths of a pixel, whatever the needle looks like. A pivot that is off by one pixel on a dial 100 pixels wide
moves readings by a degree and a half to and fro.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from decoder.arrays import Floats
from decoder.gauge import Gauge
from decoder.needle_template import NeedleTemplate
from decoder.reading import Reading, Status
from decoder.sorting import middle_of
from decoder.tilts import Tilt, across, tilt_of, tilts_of
from decoder.unwrapping import PolarGrid, UnwrappedGauge

# What is thought of a panel's pivot before any frame has been seen, pixels.
PRIOR_PX = 0.5
# Uneven light and marks that are not quite known tilt a needle by about this, pixels.
TILT_FLOOR_PX = 0.03
MIN_TILTS = 5
# A needle stands a few millimetres above a dial that lies some centimetres from the anchors' plane.
PRIOR_LIFT = 0.2
HUBER_SPREADS = 2.0
ROBUST_PASSES = 4
SIGNIFICANT_SPREADS = 2.5
# Needles that stand this far apart lie over other marks. Of such places there must be more than unknowns.
APART_DEG = 3.0
MIN_PLACES = 3
# What tilts claim to scatter counts for as much as so many tilts.
CLAIM_COUNTS = 2
# Where each dial is found by itself, errors of its place that all frames share do not scatter.
PLACED_SCALE = 0.8
MAD_TO_SIGMA = 1.4826
# A needle's line that misses its pivot by more than both is no line of that needle.
MISSING_SPREADS = 5.0
MISSING_PX = 0.5


@dataclass(frozen=True, slots=True)
class Pivot:
    """A gauge's pivot as its needles tell it, relative to where the gauge was unwrapped.

    Attributes
    ----------
    offset_px
        (x, y).
    covariance_px2
        (2, 2) of the offset.
    lift, lift_sigma
        How far the needle goes beyond its dial, for each pixel that the dial moves against the anchors: it stands
        nearer to the camera; and how uncertain that is.
    scatter_px2, tilts
        The variance of the needles' tilts beyond their own noise, which may come out below nothing, and how many
        tilts tell it: by so much the dial is not where it was unwrapped, another way in each frame.
    own_px
        By needle: its tilt where the dial lies right.
    alone_px
        The offset by the gauge's own needles, whatever the others of the panel tell: with `own_px` it explains tilts.
    """

    offset_px: tuple[float, float]
    covariance_px2: Floats
    lift: float = 0.0
    lift_sigma: float = PRIOR_LIFT
    scatter_px2: float = 0.0
    tilts: int = 0
    own_px: Mapping[str, float] = field(default_factory=dict)
    alone_px: tuple[float, float] = (0.0, 0.0)

    @property
    def is_certain(self) -> bool:
        """Whether the needles turn elsewhere beyond doubt."""
        offset = np.array(self.offset_px)
        return float(offset @ np.linalg.solve(self.covariance_px2, offset)) > SIGNIFICANT_SPREADS**2

    @property
    def is_lifted(self) -> bool:
        """Whether the needle goes another way than its dial beyond doubt."""
        return abs(self.lift) > SIGNIFICANT_SPREADS * self.lift_sigma

    @property
    def told_lift(self) -> float:
        """The lift as far as needles tell it."""
        return self.lift**3 / (self.lift**2 + self.lift_sigma**2)

    @property
    def told_px(self) -> Floats:
        """(2,): the offset as far as needles tell it."""
        told: Floats = self.told_part @ np.array(self.offset_px)
        return told

    @property
    def told_part(self) -> Floats:
        """(2, 2): how much of what is left needles tell, the less the more they doubt it in some direction.

        It is what to think of an offset that is about as long as it seems and may lie in any direction (a ridge).
        """
        size_px2 = float(np.square(self.offset_px).sum())
        part: Floats = size_px2 * np.linalg.inv(self.covariance_px2 + size_px2 * np.eye(2))
        return part

    def settled(self, first_px: tuple[float, float], moved_px: tuple[float, float]) -> Pivot:
        """The pivot as uncertain as it is after it was moved in steps, of which `first_px` was the first.

        A step falls short where the needle that was learned around the old pivot took in a part of the tilts. All of
        them together, `moved_px` and what is left, go so many times as far as the first, and so do its errors.
        """
        first, whole = math.hypot(*first_px), math.dist(moved_px, [-left for left in self.offset_px])
        if first == 0.0 or whole <= first:
            return self
        return replace(self, covariance_px2=self.covariance_px2 * (whole / first) ** 2)

    def unsettled(self) -> Pivot:
        """The pivot with what is left of its offset among its doubts: it was looked for, and not found."""
        return replace(self, covariance_px2=self.covariance_px2 + np.outer(self.offset_px, self.offset_px))

    def blurred(self, sigma_px: float) -> Pivot:
        """The pivot with so much more doubt, all round."""
        return replace(self, covariance_px2=self.covariance_px2 + sigma_px**2 * np.eye(2))

    def sigma_deg(self, angles_deg: Floats, zero_deg: float, radius_px: float) -> Floats:
        """What a pivot that is still not quite right may add to readings, as a standard uncertainty.

        Parameters
        ----------
        angles_deg
            (N,): of the readings.
        zero_deg
            The angle at which the needle's zero was set: there the pivot does no harm.
        radius_px
            The needle's mean radius.
        """
        lever = across(angles_deg) - across(np.array([zero_deg]))
        variance = np.einsum("ni,ij,nj->n", lever, self.covariance_px2, lever)
        sigma: Floats = np.degrees(np.sqrt(np.maximum(variance, 0.0)) / radius_px)
        return sigma


UNKNOWN = Pivot((0.0, 0.0), PRIOR_PX**2 * np.eye(2))


def pivot_of(
    gauge: Gauge,
    grid: PolarGrid,
    face: UnwrappedGauge,
    templates: Mapping[str, NeedleTemplate],
    frames: Sequence[tuple[UnwrappedGauge, Mapping[str, Reading], tuple[float, float]]],
) -> Pivot:
    """The pivot of a gauge from some frames: each the unwrapped gauge, its readings, and its dial's shift."""
    return pivot_from(tilts_of(gauge, grid, face, templates, frames))


def pivot_from(tilts: Sequence[Tilt]) -> Pivot:
    """The pivot that explains the tilts best: robust least squares, each needle with a tilt of its own."""
    names = sorted({tilt.needle for tilt in tilts})
    names = [name for name in names if sum(tilt.needle == name for tilt in tilts) >= MIN_TILTS]
    tilts = [tilt for tilt in tilts if tilt.needle in names]
    if not tilts:
        return UNKNOWN
    own = np.array([[tilt.needle == name for name in names] for tilt in tilts], np.float64)
    beside = across(np.array([tilt.angle_deg for tilt in tilts]))
    shifts = np.array([tilt.dial_shift_px for tilt in tilts])
    lifted = (beside * (shifts - shifts.mean(axis=0))).sum(axis=1, keepdims=True)
    rows = np.concatenate([beside, own, lifted], axis=1)
    seen = np.array([tilt.kappa_px for tilt in tilts])
    sigma = np.hypot([tilt.sigma_px for tilt in tilts], TILT_FLOOR_PX)
    prior = np.diag([1 / PRIOR_PX**2] * 2 + [1e-6] * len(names) + [1 / PRIOR_LIFT**2])
    weights = 1 / sigma**2
    for _ in range(ROBUST_PASSES):
        normal = rows.T @ (weights[:, None] * rows) + prior
        solution = np.linalg.solve(normal, rows.T @ (weights * seen))
        spreads = np.abs(seen - rows @ solution) / sigma
        scale = _scale(spreads, len(seen) - len(solution), least=PLACED_SCALE if shifts.any() else 0.0)
        weights = np.minimum(1.0, HUBER_SPREADS * scale / np.maximum(spreads, 1e-9)) / (scale * sigma) ** 2
    covariances = np.linalg.inv(rows.T @ (weights[:, None] * rows) + prior)
    covariance = covariances[:2, :2]
    if _places(tilts) < MIN_PLACES + len(names):  # as many as unknowns: what spoils one place would move the pivot
        covariance = covariance + np.outer(solution[:2], solution[:2])
    left = seen - rows @ solution
    scatter_px2 = (MAD_TO_SIGMA * float(middle_of(np.abs(left)))) ** 2 * len(left) / max(len(left) - rows.shape[1], 1)
    own_px2 = float(middle_of(np.array([tilt.sigma_px for tilt in tilts]))) ** 2
    return Pivot(
        offset_px=(float(solution[0]), float(solution[1])),
        covariance_px2=covariance,
        lift=float(solution[-1]),
        lift_sigma=math.sqrt(float(covariances[-1, -1])),
        scatter_px2=scatter_px2 - own_px2,
        tilts=len(left),
        own_px=dict(zip(names, solution[2:-1].tolist(), strict=True)),
        alone_px=(float(solution[0]), float(solution[1])),
    )


def _places(tilts: Sequence[Tilt]) -> int:
    """In how many places, well apart, the needles stood."""
    count = 0
    last = ("", -math.inf)
    for needle, angle_deg in sorted((tilt.needle, tilt.angle_deg) for tilt in tilts):
        if needle != last[0] or angle_deg - last[1] > APART_DEG:
            count += 1
            last = (needle, angle_deg)
    return count


def _scale(spreads: Floats, freedoms: int, *, least: float) -> float:
    """By how much tilts scatter more than they claim, or less: then their claims count beside what they do."""
    scale = MAD_TO_SIGMA * float(middle_of(spreads))
    if scale < 1.0:
        known = max(freedoms, 0)
        fitted = len(spreads) / max(known, 1)  # what is left is the less, the more was fitted
        scale = math.sqrt((CLAIM_COUNTS + known * fitted * scale**2) / (CLAIM_COUNTS + known))
    return max(scale, least)


def with_lines_checked(
    strip: UnwrappedGauge,
    readings: Mapping[str, Reading],
    gauge: Gauge,
    grid: PolarGrid,
    *,
    face: UnwrappedGauge,
    templates: Mapping[str, NeedleTemplate],
    pivot: Pivot,
) -> dict[str, Reading]:
    """A gauge's readings; a needle whose line misses its pivot by far was seen in part, or not as it is: `edge`."""
    checked = dict(readings)
    for name, own_px in pivot.own_px.items():
        tilt = tilt_of(name, strip, readings, gauge, grid, face=face, templates=templates)
        if tilt is None:
            continue
        reading = readings[name]
        miss_px = abs(tilt.kappa_px - own_px - float(across(np.array([reading.angle_deg]))[0] @ pivot.alone_px))
        spread_px = math.hypot(tilt.sigma_px, TILT_FLOOR_PX, math.sqrt(max(pivot.scatter_px2, 0.0)))
        if miss_px > max(MISSING_SPREADS * spread_px, MISSING_PX):
            sigma_deg = math.hypot(reading.sigma_deg, math.degrees(miss_px / (sum(gauge.radius) / 2)))
            checked[name] = Reading(Status.EDGE, reading.angle_deg, sigma_deg, reading.score)
    return checked
