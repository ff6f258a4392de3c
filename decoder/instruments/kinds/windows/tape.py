"""Tapes: a scale that slides or turns behind a fixed index, such as a compass card seen edge-on or an altitude tape.

The tape is one picture, longer than the window, and a frame shows a part of it. At first only the part in the panel
picture is known. A frame that overlaps the known part, and matches it well and nowhere else, adds some more, until no
frame does. The best match is added before the next frame is compared: this keeps a frame from being taken for a similar
part of the tape while its own is still unknown. Where all frames agree, something stands still in the window, such as a
lubber line; that has no weight. Nor has anything that the tape shows at every position, such as a line along its ticks.

A reading is the whole tape's best match with the window, searched at every position and then refined by least squares.
Where another position matches nearly as well, or the tape was never seen, nothing is read.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.imaging.sorting import median_of
from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import UnwrappedGauge, WindowGrid
from decoder.instruments.appearance import DrawnInstrument, Look
from decoder.instruments.kinds.windows.tape_shape import (
    ROW_PX,
    DrawnMarks,
    TapeShape,
    Unrolling,
    rows_in_sight,
    softened,
)
from decoder.instruments.kinds.windows.window import WindowKind
from decoder.instruments.reading import Reading, Status
from decoder.instruments.thresholds import CLEARLY_WORSE, STILL_ROWS, SURE_SCORE
from decoder.matching.correlation import explained, products
from decoder.matching.needle_search import COARSE_STEP
from decoder.matching.thresholds import MAX_PEAK_ROWS, MIN_CONTRAST_PART, MUCH_BETTER, OUTLIER_SPREADS
from decoder.panel.arrays import Floats, Indices, Mask, limited
from decoder.panel.errors import PanelError
from decoder.panel.gauge import Gauge
from decoder.panel.kinds.straight import ACROSS
from decoder.panel.scale import FULL_CIRCLE_DEG
from decoder.registration.thresholds import LIKELY_SCORE, MIN_SPREAD_LEVELS, NOISE_LEVELS, SCORE_THRESHOLD

FIT_STEPS = 6
# Steps after which a rival's score is known to a thousandth.
RIVAL_STEPS = 2
# Errors are correlated within patches: this many along the window.
PATCHES = 12
# Neighbouring samples have correlated errors: one in this many is independent.
TOGETHER = 6.0
# All views share the shape's errors, so together they have no more information than one would, and samples have less
# than their number suggests.
ALIKE = 20.0
# How far a tape without an end is followed to either side, in windows.
REACH_WINDOWS = 12
# Up to this part of a sample's frames may show the same position without spoiling the test of what stands still.
MOVING_QUANTILE = 0.8
SETTLE_ROUNDS, REFINE_ROUNDS, GROW_ROUNDS = 2, 4, 40


@dataclass(frozen=True, slots=True)
class Laid:
    """Where a tape lies in F frames.

    Attributes
    ----------
    rows, sigma_rows, score
        (F,): how far it has moved from where it is unrolled, with the uncertainty and the score.
    gains, lights
        (F, R, 1) and (F, R, C): the light there, `seen = gains * tape + lights`.
    is_there
        (F,): whether it was found at all.
    """

    rows: Floats
    sigma_rows: Floats
    score: Floats
    gains: Floats
    lights: Floats
    is_there: Mask

    def put(self, which: Indices | Mask, others: Laid) -> None:
        """Overwrite some of them with others, in place."""
        for name in ("rows", "sigma_rows", "score", "gains", "lights", "is_there"):
            getattr(self, name)[which] = getattr(others, name)

    def part(self, which: Indices | Mask) -> Laid:
        """Return some of them."""
        return Laid(
            self.rows[which],
            self.sigma_rows[which],
            self.score[which],
            self.gains[which],
            self.lights[which],
            self.is_there[which],
        )


@dataclass(frozen=True, slots=True)
class _Fit:
    """A step of least squares for K unknowns in F windows, the first two of which are gain and position.

    Attributes
    ----------
    seen, weights, left
        (F, R, C): the windows, their weights, and the residuals.
    mean
        (F,): the tape's mean level, which is subtracted before the fit.
    weighed, inverse, solution
        (F, K, R * C), (F, K, K) and (F, K).
    flat
        (F, 1, R * C): the weights without outliers.
    """

    seen: Floats
    weights: Floats
    mean: Floats
    weighed: Floats
    inverse: Floats
    solution: Floats
    left: Floats
    flat: Floats

    def part(self, which: Mask) -> _Fit:
        """Return some of the windows."""
        return _Fit(*(getattr(self, each.name)[which] for each in fields(self)))


@dataclass(frozen=True)
class TapePicture:
    """What a tape looks like, and how it lies in its window.

    Attributes
    ----------
    shape
        How it lies; `unrolled` are its visible rows, each worth `step`.
    levels
        (P, C) float32: the whole tape, cyclic, with the panel picture's part from row 0 on.
    known
        (P, C): which of its cells were seen.
    weights
        (R, C) in [0, 1]: how well each cell of the window shows it.
    drawn
        (along, across): the window in the panel picture.
    origin
        How far it has moved there.
    is_learned
        Whether a flight separated it from what stands still over it.
    """

    shape: TapeShape
    unrolled: NDArray[np.intp]
    step: float
    levels: Floats
    known: Mask
    weights: Floats
    drawn: Floats
    origin: float = 0.0
    is_learned: bool = False

    @cached_property
    def unroll(self) -> Unrolling:
        """What unrolls its window."""
        return Unrolling(self.shape, self.unrolled, self.step)

    @property
    def is_whole(self) -> bool:
        """Whether all of it was seen."""
        return bool((self.known.mean(axis=1) >= HALF).all())

    def value(self, rows: float, index_px: float) -> float:
        """Return the value at a place of the window when the tape has moved by `rows`."""
        return self.shape.value_at(index_px) + self.moved(rows)

    def moved(self, rows: float) -> float:
        """Return the change of values when the tape lies at a row, the short way around as it is cyclic."""
        size = len(self.levels)
        return ((rows - self.origin + size / 2) % size - size / 2) * self.step


class TapeFinder:
    """Finds where a tape lies."""

    def __init__(self, picture: TapePicture) -> None:
        self._picture = picture
        self._rows, self._columns = picture.weights.shape
        self._size = len(picture.levels)
        self._lights = _lights(self._rows, self._columns, _profile(picture))
        # The slope half a row on, since `_at` blends two rows: over three rows, a sharp mark would change half as fast.
        self._slopes = np.roll(picture.levels, -1, 0) - picture.levels
        self._known = picture.known.astype(np.float32)
        self._along = np.linspace(-1.0, 1.0, self._rows, dtype=np.float32)[:, None]

    def laid(self, strips: Floats) -> tuple[Laid, Floats]:
        """Find the tape in F unrolled windows (F, R, C); also return (F,) how well the next best place matches."""
        scores = np.stack([self._scores(strip) for strip in strips])
        best = scores.argmax(axis=1)
        found = self.settled(strips, self._places[best].astype(np.float64))
        every = np.arange(len(scores))
        elsewhere = np.where(self._is_peak(scores) & self._is_apart[best], scores, 0.0)
        rival = elsewhere.argmax(axis=1)
        rivals = limited(elsewhere[every, rival].astype(np.float64), 0.0, 1.0)
        doubt = np.flatnonzero(found.is_there & (rivals >= LIKELY_SCORE))
        if doubt.size:
            other = self.settled(strips[doubt], self._places[rival[doubt]].astype(np.float64), RIVAL_STEPS)
            rivals[doubt] = np.maximum(rivals[doubt], other.score)
            is_better = other.is_there & (other.score > found.score[doubt])
            better = doubt[is_better]
            rivals[better] = found.score[better]
            found.put(better, self.settled(strips[better], other.rows[is_better]))
        return found, rivals

    @cached_property
    def _places(self) -> Indices:
        """(N,): the rows at which to search: those where enough of what the window would show is known."""
        rows = np.arange(0, self._size, COARSE_STEP)
        return np.asarray(rows[self.part_known(rows) >= HALF])

    def part_known(self, rows: Floats | Indices) -> Floats:
        """(F,): how much of what the window would show is known if the tape has moved by rows (F,)."""
        return self._parts_known[np.rint(rows).astype(np.intp) % self._size]

    @cached_property
    def _parts_known(self) -> Floats:
        """(P,): the same for every row of the tape."""
        known, weights = self._picture.known[:, ::COARSE_STEP], self._picture.weights[:, ::COARSE_STEP]
        window = np.zeros(known.shape)
        np.add.at(window, np.arange(self._rows) % self._size, weights)
        spectra = np.fft.rfft(known, axis=0) * np.fft.rfft(window, axis=0).conj()
        parts: Floats = np.fft.irfft(spectra.sum(axis=1), self._size) / max(float(weights.sum()), 1e-9)
        return parts

    @cached_property
    def _is_apart(self) -> Mask:
        """(N, N): whether two places are different peaks."""
        apart = np.abs(self._places[:, None] - self._places)
        far: Mask = 8 * np.minimum(apart, self._size - apart) > self._rows
        return far

    @staticmethod
    def _is_peak(scores: Floats) -> Mask:
        higher = np.maximum(np.roll(scores, 1, axis=1), np.roll(scores, -1, axis=1))
        peaks: Mask = scores >= higher
        return peaks

    @cached_property
    def _searched(self) -> tuple[Floats, Floats, Floats]:
        """(N, S) twice, (5 N, S): the tape without light, weighted, of unit length; weights; weighted light modes."""
        thin = (slice(None, None, COARSE_STEP), slice(None, None, COARSE_STEP))
        weights = self._picture.weights[thin]
        lights = self._lights.reshape(-1, self._rows, self._columns)[(slice(None), *thin)].reshape(
            len(self._lights), -1
        )
        at = (self._places[:, None] + np.arange(0, self._rows, COARSE_STEP)) % self._size
        seen = (self._picture.known[:, ::COARSE_STEP][at] * weights).reshape(len(at), -1)
        levels = self._picture.levels[:, ::COARSE_STEP][at].reshape(len(at), -1).astype(np.float64)
        levels -= (seen * levels).sum(axis=1, keepdims=True) / np.maximum(seen.sum(axis=1, keepdims=True), 1e-9)
        normal = np.einsum("an,kn,bn->kab", lights, seen, lights)
        hold = 1e-6 * (np.trace(normal, axis1=1, axis2=2) + 1e-6)[:, None, None] * np.eye(len(lights))
        own = np.linalg.solve(np.linalg.cholesky(normal + hold), np.broadcast_to(lights, (len(at), *lights.shape)))
        weighed = own * seen[:, None]
        levels -= np.einsum("kan,ka->kn", own, np.einsum("kan,kn->ka", weighed, levels))
        squares = (seen * levels**2).sum(axis=1)
        plain = squares < seen.sum(axis=1) * (MIN_SPREAD_LEVELS * NOISE_LEVELS) ** 2
        length = np.where(plain, np.inf, np.sqrt(np.maximum(squares, 1e-9)))
        tape = seen * levels / length[:, None]
        parts = (tape, seen, weighed.reshape(-1, lights.shape[1]))
        return parts[0].astype(np.float32), parts[1].astype(np.float32), parts[2].astype(np.float32)

    def _scores(self, strip: Floats) -> Floats:
        """(N,): the NCC of a window (R, C) with the tape at each place, both without smooth light."""
        tape, weights, lights = self._searched
        thin = strip[::COARSE_STEP, ::COARSE_STEP].ravel()
        thin = thin - thin.mean()
        left = weights @ thin**2 - ((lights @ thin).reshape(len(tape), -1) ** 2).sum(axis=1)
        scores: Floats = (tape @ thin) / np.sqrt(np.maximum(left, MIN_SPREAD_LEVELS))
        return scores

    def _at(self, levels: Floats, rows: Floats) -> Floats:
        """(F, R, C): what windows show of a picture (P, C) that has moved by rows (F,)."""
        first = np.floor(rows).astype(np.intp)
        part = (rows - first).astype(np.float32)[:, None, None]
        shown = levels.take(first[:, None] + np.arange(self._rows + 1), axis=0, mode="wrap")
        between: Floats = (1 - part) * shown[:, :-1] + part * shown[:, 1:]
        return between

    def settled(self, strips: Floats, rows: Floats, most_steps: int = FIT_STEPS) -> Laid:
        """Fit gain, its slope along the window, light and position by least squares, starting from places (F,).

        Outliers have no weight in the fit but full weight in the score, since a few pixels match in many places.
        """
        count, size = len(strips), self._rows * self._columns
        columns = np.empty((count, 3 + len(self._lights), size), np.float32)
        columns[:, 3:] = self._lights
        found = Laid(
            rows.copy(),
            np.full(count, np.inf),
            np.zeros(count),
            np.ones((count, self._rows, 1), np.float32),
            np.zeros((count, self._rows, self._columns), np.float32),
            np.zeros(count, bool),
        )
        trusted = np.ones((count, self._rows, self._columns), np.float32)
        open_ = np.arange(count)
        for steps_left in reversed(range(most_steps)):
            if not open_.size:
                break
            here, seen = found.rows[open_], strips[open_]
            weights = (self._at(self._known, here) > 1 - STILL_ROWS) * self._picture.weights
            shown = self._at(self._picture.levels, here)
            mean = (weights * shown).sum(axis=(1, 2)) / np.maximum(weights.sum(axis=(1, 2)), 1e-6)
            shown = shown - mean[:, None, None].astype(np.float32)
            columns = columns[: len(here)]  # those of the light are the same for all
            for column, levels in enumerate((shown, self._at(self._slopes, here - HALF), shown * self._along)):
                columns[:, column] = levels.reshape(-1, size)
            flat = (weights * trusted[open_]).reshape(len(here), 1, size)
            weighed = columns * flat
            normal = products(weighed, columns).astype(np.float64)
            hold = 1e-9 * np.trace(normal, axis1=1, axis2=2)[:, None, None] + 1e-9
            inverse = np.linalg.inv(normal + hold * np.eye(len(columns[0])))
            sides = (weighed @ seen.reshape(len(here), size, 1)).astype(np.float64)
            solution = (inverse @ sides)[..., 0]
            gain, step = solution[:, 0], solution[:, 1] / np.where(solution[:, 0] > 0, solution[:, 0], np.nan)
            left = seen - (solution[:, None].astype(np.float32) @ columns).reshape(seen.shape)
            usable = (gain >= MIN_CONTRAST_PART) & (np.abs(here + step - rows[open_]) <= MAX_PEAK_ROWS)
            found.is_there[open_] = usable
            found.rows[open_] = np.where(
                usable, here + limited(np.nan_to_num(step), -MAX_PEAK_ROWS, MAX_PEAK_ROWS), here
            )
            moves = usable & (np.abs(np.nan_to_num(step)) >= STILL_ROWS)
            ends = ~moves if steps_left else np.ones_like(moves)
            fit = _Fit(seen, weights, mean, weighed, inverse, solution, left, flat)
            self._tell(found, open_[ends], fit.part(ends))
            open_ = open_[moves]
            trusted[open_] = _trusted(left[moves], weights[moves])
        return found

    def _tell(self, found: Laid, which: Indices, fit: _Fit) -> None:
        """Store score, sigma and light of windows that have converged, (F',)."""
        if not which.size:
            return
        gain, usable = fit.solution[:, 0], found.is_there[which]
        found.score[which] = np.where(usable, self._match(fit.seen, fit.left, fit.weights), 0.0)
        left = fit.left.reshape(len(which), 1, -1)
        noise = (fit.flat * left**2).sum(axis=2)[:, 0] / fit.flat.sum(axis=2)[:, 0] * TOGETHER
        pulls = (fit.inverse[:, 1:2].astype(np.float32) @ fit.weighed * left).reshape(fit.left.shape).sum(axis=2)
        by_patch = np.add.reduceat(pulls, np.arange(PATCHES) * self._rows // PATCHES, axis=1)
        variance = np.maximum(fit.inverse[:, 1, 1] * noise, (by_patch**2).sum(axis=1))
        found.sigma_rows[which] = np.where(usable, np.sqrt(np.maximum(variance, 0.0)) / np.abs(gain), np.inf)
        gains = gain[:, None, None] + fit.solution[:, 2, None, None] * self._along
        found.gains[which] = gains = np.maximum(gains, 0.3 * gain[:, None, None])
        light = (fit.solution[:, None, 3:].astype(np.float32) @ self._lights).reshape(fit.left.shape)
        found.lights[which] = light - gains * fit.mean[:, None, None]

    def changes(self, rows: Floats, shifts: Floats) -> Floats:
        """(F, K, R, C): how windows change if their pixels are sampled elsewhere, by `shifts` (K, 2, R, C)."""
        down = self._at(self._slopes, rows - HALF)
        across = self._at(np.gradient(self._picture.levels, axis=1).astype(np.float32), rows)
        changes: Floats = down[:, None] * shifts[:, 0] + across[:, None] * shifts[:, 1]
        return changes

    def told(self, strips: Floats, where: Laid, changes: Floats) -> tuple[Floats, Floats]:
        """Set up least squares for changes of windows (F, K, R, C), in the tape's light, with their light fitted too.

        Return the normal matrix (K, K) and the right side (K,) for the residuals of windows (F, R, C) at `where`.
        """
        kinds, size = changes.shape[1], self._rows * self._columns
        normal, sides = np.zeros((kinds, kinds)), np.zeros(kinds)
        shown, slopes = self._at(self._picture.levels, where.rows), self._at(self._slopes, where.rows - HALF)
        weights = (self._at(self._known, where.rows) > 1 - STILL_ROWS) * self._picture.weights
        lit = (strips - where.lights) / where.gains - shown
        trusted = _trusted(lit, weights)
        for left, tape, slope, change, weight in zip(lit, shown, slopes, changes, weights * trusted, strict=True):
            own = np.concatenate([[tape.ravel(), slope.ravel(), (tape * self._along).ravel()], self._lights])
            flat = own * weight.ravel()
            both = np.concatenate([change.reshape(kinds, size), left.reshape(1, size)])
            shares = np.linalg.solve(flat @ own.T + 1e-3 * np.eye(len(own)), flat @ both.T)
            rest = both - shares.T @ own
            weighed = rest * weight.ravel()
            normal += weighed[:kinds] @ rest[:kinds].T
            sides += weighed[:kinds] @ rest[kinds]
        noise = NOISE_LEVELS**2 * ALIKE * len(strips)
        return normal / noise, sides / noise

    def _match(self, seen: Floats, left: Floats, weights: Floats) -> Floats:
        """(F,): the NCC of windows with their fits, from the residuals `left`, both without smooth light."""
        flat = weights.reshape(len(seen), 1, -1)
        lights = self._lights * flat
        normal = products(lights, self._lights).astype(np.float64) + 1e-6 * np.eye(len(self._lights))
        middle = seen.reshape(len(seen), -1, 1) - seen.mean(axis=(1, 2))[:, None, None]
        part = np.linalg.solve(normal, (lights @ middle).astype(np.float64)).astype(np.float32)
        plain = (flat * (middle[..., 0] - (part.swapaxes(1, 2) @ self._lights)[:, 0])[:, None] ** 2).sum(axis=(1, 2))
        unexplained = (weights * left**2).sum(axis=(1, 2)) / np.maximum(plain, 1e-6)
        return np.asarray(np.sqrt(np.maximum(1.0 - unexplained, 0.0)), np.float64)


def _lights(rows: int, columns: int, profile: Floats) -> Floats:
    """(5, R * C): the light modes of a window: constant, linear and quadratic along it, linear across it.

    The last is not light but the tape's average profile across it, (C,), which is the same at every position.
    """
    along, across = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    everywhere = np.broadcast_to(profile, along.shape)
    return np.stack([np.ones_like(along), along, along**2, across, everywhere]).reshape(5, -1).astype(np.float32)


def _profile(picture: TapePicture) -> Floats:
    """(C,): the tape's average profile across, such as a line along its ticks, beyond even light; of unit spread."""
    levels = _mean(picture.levels, picture.known.astype(np.float32)).astype(np.float64)
    even = np.stack([np.ones_like(levels), np.linspace(-1, 1, len(levels))])
    beyond = levels - np.linalg.lstsq(even.T, levels, rcond=None)[0] @ even
    profile: Floats = beyond / max(float(beyond.std()), NOISE_LEVELS)
    return profile


def _trusted(left: Floats, weights: Floats) -> Floats:
    """(F, R, C): 1 where residuals are no larger than usual for pixels with weight, else 0."""
    own = [explained(*each) for each in zip(left, weights, strict=True)]
    return np.stack(own) if own else np.zeros_like(left)


def first_tape(marks: DrawnMarks, turn: float | None, drawn: Floats, *, is_round: bool) -> TapePicture:
    """Return a tape as far as the panel picture shows it in its window (along, across), with all that lies over it."""
    shape = TapeShape.of_marks(marks, (len(drawn), drawn.shape[1]), turn, is_round=is_round)
    rows, step = rows_in_sight(shape), shape.step
    size = (2 * REACH_WINDOWS + 1) * len(rows) if turn is None else round(turn / step)
    weights = Unrolling(shape, rows, step).worth
    blank = np.zeros((size, drawn.shape[1]), np.float32)
    picture = TapePicture(shape, rows, step, blank, np.zeros(blank.shape, bool), weights, drawn)
    (here,) = picture.unroll(drawn)[None]
    levels, known = _composed(picture, here[None], _as_drawn(here))
    return replace(picture, levels=levels, known=known)


def _as_drawn(strip: Floats) -> Laid:
    """Return where the panel picture shows it, in its own light."""
    return Laid(
        np.zeros(1),
        np.zeros(1),
        np.ones(1),
        np.ones((1, len(strip), 1), np.float32),
        np.zeros((1, *strip.shape), np.float32),
        np.ones(1, bool),
    )


def learn_tape(strips: Sequence[Floats], given: TapePicture, marks: DrawnMarks) -> TapePicture:
    """Learn the tape as far as frames (along, across) show it; return it as given if they do not suffice."""
    drawn = softened(given.drawn)
    lit = [_in_light_of(drawn, softened(strip)) for strip in strips]
    if not lit:
        return given
    free = 1.0 - _still(lit)
    return _Learning(given, [drawn, *lit], free, marks).learned()


class _Learning:
    """Composes a tape from `windows`, the panel picture first; `free` is 1 where nothing stands still."""

    def __init__(self, given: TapePicture, windows: Sequence[Floats], free: Floats, marks: DrawnMarks) -> None:
        self._windows, self._free, self._marks = windows, free, marks
        self._picture = given
        self._use(given.shape)
        self._where = _as_drawn(self._strips[0])
        empty = np.zeros(len(windows) - 1, np.intp)
        self._where = Laid(
            *(np.concatenate([getattr(self._where, name)] * len(windows)) for name in _LAID)  # overwritten as found
        )
        self._is_placed = np.concatenate([[True], np.zeros(len(empty), bool)])
        self._compose()

    def learned(self) -> TapePicture:
        for _ in range(GROW_ROUNDS):
            found, rivals = TapeFinder(self._picture).laid(self._strips)
            left, other = 1.0 - found.score**2, 1.0 - rivals**2
            fits = found.is_there & (found.score >= SURE_SCORE) & (left < MUCH_BETTER * other) & (rivals < SURE_SCORE)
            fits &= ~self._is_placed
            if not fits.any():
                break
            fits &= left <= CLEARLY_WORSE * left[fits].min()
            self._where.put(fits, found.part(fits))
            self._is_placed |= fits
            self._settle()
            if self._picture.shape.is_round:
                self._refine()
        is_learned = int(self._is_placed.sum()) > 1
        return replace(self._picture, origin=float(self._where.rows[0]), is_learned=is_learned)

    def _use(self, shape: TapeShape) -> None:
        unroll = Unrolling(shape, self._picture.unrolled, self._picture.step)
        self._strips = np.stack([unroll.of_soft(window) for window in self._windows])
        weights = unroll.worth * limited(unroll.of_soft(self._free), 0.0, 1.0)
        self._picture = replace(self._picture, shape=shape, weights=weights.astype(np.float32))

    def _compose(self) -> None:
        which = np.flatnonzero(self._is_placed)
        levels, known = _composed(self._picture, self._strips[which], self._where.part(which))
        self._picture = replace(self._picture, levels=levels, known=known)

    def _settle(self) -> float:
        """Fit the placed views again and compose the tape anew; return the part left unexplained."""
        which = np.flatnonzero(self._is_placed)
        left = 1.0
        for _ in range(SETTLE_ROUNDS):
            found = TapeFinder(self._picture).settled(self._strips[which], self._where.rows[which])
            self._where.put(which[found.is_there], found.part(found.is_there))
            left = float(np.mean(1.0 - found.score**2))
            self._compose()
        return left

    def _refine(self) -> None:
        """Refine the tape's shape from the views, as long as that explains them better."""
        best, kept = self._settle(), self._state()
        for _ in range(REFINE_ROUNDS):
            self._use(self._picture.shape.refined(self._marks, *self._told()))
            left = self._settle()
            if left * MUCH_BETTER <= best:
                kept = self._state()
            best = min(best, left)
        self._picture, self._strips, self._where = kept

    def _state(self) -> tuple[TapePicture, Floats, Laid]:
        return self._picture, self._strips, self._where.part(np.arange(len(self._strips)))

    def _told(self) -> tuple[Floats, Floats]:
        """Set up the views' least squares for the shape's parameters: (4, 4) and (4,).

        A residual that all views of a place share was absorbed by the picture of the tape, and is left out.
        """
        picture, size = self._picture, len(self._picture.levels)
        which = np.flatnonzero(self._is_placed)
        where = self._where.part(which)
        finder = TapeFinder(picture)
        changes = finder.changes(where.rows, picture.unroll.shifts(picture.shape.trials()))
        rows = (np.rint(where.rows).astype(np.intp)[:, None] + np.arange(len(picture.weights))) % size
        facing = _facing(picture.weights)
        shared, total = np.zeros((changes.shape[1], *picture.levels.shape)), np.zeros(picture.levels.shape)
        for own, at in zip(changes, rows, strict=True):
            total[at] += facing
            shared[:, at] += facing * own
        shared /= np.maximum(total, 1e-9)
        return finder.told(self._strips[which], where, changes - shared[:, rows].swapaxes(0, 1).astype(np.float32))


_LAID = ("rows", "sigma_rows", "score", "gains", "lights", "is_there")


def _composed(picture: TapePicture, strips: Floats, where: Laid) -> tuple[Floats, Mask]:
    """Return the whole tape (P, C) as views (K, R, C) show it, and which of its cells (P, C) they show."""
    size, (rows, columns) = len(picture.levels), picture.weights.shape
    facing = _facing(picture.weights)
    first = np.floor(where.rows).astype(np.intp)
    part = (where.rows - first).astype(np.float32)[:, None, None]
    lit = (strips - where.lights) / where.gains
    # Most of a tape without an end is never seen: only the rows that are take room.
    seen, at = np.unique((first[:, None] + 1 + np.arange(rows - 1)) % size, return_inverse=True)
    every = np.arange(len(strips))[:, None]
    levels, weights = (np.zeros((len(strips), len(seen), columns), np.float32) for _ in range(2))
    levels[every, at] = part * lit[:, :-1] + (1 - part) * lit[:, 1:]
    weights[every, at] = np.minimum(facing[:-1], facing[1:])
    mean = _mean(levels, weights)
    off = np.abs(levels - mean)
    spread = np.sqrt(_mean(off**2, weights))
    agreed = weights * (off <= OUTLIER_SPREADS * np.maximum(spread, NOISE_LEVELS) / 2)
    whole, known = np.zeros((size, columns), np.float32), np.zeros((size, columns), bool)
    whole[seen] = np.where(agreed.any(axis=0), _mean(levels, agreed), mean)
    known[seen] = 2 * weights.max(axis=0) > _facing(np.array(HALF))
    return whole, known


def _facing(weights: Floats) -> Floats:
    """Return the weight of a view's pixels in the tape: those seen from the side count little."""
    told: Floats = np.square(np.square(weights))
    return told


def _mean(levels: Floats, weights: Floats) -> Floats:
    mean: Floats = (weights * levels).sum(axis=0) / np.maximum(weights.sum(axis=0), 1e-9)
    return mean


def _in_light_of(reference: Floats, window: Floats) -> Floats:
    """Return a window scaled to the median and spread of another."""
    spread = max(float(window.std()), MIN_SPREAD_LEVELS)
    lit: Floats = (window - np.median(window)) / spread * float(reference.std()) + np.median(reference)
    return lit


def _still(windows: Sequence[Floats]) -> Floats:
    """(along, across): 1 where windows show the same in most frames, whatever the tape does, else 0.

    That is either an edge, or the inside of something that lies over the tape. The inside counts if its level differs
    from the rest along the window by more than the tape's levels usually change, and if it outweighs everything that
    moves, since it would then match at every position. A small part of the window that these enclose counts, too.
    """
    views = np.stack(windows)
    middle = median_of(views)
    off = np.abs(views - middle)
    moves = np.quantile(off, MOVING_QUANTILE, axis=0)
    edges = np.abs(np.diff(middle, axis=0))
    edge = np.maximum(np.pad(edges, ((1, 0), (0, 0))), np.pad(edges, ((0, 1), (0, 0))))
    half = len(middle) // 2
    slope = np.median(middle[half:] - middle[: len(middle) - half], axis=0) / half
    level = middle - slope * np.arange(len(middle))[:, None]
    beside = np.abs(level - np.median(level, axis=0))
    usual = np.sqrt(np.mean(np.square(off), axis=(0, 1)))
    is_edge = (edge > NOISE_LEVELS) & (moves < edge / 2)
    is_over = (beside > OUTLIER_SPREADS * np.maximum(usual, NOISE_LEVELS)) & (moves < beside / 2)
    is_over &= np.square(beside[is_over]).sum() > np.square(off).mean(axis=0).sum()
    grown = (
        cv2.dilate(still.astype(np.float32), np.ones(reach, np.uint8))
        for still, reach in ((is_edge, (3, 1)), (is_over, (5, 5)))
    )
    return _with_enclosed(np.asarray(np.maximum(*grown), np.float32))


def _with_enclosed(still: Floats) -> Floats:
    """(along, across): also 1 where what stands still encloses a small part of the window, as a readout's frame does.

    The digits of a readout over the tape change, but not as the tape does. A large part is the tape itself, between an
    index and the ends of its window.
    """
    _, labels = cv2.connectedComponents((still < HALF).astype(np.uint8), connectivity=4)
    is_small = np.bincount(labels.ravel()) < HALF**2 * labels.size
    is_small[np.union1d(labels[0], labels[-1])] = False
    enclosed = is_small[labels] & (still < HALF)
    return np.where(enclosed, np.float32(1.0), still)


class TapeReader:
    """Reads one tape."""

    def __init__(self, gauge: Gauge, grid: WindowGrid, picture: TapePicture) -> None:
        self._drawn, self._picture = DrawnTape.of(gauge, grid), picture
        self._finder = TapeFinder(picture)
        self._least = SCORE_THRESHOLD if picture.is_whole else SURE_SCORE

    def read(self, strips: Floats, place_sigmas_px: Floats) -> list[dict[str, Reading]]:
        """Read F frames of its window, (F, R, C) as they are sampled.

        While part of a tape is unknown, that part may look like a known one, so a match must be better; and if two
        known parts look alike, an unknown one may look like them too. A place of which less than most is known is not
        read: one or two numerals would decide. A tape to which no frame of the flight could be added is not read.
        """
        picture, drawn = self._picture, self._drawn
        windows = np.stack([picture.unroll(window) for window in drawn.along(strips)])
        found, rivals = self._finder.laid(windows)
        base = picture.shape.value_at(drawn.index_px)
        own_sigma, per_unit = picture.shape.sigmas(drawn.marks, drawn.index_px)
        a_pixel = picture.step / ROW_PX
        is_read = found.is_there & (found.score >= self._least)
        is_read &= 1.0 - rivals**2 > CLEARLY_WORSE * (1.0 - found.score**2)
        is_read &= picture.is_whole | ((rivals < SURE_SCORE) & (self._finder.part_known(found.rows) >= 1.0 - HALF**2))
        is_read &= picture.is_learned
        readings = []
        for number, place_sigma_px in enumerate(place_sigmas_px.tolist()):
            moved = picture.moved(float(found.rows[number]))
            away = moved if drawn.turn is None else (moved + drawn.turn / 2) % drawn.turn - drawn.turn / 2
            parts = found.sigma_rows[number] * picture.step, own_sigma, per_unit * away, place_sigma_px * a_pixel
            status = Status.READ if is_read[number] else Status.MISSING
            value = base + moved
            scale = 1.0 if drawn.turn is None else FULL_CIRCLE_DEG / drawn.turn
            angle = value if drawn.turn is None else value % drawn.turn * scale
            sigma = math.hypot(*(float(part) for part in parts)) * scale
            readings.append({drawn.name: Reading(status, float(angle), sigma, float(found.score[number]))})
        return readings


@dataclass(frozen=True, slots=True)
class DrawnTape:
    """One tape as it is described, in cells of its window along and across it."""

    name: str
    goes_across: bool
    marks: DrawnMarks
    index_px: float
    turn: float | None
    is_round: bool

    @classmethod
    def of(cls, gauge: Gauge, grid: WindowGrid) -> DrawnTape:
        """Return the tape of a gauge that has one."""
        own = gauge.tape
        if own is None:
            raise AssertionError(f"{gauge.name} is no tape")
        goes_across = own.moves == ACROSS
        width_px, height_px = grid.cell_px
        along_px, across_px = (width_px, height_px) if goes_across else (height_px, width_px)
        marks = [(x / along_px - 0.5, y / across_px - 0.5, value) for x, y, value in own.drawn(grid.corners)]
        index = own.index_px(grid.corners) / along_px - 0.5
        return cls(own.name, goes_across, marks, index, own.turn, own.drum)

    def along(self, strips: Floats) -> Floats:
        """(..., along, across): turn windows as they are sampled."""
        return np.ascontiguousarray(np.swapaxes(strips, -1, -2)) if self.goes_across else strips


class TapeKind(WindowKind):
    """A scale that slides or turns behind an index."""

    def owns(self, gauge: Gauge) -> bool:
        return gauge.tape is not None

    def first(self, gauge: Gauge, grid: WindowGrid, drawn: UnwrappedGauge) -> TapePicture:
        own = DrawnTape.of(gauge, grid)
        return first_tape(own.marks, own.turn, own.along(drawn), is_round=own.is_round)

    def first_look(self, drawn: DrawnInstrument) -> Look:
        own = DrawnTape.of(drawn.gauge, drawn.window)
        along, across = own.along(drawn.strip).shape
        if not len(rows_in_sight(TapeShape.of_marks(own.marks, (along, across), own.turn, is_round=own.is_round))):
            raise PanelError(f"gauges[{drawn.index}].tape.marks", "tell of a tape that its window shows nothing of")
        return super().first_look(drawn)

    def learned(
        self, gauge: Gauge, grid: WindowGrid, strips: Sequence[UnwrappedGauge], known: TapePicture
    ) -> TapePicture:
        own = DrawnTape.of(gauge, grid)
        return known if known.is_learned else learn_tape([own.along(strip) for strip in strips], known, own.marks)

    def window_reader(self, gauge: Gauge, grid: WindowGrid, picture: TapePicture) -> TapeReader:
        return TapeReader(gauge, grid, picture)
