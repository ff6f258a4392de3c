"""Lamps: whether a warning light is lit, and how much light it adds.

A window brightens when its lamp is lit, and as well when the sun comes round. What lies around the window tells the two
apart: from there the light on the panel is fitted, its strength and how it falls off to one side, and what the window
shows beyond the panel picture in that light is the lamp's own. Which of its pixels tell most, those of a shining bezel
do not, a sample of the flight teaches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from decoder.imaging.sorting import MAD_TO_SIGMA
from decoder.imaging.unwrapping import UnwrappedGauge, WindowGrid
from decoder.instruments.kinds.windows import WindowKind
from decoder.instruments.reading import Reading, Status
from decoder.instruments.thresholds import CERTAIN_SPREADS, FRAMES_TO_LEARN, MISSING_SPREADS
from decoder.matching.thresholds import FACE_NOISE_LEVELS, NOISE_LEVELS, SCORE_THRESHOLD
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.panel.kinds.lamp import Lamp

WHITE = 255.0
PERCENT = 100.0
# The light around a window is fitted so many times, what does not fit it counting less each time.
PASSES = 3
# What a fit leaves around a window lies in patches, not in pixels: so many of them.
PATCHES = 8
# The middle half of a normal distribution is so many sigmas wide.
HALF_SIGMAS = 1.349


@dataclass(frozen=True, slots=True)
class LampPicture:
    """What a lamp looks like.

    Attributes
    ----------
    drawn
        (R, C): its window with what is around it in the panel picture.
    weights
        (r, c), sum 1: how much each pixel of the window tells.
    sigma
        How far what is told in this way scatters by itself, grey levels.
    left
        The variance of what is left around the window when the light there was fitted, as a rule.
    other
        How many grey levels away its other state is, if the sample shows it.
    """

    drawn: UnwrappedGauge
    weights: Floats
    sigma: float
    left: float = 0.0
    other: float | None = None

    def sigmas(self, left: Floats) -> Floats:
        """(F,): how far off light may be told where so much is left around the window: a hand, the edge of a shadow."""
        unusual = np.maximum(left - self.left, 0.0)
        sigmas: Floats = np.sqrt(self.sigma**2 + unusual / PATCHES)
        return sigmas


@dataclass(frozen=True, slots=True)
class Added:
    """Light beyond the panel picture's in F frames: (F, r, c) by pixel.

    `left` (F,) is the variance of what is left around the window, and `score` how well the light there was fitted.
    """

    levels: Floats
    left: Floats
    score: Floats


def added_light(grid: WindowGrid, drawn: UnwrappedGauge, strips: Floats) -> Added:
    """Tell what windows show beyond the panel picture, in the light that falls around them.

    Parameters
    ----------
    drawn, strips
        (R, C) and (F, R, C): the window with what is around it, in the panel picture and in frames.
    """
    around = np.ones((grid.rows, grid.columns), bool)
    around[grid.within] = False
    down, across = np.indices(drawn.shape) / max(drawn.shape) - 0.5
    terms = np.stack([drawn / WHITE, np.ones_like(drawn), across, down], axis=-1).astype(np.float64)
    known, seen = terms[around], strips[:, around].astype(np.float64)
    weights = np.ones_like(seen)
    for _ in range(PASSES):
        normal = np.einsum("fm,mi,mj->fij", weights, known, known) + np.eye(4)  # flat surroundings leave a gain open
        light = np.linalg.solve(normal, np.einsum("fm,fm,mi->fi", weights, seen, known)[..., None])[..., 0]
        left = seen - light @ known.T
        spread = np.maximum(MAD_TO_SIGMA * np.median(np.abs(left), axis=1, keepdims=True), FACE_NOISE_LEVELS)
        weights = 1.0 / (1.0 + np.square(left / (2.0 * spread)))
    noise = np.square(left).mean(axis=1)
    shown = seen.var(axis=1) + NOISE_LEVELS**2
    return Added(
        levels=strips[:, *grid.within] - np.einsum("fi,rci->frc", light, terms[grid.within]),
        left=noise,
        score=np.sqrt(shown / (shown + np.maximum(noise - NOISE_LEVELS**2, 0.0))),
    )


def first_lamp(grid: WindowGrid, drawn: UnwrappedGauge) -> LampPicture:
    """Take a lamp's looks from the panel picture alone: all of its window tells."""
    shape = drawn[grid.within].shape
    return LampPicture(drawn, np.full(shape, 1.0 / np.prod(shape)), NOISE_LEVELS)


def learn_lamp(grid: WindowGrid, strips: Sequence[UnwrappedGauge], known: LampPicture) -> LampPicture:
    """Learn from a sample's frames (R, C) which pixels scatter least while the lamp does not change."""
    if len(strips) < FRAMES_TO_LEARN:
        return known
    added = added_light(grid, known.drawn, np.stack(strips))
    levels = added.levels
    spread = MAD_TO_SIGMA * np.median(np.abs(levels - np.median(levels, axis=0)), axis=0)
    weights = 1.0 / (np.square(spread) + NOISE_LEVELS**2)
    weights /= weights.sum()
    told = np.einsum("frc,rc->f", levels, weights)
    learned = LampPicture(known.drawn, weights, _scatter(told), float(np.median(added.left)))
    away = np.abs(told)
    seen = away[away >= CERTAIN_SPREADS * learned.sigmas(added.left)]
    return replace(learned, other=float(np.median(seen))) if seen.size else learned


def _scatter(levels: Floats) -> float:
    """Estimate the spread of (F,) levels of which the larger part belongs to one state, by its densest half."""
    ordered, half = np.sort(levels), len(levels) // 2
    narrowest = float(np.min(ordered[half:] - ordered[: len(ordered) - half]))
    sigma = narrowest / HALF_SIGMAS
    return max(sigma, FACE_NOISE_LEVELS)


class LampReader:
    """Reads one lamp: its state and, where that is asked for, its light."""

    def __init__(self, lamp: Lamp, grid: WindowGrid, picture: LampPicture) -> None:
        self._lamp, self._grid, self._picture = lamp, grid, picture

    def read(self, strips: Floats, _: Floats) -> list[dict[str, Reading]]:
        """Read F frames of the window with what is around it, (F, R, C).

        The other state than the panel picture's is told only where the light is further off than a reflection's foot
        or an uneven shade would bring it, or nearer to how the flight showed it; in between nothing is told.
        """
        added = added_light(self._grid, self._picture.drawn, strips)
        levels = np.einsum("frc,rc->f", added.levels, self._picture.weights)
        sigmas = self._picture.sigmas(added.left)
        away, other = -levels if self._lamp.lit else levels, self._picture.other
        is_same = np.abs(away) <= MISSING_SPREADS * sigmas
        if other is None:
            is_other = away >= CERTAIN_SPREADS * sigmas
        else:
            is_same &= away < other / 2
            is_other = (away >= MISSING_SPREADS * sigmas) & (away >= other / 2)
        is_told = (is_same | is_other) & (added.score >= SCORE_THRESHOLD)
        statuses = [Status.READ if told else Status.MISSING for told in is_told.tolist()]
        lit, scores = (is_other != self._lamp.lit).astype(float).tolist(), added.score.tolist()
        found = [{self._lamp.name: Reading(*own)} for own in zip(statuses, lit, [0.0] * len(lit), scores, strict=True)]
        if self._lamp.light is not None:
            percents = PERCENT / WHITE * np.stack([np.maximum(levels, 0.0), sigmas])
            for own, status, light, sigma, score in zip(found, statuses, *percents.tolist(), scores, strict=True):
                own[self._lamp.light] = Reading(status, light, sigma, score)
        return found


class LampKind(WindowKind):
    """A light that is on or off."""

    def owns(self, gauge: Gauge) -> bool:
        return gauge.lamp is not None

    def first(self, _: Gauge, grid: WindowGrid, drawn: UnwrappedGauge) -> LampPicture:
        return first_lamp(grid, drawn)

    def learned(self, _: Gauge, grid: WindowGrid, strips: Sequence[UnwrappedGauge], known: LampPicture) -> LampPicture:
        return learn_lamp(grid, strips, known)

    def window_reader(self, gauge: Gauge, grid: WindowGrid, picture: LampPicture) -> LampReader:
        if gauge.lamp is None:
            raise AssertionError(f"{gauge.name} is no lamp")
        return LampReader(gauge.lamp, grid, picture)
