"""Tick marks around a pivot: where the comb is, the plane it is seen in, and each mark's angle.

The strokes that aim at a pivot from about the same distance are its ticks. Their lines meet in it, to a fraction of a
pixel, and the ring on which they begin or end shows how obliquely the dial is seen.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from decoder.imaging.motion import jacobian
from decoder.imaging.planes import DialPlane
from decoder.imaging.thresholds import HALF
from decoder.learning.obliqueness import squeeze_shown
from decoder.panel.arrays import Floats
from decoder.panel.errors import PictureError
from decoder.registration.thresholds import NOISE_LEVELS
from decoder.setup.dial_edges import (
    Freedom,
    Rim,
    Ring,
    begun,
    levels_on_rings,
    mark_angle_deg,
    oblique_rim,
    ring_design,
)
from decoder.setup.drawn_plane import XY, DrawnPlane, Planes
from decoder.setup.finding.robust import Trust, meeting, robust
from decoder.setup.finding.strokes import Strokes
from decoder.setup.finding.thresholds import (
    ALL_ROUND_DEG,
    FURTHEST,
    LEAST_APART_DEG,
    LEAST_PX,
    LEAST_STROKES,
    LEAST_TICKS,
    LONGEST_PART,
    MISS_PART,
    MISS_PX,
    NEAREST,
    OFF_DEG,
)
from decoder.setup.thresholds import MAX_FLATNESS

PASSES = 5
ROUNDS = 3
ENDS = (("inner_px", 20), ("outer_px", 80))
# How far strokes may pass the point that they aim at, and ticks end beside their circle, px.
STROKES, ENDS_OFF = Trust(0.075, 1.5), Trust(0.2, 1.5)
ANGLE_STEP_DEG = 0.25
RADIUS_STEP_PX = 0.5
PLAIN_STEP = 4
# The length of short ticks, as a part of their numerals' distance from the pivot.
SHORT_PART = 0.05
# The dial's face is visible this far to either side of a tick.
BESIDE_DEG = 5.0


@dataclass(frozen=True, slots=True)
class Tick:
    """A mark: its angle on the dial's plane, and its inner and outer end, in the dial's pixels."""

    angle_deg: float
    inner_px: float
    outer_px: float
    contrast: float

    @property
    def length_px(self) -> float:
        """How long it is."""
        return self.outer_px - self.inner_px


@dataclass(frozen=True, slots=True)
class Comb:
    """The ticks of a dial, clockwise; `rim` is the ring that they are on, `miss_px` how well their lines meet."""

    rim: Rim
    ticks: tuple[Tick, ...]
    miss_px: float
    lines: int

    @property
    def ring_px(self) -> tuple[float, float]:
        """The inner and outer ends of most of its ticks."""
        inner, outer = (np.percentile([getattr(tick, end) for tick in self.ticks], part) for end, part in ENDS)
        return float(inner), float(outer)

    @property
    def shape(self) -> Floats:
        """(2, 2): how the dial is seen, without its size."""
        seen: Floats = jacobian(self.rim.drawn.plane.matrix, (0.0, 0.0))
        return seen / math.sqrt(np.linalg.det(seen))

    @property
    def is_all_round(self) -> bool:
        """Whether its ticks go all around, so that they determine their centre and how obliquely they are seen."""
        return _gap_deg(self.ticks) <= ALL_ROUND_DEG


def _gap_deg(ticks: Sequence[Tick]) -> float:
    angles = np.sort([tick.angle_deg for tick in ticks])
    return float(np.diff(angles, append=angles[0] + 360.0).max())


def flat_shape(combs: Sequence[Comb]) -> Floats | None:
    """(2, 2): how a panel's dials are seen, from those whose ticks go all around; None if there are none."""
    told = [comb.shape for comb in combs if comb.is_all_round and comb.rim.points]
    if not told:
        return None
    shape: Floats = np.median(told, axis=0)
    return shape


def shaped(centre: XY, shape: Floats) -> DrawnPlane:
    """Place a dial's plane at a centre."""
    return DrawnPlane(DialPlane.of(np.block([[shape, np.array(centre)[:, None]], [np.zeros((1, 2)), np.eye(1)]])))


def comb_about(picture: NDArray[np.uint8], planes: Planes, comb: Comb, drawn: DrawnPlane) -> Comb | None:
    """Measure a comb again on a plane of fixed shape, starting from its centre; None if it is not there.

    The ends of ticks that go only part of the way around do not determine centre and obliqueness together: either may
    be far off. Their lines give the centre, and the panel the obliqueness.
    """
    inner, outer = comb.ring_px
    ticks: list[Tick] = []
    start = drawn
    for _ in range(PASSES):
        ticks = _ticks(picture, drawn, inner, outer)
        if len(ticks) < max(LEAST_TICKS, HALF * len(comb.ticks)):
            return None
        drawn = drawn.moved(*_radiating(picture, drawn, ticks))
        if start.polar(drawn.centre)[1] > HALF * HALF * inner:
            return None
    ticks = _ticks(picture, drawn, inner, outer)
    if len(ticks) < max(LEAST_TICKS, HALF * len(comb.ticks)):
        return None
    miss_px = min(float(np.median(np.abs(ends - np.median(ends)))) for ends in _both_ends(ticks))
    return Comb(oblique_rim(planes, drawn, outer), tuple(ticks), miss_px, comb.lines)


def _radiating(picture: NDArray[np.uint8], drawn: DrawnPlane, ticks: Sequence[Tick]) -> XY:
    """Find where ticks radiate from, px from the pivot on the dial, using both halves of each."""
    design, off = [], []
    for tick in (each for each in ticks if each.length_px > 2 * LEAST_PX):
        length, turn = tick.length_px, math.radians(tick.angle_deg)
        inner_deg, outer_deg = (
            _angle_deg(picture, drawn, tick.angle_deg, start, start + length / 3)
            for start in (tick.inner_px + length / 10, tick.outer_px - length / 10 - length / 3)
        )
        middle_px = length * (1 / 10 + 1 / 6)
        lean = 1.0 / (tick.inner_px + middle_px) - 1.0 / (tick.outer_px - middle_px)
        design.append((-lean * math.sin(turn), lean * math.cos(turn)))
        off.append(math.radians(inner_deg - outer_deg))
    if len(off) < LEAST_TICKS:
        return 0.0, 0.0
    (x, y), _, _ = robust(np.array(design), np.array(off), Trust(1e-4, 3.0, power=2), held=1e-9 * np.eye(2))
    return float(x), float(y)


def _angle_deg(picture: NDArray[np.uint8], drawn: DrawnPlane, near_deg: float, from_px: float, to_px: float) -> float:
    """Measure the angle of a tick between two distances, by the middle of its light."""
    away_deg = np.arange(-BESIDE_DEG, BESIDE_DEG + ANGLE_STEP_DEG / 2, ANGLE_STEP_DEG)
    angles = np.radians(near_deg + away_deg)
    light = levels_on_rings(picture, drawn, angles, np.linspace(from_px, to_px, 5)).mean(axis=1)
    light = np.abs(light - np.median(light)) * (np.abs(away_deg) <= 2 * OFF_DEG)
    light[light < HALF * light.max()] = 0.0
    return math.degrees(float(np.average(angles, weights=light + 1e-9)))


def _both_ends(ticks: Sequence[Tick]) -> tuple[Floats, Floats]:
    inner, outer = (np.array([getattr(tick, end) for tick in ticks]) for end, _ in ENDS)
    return inner, outer


def comb_around(
    picture: NDArray[np.uint8], planes: Planes, strokes: Strokes, pivot: XY, numerals_px: float
) -> Comb | None:
    """Find the ticks around a pivot, near the ring of its numerals; None if there are too few.

    Parameters
    ----------
    picture : (H, W)
    numerals_px : how far its numerals are from the pivot
    """
    centre = pivot
    for _ in range(PASSES):
        own = _aiming(strokes, centre, numerals_px)
        if len(own) < LEAST_STROKES:
            return None
        ring = own.where(_ring(own, centre))
        x, y = meeting(ring.at, ring.along, ring.length_px, STROKES)
        centre = float(x), float(y)
    own = _aiming(strokes, centre, numerals_px)
    own = own.where(_ring(own, centre))
    if len(own) < LEAST_STROKES:
        return None
    inner, outer = (float(np.median(end)) for end in _ends(own, centre))
    return _comb(picture, planes, planes.drawn(centre), (inner, outer), len(own))


def combs_by(
    picture: NDArray[np.uint8], planes: Planes, pivot: XY, numerals_px: float, height_px: float
) -> Iterator[Comb]:
    """Find what may be the ticks of numerals, even ticks too short to aim at their pivot; `comb_on` measures them.

    Parameters
    ----------
    picture : (H, W)
    pivot : about the middle of the numerals
    numerals_px, height_px : how far they are from it, and how high
    """
    wide = SHORT_PART * numerals_px
    for low in np.arange(NEAREST * numerals_px, FURTHEST * numerals_px, HALF * wide):
        inner, outer, drawn = float(low), float(low) + wide, planes.drawn(pivot)
        if abs(inner + outer - 2 * numerals_px) < height_px:
            continue  # its marks would be the numerals themselves
        for _ in range(ROUNDS):
            ticks = _seen_on(picture, drawn, inner, outer)
            if len(ticks) < 2 * LEAST_TICKS:
                break
            rim = Rim(drawn.centre, outer, None, drawn)
            drawn, inner, outer, off_px = _centred(drawn, ticks)
        else:
            yield Comb(rim, tuple(ticks), off_px, 0)


def comb_on(picture: NDArray[np.uint8], planes: Planes, rough: Comb) -> Comb | None:
    """Measure a comb that `combs_by` found; None if its ticks are too few."""
    return _comb(picture, planes, rough.rim.drawn, rough.ring_px, rough.lines)


def as_circles_show(picture: NDArray[np.uint8], planes: Planes, comb: Comb) -> Comb | None:
    """Measure a comb again on the plane in which most of what shows around it are circles; None if it is not there.

    Ticks that go only part of the way around do not determine their plane, and do not lie on circles in any other.
    """
    centre = np.array(comb.rim.centre)
    squeeze = squeeze_shown(picture, planes.optics, centre, comb.rim.radius_px)
    drawn, (inner, outer) = shaped(comb.rim.centre, squeeze.matrix), comb.ring_px
    tried: list[Comb] = []
    for _ in range(PASSES):
        ticks = _ticks(picture, drawn, inner, outer)
        if len(ticks) < LEAST_TICKS:
            break
        moved_to, inner, outer, off_px = _centred(drawn, ticks)
        tried.append(Comb(oblique_rim(planes, drawn, outer), tuple(ticks), off_px, comb.lines))
        drawn = moved_to
    return min(tried, key=lambda each: each.miss_px, default=None)


def _comb(
    picture: NDArray[np.uint8], planes: Planes, drawn: DrawnPlane, ring_px: tuple[float, float], lines: int
) -> Comb | None:
    """Measure the ticks on about this ring, moved and bent until their ends lie on circles."""
    inner, outer = ring_px
    tried: list[tuple[float, Rim, list[Tick]]] = []
    for _ in range(ROUNDS):
        ticks = _ticks(picture, drawn, inner, outer)
        if len(ticks) < LEAST_TICKS:
            break
        moved_to, inner, outer, off_px = _centred(drawn, ticks)
        tried.append((off_px, Rim(drawn.centre, outer, None, drawn), ticks))
        drawn = moved_to
    for rim in (*_rims(picture, planes, drawn, inner, outer), *_bent(picture, planes, drawn, inner, outer)):
        ticks = _ticks(picture, rim.drawn, inner, outer)
        if len(ticks) >= LEAST_TICKS:
            tried.append((_centred(rim.drawn, ticks)[3], rim, ticks))
    if not tried:
        return None
    off_px, rim, ticks = min(tried, key=lambda each: each[0])
    return Comb(rim, tuple(ticks), off_px, lines)


def _aiming(strokes: Strokes, centre: XY, numerals_px: float) -> Strokes:
    far, miss = strokes.seen_from(centre)
    return strokes.where(
        (miss < MISS_PART * far + MISS_PX)
        & (far > NEAREST * numerals_px)
        & (far < FURTHEST * numerals_px)
        & (strokes.length_px < LONGEST_PART * far)
    )


def _ends(own: Strokes, centre: XY) -> tuple[Floats, Floats]:
    far = np.hypot(*(own.at - np.array(centre)).T)
    return far - own.length_px / 2, far + own.length_px / 2


def _ring(own: Strokes, centre: XY) -> NDArray[np.bool_]:
    """Select the strokes that cross the circle crossed by most, each direction once."""
    inner, outer = _ends(own, centre)
    sector = (np.degrees(np.arctan2(*(own.at - np.array(centre)).T[::-1])) % 360.0 // 3).astype(np.int64)
    radii = np.arange(inner.min(), outer.max() + 1.0, 1.0)
    crossed = (inner[:, None] <= radii) & (radii <= outer[:, None])
    counts = [len(set(sector[crossing])) for crossing in crossed.T]
    best = crossed[:, int(np.argmax(counts))]
    return np.asarray(best, np.bool_)


def _centred(drawn: DrawnPlane, ticks: Sequence[Tick]) -> tuple[DrawnPlane, float, float, float]:
    """Move a pivot to where the ticks' ends lie on circles; return its plane, both ends' distances there, and misfits.

    The misfit is that of the ends and a circle around the old pivot, due to its place and to its shape.
    """
    angles = np.radians([tick.angle_deg for tick in ticks])
    design = ring_design(angles, Freedom.CIRCLE)
    found = []
    inner, outer = _both_ends(ticks)
    # Long and short ticks share one end, or their middles.
    for ends in (inner, outer, (inner + outer) / 2):
        # A comb on one side determines radius and place only together, so neither may run off.
        step, off, weights = robust(design, ends, ENDS_OFF, held=np.diag([0.5, 0.5, 0.0]))
        shape = np.array(
            [
                np.average((design @ step - ends) * np.cos(2 * angles + turn), weights=weights)
                for turn in (0.0, np.pi / 2)
            ]
        )
        found.append(
            (float(np.average(off, weights=weights)), step, math.hypot(*step[:2]) + 2 * float(np.hypot(*shape)))
        )
    (_, inner, _), (_, outer, _), _ = found
    _, (right, down, _), off_px = min(found, key=lambda each: each[0])
    return drawn.moved(right, down), float(inner[2]), float(outer[2]), off_px


def _rims(
    picture: NDArray[np.uint8], planes: Planes, drawn: DrawnPlane, inner_px: float, outer_px: float
) -> Iterator[Rim]:
    """Fit the rings that the ticks begin and end on."""
    for radius_px in (outer_px, inner_px):
        clicks = [drawn.place(angle_deg, radius_px) for angle_deg in (20.0, 140.0, 260.0)]
        try:
            yield begun(picture, planes, clicks)
        except PictureError:
            continue


def _bent(
    picture: NDArray[np.uint8], planes: Planes, drawn: DrawnPlane, inner_px: float, outer_px: float
) -> Iterator[Rim]:
    """Deform the dial's plane until the ends of ticks that go all around lie on circles."""
    if planes.inches is not None:
        return
    ring = Ring(drawn, outer_px)
    for _ in range(ROUNDS):
        ticks = _ticks(picture, ring.drawn, inner_px, outer_px)
        if len(ticks) < 2 * LEAST_TICKS or _gap_deg(ticks) > ALL_ROUND_DEG:
            return
        inner, outer = _both_ends(ticks)
        around = np.radians([tick.angle_deg for tick in ticks])
        design = ring_design(around, Freedom.ELLIPSE)
        found = [robust(design, each, ENDS_OFF) for each in (inner, outer, (inner + outer) / 2)]
        step, _, _ = min(found, key=lambda each: float(np.average(each[1], weights=each[2])))
        level = float(step[2])
        bent = Ring(ring.drawn, level).stepped(step - np.array([0.0, 0.0, level, 0.0, 0.0]))
        inner_px, outer_px = (float(each[0][2]) for each in found[:2])
        ring = Ring(bent.drawn, outer_px)
    if ring.flatness < MAX_FLATNESS:
        yield oblique_rim(planes, ring.drawn, outer_px)


def _ticks(picture: NDArray[np.uint8], drawn: DrawnPlane, low: float, high: float) -> list[Tick]:
    """Measure every mark on the ring between two distances."""
    middle = (low + high) / 2
    found = [
        replace(tick, angle_deg=mark_angle_deg(picture, drawn, drawn.place(tick.angle_deg, middle)))
        for tick in _seen_on(picture, drawn, low, high)
    ]
    return _apart(sorted(found, key=lambda each: each.angle_deg))


def _seen_on(picture: NDArray[np.uint8], drawn: DrawnPlane, low: float, high: float) -> list[Tick]:
    """Find every mark on the ring between two distances, to `ANGLE_STEP_DEG`."""
    long = 1.2 * (high - low) + 2.0
    middle = (low + high) / 2
    radii = np.arange(middle - long, middle + long, RADIUS_STEP_PX)
    angles = np.radians(np.arange(0.0, 360.0, ANGLE_STEP_DEG))
    light = levels_on_rings(picture, drawn, angles, radii)
    beside = round(BESIDE_DEG / ANGLE_STEP_DEG)
    around = np.concatenate([light[-beside:], light, light[:beside]])
    # A face changes slowly, so every fourth angle suffices.
    windows = np.lib.stride_tricks.sliding_window_view(around, 2 * beside + 1, axis=0)[::PLAIN_STEP]
    plain = np.repeat(np.median(windows, axis=-1), PLAIN_STEP, axis=0)[: len(light)]
    contrast = light - plain
    band = (radii >= low) & (radii <= high)
    profile = contrast[:, band].mean(axis=1)
    sign = 1.0 if np.percentile(profile, 97) > -np.percentile(profile, 3) else -1.0
    signed = sign * profile
    ahead = np.concatenate([signed[-4:], signed, signed[:4]])
    top = signed >= np.lib.stride_tricks.sliding_window_view(ahead, 9).max(axis=-1)
    high_enough = max(2 * NOISE_LEVELS, HALF * HALF * float(np.percentile(signed[top], 75)))
    found = []
    for row in np.flatnonzero(top & (signed > high_enough)):
        along = sign * contrast[row]
        half = HALF * float(along[band].mean())
        at = int(np.flatnonzero(band)[along[band].argmax()])
        below = np.flatnonzero(along < half)
        start = below[below < at].max(initial=-1) + 1
        end = below[below > at].min(initial=len(radii)) - 1
        found.append(Tick(float(np.degrees(angles[row])), float(radii[start]), float(radii[end]), float(signed[row])))
    return found


def _apart(ticks: Sequence[Tick]) -> list[Tick]:
    kept: list[Tick] = []
    for tick in ticks:
        if kept and tick.angle_deg - kept[-1].angle_deg < LEAST_APART_DEG:
            if tick.contrast > kept[-1].contrast:
                kept[-1] = tick
        else:
            kept.append(tick)
    return kept
