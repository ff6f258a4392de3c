"""Needles proposed: what moves between frames on a dial, and where it is in the panel picture.

A needle's two halves are often lit differently, so the middle of its light is not its axis: on the rendered flights it
is 0.3 degrees off. Its outline is symmetric, though. Each column is modelled as a left half of one tone and a right
half of another, equally wide, blurred by the lens; the needle's axis is the one that explains all columns best. On
those flights it is right to 0.03 degrees.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from decoder.imaging.alignment import IDENTITY, Alignment
from decoder.imaging.pictures import GreyPicture
from decoder.imaging.planes import DialPlane, Raised
from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import PolarGrid, Unwrapper, polar_grid
from decoder.matching.faces import in_light_of
from decoder.matching.thresholds import OUTLIER_SPREADS
from decoder.panel.arrays import Floats
from decoder.panel.scale import FULL_CIRCLE_DEG
from decoder.panel.thresholds import BEYOND_SWEEP_DEG
from decoder.registration.thresholds import NOISE_LEVELS
from decoder.setup.thresholds import MIN_PART

REACH_DEG = 7.0
# A needle that somebody points at may lie beyond the sweep as drawn so far.
AROUND_DEG = 60.0
AXIS_STEP_DEG = 0.1
AXIS_REACH_DEG = 1.2
BLURS_PX = (0.5, 0.65, 0.8, 0.95, 1.2)
HALF_WIDTHS_PX = np.concatenate([np.arange(0.4, 4.0, 0.2), np.arange(4.0, 16.0, 0.8)])
OWN_NOISE_LEVELS = 2.0
# How often a guess at the end of the range is moved on.
ROUNDS = 3
# The number of columns used of a large dial, since they are processed one by one.
MOST_COLUMNS = 20


_TABLE_REACH, _TABLE_STEPS = 6.0, 12000
_TABLE = np.array(
    [0.5 * (1 + math.erf(x / math.sqrt(2))) for x in np.linspace(-_TABLE_REACH, _TABLE_REACH, _TABLE_STEPS + 1)],
    np.float32,
)

MOST = 3
CHANGED_PERCENTILE = 75
SPAN_WIDTHS = 2.5
SPAN_RANGE_DEG = (8.0, 40.0)
ROUGH_DEG = 2.0
# Anything nearer to the centre is a hub, as a part of the dial's outer radius.
HUB_PART = 0.12
# How far a card may reach beyond the ring of its marks, to include its numerals.
BEYOND_RING = 1.5
# Between marks and numerals there are blank columns.
GAP_COLUMNS = 5


def axis_deg(light: Floats, grid: PolarGrid, guess_deg: float) -> float:
    """Measure the angle of a needle's axis.

    Parameters
    ----------
    light
        (R, C): what the needle adds to the dial's face, on `grid`; bright or dark.
    guess_deg
        An angle on the needle, to about a degree.
    """
    light, radii = light[:, grid.tail_columns :], grid.radii_px[grid.tail_columns :]
    for _ in range(ROUNDS):
        middle = round((guess_deg - grid.start_deg) / grid.step_deg)
        reach = round(REACH_DEG / grid.step_deg)
        rows = np.arange(max(middle - reach, 0), min(middle + reach + 1, len(light)))
        used = np.flatnonzero(np.abs(light[rows]).max(axis=0) >= 2 * NOISE_LEVELS) if rows.size else rows
        if not used.size:
            return guess_deg
        used = used[np.unique(np.linspace(0, used.size - 1, MOST_COLUMNS).round().astype(int))]
        seen = _Seen(light[rows][:, used], grid.start_deg + rows * grid.step_deg, radii[used])
        place, found = _lowest(seen, guess_deg)
        if found:
            return place
        guess_deg = place
    return guess_deg


@dataclass(frozen=True, slots=True)
class _Seen:
    """The light of some columns, (R, C), at angles (R,) and radii (C,)."""

    light: Floats
    angles_deg: Floats
    radii_px: Floats


def _lowest(seen: _Seen, guess_deg: float) -> tuple[float, bool]:
    """Find the place that explains the columns best, and whether it lies within the range searched."""
    places = np.arange(-AXIS_REACH_DEG, AXIS_REACH_DEG + AXIS_STEP_DEG / 2, AXIS_STEP_DEG) + guess_deg
    left = [_unexplained(seen, places, blur) for blur in BLURS_PX]  # (C, places, widths) each
    curves = [np.log(each.min(axis=2)) for each in left]
    sharpest = min(range(len(curves)), key=lambda index: float(curves[index].sum(axis=0).min()))
    best = int(curves[sharpest].sum(axis=0).argmin())
    plain = _tapering(HALF_WIDTHS_PX[left[sharpest][:, best].argmin(axis=1)], seen.radii_px)
    curve = curves[sharpest][plain].sum(axis=0)
    best = int(curve.argmin())
    if not 0 < best < len(curve) - 1:
        return float(places[best]), False
    before, at, after = (float(value) for value in curve[best - 1 : best + 2])
    bend = before - 2 * at + after
    part = 0.5 * (before - after) / bend if bend > 0 else 0.0
    return float(places[best]) + part * AXIS_STEP_DEG, True


def _tapering(half_widths_px: Floats, radii_px: Floats) -> NDArray[np.bool_]:
    """(C,): the columns in which the needle is about as wide as in the neighbouring ones.

    Where it runs into a numeral or a mark it looks wider, and lopsided. The line is a Theil-Sen fit.
    """
    one, other = np.triu_indices(len(radii_px), 1)
    slope = np.median([0.0, *(half_widths_px[other] - half_widths_px[one]) / (radii_px[other] - radii_px[one])])
    off = half_widths_px - slope * radii_px
    off = np.abs(off - np.median(off))
    plain: NDArray[np.bool_] = off <= OUTLIER_SPREADS * (float(np.median(off)) + 0.1)
    return plain


def _unexplained(seen: _Seen, places: Floats, blur_px: float) -> Floats:
    """(C, places, widths): the residual of two tones to either side of each place, for each column and width.

    Each column has its own noise: one that shows something besides the needle has little weight.
    """
    left = np.empty((len(seen.radii_px), len(places), len(HALF_WIDTHS_PX)))
    halves = HALF_WIDTHS_PX[None, :, None] / blur_px
    for number, radius_px in enumerate(seen.radii_px):
        light = seen.light[:, number].astype(np.float64)
        off = (seen.angles_deg[None, :] - places[:, None]) * math.radians(1.0) * radius_px / blur_px
        middle = _step(off)[:, None, :]
        one = _step(off[:, None, :] + halves) - middle
        other = middle - _step(off[:, None, :] - halves)
        aa, bb, ab = (one * one).sum(-1), (other * other).sum(-1), (one * other).sum(-1)
        ay, by = one @ light, other @ light
        explained = (bb * ay * ay - 2 * ab * ay * by + aa * by * by) / np.maximum(aa * bb - ab * ab, 1e-9)
        left[number] = np.maximum(float(light @ light) - explained, 0.0) + OWN_NOISE_LEVELS**2 * len(light)
    return left


def _step(x: Floats) -> Floats:
    """Look up a blurred step from 0 to 1 in a table, as erf itself would take seconds."""
    place = np.rint((x + _TABLE_REACH) * (_TABLE_STEPS / (2 * _TABLE_REACH)))
    steps: Floats = _TABLE.take(place.astype(np.intp), mode="clip")
    return steps


@dataclass(frozen=True, slots=True)
class Proposal:
    """A needle: its angle in the panel picture, and how many degrees its template should span.

    `reach_px` is the distance of its tip from the centre.
    """

    at_deg: float
    span_deg: float
    reach_px: float


@dataclass(frozen=True, slots=True)
class Dial:
    """What is known of a gauge before it has needles; `raised` is the plane in which they turn, if above its face."""

    centre: tuple[float, float]
    radius_px: tuple[float, float]
    sweep_deg: tuple[float, float]
    plane: DialPlane | None = None
    raised: Raised | None = None

    @property
    def from_hub(self) -> Dial:
        """The same dial from its middle outwards, where short hands are."""
        return replace(self, radius_px=(HUB_PART * self.radius_px[1], self.radius_px[1]))

    def grid(self, margin_deg: float = 2 * BEYOND_SWEEP_DEG) -> PolarGrid:
        """Lay a polar grid over the dial, with a margin at both ends."""
        first, last = self.sweep_deg
        margin_deg = min(margin_deg, (FULL_CIRCLE_DEG - (last - first)) / 2)
        grid = polar_grid(self.centre, self.radius_px, first - margin_deg, last + margin_deg, plane=self.plane)
        return replace(grid, raised=self.raised)


@dataclass(frozen=True, slots=True)
class Pictures:
    """The panel picture, and frames of the flight, each with the panel's alignment.

    `own` is the alignment in the panel picture itself: the identity except for the lens.
    """

    picture: GreyPicture
    frames: Sequence[tuple[GreyPicture, Alignment]]
    own: Alignment = IDENTITY


def proposed(seen: Pictures, dial: Dial) -> list[Proposal]:
    """Propose needles on a dial, the clearest first, from pictures in which they may move; none if nothing did."""
    views = _views(seen, dial)
    if not len(views.others):
        return []
    whole = _views(seen, dial.from_hub)
    # Light that other frames do not show in that place, and that differs from a plain dial in the panel picture.
    changes = np.percentile(np.abs(views.others - views.own), CHANGED_PERCENTILE, axis=0)
    here = np.minimum(changes, np.abs(views.own - np.median(views.own, axis=0)))
    profile = _smooth(here.mean(axis=1), round(ROUGH_DEG / views.grid.step_deg))
    found: list[Proposal] = []
    highest = float(profile.max())
    for _ in range(MOST):
        row = int(profile.argmax())
        if profile[row] < max(2 * NOISE_LEVELS, MIN_PART * highest):
            break
        guess_deg = views.grid.angle_deg(row)
        light = views.light(guess_deg)
        found.append(_proposal(light, views.grid, guess_deg, whole))
        reach = round((_width_deg(light, views.grid, guess_deg) + ROUGH_DEG) / views.grid.step_deg)
        profile[max(row - reach, 0) : row + reach + 1] = 0.0
    first, last = dial.sweep_deg
    reach_deg = 2 * BEYOND_SWEEP_DEG  # the precision of sweeps drawn by hand
    return [each for each in found if first - reach_deg <= each.at_deg <= last + reach_deg]


def turning_px(seen: Pictures, dial: Dial) -> tuple[float, float] | None:
    """Find between which radii the whole dial turns, around the ring that is drawn; None if nothing does.

    What turns looks the same in every frame when turned back with the ring; what stands still or shifts does not.
    """
    outer = dial.radius_px[1]
    all_round = replace(dial, radius_px=(HUB_PART * outer, BEYOND_RING * outer), sweep_deg=(0.0, FULL_CIRCLE_DEG))
    views = _views(seen, all_round)
    if not len(views.others):
        return None
    rows = round(FULL_CIRCLE_DEG / views.grid.step_deg)
    own, others = (each - each.mean(axis=-2, keepdims=True) for each in (views.own[:rows], views.others[:, :rows]))
    size = np.linalg.norm(own, axis=0) * np.linalg.norm(others, axis=1) + NOISE_LEVELS**2 * rows
    alike = np.fft.irfft(np.conj(np.fft.rfft(own, axis=0)) * np.fft.rfft(others, axis=1), n=rows, axis=1)
    alike /= size[:, None]  # (N, rows by which it is turned, C)
    radii = views.grid.radii_px
    ring = int(np.abs(radii - (1 - HUB_PART) * outer).argmin())
    moves = np.median(alike[:, 0], axis=0) < HALF
    if not moves.any():
        return None
    turned = alike[:, :, moves].mean(axis=2).argmax(axis=1)
    far = np.argsort(np.minimum(turned, rows - turned))[len(turned) // 2 :]  # those that turned most tell best
    about = (turned[far, None] + np.arange(-2, 3)) % rows
    with_ring = np.median(alike[far[:, None], about].max(axis=1), axis=0)
    places = np.flatnonzero((with_ring > HALF) & moves)
    if not places.size:
        return None
    joined = np.flatnonzero(np.convolve(np.isin(np.arange(len(radii)), places), np.ones(GAP_COLUMNS), "same"))
    parts = np.split(joined, np.flatnonzero(np.diff(joined) > 1) + 1)
    here = np.intersect1d(min(parts, key=lambda part: int(np.abs(part - ring).min())), places)
    return float(radii[here[0]]), float(radii[here[-1]])


def needle_at(seen: Pictures, dial: Dial, guess_deg: float) -> Proposal:
    """Measure the needle that somebody pointed at, to some hundredths of a degree; it need not move."""
    views = _views(seen, dial)
    return _proposal(views.light(guess_deg), views.grid, guess_deg, _views(seen, dial.from_hub))


@dataclass(frozen=True, slots=True)
class _Views:
    """A dial in the panel picture, (R, C), and in other frames, (N, R, C), all on one grid."""

    grid: PolarGrid
    own: Floats
    others: Floats

    def light(self, guess_deg: float) -> Floats:
        """(R, C): what the needle near an angle adds to the dial.

        The dial is taken from frames in which that needle is elsewhere; if there are none, it is the median at each
        radius.
        """
        plain: Floats = self.own - np.median(self.own, axis=0)
        row = round((guess_deg - self.grid.start_deg) / self.grid.step_deg)
        reach = round(REACH_DEG / self.grid.step_deg)
        window = slice(max(row - reach, 0), row + reach + 1)
        if not len(self.others):
            return plain
        changes = np.abs(self.others[:, window] - self.own[window]).mean(axis=(1, 2))
        away = changes > HALF * max(changes.max(), np.abs(plain[window]).mean())
        light: Floats = self.own - np.median(self.others[away], axis=0) if away.any() else plain
        return light


def _views(seen: Pictures, dial: Dial) -> _Views:
    grid = dial.grid()
    unwrapper = Unwrapper([grid])
    own = unwrapper.unwrap(seen.picture, seen.own)[0]
    frames = [unwrapper.unwrap(frame, alignment)[0] for frame, alignment in seen.frames]
    # Print that is brighter or dimmer in another frame's light has not moved.
    others = [lit for lit in in_light_of(own, frames) if lit is not None]
    return _Views(grid, own, np.stack(others) if others else np.zeros((0, *own.shape), np.float32))


def _proposal(light: Floats, grid: PolarGrid, guess_deg: float, whole: _Views) -> Proposal:
    low, high = SPAN_RANGE_DEG
    _, span_deg, _ = sorted((low, SPAN_WIDTHS * _width_deg(light, grid, guess_deg), high))
    at_deg = axis_deg(light, grid, guess_deg)
    return Proposal(at_deg, round(span_deg), _reach_px(whole, at_deg))


def _reach_px(whole: _Views, at_deg: float) -> float:
    """Find where a needle ends: beyond its tip there is less than half of its light."""
    grid = whole.grid
    row, reach = round((at_deg - grid.start_deg) / grid.step_deg), round(AXIS_REACH_DEG / grid.step_deg)
    along = np.abs(whole.light(at_deg)[max(row - reach, 0) : row + reach + 1]).mean(axis=0)
    mostly = np.percentile(along, CHANGED_PERCENTILE)
    bright = np.flatnonzero(along > HALF * mostly)
    longest = max(np.split(bright, np.flatnonzero(np.diff(bright) > 1) + 1), key=len)
    return float(grid.radii_px[longest[-1]])


def _smooth(profile: Floats, rows: int) -> Floats:
    smooth: Floats = np.convolve(profile, np.ones(rows) / rows, mode="same")
    return smooth


def _width_deg(light: Floats, grid: PolarGrid, at_deg: float) -> float:
    """Return the width of the needle in the inner half of the ring, at half its contrast."""
    row = round((at_deg - grid.start_deg) / grid.step_deg)
    reach = round(SPAN_RANGE_DEG[1] / 2 / grid.step_deg)
    inner = np.abs(light[max(row - reach, 0) : row + reach + 1, : max(grid.columns // 2, 1)]).mean(axis=1)
    return float((inner > inner.max() / 2).sum()) * grid.step_deg
