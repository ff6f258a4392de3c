"""The picture of a tape: what is known of it, where frames show it, and how it is composed from them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from decoder.imaging.thresholds import HALF
from decoder.instruments.kinds.windows.tape_shape import TapeShape, Unrolling
from decoder.matching.thresholds import OUTLIER_SPREADS
from decoder.panel.arrays import Floats, Indices, Mask
from decoder.registration.thresholds import NOISE_LEVELS


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

    @classmethod
    def at(cls, rows: Sequence[float], size: tuple[int, ...]) -> Laid:
        """Return places of windows of a size (R, C) in the tape's own light."""
        count = len(rows)
        ones, none = np.ones((count, size[0], 1), np.float32), np.zeros((count, *size), np.float32)
        return cls(np.array(rows, np.float64), np.zeros(count), np.ones(count), ones, none, np.ones(count, bool))

    def with_others(self, others: Laid) -> Laid:
        """Return these and others."""
        return Laid(*(np.concatenate([getattr(each, field.name) for each in (self, others)]) for field in fields(self)))

    def put(self, which: Indices | Mask, others: Laid) -> None:
        """Overwrite some of them with others, in place."""
        for each in fields(self):
            getattr(self, each.name)[which] = getattr(others, each.name)

    def part(self, which: Indices | Mask) -> Laid:
        """Return some of them."""
        return Laid(*(getattr(self, each.name)[which] for each in fields(self)))


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
    drawn, free
        (along, across): the window in the panel picture, and 1 where nothing stands still over the tape, else 0.
    origin
        How far it has moved there.
    lowest
        The least that it can have moved from there, in rows; it is cyclic, so that the most is its length more.
    is_learned
        Whether a flight separated it from what stands still over it.
    views, rows_of_views
        The softened windows (along, across) of which it was composed, beside that in the panel picture; and how far it
        has moved in each.
    """

    shape: TapeShape
    unrolled: NDArray[np.intp]
    step: float
    levels: Floats
    known: Mask
    weights: Floats
    drawn: Floats
    free: Floats
    lowest: float
    origin: float = 0.0
    is_learned: bool = False
    views: tuple[Floats, ...] = ()
    rows_of_views: tuple[float, ...] = ()

    @cached_property
    def unroll(self) -> Unrolling:
        """What unrolls its window."""
        return Unrolling(self.shape, self.unrolled, self.step)

    @property
    def is_whole(self) -> bool:
        """Whether all of it was seen."""
        return bool((self.known.mean(axis=1) >= HALF).all())

    def moved(self, rows: Floats) -> Floats:
        """(F,): the change of values when the tape lies at rows (F,)."""
        changes: Floats = ((rows - self.origin - self.lowest) % len(self.levels) + self.lowest) * self.step
        return changes


def composed(picture: TapePicture, strips: Floats, where: Laid) -> tuple[Floats, Mask]:
    """Return the whole tape (P, C) as views (K, R, C) show it, and which of its cells (P, C) they show."""
    size, (rows, columns) = len(picture.levels), picture.weights.shape
    facing = facing_weights(picture.weights)
    first = np.floor(where.rows).astype(np.intp)
    part = (where.rows - first).astype(np.float32)[:, None, None]
    lit = (strips - where.lights) / where.gains
    if picture.shape.turn is None:
        # A composed tape is less sharp than its views, so each has a gain of more than 1, and the next view, fitted to
        # it, of more still. All views were brought into the same light: half the way back keeps gains from growing.
        middle = lit.mean(axis=(1, 2), keepdims=True)
        lit = middle + (lit - middle) * np.sqrt(where.gains)
    seen = part * lit[:, :-1] + (1 - part) * lit[:, 1:]
    # A tape without an end is long, and each view shows little of it: they are added one by one.
    at = (first[:, None] + 1 + np.arange(rows - 1)) % size
    worth = np.minimum(facing[:-1], facing[1:])

    def mean(levels: Callable[[int], Floats], trusted: Callable[[int], Floats]) -> tuple[Floats, Floats]:
        total, weight = (np.zeros((size, columns), np.float32) for _ in range(2))
        for view, its in enumerate(at):
            own = worth * trusted(view)
            total[its] += own * levels(view)
            weight[its] += own
        return total / np.maximum(weight, 1e-9), weight

    def off(view: int) -> Floats:
        return np.asarray(np.abs(seen[view] - usual[at[view]]), np.float32)

    def agreed(view: int) -> Floats:
        return np.asarray(off(view) <= OUTLIER_SPREADS / 2 * spread[at[view]], np.float32)

    usual, _ = mean(lambda view: seen[view], lambda _: np.ones_like(worth))
    spread = np.maximum(np.sqrt(mean(lambda view: off(view) ** 2, lambda _: np.ones_like(worth))[0]), NOISE_LEVELS)
    whole, weight = mean(lambda view: seen[view], agreed)
    best = np.zeros((size, columns), np.float32)
    for its in at:
        best[its] = np.maximum(best[its], worth)
    return np.where(weight > 0, whole, usual), 2 * best > facing_weights(np.array(HALF))


def facing_weights(weights: Floats) -> Floats:
    """Return the weight of a view's pixels in the tape: those seen from the side count little."""
    told: Floats = np.square(np.square(weights))
    return told
