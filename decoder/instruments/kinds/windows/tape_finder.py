"""Finding where a tape lies in windows: searched at all positions of what is known of it, then fitted."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property, reduce

import cv2
import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.instruments.kinds.windows.tape_picture import Laid, TapePicture
from decoder.instruments.kinds.windows.tape_shape import ROW_PX
from decoder.instruments.thresholds import CLEARLY_WORSE, STILL_ROWS
from decoder.matching.correlation import ROUNDING, Spectrum, explained, products
from decoder.matching.needle_search import COARSE_STEP
from decoder.matching.thresholds import MAX_PEAK_ROWS, MIN_CONTRAST_PART
from decoder.panel.arrays import Floats, Indices, Mask, limited
from decoder.registration.thresholds import LIKELY_SCORE, MIN_SPREAD_LEVELS, NOISE_LEVELS

FIT_STEPS = 6
# Windows fitted together; more take memory, and are not faster.
BLOCK = 16
# Places that are compared with the best.
RIVALS = 3
# Steps after which a rival's score is known to a thousandth.
RIVAL_STEPS = 2
# Of the cells in which two places differ, the part that has to match.
MOST = 0.9
# Blur that is as large as a digit.
DIGIT_PX = 4.0
# Errors are correlated within patches: this many along the window.
PATCHES = 12
# Neighbouring samples have correlated errors: one in this many is independent.
TOGETHER = 6.0
# All views share the shape's errors, so together they have no more information than one would, and samples have less
# than their number suggests.
ALIKE = 20.0


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


@dataclass(frozen=True, slots=True)
class Matches:
    """Where a tape was found in F windows, how well the next best place matches (F,), and the rows (F, N) of others."""

    found: Laid
    rivals: Floats
    others: Floats

    @property
    def is_clear(self) -> Mask:
        """(F,): whether the next best place leaves so much more unexplained that it cannot be the right one."""
        clear: Mask = CLEARLY_WORSE * (1.0 - self.found.score**2) < 1.0 - self.rivals**2
        return clear


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

    def laid(self, strips: Floats) -> Matches:
        """Find the tape in F unrolled windows (F, R, C)."""
        scores = np.stack([self._search.scores(strip) for strip in strips])
        best = scores.argmax(axis=1)
        found = self.settled(strips, best.astype(np.float64))
        apart = np.abs(np.arange(scores.shape[1]) - best[:, None])
        is_apart = 8 * np.minimum(apart, self._size - apart) > self._rows
        elsewhere = np.where(_is_peak(scores) & is_apart, scores, 0.0)
        order = np.argsort(-elsewhere, axis=1, kind="stable")[:, :RIVALS]
        others = order.astype(np.float64)
        rivals = limited(np.take_along_axis(elsewhere, order[:, :1], axis=1)[:, 0], 0.0, 1.0)
        doubt = np.flatnonzero(found.is_there & (rivals >= LIKELY_SCORE))
        if doubt.size:
            other = self.settled(strips[doubt], others[doubt, 0], RIVAL_STEPS)
            rivals[doubt] = np.maximum(rivals[doubt], other.score)
            is_better = other.is_there & (other.score > found.score[doubt])
            better = doubt[is_better]
            rivals[better], others[better, 0] = found.score[better], found.rows[better]
            found.put(better, self.settled(strips[better], other.rows[is_better]))
        return Matches(found, rivals, others)

    def explained(self, strips: Floats, found: Laid, which: Indices) -> Mask:
        """(len(which),): whether these of the windows (F, R, C) show what is at their places, digit by digit.

        A place that was never seen may differ from them in one digit of each numeral, which a score over the whole
        window hardly shows. Around it a 0 in place of an 8 leaves a sixteenth of what is printed there, and most
        digits a third; half of the former may be left. The window may be more or less sharp than what was learned.
        """
        is_explained = np.zeros(len(which), bool)
        for place, number in enumerate(which.tolist()):
            fit = found.part(np.array([number]))
            own = ((self._at(self._known, fit.rows) > 1 - STILL_ROWS) * self._picture.weights)[0]
            shown = (fit.gains * self._at(self._picture.levels, fit.rows) + fit.lights)[0]
            shown = _as_sharp(own, shown, strips[number])
            left = _detail(own, strips[number] - shown)
            is_explained[place] = _part_left(own, _detail(own, shown), left) < HALF**5
        return is_explained

    def told_apart(self, strips: Floats, matches: Matches, which: Indices) -> Mask:
        """(len(which),): whether these of the windows (F, R, C) show their places, and none that matches next best.

        If one of those matches better once it is fitted, it takes the other's place in `matches`.
        """
        is_told = matches.rivals[which] < LIKELY_SCORE
        for place, number in zip(np.flatnonzero(~is_told).tolist(), which[~is_told].tolist(), strict=True):
            rows = np.append(matches.found.rows[number], matches.others[number])
            fits = self.settled(np.broadcast_to(strips[number], (len(rows), *strips[number].shape)), rows)
            first, *others = np.argsort(-fits.score, kind="stable").tolist()
            matches.found.put(np.array([number]), fits.part(np.array([first])))
            is_told[place] = all(
                self._is_told_apart(strips[number], fits, (first, other)) for other in others if fits.is_there[other]
            )
        return is_told

    def _is_told_apart(self, strip: Floats, fits: Laid, pair: tuple[int, int]) -> bool:
        """Whether a window shows what is at the best place of the tape, rather than what is at another or at neither.

        Places often differ in a digit only, while all that they share, such as ticks, matches well. Where they differ,
        a window that shows neither is half way between them, and its digit is as unlike the one as the other: about
        half stays unexplained.
        """
        best, other = pair
        shown = fits.gains * self._at(self._picture.levels, fits.rows) + fits.lights
        own, its = ((self._at(self._known, fits.rows) > 1 - STILL_ROWS) * self._picture.weights)[[best, other]]
        unlike, both = shown[best] - shown[other], np.minimum(own, its)
        differ = both * (_around(both * unlike**2) > NOISE_LEVELS**2)
        if (differ * (strip - shown[other]) * unlike).sum() < (1.0 - HALF**2) * (differ * unlike**2).sum():
            return False
        if not differ.any() and both.sum() > HALF * own.sum():
            return False
        # Where the other place is not known, nothing is known to be alike.
        apart = np.where(its > 0, unlike, _detail(own, shown[best]))
        return _part_left(own, apart, strip - shown[best]) < HALF**2

    @cached_property
    def _search(self) -> _PlaceSearch:
        return _PlaceSearch(self._picture, self._lights, self._parts_known)

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
        parts = [
            self._settled(strips[first : first + BLOCK], rows[first : first + BLOCK], most_steps)
            for first in range(0, max(len(strips), 1), BLOCK)
        ]
        return reduce(Laid.with_others, parts)

    def _settled(self, strips: Floats, rows: Floats, most_steps: int) -> Laid:
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
        noise = (fit.flat * left**2).sum(axis=2)[:, 0] / np.maximum(fit.flat.sum(axis=2)[:, 0], 1e-9) * TOGETHER
        pulls = (fit.inverse[:, 1:2].astype(np.float32) @ fit.weighed * left).reshape(fit.left.shape).sum(axis=2)
        by_patch = np.add.reduceat(pulls, np.arange(PATCHES) * self._rows // PATCHES, axis=1)
        variance = np.maximum(fit.inverse[:, 1, 1] * noise, (by_patch**2).sum(axis=1))
        found.sigma_rows[which] = np.where(usable, np.sqrt(np.maximum(variance, 0.0)) / np.abs(gain), np.inf)
        gains = gain[:, None, None] + fit.solution[:, 2, None, None] * self._along
        gains = np.maximum(gains, 0.3 * gain[:, None, None])
        light = (fit.solution[:, None, 3:].astype(np.float32) @ self._lights).reshape(fit.left.shape)
        at = _nearest_known(fit.weights)
        found.gains[which] = gains = np.take_along_axis(gains, at, axis=1)
        found.lights[which] = np.take_along_axis(light, at, axis=1) - gains * fit.mean[:, None, None]

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


class _PlaceSearch:
    """Matches a window with a tape at every row, on every `COARSE_STEP`-th column.

    All places are matched at once, by Fourier transforms along the tape. What smooth light explains at a place, it
    explains there in the tape and in the window, and is left out in both. Columns of which the same is known are summed
    before they are transformed; that is most of them.
    """

    def __init__(self, picture: TapePicture, lights: Floats, parts_known: Floats) -> None:
        self._weights = picture.weights[:, ::COARSE_STEP].astype(np.float64)
        rows, columns = self._weights.shape
        self._lights = lights.reshape(len(lights), *picture.weights.shape)[..., ::COARSE_STEP].astype(np.float64)
        self._count = len(picture.levels)
        self._length = cv2.getOptimalDFTSize(self._count + rows)
        at = np.arange(self._count + rows) % self._count  # past its end, a tape begins again
        known = picture.known[at, ::COARSE_STEP].astype(np.float64)
        levels = picture.levels[at, ::COARSE_STEP].astype(np.float64)
        levels = known * (levels - (known * levels).sum() / max(float(known.sum()), 1.0))
        alike, group = np.unique(known, axis=1, return_inverse=True)
        self._groups = np.eye(alike.shape[1])[group.ravel()]
        self._known, self._tape, squared = (
            np.fft.rfft(each, self._length, axis=0) for each in (alike, levels, levels**2)
        )
        count = len(lights)
        pairs = self._lights[:, None] * self._lights
        normal = self._over_known(pairs.reshape(-1, rows, columns)).T.reshape(-1, count, count)
        hold = 1e-6 * (np.trace(normal, axis1=1, axis2=2) + 1e-6)[:, None, None] * np.eye(count)
        self._inverse = np.linalg.inv(normal + hold)
        self._tape_light = self._sums(self._tape, self._weights * self._lights).T
        (squares,) = self._sums(squared, self._weights[None])
        squares -= self._explained(self._tape_light, self._tape_light)
        (seen,) = self._over_known(np.ones((1, rows, columns)))
        is_plain = squares < seen * (MIN_SPREAD_LEVELS * NOISE_LEVELS) ** 2
        is_searched = (parts_known >= HALF) & ~is_plain
        self._length_of_tape = np.where(is_searched, np.sqrt(np.maximum(squares, 1e-9)), np.inf)

    def scores(self, strip: Floats) -> Floats:
        """(N,): the NCC of a window (R, C) with the tape at each place; 0 where too little of that is known."""
        thin = strip[:, ::COARSE_STEP].astype(np.float64)
        thin = thin - thin.mean()
        own = self._over_known(np.concatenate([self._lights * thin, thin[None] ** 2]))
        light = own[:-1].T
        (both,) = self._sums(self._tape, (self._weights * thin)[None])
        left = own[-1] - self._explained(light, light)
        matched = both - self._explained(self._tape_light, light)
        scores: Floats = matched / (self._length_of_tape * np.sqrt(np.maximum(left, MIN_SPREAD_LEVELS)))
        return scores

    def _over_known(self, windows: Floats) -> Floats:
        """(M, N): the weighted sums of windows (M, R, C) over what is known of a tape at each place."""
        return self._sums(self._known, (windows * self._weights) @ self._groups)

    def _sums(self, tape: Spectrum, windows: Floats) -> Floats:
        """(M, N): the sums of products of windows (M, R, C) with a tape at each place."""
        spectra = np.fft.rfft(windows, self._length, axis=1).conj()
        sums: Floats = np.fft.irfft((spectra * tape).sum(axis=2), self._length, axis=1)[:, : self._count]
        return sums

    def _explained(self, one: Floats, other: Floats) -> Floats:
        """(N,): what light explains of a product, given the products (N, 5) of both with its modes."""
        told: Floats = np.einsum("na,nab,nb->n", one, self._inverse, other)
        return told


def _detail(own: Floats, shown: Floats) -> Floats:
    """(R, C): what levels show beyond their mean around each cell, where they have weight."""
    plain: Floats = shown - _around(own * shown) / np.maximum(_around(own), ROUNDING)
    return plain


def _as_sharp(own: Floats, shown: Floats, seen: Floats) -> Floats:
    """(R, C): what a place shows, as sharp as a window: a little blur, along any line, adds second differences."""
    sure = cv2.erode(own, np.ones((3, 3), np.uint8)).ravel()
    along, across = np.gradient(shown)
    modes = np.stack([*np.gradient(along), np.gradient(across, axis=1)]).reshape(3, -1)
    weighed = modes * sure
    parts = np.linalg.solve(weighed @ modes.T + ROUNDING * np.eye(3), weighed @ (seen - shown).ravel())
    return np.asarray(shown + (parts @ modes).reshape(shown.shape), np.float32)


def _part_left(own: Floats, told: Floats, left: Floats) -> float:
    """Return the part of `told` (R, C) that a residual `left` leaves around most cells that tell; 1 if none does.

    The noise, which is what it usually is around a cell, is left out of account.
    """
    size, weight, left = _around(own * told**2), _around(own), _around(own * left**2)
    tells = size > max(NOISE_LEVELS**2, HALF**3 * float(size.max()))
    if not tells.any():
        return 1.0
    noise = np.median(left[own > 0] / weight[own > 0])
    return float(np.quantile((left[tells] - noise * weight[tells]) / size[tells], MOST))


def _around(levels: Floats) -> Floats:
    """(R, C): the mean around each cell, over the size of a digit."""
    mean = cv2.GaussianBlur(levels.astype(np.float32), (0, 0), sigmaX=DIGIT_PX, sigmaY=DIGIT_PX / ROW_PX)
    return np.asarray(mean, np.float32)


def _is_peak(scores: Floats) -> Mask:
    """(F, N): whether a place matches at least as well as those beside it."""
    higher = np.maximum(np.roll(scores, 1, axis=1), np.roll(scores, -1, axis=1))
    peaks: Mask = scores >= higher
    return peaks


def _lights(rows: int, columns: int, profile: Floats) -> Floats:
    """(5, R * C): the light modes of a window: constant, linear and quadratic along it, linear across it.

    The last is not light but the tape's average profile across it, (C,), which is the same at every position.
    """
    along, across = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    everywhere = np.broadcast_to(profile, along.shape)
    return np.stack([np.ones_like(along), along, along**2, across, everywhere]).reshape(5, -1).astype(np.float32)


def _profile(picture: TapePicture) -> Floats:
    """(C,): the tape's average profile across, such as a line along its ticks, beyond even light; of unit spread."""
    levels = _mean_where(picture.known, picture.levels)
    even = np.stack([np.ones_like(levels), np.linspace(-1, 1, len(levels))])
    beyond = levels - np.linalg.lstsq(even.T, levels, rcond=None)[0] @ even
    profile: Floats = beyond / max(float(beyond.std()), NOISE_LEVELS)
    return profile


def _trusted(left: Floats, weights: Floats) -> Floats:
    """(F, R, C): 1 where residuals are no larger than usual for pixels with weight, else 0."""
    own = [explained(*each) for each in zip(left, weights, strict=True)]
    return np.stack(own) if own else np.zeros_like(left)


def _nearest_known(weights: Floats) -> Indices:
    """(F, R, 1): the row of a window nearest to each that has weight (F, R, C).

    The light of what is not known is taken from there. Extrapolated, its slopes would be handed on from each view to
    the next, and grow.
    """
    has_weight = weights.max(axis=2) > 0
    rows = weights.shape[1]
    first, last = has_weight.argmax(axis=1), rows - 1 - has_weight[:, ::-1].argmax(axis=1)
    nearest: Indices = limited(np.arange(rows)[None], first[:, None], last[:, None])[..., None]
    return nearest


def _mean_where(known: Mask, levels: Floats) -> Floats:
    """(C,): the mean of known levels (P, C) by column, 0 where there are none."""
    mean: Floats = (known * levels.astype(np.float64)).sum(axis=0) / np.maximum(known.sum(axis=0), 1e-9)
    return mean
