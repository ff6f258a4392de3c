"""The search for the pivots of needles and cards whose centres are drawn off by up to a tenth of the dial's radius.

Tilts give a pivot to hundredths of a pixel (`decoder.learning.pivots`), but only if the needles are found. Around a
centre that is drawn too far off they are not, because a needle that has turned lies askew. This search tries many
centres, without knowing what the needles look like. Around the right one, the ridges of everything that moves lie along
radii, however many needles there are and wherever they point. Around a card's pivot, all frames show the same card,
only turned.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Self

import cv2
import numpy as np

from decoder.imaging.planes import Squeeze
from decoder.imaging.sorting import MAD_TO_SIGMA, median, median_of
from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import PolarGrid, UnwrappedGauge, row_of_angle
from decoder.matching.correlation import noise_between, turned_correlation
from decoder.matching.needle_template import odd_rows
from decoder.matching.thresholds import FAR_GAIN, FAR_PART, MIN_VIEWS, MOSTLY, REACH_PART
from decoder.panel.arrays import Floats, Mask, limited
from decoder.panel.scale import FULL_CIRCLE_DEG
from decoder.registration.thresholds import NOISE_LEVELS

Vector = tuple[float, float]
Score = Callable[[Floats], Floats]
"""How well pivots at offsets (N, 2) px, or views (N, 4), explain all frames: (N,) in [0, 1]."""

# At this resolution a needle that is askew by a fiftieth of the radius still shows.
ROW_DEG, COLUMNS = 1.0, 16
CARD_COLUMNS = 32
# Ridges are half as far apart as this, since hardly any needle is as wide.
WIDEST_DEG = 12.0
# Parts of an axis are one axis if they are hardly further apart than their rows.
GAP_ROWS = 2
# Axes of many frames in one such sector tell about the same.
SECTOR_DEG = 10.0
# Fits of a line to a ridge; pixels beside it count less each time.
LINE_FITS = 4
MOST_FRAMES, MOST_CARD_FRAMES = 16, 8
# The steps of the search, and those around the best, as parts of the radius; tilts give the rest.
STEP_PART, LAST_STEP_PART = 0.02, 0.01
ROUND = Squeeze(0.0, 0.0)
# A view's offset and squeeze are searched for in steps of `STEP_PART`, so many times halved.
HALVINGS = 5
# Views that are the same in so many digits are one: steps that lead to it add up differently.
ROUNDED = 9
Axes = frozenset[int]
SQUEEZE_AXES: Axes = frozenset({2, 3})
ALL_AXES: Axes = frozenset({0, 1}) | SQUEEZE_AXES
# Fewer marks, or waves, all round a dial hardly show where it is squeezed; marks lie in a fraction of the radii.
FEWEST_MARKS, BANDS = 12, 4
# So many views are sampled at once: OpenCV fills less than 32,767 rows, and the processor's cache holds less still.
AT_ONCE = 32
# A needle of the panel picture is searched for up to this far from where it is drawn.
BESIDE_DEG = 10.0
# The frames that show a needle elsewhere, and so what lies behind it: the most different third of them.
ELSEWHERE = 3


def needle_pivot(grid: PolarGrid, strips: Sequence[UnwrappedGauge]) -> Vector | None:
    """Search for the pivot of a gauge's needles, where the straight ridges of what moves in frames (R, C) cross.

    A needle that hardly turns does not determine the pivot's position along the needle; that is then kept as drawn.

    Returns
    -------
    (x, y) from the centre, pixels in the dial's own plane; None if frames show none that is far from it.
    """
    radius_px = float(grid.radii_px[-1])
    lines = _AxisLines.of(_axes_seen(grid, strips), radius_px)
    if lines.sectors < MIN_VIEWS:
        return None
    found = _best(lines.share_through, radius_px, REACH_PART * radius_px, near_part=0.0, most_left=MOSTLY)
    if found is None:
        return None
    told = lines.told(np.array(found))
    left, drawn = (1.0 - lines.share_through(np.stack([told, np.zeros(2)]))).tolist()
    # Lines of a small dial are no surer than to a pixel; what is nearer is left to tilts there, too.
    if left > MOSTLY * drawn or math.hypot(*told) < max(FAR_PART * radius_px, 1.0):
        return None
    return float(told[0]), float(told[1])


def _axes_seen(grid: PolarGrid, strips: Sequence[UnwrappedGauge]) -> list[Floats]:
    """(N, 2) for each ridge of what moves in some frames: its pixels, in the dial's own plane.

    A needle's ridge is its axis, however wide the needle is and however it tapers. A ridge has to fall off on both
    sides, or it is the edge of something wide. If a needle moves by less than its width in most frames, only a part of
    it shows: ridges near pixels that have also differed with the opposite sign are left out.
    """
    if not strips:
        return []
    seen = np.stack(_spread(strips, MOST_FRAMES))
    fine = math.ceil(ROW_DEG / grid.step_deg), math.ceil(seen.shape[2] / COLUMNS)
    moving = np.stack([np.asarray(cv2.blur(each, fine[::-1]), np.float32) for each in seen - median_of(seen)])
    reach = 2 * round(WIDEST_DEG / 2 / grid.step_deg) + 1
    near, around = np.ones((reach, 1), np.uint8), np.ones((2 * reach - 1, 1), np.uint8)
    brightest, darkest = (cv2.dilate(np.maximum(each, 0.0), around) for each in (moving.max(0), -moving.min(0)))
    least = max(HALF * HALF * float(np.median(np.abs(moving).max(axis=(1, 2)))), 3 * NOISE_LEVELS)
    axes = []
    for each in moving:
        height = np.abs(cv2.GaussianBlur(each, (1, reach), sigmaX=1.0, sigmaY=ROW_DEG / grid.step_deg))
        opposite = np.where(each > 0.0, darkest, brightest)
        beside = np.maximum(*(cv2.erode(height, near, anchor=(0, end)) for end in (0, reach - 1)))
        is_ridge = (height >= cv2.dilate(height, near)) & (height > least) & (opposite < HALF * height)
        is_ridge &= beside < HALF * height
        axes += [axis for is_of in (each > 0.0, each < 0.0) for axis in _connected(grid, is_ridge & is_of)]
    return axes


def _connected(grid: PolarGrid, is_ridge: Mask) -> Iterator[Floats]:
    """(N, 2) for each part of ridges (R, C) that is connected, but for gaps of a few degrees: its pixels."""
    thin = is_ridge.astype(np.uint8)
    gap = 2 * math.ceil(GAP_ROWS * ROW_DEG / grid.step_deg) + 1
    count, parts = cv2.connectedComponents(cv2.dilate(thin, np.ones((gap, 3), np.uint8)))
    rows, columns = np.nonzero(thin)
    labels = parts[rows, columns]
    angles = np.radians(grid.start_deg + grid.step_deg * rows)
    radii_px = grid.radii_px[columns]
    places_px = np.stack([radii_px * np.cos(angles), radii_px * np.sin(angles)], axis=1)
    for label in range(1, count):
        yield places_px[labels == label]


@dataclass(frozen=True, slots=True)
class _AxisLines:
    """Straight lines along which frames show needles' axes."""

    places_px: Floats
    """(N, 2): the middle of each, from the centre."""
    along: Floats
    """(N, 2): unit vectors."""
    lengths_px: Floats
    scatter_px: Floats
    """(N,): how far a middle is known to be on its line, from the scatter of the ridge about it."""
    weights: Floats
    """(N,), of sum 1: the length, of many at about the same place as the root of their number."""
    sectors: int
    """In how many places they lie. In one they may all be the flank of something that hardly moves."""
    radius_px: float

    @classmethod
    def of(cls, axes: Sequence[Floats], radius_px: float) -> Self:
        """Fit a line to each axis that is long enough, whatever else its ridge runs into."""
        fitted = [line for line in map(_fitted_line, axes) if line[4] > REACH_PART * radius_px]
        places_x, places_y, along_x, along_y, lengths_px, scatter_px = np.array(fitted).reshape(-1, 6).T
        sectors = np.floor(np.degrees(np.arctan2(places_y, places_x)) / SECTOR_DEG)
        weights = np.sqrt([1.0 / lengths_px[sectors == sector].sum() for sector in sectors]) * lengths_px
        return cls(
            np.stack([places_x, places_y], axis=1),
            np.stack([along_x, along_y], axis=1),
            lengths_px,
            scatter_px,
            weights / max(weights.sum(), np.finfo(float).tiny),
            len(np.unique(sectors)),
            radius_px,
        )

    def share_through(self, offsets_px: Floats) -> Floats:
        """(M,): the share of lines that pass through points (M, 2)."""
        share: Floats = self._passing(offsets_px) @ self.weights
        return share

    def told(self, offset_px: Floats) -> Floats:
        """(2,): the part of an offset that lines through it determine: of parallel lines, only the part across them."""
        passing = self.weights * self._passing(offset_px[None])[0]
        across = np.stack([-self.along[:, 1], self.along[:, 0]])
        (least, _), axes = np.linalg.eigh((across * passing) @ across.T / max(passing.sum(), np.finfo(float).tiny))
        ahead, aside = axes.T @ offset_px
        if FAR_PART * self.radius_px > abs(ahead) * math.sqrt(self.sectors * max(least, 0.0)):
            ahead = 0.0
        told: Floats = axes @ [ahead, aside]
        return told

    def _passing(self, offsets_px: Floats) -> Floats:
        """(M, N): 1 where a line passes through a point; less the further beside it, relative to its uncertainty."""
        away = offsets_px[:, None] - self.places_px
        beside_px = away[..., 0] * self.along[:, 1] - away[..., 1] * self.along[:, 0]
        askew = np.hypot(away[..., 0], away[..., 1]) / self.lengths_px
        known_px = np.hypot(FAR_PART * self.radius_px, self.scatter_px * np.sqrt(1.0 + 12.0 * askew**2))
        passing: Floats = np.exp(-0.5 * np.square(beside_px / known_px))
        return passing


def _fitted_line(axis_px: Floats) -> tuple[float, ...]:
    """Fit a line to pixels (N, 2) of a ridge: its middle x, y, its direction x, y, its length and its scatter."""
    weights = np.ones(len(axis_px))
    for _ in range(LINE_FITS):
        middle = weights @ axis_px / weights.sum()
        about = axis_px - middle
        _, axes = np.linalg.eigh((about.T * weights) @ about)
        off = about @ axes[:, 0]
        spread = max(MAD_TO_SIGMA * float(median(np.abs(off))), 0.2)  # as rows are whole
        weights = 1.0 / (1.0 + (off / (2.0 * spread)) ** 2)
    return (*middle, *axes[:, 1], np.ptp(about @ axes[:, 1]), spread / math.sqrt(max(len(axis_px) / 3, 1.0)))


def drawn_needles_deg(
    grid: PolarGrid, cuts: Sequence[tuple[float, float]], own: UnwrappedGauge, strips: Sequence[UnwrappedGauge]
) -> list[float | None]:
    """Find the angle at which the panel picture shows each needle, near where it is cut; None if it stays there.

    Parameters
    ----------
    cuts
        For each needle, its angle in the panel picture, and how many degrees are cut around it.
    own, strips
        (R, C) each: the gauge in the panel picture, and in frames brought into its light, unwrapped around its pivot.
    """
    if not strips:
        return [None] * len(cuts)
    dial = _CoarseDial.of(grid, own, strips)
    axes = [_axis_of(dial, at_deg, odd_rows(span_deg, dial.step_deg)) for at_deg, span_deg in cuts]
    return [None if axis is None else dial.angle_deg(axis) for axis in axes]


def card_pivot(grid: PolarGrid, strips: Sequence[UnwrappedGauge]) -> Vector | None:
    """Search for a card's pivot, as `needle_pivot`: around it, frames show the same card, only turned."""
    strips = _most_different(strips)
    if len(strips) <= 1:
        return None
    radius_px = float(grid.radii_px[-1])
    reach_px = min(REACH_PART * radius_px, _most_margin_px(grid))
    rings = _Rings.of(grid, strips, reach_px)

    def score(offsets_px: Floats) -> Floats:
        return np.array([_alike(rings.around(offset_px)) for offset_px in offsets_px])

    # A card around a centre that is off by less than for needles is not read either, and then no tilt helps.
    start = _best(score, radius_px, reach_px, near_part=LAST_STEP_PART)
    if start is None:
        return None
    found = _finest(score, np.array(start), LAST_STEP_PART * radius_px / 2)
    # Near its edges a card may show what decides.
    drawn, there = (1.0 - _alike(card_rings(grid, strips, each)) for each in ((0.0, 0.0), found))
    if there >= FAR_GAIN * drawn:
        return None
    # On an ellipse a card may match itself better far off its pivot than around it, until it is squared up.
    search = _ViewSearch(rings, radius_px, reach_px / radius_px)
    there_only = np.array([*found, 0.0, 0.0]) / radius_px
    squared_up, view = search.best(ALL_AXES, there_only)
    is_nearer = math.hypot(*view[:2]) < math.hypot(*(view - there_only)[:2])
    explains_more = 1.0 - squared_up < FAR_GAIN * (1.0 - float(search.score(there_only[None])[0]))
    return None if is_nearer and explains_more else found


def _most_margin_px(grid: PolarGrid) -> float:
    """Return the most to leave out at either edge of a card: what is left has to be visible wherever it is tried."""
    return float(grid.radii_px[-1] - grid.inner_px) / 3


def card_rings(grid: PolarGrid, strips: Sequence[UnwrappedGauge], offset_px: Vector) -> Floats:
    """(F, P, N): all of a card that frames (R, C) show around another centre, a row in `ROW_DEG`."""
    return _Rings.of(grid, strips, 0.0).around(np.array(offset_px))


def card_squeeze(
    grid: PolarGrid,
    strips: Sequence[UnwrappedGauge],
    *,
    most_left: float = FAR_GAIN,
    axes: Axes = ALL_AXES,
) -> Squeeze | None:
    """Search for the squeeze of a card that is seen obliquely: with it removed, all frames show the card only turned.

    Marks that turn within an ellipse come closer together and draw apart, so regular marks soon fall out of step. They
    do the same around a centre that is not their pivot, so the pivot is searched for at the same time, unless `axes`
    contains those of squeezes only. None if the card is seen square on, nothing turns, or more than `most_left` remains
    of what the best pivot alone leaves unexplained.
    """
    strips = _most_different(strips)
    if len(strips) <= 1:
        return None
    search = _ViewSearch.of(grid, strips)
    square_on, round_view = search.climb(np.zeros((1, 4)), axes - SQUEEZE_AXES)
    highest, view = search.best(axes, round_view)
    return Squeeze(*view[2:].tolist()) if 1.0 - highest < most_left * (1.0 - square_on) else None


@dataclass(frozen=True, slots=True)
class _ViewSearch:
    """A search for the view of a card in which frames show it only turned: `rings` are theirs within `reach`.

    Its climbs meet again and again, so what is `known` of a view is not computed again.
    """

    rings: _Rings
    radius_px: float
    reach: float
    known: dict[tuple[float, ...], float] = field(default_factory=dict)

    @classmethod
    def of(cls, grid: PolarGrid, strips: Sequence[UnwrappedGauge]) -> Self:
        """Begin around the drawn centre, square on."""
        radius_px = float(grid.radii_px[-1])
        reach = min(REACH_PART, _most_margin_px(grid) / radius_px)  # at most as seen from 35 degrees aside
        return cls(_Rings.of(grid, strips, reach * radius_px), radius_px, reach)

    def score(self, views: Floats) -> Floats:
        """(N,): how well frames match in each of N views."""
        return np.array([self._score(*view) for view in views.round(ROUNDED).tolist()])

    def _score(self, x: float, y: float, *squeeze: float) -> float:
        view = x, y, *squeeze
        if view not in self.known:
            around = self.rings.around((self.radius_px * x, self.radius_px * y), Squeeze(*squeeze))
            self.known[view] = _alike(around)
        return self.known[view]

    def climb(self, starts: Floats, axes: Axes) -> tuple[float, Floats]:
        """Climb from views (N, 4) to the best one; return how well frames match in it, and the view."""
        heights, views = climbed(self.score, starts, axes, self.reach)
        return float(heights.max()), views[heights.argmax()]

    def best(self, axes: Axes, square_on: Floats) -> tuple[float, Floats]:
        """Climb to the best view, also from the best without a squeeze."""
        squeezes = np.pad(_disc(self.reach, STEP_PART), ((0, 0), (2, 0)))
        return self.climb(np.stack([np.zeros(4), square_on, squeezes[self.score(squeezes).argmax()]]), axes)


def even_marks_squeeze(grid: PolarGrid, drawn: UnwrappedGauge) -> Squeeze | None:
    """Search for the squeeze of a dial that is seen obliquely, in one picture (R, C) of the marks around it.

    Marks all round a dial are even, so seen obliquely they stand closer together at both ends of the ellipse's longer
    diameter. They look uneven from beside their middle as well, so it is searched for at the same time. None if the
    dial is seen square on, or its ring shows too much besides even marks.
    """
    radius_px = float(grid.radii_px[-1])
    reach = min(REACH_PART, _most_margin_px(grid) / radius_px)
    rings = _Rings.of(grid, [drawn], reach * radius_px)

    def score(views: Floats, rings: _Rings = rings) -> Floats:
        parts = np.split(views, range(AT_ONCE, len(views), AT_ONCE))
        return np.concatenate([_even(rings.seen(radius_px * each[:, :2], each[:, 2:])[:, 0]) for each in parts])

    # Many marks are in step in some wrong views too, so views have to be close to each other, if not with all radii.
    near, views = _disc(reach / 4, STEP_PART / 2), _disc(reach / 2, STEP_PART / 2)
    starts = np.array([[*offset, *squeeze] for offset in near for squeeze in views])
    thin = replace(rings, radii_px=rings.radii_px[::BANDS])
    likely = starts[np.argsort(score(starts, thin))[-BANDS:]]
    (square_on,), _ = climbed(score, np.zeros((1, 4)), ALL_AXES - SQUEEZE_AXES, reach)
    heights, views = climbed(score, likely, ALL_AXES, reach)
    highest, view = heights.max(), views[heights.argmax()]
    is_clear = 1.0 - highest < min(HALF * HALF, FAR_GAIN * (1.0 - square_on))
    return Squeeze(*view[2:].tolist()) if is_clear else None


def _even(rings: Floats) -> Floats:
    """(V,): how much of what each ring (V, angles, radii) shows is even, in the band of radii where most of it is.

    That is the share of it that recurs after some part of a turn, all the way round, beyond the share that noise has.
    """
    power = np.square(np.abs(np.fft.rfft(rings, axis=1)))[:, FEWEST_MARKS:].astype(np.float32)
    width = rings.shape[2] // BANDS
    sums = np.cumsum(np.pad(power, ((0, 0), (0, 0), (1, 0))), axis=2)
    bands = sums[..., width:] - sums[..., :-width]
    is_of = _waves_of_marks(power.shape[1])
    noise = NOISE_LEVELS**2 * width * rings.shape[1]
    shares = is_of @ (bands / (bands.sum(axis=1, keepdims=True) + noise))
    most: Floats = (shares.max(axis=2) - is_of.mean(axis=1)).max(axis=1)
    return most


@cache
def _waves_of_marks(count: int) -> Floats:
    """(W, W) float32: for each number of even marks all round, from the fewest on, which waves around them it has."""
    waves = np.arange(FEWEST_MARKS, FEWEST_MARKS + count)
    is_of: Floats = (waves % waves[:, None] == 0).astype(np.float32)
    return is_of


def climbed(score: Score, starts: Floats, axes: Axes, reach: float) -> tuple[Floats, Floats]:
    """Climb from each of S views along some axes to a peak of the score in ever smaller steps.

    A view is an offset and a squeeze, all as parts of the radius; together they stay within `reach`. All climbs are at
    the same size of step, so that many views are scored at once.

    Returns
    -------
    heights : (S,)
    views : (S, 4)
    """
    ways = np.eye(4)[sorted(axes)]
    ways = np.concatenate([ways, -ways])
    heights, views = score(starts).astype(np.float64), starts.copy()
    for halved in range(HALVINGS):
        rising = np.arange(len(views) if len(ways) else 0)
        while len(rising):
            around = views[rising, None] + STEP_PART / 2**halved * ways
            x, y, across, askew = np.moveaxis(around, -1, 0)
            is_within = np.hypot(x, y) + np.hypot(across, askew) <= reach
            found = np.full(is_within.shape, -np.inf)
            if is_within.any():
                found[is_within] = score(around[is_within])
            best, highest = found.argmax(axis=1), found.max(axis=1)
            rises = highest > heights[rising]
            rising = rising[rises]
            heights[rising], views[rising] = highest[rises], around[rises, best[rises]]
    return heights, views


def _most_different(strips: Sequence[UnwrappedGauge]) -> list[UnwrappedGauge]:
    """Choose frames that differ most from each other: only what moved between frames can show what turns."""
    if not strips:
        return []
    chosen, apart = [0], np.full(len(strips), np.inf)
    for _ in range(1, MOST_CARD_FRAMES):
        apart = np.minimum(apart, [float(np.square(strip - strips[chosen[-1]]).mean()) for strip in strips])
        if apart.max() <= NOISE_LEVELS**2:
            break
        chosen.append(int(apart.argmax()))
    return [strips[index] for index in chosen]


def _finest(score: Score, offset_px: Floats, step_px: float) -> Vector:
    """Climb to the peak of a score in ever smaller steps."""
    for _ in range(2):
        steps = step_px * _disc(1.5, 1.0)
        offset_px = offset_px + _peak(steps, score(offset_px + steps), step_px)
        step_px /= 2
    return float(offset_px[0]), float(offset_px[1])


@dataclass(frozen=True, slots=True)
class _Rings:
    """Blurred frames (F, R, C) on a grid, and the angles and radii on which to sample them around other centres."""

    grid: PolarGrid
    blurred: Sequence[Floats]
    angles: Floats
    radii_px: Floats

    @classmethod
    def of(cls, grid: PolarGrid, strips: Sequence[UnwrappedGauge], margin_px: float) -> Self:
        """Leave out a margin at either edge, so that all frames show all of the ring around a centre that near."""
        radii_px = np.linspace(grid.inner_px + margin_px, grid.radii_px[-1] - margin_px, CARD_COLUMNS, dtype=np.float32)
        spans = ROW_DEG / grid.step_deg, len(grid.radii_px) / CARD_COLUMNS
        wide = [max(1, round(span / 2)) for span in spans]
        return cls.around_drawn(
            grid, [np.asarray(cv2.blur(strip, wide[::-1]), np.float32) for strip in strips], radii_px
        )

    @classmethod
    def around_drawn(cls, grid: PolarGrid, blurred: Sequence[Floats], radii_px: Floats) -> Self:
        """Sample all angles of pictures that are blurred already."""
        return cls(grid, blurred, np.radians(np.arange(0.0, FULL_CIRCLE_DEG, ROW_DEG)), radii_px)

    def around(self, offset_px: Floats | Vector, squeeze: Squeeze = ROUND) -> Floats:
        """(F, A, N): frames around another centre, where circles appear squeezed, about the mean of each circle."""
        rings: Floats = self.seen(np.array([offset_px]), np.array([[squeeze.across, squeeze.askew]]))[0]
        return rings

    def seen(self, offsets_px: Floats, squeezes: Floats) -> Floats:
        """(V, F, A, N): the same around each of V centres (V, 2), with the parts of each squeeze (V, 2)."""
        grid, ways = self.grid, np.stack([np.cos(self.angles), np.sin(self.angles)])
        # Turned so that the grid's middle row lies to the right: an angle and its row then end at the same place.
        middle_deg = grid.angle_deg((grid.rows - 1) / 2)
        cos, sin = math.cos(math.radians(middle_deg)), math.sin(math.radians(middle_deg))
        back, (across, askew) = np.array([[cos, sin], [-sin, cos]]), squeezes.T
        squeezed = np.moveaxis(np.array([[1.0 + across, askew], [askew, 1.0 - across]]), -1, 0)
        off_px, ways = (offsets_px @ back.T).astype(np.float32), (back @ squeezed @ ways).astype(np.float32)
        x, y = (off_px[:, axis, None, None] + ways[:, axis, :, None] * self.radii_px for axis in (0, 1))
        rows = np.arctan2(y, x) / np.float32(math.radians(grid.step_deg))
        rows += np.float32((middle_deg - grid.start_deg) / grid.step_deg)
        columns = (np.sqrt(x * x + y * y) - np.float32(grid.inner_px)) / np.float32(grid.column_px)
        columns += np.float32(grid.tail_columns)
        flat, shape = (-1, len(self.radii_px)), rows.shape
        rows, columns = rows.reshape(flat), columns.reshape(flat)
        levels = [cv2.remap(strip, columns, rows, cv2.INTER_LINEAR).reshape(shape) for strip in self.blurred]
        rings = np.stack(levels, axis=1)
        about: Floats = rings - rings.mean(axis=2, keepdims=True)
        return about


def _alike(rings: Floats) -> float:
    """Return how well pairs of F frames (F, angles, radii) match if one is turned: the mean of their best NCCs."""
    scores = turned_correlation(rings, noise_between(rings), is_mutual=False).max(axis=2)
    return float(scores[np.triu_indices(len(rings), 1)].mean())


@dataclass(frozen=True, slots=True)
class _CoarseDial:
    """A gauge on coarse rows and columns: `own` (R, C) in the panel picture, `frames` (F, R, C) in the sample's."""

    own: Floats
    frames: Floats
    step_deg: float
    first_deg: float
    row_of: Callable[[float], float]

    @classmethod
    def of(cls, grid: PolarGrid, own: UnwrappedGauge, strips: Sequence[UnwrappedGauge]) -> Self:
        """Thin a gauge out; each sample is the mean of those around it."""
        outward = grid.columns - grid.tail_columns
        every = math.ceil(ROW_DEG / grid.step_deg), math.ceil(outward / COLUMNS)
        columns = grid.tail_columns + np.arange(every[1] // 2, outward, every[1])
        blurred = (cv2.blur(strip, every[::-1])[:: every[0], columns] for strip in (own, *_spread(strips, MOST_FRAMES)))
        drawn, *frames = (np.asarray(each, np.float32) for each in blurred)
        return cls(
            drawn,
            np.stack(frames),
            grid.step_deg * every[0],
            grid.start_deg,
            lambda angle_deg: row_of_angle(grid, angle_deg) / every[0],
        )

    def angle_deg(self, row: float) -> float:
        """Return the angle of a fractional row."""
        return self.first_deg + self.step_deg * row


def _axis_of(dial: _CoarseDial, at_deg: float, height: int) -> float | None:
    """Find the row on which a needle lies in the panel picture; None if it never leaves its place."""
    half, around = height // 2, round(BESIDE_DEG / dial.step_deg)
    drawn = dial.row_of(at_deg)
    first, end = max(round(drawn) - half - around, 0), min(round(drawn) + half + around + 1, len(dial.own))
    if end - first < height:
        return None
    apart = np.abs(dial.frames[:, first:end] - dial.own[first:end]).mean(axis=(1, 2))
    elsewhere = np.argsort(-apart, kind="stable")[: 1 + len(apart) // ELSEWHERE]
    needle = dial.own[first:end] - median_of(dial.frames[elsewhere, first:end])
    shown = np.maximum(np.abs(needle) - 3 * NOISE_LEVELS, 0.0).mean(axis=1)
    wide = np.convolve(shown, np.ones(2 * (half // 2) + 1), "same")
    middles = np.arange(half, len(wide) - half)
    best = middles[wide[middles].argmax()]
    own = slice(best - half, best + half + 1)
    if not shown[own].any():
        return None
    return first + float(np.arange(len(wide))[own] @ shown[own] / shown[own].sum())


def _best(
    score: Score, radius_px: float, reach_px: float, *, near_part: float = FAR_PART, most_left: float = FAR_GAIN
) -> Vector | None:
    """Search for the offset that explains frames best; None if it is near, or none is clearly better than no offset.

    A better one leaves at most the part `most_left` of what is unexplained. If two explain frames equally well, as
    where a needle hardly turns, the nearer one is preferred.
    """

    def liked(offsets_px: Floats) -> Floats:
        far = np.hypot(*offsets_px.T) / (REACH_PART * radius_px)
        likely: Floats = 1.0 - score(offsets_px) + (1.0 - FAR_GAIN) * far**2 * (1.0 - drawn)
        return -likely

    drawn = float(score(np.zeros((1, 2)))[0])
    first = _disc(reach_px, STEP_PART * radius_px)
    start = first[liked(first).argmax()]
    last_px = LAST_STEP_PART * radius_px
    steps = np.stack(np.meshgrid([-last_px, 0.0, last_px], [-last_px, 0.0, last_px]), axis=-1).reshape(-1, 2)
    likings = liked(start + steps)
    offset = start + _peak(steps, likings, last_px)
    is_better = -float(likings.max()) < most_left * (1.0 - drawn)
    if not is_better or math.hypot(*offset) < near_part * radius_px:
        return None
    return float(offset[0]), float(offset[1])


def _disc(reach: float, step: float) -> Floats:
    """(N, 2): a square grid of offsets up to a distance."""
    count = math.floor(reach / step)
    ticks = step * np.arange(-count, count + 1)
    offsets = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    near: Floats = offsets[np.hypot(*offsets.T) <= reach]
    return near


def _peak(places: Floats, heights: Floats, reach: float) -> Floats:
    """(2,): the peak of a parabola through heights at places (N, 2); the highest place if the parabola has no peak."""
    x, y = places.T
    _, slope_x, slope_y, xx, xy, yy = np.linalg.lstsq(np.stack([x * 0 + 1, x, y, x * x, x * y, y * y], 1), heights)[0]
    curvature = np.array([[2 * xx, xy], [xy, 2 * yy]])
    if np.linalg.eigvalsh(curvature).max() >= 0:
        highest: Floats = places[heights.argmax()]
        return highest
    peak: Floats = -np.linalg.solve(curvature, [slope_x, slope_y])
    return limited(peak, -reach, reach)


def _spread(strips: Sequence[UnwrappedGauge], most: int) -> Sequence[UnwrappedGauge]:
    """Return at most `most` of them, spread evenly."""
    if len(strips) <= most:
        return strips
    return [strips[index] for index in np.linspace(0, len(strips) - 1, most).round().astype(int)]
