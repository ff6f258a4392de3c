"""Learning a tape from windows that each show a part of it.

At first only the part in the panel picture is known. A window that overlaps the known part, and matches it well and
nowhere else, adds some more, until none does. The best match is added before the next window is compared: this keeps a
window from being taken for a similar part of the tape while its own is still unknown. Where all windows agree,
something stands still in them, such as a lubber line; that has no weight. Nor has anything that the tape shows at every
position, such as a line along its ticks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from decoder.imaging.sorting import median_of
from decoder.imaging.thresholds import HALF
from decoder.instruments.kinds.windows.tape_finder import TapeFinder
from decoder.instruments.kinds.windows.tape_picture import Laid, TapePicture, composed, facing_weights
from decoder.instruments.kinds.windows.tape_shape import DrawnMarks, TapeShape, Unrolling, rows_in_sight, softened
from decoder.instruments.thresholds import CLEARLY_WORSE, SURE_SCORE
from decoder.matching.thresholds import MUCH_BETTER, OUTLIER_SPREADS
from decoder.panel.arrays import Floats, Mask, limited
from decoder.registration.thresholds import MIN_SPREAD_LEVELS, NOISE_LEVELS

# Room on a tape without an end, in windows: its last view, one that a further view may show at either end, and one that
# keeps the ends apart.
ROOM_WINDOWS = 3
# Up to this part of a sample's frames may show the same position without spoiling the test of what stands still.
MOVING_QUANTILE = 0.8
SETTLE_ROUNDS, REFINE_ROUNDS = 2, 4


def first_tape(marks: DrawnMarks, turn: float | None, drawn: Floats, *, is_round: bool) -> TapePicture:
    """Return a tape as far as the panel picture shows it in its window (along, across), with all that lies over it."""
    shape = TapeShape.of_marks(marks, (len(drawn), drawn.shape[1]), turn, is_round=is_round)
    rows, step = rows_in_sight(shape), shape.step
    size = ROOM_WINDOWS * len(rows) if turn is None else round(turn / step)
    weights = Unrolling(shape, rows, step).worth
    blank = np.zeros((size, drawn.shape[1]), np.float32)
    picture = TapePicture(
        shape, rows, step, blank, np.zeros(blank.shape, bool), weights, drawn, np.ones_like(drawn), -size / 2
    )
    return TapeMosaic(picture, marks).picture


def learn_tape(strips: Sequence[Floats], given: TapePicture, marks: DrawnMarks) -> TapePicture:
    """Learn the tape as far as frames (along, across) show it; return it as given if they do not suffice."""
    if not strips:
        return given
    lit = _lit(given, strips)
    still = _still(lit)
    still = np.maximum(still, _still(_lit_alike(lit, still)))
    mosaic = TapeMosaic(replace(given, free=1.0 - still), marks)
    mosaic.learn(lit)
    return mosaic.picture


class TapeMosaic:
    """Composes a tape from views of it: windows (along, across) of which the first is the panel picture's."""

    def __init__(self, given: TapePicture, marks: DrawnMarks) -> None:
        self._marks, self._picture = marks, given
        self._windows = [softened(given.drawn), *given.views]
        self._where = Laid.at([given.origin, *given.rows_of_views], given.weights.shape)
        self._others: list[Floats] = []
        self._is_known = np.empty(0, bool)
        self._strips: Floats = np.empty((0, *given.weights.shape), np.float32)
        self._use(given.shape)
        self._compose()
        if given.is_learned:
            self._settle()

    @property
    def picture(self) -> TapePicture:
        """The tape as far as it is known by now; it is learned if any window was added to the panel picture's."""
        origin, *rows = self._where.rows.tolist()
        return replace(
            self._picture,
            origin=origin,
            is_learned=bool(rows),
            views=tuple(self._windows[1:]),
            rows_of_views=tuple(rows),
        )

    def learn(self, lit: Sequence[Floats]) -> None:
        """Add those of a sample's windows, from `_lit`, that overlap what is known, the best first."""
        left = list(lit)
        while left:
            found, fits = self._matches(left)
            if not fits.any():
                break
            added = self._add(left, found, fits)
            left = [window for window, is_added in zip(left, added.tolist(), strict=True) if not is_added]

    def complete(self, windows: Sequence[Floats]) -> list[bool]:
        """Add what further windows show beyond what is known; return for all of them so far whether it is known now."""
        wanted = np.arange(len(self._others), len(self._others) + len(windows))
        self._others += _lit(self._picture, windows)
        self._is_known = np.concatenate([self._is_known, np.zeros(len(windows), bool)])
        while wanted.size:
            found, fits = self._matches([self._others[each] for each in wanted.tolist()])
            if not fits.any():
                break
            is_known = TapeFinder(self._picture).part_known(found.rows) >= 1.0 - HALF**2
            added = self._add([self._others[each] for each in wanted.tolist()], found, fits)
            self._is_known[wanted[added | (fits & is_known)]] = True
            wanted = np.flatnonzero(~self._is_known)  # more of them may match now
        told: list[bool] = self._is_known.tolist()
        return told

    def _matches(self, windows: Sequence[Floats]) -> tuple[Laid, Mask]:
        """Find windows in the tape as far as it is known, and tell which match well there and nowhere else."""
        strips, finder = self._unrolled(windows), TapeFinder(self._picture)
        matches = finder.laid(strips)
        found = matches.found
        fits = found.is_there & (found.score >= SURE_SCORE)
        if self._picture.shape.is_round:  # until its shape is refined, a drum's numerals do not match exactly
            left, other = 1.0 - found.score**2, 1.0 - matches.rivals**2
            fits &= (matches.rivals < SURE_SCORE) & (left < MUCH_BETTER * other)
        else:
            fits[fits] = finder.told_apart(strips, matches, np.flatnonzero(fits))
            fits[fits] = finder.explained(strips, found, np.flatnonzero(fits))
        return found, np.asarray(fits, bool)

    def _add(self, windows: Sequence[Floats], found: Laid, fits: Mask) -> Mask:
        """Compose the tape anew with the best of the windows that fit; return which those are."""
        left = 1.0 - found.score**2
        best = fits & (left <= CLEARLY_WORSE * left[fits].min())
        self._windows += [windows[each] for each in np.flatnonzero(best).tolist()]
        before = len(self._strips)
        self._where = self._where.with_others(found.part(best))
        self._strips = self._unrolled(self._windows)
        if self._picture.shape.is_round:
            self._refine()
        else:
            self._settle(before)
        return np.asarray(best, bool)

    def _unrolled(self, windows: Sequence[Floats]) -> Floats:
        unroll = self._picture.unroll
        return np.stack([unroll.of_soft(window) for window in windows])

    def _use(self, shape: TapeShape) -> None:
        self._picture = replace(self._picture, shape=shape)
        unroll = self._picture.unroll
        weights = unroll.worth * limited(unroll.of_soft(self._picture.free), 0.0, 1.0)
        self._picture = replace(self._picture, weights=weights.astype(np.float32))
        self._strips = self._unrolled(self._windows)

    def _compose(self) -> None:
        if self._picture.shape.turn is None:
            self._make_room()
        levels, known = composed(self._picture, self._strips, self._where)
        self._picture = replace(self._picture, levels=levels, known=known)

    def _make_room(self) -> None:
        """Lengthen a tape without an end, which is cyclic here too, so that its ends never meet."""
        picture, window = self._picture, len(self._picture.weights)
        moved = picture.moved(self._where.rows) / picture.step
        missing = math.ceil(np.ptp(moved)) + ROOM_WINDOWS * window - len(picture.levels)
        longer = np.pad(picture.levels, ((0, max(missing, 0)), (0, 0)))
        self._where.rows[:] = picture.origin + moved
        self._picture = replace(picture, levels=longer, lowest=float(moved.min()) - window)

    def _settle(self, first: int = 0) -> float:
        """Fit the views from the `first` on again and compose the tape anew; return the part left unexplained."""
        left = 1.0
        for _ in range(SETTLE_ROUNDS):
            self._compose()
            found = TapeFinder(self._picture).settled(self._strips[first:], self._where.rows[first:])
            self._where.put(first + np.flatnonzero(found.is_there), found.part(found.is_there))
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
        where = self._where
        finder = TapeFinder(picture)
        changes = finder.changes(where.rows, picture.unroll.shifts(picture.shape.trials()))
        rows = (np.rint(where.rows).astype(np.intp)[:, None] + np.arange(len(picture.weights))) % size
        facing = facing_weights(picture.weights)
        shared, total = np.zeros((changes.shape[1], *picture.levels.shape)), np.zeros(picture.levels.shape)
        for own, at in zip(changes, rows, strict=True):
            total[at] += facing
            shared[:, at] += facing * own
        shared /= np.maximum(total, 1e-9)
        return finder.told(self._strips, where, changes - shared[:, rows].swapaxes(0, 1).astype(np.float32))


def _lit(picture: TapePicture, windows: Sequence[Floats]) -> list[Floats]:
    """Soften windows (along, across), and bring them into the panel picture's light."""
    drawn = softened(picture.drawn)
    return [_in_light_of(drawn, softened(window)) for window in windows]


def _in_light_of(reference: Floats, window: Floats) -> Floats:
    """Return a window scaled to the median and spread of another."""
    spread = max(float(window.std()), MIN_SPREAD_LEVELS)
    lit: Floats = (window - np.median(window)) / spread * float(reference.std()) + np.median(reference)
    return lit


def _lit_alike(windows: Sequence[Floats], still: Floats) -> list[Floats]:
    """Bring windows into one light by what stands still in them: their spread also tells how much print they show."""
    is_still = still >= HALF
    if not is_still.any():
        return list(windows)
    middle = median_of(np.stack(windows))
    usual = middle[is_still] - middle[is_still].mean()
    alike = []
    for window in windows:
        own = window[is_still] - window[is_still].mean()
        gain = float(usual @ usual) / max(float(own @ usual), MIN_SPREAD_LEVELS * is_still.sum())
        alike.append((window - window[is_still].mean()) * gain + middle[is_still].mean())
    return alike


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
    # Numerals pass everywhere along the window, but not before a line that crosses them.
    is_edge |= (beside > NOISE_LEVELS) & (moves < HALF * np.minimum(beside, np.median(moves, axis=0)))
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
