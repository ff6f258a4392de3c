"""Horizons: where the picture of one lies behind its window in a frame, with its uncertainty and its light.

The coarse search correlates the picture, at every shift, with the window unwrapped around the dial's centre, by Fourier
transforms along the rows for all turns at once. Least squares on the pixels there give fractions of a degree and of a
pixel, and the uncertainty, together with the light: its strength, and how it falls off across the window.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.imaging.resampling import levels_at, put_levels
from decoder.imaging.sorting import MAD_TO_SIGMA, median_of
from decoder.imaging.unwrapping import PolarGrid, UnwrappedGauge
from decoder.instruments.appearance import CardPicture
from decoder.instruments.thresholds import CLEARLY_WORSE
from decoder.matching.correlation import explained, is_singular, products, shared_weights, weighted_correlation
from decoder.matching.needle_search import peaks_of
from decoder.matching.thresholds import MAX_PEAK_ROWS, MIN_LIGHT_GAIN, MIN_VISIBLE
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.panel.kinds.attitude import Attitude
from decoder.panel.scale import FULL_CIRCLE_DEG, Scale, in_turn
from decoder.registration.thresholds import LIKELY_SCORE, MIN_SPREAD_LEVELS, SCORE_THRESHOLD

HALF_TURN_DEG = FULL_CIRCLE_DEG / 2
SEARCH_STEP_DEG = 2.0
SEARCH_COLUMNS = 14
# The horizon is searched for up to this many window radii away, at this many shifts.
REACH_RADII = 2.0
SEARCH_SHIFTS = 97
# A score is a peak if none is higher within this many steps.
PEAK_STEPS = 2
FIT_STEPS = 5
# Errors are correlated within patches of the window: this many around, and across.
PATCHES = 12, 3
QUARTERS = 4
# How precisely a pitch mark is drawn: on a tilted line, and anywhere within it, lines being a thirtieth of the radius
# thick.
MARK_PX, MARK_PART = 0.5, 0.01

Spectra = NDArray[np.complexfloating[Any, Any]]


@dataclass(frozen=True, slots=True)
class Place:
    """Where a horizon lies relative to the panel picture: `turned_deg` clockwise, `down_px` along its vertical axis."""

    turned_deg: float
    down_px: float

    @property
    def is_inverted(self) -> bool:
        """Whether it is nearer to upside down than to the panel picture."""
        return math.cos(math.radians(self.turned_deg)) < 0.0


AS_DRAWN = Place(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class AttitudePicture:
    """What an attitude indicator looks like.

    Attributes
    ----------
    horizon
        (H, W) float32, what moves behind the window, upright as in the panel picture, with the dial's centre in the
        middle; a cell is as large as a column of the gauge's grid.
    known
        (H, W): 1 where frames showed that, else 0.
    weights
        (P, C) in [0, 1]: how well each place of the window, which stands still, shows the horizon.
    ring
        The ring that turns around the window, if there is one.
    drawn
        (P, C) float32, the window in the panel picture.
    shift_turn
        How many degrees the direction of the shift turns per degree of the ring, from the panel or from a flight.
    origin
        The place of `horizon` in that window.
    is_learned
        Whether it was composed from frames; the panel picture shows all that lies over the horizon too.
    tilted_deg
        How much further clockwise than drawn the panel picture shows the horizon, where no ring tells.
    is_law_from_afar
        Whether `shift_turn` was learned before the dial was moved to where it is now.
    """

    horizon: Floats
    known: Floats
    weights: Floats
    ring: CardPicture | None
    drawn: UnwrappedGauge
    shift_turn: float
    origin: Place = AS_DRAWN
    is_learned: bool = False
    tilted_deg: float = 0.0
    is_law_from_afar: bool = False


@dataclass(frozen=True, slots=True)
class Sight:
    """A horizon in one frame: its place with sigmas, its light, and whether no other place matches as well.

    `haze` (T,) are the terms of the light that is added to the picture, T as in `Attitudes.haze`.
    """

    place: Place
    sigma_deg: float
    sigma_px: float
    gain: float
    haze: Floats
    score: float
    is_alone: bool

    @property
    def is_sure(self) -> bool:
        """Whether it can be read."""
        return self.score >= SCORE_THRESHOLD and self.is_alone


NOT_SEEN = Sight(AS_DRAWN, math.inf, math.inf, 1.0, np.zeros(1, np.float32), 0.0, is_alone=False)


@dataclass(frozen=True)
class Attitudes:
    """One attitude indicator on its grid, and how it moves: pixels in its own plane, degrees clockwise.

    `tilted_deg` is as in `AttitudePicture`.
    """

    own: Attitude
    gauge: Gauge
    grid: PolarGrid
    tilted_deg: float = 0.0

    @classmethod
    def of(cls, gauge: Gauge, grid: PolarGrid) -> Attitudes:
        """Return that of a gauge that has one."""
        if gauge.attitude is None:
            raise AssertionError(f"{gauge.name} is no attitude indicator")
        return cls(gauge.attitude, gauge, grid)

    def shifting(self, shift_turn: float) -> Attitudes:
        """Let the direction of its shift turn by `shift_turn` degrees per degree of the ring."""
        return replace(self, own=self.own.model_copy(update={"shift_turn": shift_turn}))

    def moving_as(self, picture: AttitudePicture) -> Attitudes:
        """Let it move as it was learned to."""
        return replace(self.shifting(picture.shift_turn), tilted_deg=picture.tilted_deg)

    @property
    def is_odd(self) -> bool:
        """Whether the direction of the shift turns differently from the horizon, so that no mark on it shows it."""
        return self.own.shift_turn != self.own.horizon_turn

    @cached_property
    def rows(self) -> int:
        """How many rows of the grid are one turn."""
        return self.grid.rows - 1  # the last repeats the first

    @cached_property
    def window(self) -> int:
        """How many columns of the grid lie in the window."""
        return int(np.searchsorted(self.grid.radii_px, self.own.window, side="right"))

    @cached_property
    def ring(self) -> slice:
        """The columns of the grid on which a ring turns."""
        first_px = math.inf if self.own.ring is None else self.own.ring - self.grid.column_px / 2
        return slice(int(np.searchsorted(self.grid.radii_px, first_px)), self.grid.columns)

    @cached_property
    def ring_grid(self) -> PolarGrid:
        """The part of the grid on which a ring turns."""
        inner_px = float(self.grid.radii_px[self.ring.start])
        return replace(self.grid, inner_px=inner_px, columns=self.ring.stop - self.ring.start)

    @cached_property
    def points_px(self) -> tuple[Floats, Floats]:
        """(P, C) each: x and y of the window's samples around the dial's centre."""
        angles = np.radians(self.grid.angle_deg(0) + self.grid.step_deg * np.arange(self.rows))
        return _around(angles, self.grid.radii_px[: self.window])

    @cached_property
    def haze(self) -> Floats:
        """(3, P, C) float32, the terms of light that is added in the window: even, and rising across and down it."""
        x, y = (each / self.grid.radii_px[self.window - 1] for each in self.points_px)
        return np.stack([np.ones_like(x), x, y]).astype(np.float32)

    @cached_property
    def upright_deg(self) -> float:
        """How far the horizon is turned in its case in the panel picture."""
        return self.own.horizon_turn * self.own.turned_deg(self.gauge) + self.tilted_deg

    @cached_property
    def tilt_deg(self) -> float:
        """How far the horizon is turned in the panel picture, whose camera may be rolled."""
        return self.own.tilt_deg(self.gauge) + self.tilted_deg

    @cached_property
    def a_pixel_deg(self) -> float:
        """The angle as which a pixel of shift is read."""
        return math.degrees(1.0 / self.own.arc_px(self.gauge))

    @cached_property
    def level_px(self) -> float:
        """How far below the centre zero pitch lies in the panel picture, along the horizon's vertical axis."""
        return -float(Scale.of(self.own.ladder).angles_of(np.zeros(1))[0])

    @cached_property
    def _ups_px(self) -> Floats:
        return np.array([up_px for up_px, _ in self.own.ladder])

    def _slant(self, turned_deg: float) -> float:
        """Return the angle from the horizon's vertical axis to its direction of shift, radians, at this turn."""
        ring_deg = (self.upright_deg + turned_deg) / self.own.horizon_turn
        return math.radians((self.own.shift_turn - self.own.horizon_turn) * ring_deg)

    def aside_px(self, place: Place) -> float:
        """Return how far the picture has moved to the right across its own vertical axis."""
        there, here = math.tan(self._slant(0.0)), math.tan(self._slant(place.turned_deg))
        return self.level_px * there - (self.level_px + place.down_px) * here

    def in_even_light(self, strip: UnwrappedGauge, sight: Sight) -> Floats:
        """(P, C): the window of a gauge (R, C) in the light of the picture."""
        haze = np.tensordot(sight.haze, self.haze[: len(sight.haze)], 1)
        levels: Floats = (strip[: self.rows, : self.window] - haze) / sight.gain
        return levels

    def up_px(self, place: Place) -> tuple[float, float]:
        """Return the height in the panel picture of the mark that is now at the centre, and its change per pixel.

        Where both turn alike, the whole shift lies along the horizon's vertical axis.
        """
        part = math.cos(self._slant(place.turned_deg))
        return (self.level_px + place.down_px) / part - self.level_px, 1.0 / abs(part)

    def is_level_in_sight(self, place: Place) -> bool:
        """Whether zero pitch lies in the window; without it, the marks of the ladder all look alike."""
        return abs(self.level_px + place.down_px) < self.own.window

    def upside_down(self, place: Place) -> Place:
        """Return where the horizon's line is the same, with the sky below it."""
        return Place(place.turned_deg + HALF_TURN_DEG, -2 * self.level_px - place.down_px)

    def drawn_sigma_px(self, up_px: float) -> float:
        """Return the uncertainty, due to marks drawn by hand, of a place on the straight line fitted through them."""
        middle_px = float(self._ups_px.mean())
        off_px = self._ups_px - middle_px
        mark_px = math.hypot(MARK_PX, MARK_PART * self.gauge.radius[1])
        return mark_px * math.sqrt(1.0 / len(off_px) + (up_px - middle_px) ** 2 / float(off_px @ off_px))


class HorizonReader:
    """Finds the horizon in the window of one gauge."""

    def __init__(self, own: Attitudes, picture: AttitudePicture) -> None:
        self._own, self._picture, grid = own, picture, own.grid
        radii_px = grid.radii_px[: own.window]
        self._points = (np.dstack(own.points_px) / grid.column_px).astype(np.float32)
        # samples further out cover more of the window
        self._weights = picture.weights * (radii_px / radii_px[-1]).astype(np.float32)
        # least squares use rows as far apart at the rim as columns are
        self._stride = max(round(grid.column_px / (math.radians(grid.step_deg) * radii_px[-1])), 1)
        self._thinned = self._weights[:: self._stride]
        self._haze = own.haze[:, :: self._stride]
        self._pixels_per_sample = min(1.0, grid.pixels_per_sample * self._stride)
        # The slope between two neighbours, half way between them, is that of the interpolated picture. Over two cells,
        # a sharp horizon would change half as fast, and every step of a fit would go too far.
        self._ups = np.diff(picture.horizon, axis=0) / np.float32(-grid.column_px)
        self._rights = np.diff(picture.horizon, axis=1) / np.float32(grid.column_px)
        # A horizon that moves less has converged: it is a tenth of what marks drawn by hand leave open.
        self._still_px = own.drawn_sigma_px(0.0) / 10
        self._thinned_px = [each[:: self._stride].astype(np.float32) for each in own.points_px]
        self._patches = [_parts(size, parts) for size, parts in zip(self._thinned.shape, PATCHES, strict=True)]

    @cached_property
    def _search(self) -> _Search:
        return _Search(self._own, self._picture.horizon, self._weights)

    def sight(self, strip: UnwrappedGauge, turned_deg: float | None, *, is_upright: bool = False) -> Sight:
        """Find the horizon in a gauge (R, C), at its turn from the panel picture where that is known."""
        seen = strip[: self._own.rows, : self._own.window]
        found = self._search.best(seen, turned_deg, is_upright=is_upright)
        if found is None:
            return NOT_SEEN
        place, rival, rival_score = found
        thinned = seen[:: self._stride]
        is_turn_known = turned_deg is not None
        # Light that falls off looks like a sky over its ground until it is known what lies over them. Where no ring
        # shows which way is up, it would make a horizon match upside down.
        is_falling = is_turn_known and self._picture.is_learned
        sight = self._fitted(thinned, place, self._thinned, is_turn_known=is_turn_known, is_falling=is_falling)
        if rival_score >= LIKELY_SCORE:  # the search is too coarse to compare places in
            other = self._fitted(thinned, rival, self._thinned, is_turn_known=is_turn_known, is_falling=is_falling)
            sight, other = sorted((sight, other), key=lambda each: -each.score)
            rival_score = other.score or rival_score  # it is 0 where nothing could be fitted
        is_alone = _is_worse(rival_score, sight)
        if not is_turn_known and sight.place.is_inverted:
            is_alone = is_alone and self._knows(self._own.upside_down(sight.place))
        return replace(sight, is_alone=is_alone)

    def without_quarters(self, strip: UnwrappedGauge, sight: Sight) -> Sight:
        """Estimate how far a horizon would move if any quarter of the window did not count (the jackknife).

        Least squares only know errors that are independent between patches. A reflection along the horizon is not, and
        turns it, unless a ring tells its turn.
        """
        if not sight.is_alone:
            return sight
        seen = self._seen(strip)
        rows, parts = np.arange(len(seen)) * QUARTERS // len(seen), []
        for quarter in range(QUARTERS):
            counts = self._thinned * (rows != quarter)[:, None]
            parts.append(self._fitted(seen, sight.place, counts, is_turn_known=False, is_falling=False))
            if not parts[-1].score:
                return replace(sight, is_alone=False)
        places = np.array([(each.place.turned_deg, each.place.down_px) for each in parts])
        off_deg, off_px = np.sqrt((QUARTERS - 1) * places.var(axis=0)).tolist()
        sigma_deg, sigma_px = math.hypot(sight.sigma_deg, off_deg), math.hypot(sight.sigma_px, off_px)
        return replace(sight, sigma_deg=sigma_deg, sigma_px=sigma_px)

    def _seen(self, strip: UnwrappedGauge) -> Floats:
        """(P', C): the rows of the window of a gauge (R, C) that are fitted."""
        return strip[: self._own.rows : self._stride, : self._own.window]

    def is_worse_upside_down(self, strip: UnwrappedGauge, sight: Sight) -> bool:
        """Whether a horizon found in a gauge (R, C) matches clearly worse with the sky below its line."""
        seen = self._seen(strip)
        place = self._own.upside_down(sight.place)
        other = self._fitted(seen, place, self._thinned, is_turn_known=False, is_falling=False)
        return _is_worse(other.score, sight)

    def is_near(self, place: Place, start: Place) -> bool:
        """Whether two places belong to the same peak of the search."""
        return self._search.is_near(place, start)

    def turns_on(self, strip: UnwrappedGauge, place: Place) -> bool:
        """Whether a horizon that was found in a gauge (R, C) at the ring's turn turns on if its own turn is fitted."""
        seen = self._seen(strip)
        is_falling = self._picture.is_learned
        free = self._fitted(seen, place, self._thinned, is_turn_known=False, is_falling=is_falling)
        on_deg = free.place.turned_deg - place.turned_deg
        return math.isinf(free.sigma_deg) or not np.isclose(on_deg, 0.0, atol=SEARCH_STEP_DEG)

    def _knows(self, place: Place) -> bool:
        """Whether frames showed nearly all that the window would show at a place, so that it could match there."""
        known = self._weights * sampled_at(self._picture.known, self._cells(place, 1))
        return float(known.sum()) >= (1.0 - MIN_VISIBLE) * float(self._weights.sum())

    def still(self, views: Sequence[tuple[UnwrappedGauge, Sight]]) -> Floats:
        """(P, C): the weight of each place in the window, by how consistently frames show what moves there."""
        apart = [
            self._own.in_even_light(strip, sight) - sampled_at(self._picture.horizon, self._cells(sight.place, 1))
            for strip, sight in views
        ]
        spread = MAD_TO_SIGMA * median_of(np.abs(apart))
        return shared_weights(spread, float(self._picture.horizon.std()))

    def _centre(self, place: Place) -> tuple[float, float]:
        """Return the column and row of the picture that lie at the dial's centre."""
        (height, width), cell_px = self._picture.horizon.shape, self._own.grid.column_px
        return (width - 1) / 2 - self._own.aside_px(place) / cell_px, (height - 1) / 2 - place.down_px / cell_px

    def _cells(self, place: Place, stride: int, before: tuple[float, float] = (0.0, 0.0)) -> Floats:
        """(P', C, 2): column and row, less `before`, of the picture at every `stride`-th row of the window."""
        (cos, sin), (x, y) = self._back(place), self._centre(place)
        matrix = np.array([[cos, sin, x - before[0]], [-sin, cos, y - before[1]]])
        return np.asarray(cv2.transform(self._points[::stride], matrix), np.float32)

    def _from_centre_px(self, place: Place) -> tuple[Floats, Floats]:
        """(P', C) each: how far what the fitted samples show is right of and below the dial's centre in the picture."""
        (cos, sin), (x, y) = self._back(place), self._thinned_px
        return cos * x + sin * y, cos * y - sin * x

    def _back(self, place: Place) -> tuple[float, float]:
        back = math.radians(self._own.tilt_deg + place.turned_deg)
        return math.cos(back), math.sin(back)

    def _fitted(self, seen: Floats, place: Place, counts: Floats, *, is_turn_known: bool, is_falling: bool) -> Sight:
        """Fit gain, haze, shift and, where it is not known, turn, by least squares, with weights `counts` (P', C).

        Haze is even, or falls off across the window. Outliers have no weight in the fit but full weight in the
        score, since a few pixels match in many places.
        """
        start, weights, terms = place, counts, self._haze if is_falling else self._haze[:1]
        is_haze = slice(1, 1 + len(terms))
        for _ in range(FIT_STEPS):
            columns = self._columns(place, terms, is_turn_known=is_turn_known)
            weighted = columns * weights.ravel()
            normal = products(weighted, columns).astype(np.float64)
            if is_singular(normal):
                return NOT_SEEN
            inverse = np.linalg.inv(normal)
            solution = inverse @ (weighted @ seen.ravel())
            gain, steps = float(solution[0]), solution[is_haze.stop :].tolist()
            if gain < MIN_LIGHT_GAIN:
                return NOT_SEEN
            left = seen - (solution.astype(np.float32) @ columns).reshape(seen.shape)
            step_px, turn_deg = steps[0] / gain, math.degrees(sum(steps[1:]) / gain)
            place = Place(place.turned_deg + turn_deg, place.down_px + step_px)
            if not self._search.is_near(place, start):
                return NOT_SEEN
            if math.hypot(step_px, turn_deg) < self._still_px:
                break
            weights = counts * explained(left, counts)
        sigma_px, *sigmas = (self._sigmas(inverse, weighted, left, weights)[is_haze.stop :] / gain).tolist()
        haze = solution[is_haze].astype(np.float32)
        score = weighted_correlation(seen - np.tensordot(haze, terms, 1), left, counts)
        return Sight(place, math.degrees(sum(sigmas)), sigma_px, gain, haze, score, is_alone=True)

    def _columns(self, place: Place, haze: Floats, *, is_turn_known: bool) -> Floats:
        """(K, N): the derivatives by gain, each term of haze, shift and, where it is not known, turn."""
        columns = np.empty((2 + len(haze) + (not is_turn_known), *haze.shape[1:]), np.float32)
        columns[1 : 1 + len(haze)] = haze
        up = columns[1 + len(haze)]
        put_levels(columns[0], self._picture.horizon, self._cells(place, self._stride))
        put_levels(up, self._ups, self._cells(place, self._stride, (0.0, 0.5)))
        if not is_turn_known:
            put_levels(columns[-1], self._rights, self._cells(place, self._stride, (0.5, 0.0)))
            x_px, y_px = self._from_centre_px(place)
            columns[-1] *= y_px
            columns[-1] += up * x_px
        return columns.reshape(len(columns), -1)

    def _sigmas(self, inverse: Floats, weighted: Floats, left: Floats, weights: Floats) -> Floats:
        """Return the standard uncertainties of a fit: the larger of the estimate per pixel and the one per patch."""
        noise = float((weights * left**2).sum() / weights.sum()) / self._pixels_per_sample
        pulls = weighted.reshape(-1, *left.shape) * left
        for axis, starts in enumerate(self._patches, 1):
            pulls = np.add.reduceat(pulls, starts, axis=axis, dtype=np.float64)
        pulls = pulls.reshape(len(weighted), -1)
        by_patch = np.diag(inverse @ (pulls @ pulls.T) @ inverse)
        sigmas: Floats = np.sqrt(np.maximum(np.diag(inverse) * noise, by_patch))
        return sigmas


def _is_worse(score: float, sight: Sight) -> bool:
    """Whether a score leaves clearly more unexplained than a horizon's."""
    return 1.0 - score**2 > CLEARLY_WORSE * (1.0 - min(sight.score, 1.0) ** 2)


def _parts(size: int, count: int) -> NDArray[np.intp]:
    """(count,): where each of as many equal parts of a number of samples begins."""
    return -(-np.arange(count) * size // count)


class _Search:
    """The coarse search: the NCC of a window with the picture at every shift and turn."""

    def __init__(self, own: Attitudes, horizon: Floats, weights: Floats) -> None:
        grid = own.grid
        self._stride = round(SEARCH_STEP_DEG / grid.step_deg)
        self._step_deg = self._stride * grid.step_deg
        self._columns = np.unique(np.linspace(0, own.window - 1, SEARCH_COLUMNS).round().astype(np.intp))
        reach_px = REACH_RADII * float(grid.radii_px[own.window - 1])
        self._downs_px, self._step_px = np.linspace(-reach_px, reach_px, SEARCH_SHIFTS, retstep=True)
        self._weights = self._thinned(weights).astype(np.float64)
        self._rows = len(self._weights)
        angles = np.radians(grid.angle_deg(0) + self._step_deg * np.arange(self._rows) - own.tilt_deg)
        x, y = _around(angles, grid.radii_px[self._columns])
        # Both are softened to the search's steps, or lines thinner than a step would be missed between two of them.
        step = float(self._step_px) / grid.column_px
        soft = softened(horizon, step / 2, step / 2)
        shown = np.stack([_sampled(soft, x, y - down, grid.column_px) for down in self._downs_px])
        self._total = max(float(self._weights.sum()), 1.0)
        self._shown = shown.reshape(len(shown), -1).astype(np.float64)
        self._spectra = np.fft.rfft(shown, axis=1)
        self._mean = self._turned_sums(self._weights, self._spectra) / self._total
        square = self._turned_sums(self._weights, np.fft.rfft(shown**2, axis=1)) / self._total
        self._spread = np.sqrt(np.maximum(square - self._mean**2, 0.0))

    def is_near(self, place: Place, start: Place) -> bool:
        """Whether two places belong to the same peak."""
        turns = abs(place.turned_deg - start.turned_deg) / self._step_deg
        shifts = abs(place.down_px - start.down_px) / float(self._step_px)
        return turns <= MAX_PEAK_ROWS and shifts <= MAX_PEAK_ROWS

    def best(self, seen: Floats, turned_deg: float | None, *, is_upright: bool) -> tuple[Place, Place, float] | None:
        """Return where the picture matches a window (P, C) best and second best, and how well; None for a blank window.

        With `turned_deg`, only that turn is searched; else all, or those nearer to upright than to upside down.
        """
        rows = None if turned_deg is None else round(turned_deg / self._step_deg) % self._rows
        scores = self._scores(self._thinned(seen), rows)
        if scores is None:
            return None
        if is_upright and turned_deg is None:
            turns = np.radians(self._step_deg * np.arange(self._rows))
            scores = np.where(np.cos(turns) >= 0.0, scores, -1.0)
        shift, turn = divmod(int(scores.argmax()), scores.shape[1])
        second = _second_peak(scores, shift, turn)
        places = [self._place(scores, peak, turned_deg) for peak in ((shift, turn), second)]
        return places[0], places[1], max(float(scores[second]), 0.0)

    def _place(self, scores: Floats, peak: tuple[int, int], turned_deg: float | None) -> Place:
        """Return the place of a peak of scores (K, P): its shift lies between steps."""
        shift, turn = peak
        found_deg = float(in_turn(np.array(turn * self._step_deg), FULL_CIRCLE_DEG, -HALF_TURN_DEG))
        _, at = peaks_of(scores[:, turn], np.arange(len(scores)) == shift)
        at_deg = found_deg if turned_deg is None else turned_deg
        return Place(at_deg, float(self._downs_px[0] + at * self._step_px))

    def _scores(self, seen: Floats, rows: int | None) -> Floats | None:
        """(K, P) at every shift and turn, or (K, 1) at one turn; None where a window (P, C) is blank."""
        weighted = self._weights * seen
        mean = float(weighted.sum()) / self._total
        spread = math.sqrt(max(float((weighted * seen).sum()) / self._total - mean**2, 0.0))
        if spread < MIN_SPREAD_LEVELS:
            return None
        if rows is None:
            sums, turns = self._turned_sums(weighted, self._spectra), slice(None)
        else:
            sums, turns = self._shown @ np.roll(weighted, -rows, axis=0).reshape(-1, 1), slice(rows, rows + 1)
        together = sums / self._total - mean * self._mean[:, turns]
        spreads = self._spread[:, turns]
        known = spreads > MIN_SPREAD_LEVELS
        scores: Floats = np.divide(together, spreads * spread, out=np.zeros_like(together), where=known)
        return np.clip(scores, -1.0, 1.0)

    def _thinned(self, strip: Floats) -> Floats:
        around, across = self._stride, len(strip[0]) / len(self._columns)
        wide = np.pad(strip, ((2 * around, 2 * around), (0, 0)), mode="wrap")
        soft = softened(wide, across / 2, around / 2)[2 * around : -2 * around]
        thinned: Floats = soft[:: self._stride, self._columns]
        return thinned

    def _turned_sums(self, image: Floats, spectra: Spectra) -> Floats:
        """Sum the product of a window (P, C) and each picture (K, P, C) turned by each number of rows: (K, P)."""
        sums: Floats = np.fft.irfft(np.vecdot(spectra, np.fft.rfft(image, axis=0)), self._rows, axis=1)
        return sums


def _second_peak(scores: Floats, shift: int, turn: int) -> tuple[int, int]:
    """Return the second highest peak of scores (K, P), which are cyclic in turns: its shift and turn."""
    around = PEAK_STEPS if scores.shape[1] > 1 else 0
    padded = np.pad(scores, ((0, 0), (around, around)), mode="wrap").astype(np.float32)
    highest = cv2.dilate(padded, np.ones((2 * PEAK_STEPS + 1, 2 * around + 1), np.uint8))
    is_peak = (padded == highest)[:, around : around + scores.shape[1]]
    is_peak[shift, turn] = False
    second_shift, second_turn = divmod(int(np.where(is_peak, scores, -1.0).argmax()), scores.shape[1])
    return second_shift, second_turn


def _around(angles: Floats, radii_px: Floats) -> tuple[Floats, Floats]:
    """(P, C) each: x and y of points around a centre."""
    return np.cos(angles)[:, None] * radii_px, np.sin(angles)[:, None] * radii_px


def _sampled(levels: Floats, x_px: Floats, y_px: Floats, cell_px: float) -> Floats:
    """Sample a picture (H, W), or several as (H, W, K), at points relative to its middle."""
    height, width = levels.shape[:2]
    return sampled_at(levels, np.dstack([x_px / cell_px + (width - 1) / 2, y_px / cell_px + (height - 1) / 2]))


def softened(levels: Floats, across: float, down: float) -> Floats:
    """Blur a picture (H, W) by standard deviations in cells."""
    return np.asarray(cv2.GaussianBlur(levels, (0, 0), sigmaX=across, sigmaY=down), np.float32)


def sampled_at(levels: Floats, cells: Floats) -> Floats:
    """Sample a picture (H, W), or several as (H, W, K), at columns and rows of it, (P, C, 2)."""
    places, light = np.asarray(cells, np.float32), np.asarray(levels, np.float32)
    return np.asarray(levels_at(light, places), np.float32).reshape(*places.shape[:2], *light.shape[2:])
