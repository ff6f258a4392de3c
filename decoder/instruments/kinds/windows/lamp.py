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
from decoder.instruments.kinds.windows.window import WindowKind
from decoder.instruments.reading import Reading, Status
from decoder.instruments.thresholds import DIMMEST_LEVELS, FRAMES_TO_LEARN, MISSING_SPREADS
from decoder.matching.correlation import products
from decoder.matching.thresholds import FACE_NOISE_LEVELS
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.panel.kinds.lamp import Lamp
from decoder.registration.thresholds import NOISE_LEVELS, SCORE_THRESHOLD

WHITE = 255.0
PERCENT = 100.0
# The light around a window is fitted so many times, what does not fit it counting less each time.
PASSES = 3
# Where flat surroundings do not tell, light is stronger rather than hazy: so much of them says that there is no haze.
HAZE_PRIOR = 0.1
# What a fit leaves around a window lies in patches, not in pixels: so many of them.
PATCHES = 8
# Of a normal distribution a quarter of pairs is no further apart than a sigma over this (Rousseeuw and Croux, 1993).
QUARTER_OF_PAIRS, PAIRS_TO_SIGMA = 0.25, 2.2219


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
    response
        (r, c): how many grey levels more it shows than the light around it explains, for each gain of that: a lamp
        that is lit in the panel picture does not shine more in the sun.
    other
        How many grey levels away its other state is, if the sample shows it.
    is_contradicted
        Whether the sample shows it darker than off, or brighter than lit: then the panel has its state wrong.
    """

    drawn: UnwrappedGauge
    weights: Floats
    sigma: float
    left: float = NOISE_LEVELS**2
    response: Floats | float = 0.0
    other: float | None = None
    is_contradicted: bool = False

    def told(self, added: Added) -> Floats:
        """(F,): how much light the window adds, grey levels."""
        levels = added.levels - self.response * (added.gain - 1.0)[:, None, None]
        told: Floats = (levels * self.weights).sum(axis=(1, 2))
        return told

    def sigmas(self, added: Added) -> Floats:
        """(F,): how far off that may be, the more the less is as usual around: a hand, the edge of a shadow."""
        sigmas: Floats = np.sqrt(self.sigma**2 + self._unusual(added.left) / PATCHES)
        return sigmas

    def scores(self, added: Added) -> Floats:
        """(F,): how well what is around the window is what was drawn there, in the light that was fitted."""
        shown = added.shown + NOISE_LEVELS**2
        scores: Floats = np.sqrt(shown / (shown + self._unusual(added.left)))
        return scores

    def _unusual(self, left: Floats) -> Floats:
        unusual: Floats = np.maximum(left - self.left, 0.0)
        return unusual


@dataclass(frozen=True, slots=True)
class Added:
    """Light beyond the panel picture's in F frames: (F, r, c) by pixel.

    `gain` (F,) is the light around the window, `shown` the variance of what is seen there, and `left` what the fitted
    light leaves of it.
    """

    levels: Floats
    gain: Floats
    shown: Floats
    left: Floats


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
    outer = (known[:, :, None] * known[:, None, :]).reshape(len(known), -1)
    for _ in range(PASSES):
        normal = products(weights, outer.T).reshape(-1, *(known.shape[1:] * 2))
        normal += HAZE_PRIOR * weights.sum(axis=1)[:, None, None] * np.diag([0.0, 1.0, 1.0, 1.0])
        light = np.linalg.solve(normal, products(weights * seen, known.T)[..., None])[..., 0]
        left = seen - (light[:, None] @ known.T)[:, 0]
        spread = np.maximum(MAD_TO_SIGMA * np.median(np.abs(left), axis=1, keepdims=True), FACE_NOISE_LEVELS)
        weights = 1.0 / (1.0 + np.square(left / (2.0 * spread)))
    beyond = strips[:, *grid.within] - np.einsum("fi,rci->frc", light, terms[grid.within])
    return Added(beyond, light[:, 0] / WHITE, seen.var(axis=1), np.square(left).mean(axis=1))


def first_lamp(grid: WindowGrid, drawn: UnwrappedGauge) -> LampPicture:
    """Take a lamp's looks from the panel picture alone: all of its window tells."""
    shape = drawn[grid.within].shape
    return LampPicture(drawn, np.full(shape, 1.0 / np.prod(shape)), NOISE_LEVELS)


def learn_lamp(lamp: Lamp, grid: WindowGrid, strips: Sequence[UnwrappedGauge], known: LampPicture) -> LampPicture:
    """Learn from a sample's frames (R, C) which pixels scatter least while the lamp does not change."""
    if len(strips) < FRAMES_TO_LEARN:
        return known
    added = added_light(grid, known.drawn, np.stack(strips))
    response = _response(added.gain, added.levels) if lamp.lit else np.zeros(known.weights.shape)
    levels = added.levels - response * (added.gain - 1.0)[:, None, None]
    weights = 1.0 / (np.square(_scatter(levels)) + NOISE_LEVELS**2)
    learned = LampPicture(known.drawn, weights / weights.sum(), 0.0, float(np.median(added.left)), response)
    told = learned.told(added)
    learned = replace(learned, sigma=max(float(_scatter(told)), FACE_NOISE_LEVELS))
    away = -told if lamp.lit else told
    seen = away[away >= 2 * MISSING_SPREADS * learned.sigmas(added)]
    whole = added.levels.mean(axis=(1, 2))  # of a wrong state the pixels that tell most are wrong, too
    is_contradicted = bool(((-whole if lamp.lit else whole) <= -DIMMEST_LEVELS).any())
    return replace(learned, other=float(np.median(seen)) if seen.size else None, is_contradicted=is_contradicted)


def _response(gains: Floats, levels: Floats) -> Floats:
    """(r, c): by how much levels (F, r, c) fall as gains (F,) grow, as the middling pair of frames has it (Sen, 1968).

    They never grow: where they seem to, the lamp goes out, and the light that it threw around itself with it.
    """
    one, other = np.triu_indices(len(gains), 1)
    apart = gains[one] - gains[other]
    is_told = np.abs(apart) >= np.median(np.abs(apart))
    if not apart.any():
        return np.zeros(levels.shape[1:])
    slopes: Floats = np.median((levels[one] - levels[other])[is_told] / apart[is_told, None, None], axis=0)
    return np.minimum(slopes, 0.0)


def _scatter(levels: Floats) -> Floats:
    """(...): the spread of (F, ...) levels of which each is of one of two states, however many are of either.

    Half of all pairs at least are of the same state, so the nearest quarter of them is.
    """
    one, other = np.triu_indices(len(levels), 1)
    scatter: Floats = PAIRS_TO_SIGMA * np.quantile(np.abs(levels[one] - levels[other]), QUARTER_OF_PAIRS, axis=0)
    return scatter


class LampReader:
    """Reads one lamp: its state and, where that is asked for, its light."""

    def __init__(self, lamp: Lamp, grid: WindowGrid, picture: LampPicture) -> None:
        self._lamp, self._grid, self._picture = lamp, grid, picture

    def read(self, strips: Floats, _: Floats) -> list[dict[str, Reading]]:
        """Read F frames of the window with what is around it, (F, R, C)."""
        picture = self._picture
        added = added_light(self._grid, picture.drawn, strips)
        told = (picture.told(added), picture.sigmas(added), picture.scores(added))
        return [self._reading(*own) for own in zip(*(each.tolist() for each in told), strict=True)]

    def _reading(self, level: float, sigma: float, score: float) -> dict[str, Reading]:
        """Tell what a window with so much light beyond the panel picture's, in grey levels, shows.

        The other state than the panel picture's is told only where the light is further off than a reflection's foot
        or an uneven shade would bring it, or nearer to how the flight showed it; in between nothing is told.
        """
        lamp, picture = self._lamp, self._picture
        away, other = -level if lamp.lit else level, picture.other
        far = DIMMEST_LEVELS if other is None else other / 2
        is_same = abs(away) <= MISSING_SPREADS * sigma
        is_other = away >= (max(2 * MISSING_SPREADS * sigma, far) if other is None else far)
        is_told = (
            not picture.is_contradicted
            and MISSING_SPREADS * sigma <= far
            and is_same != is_other
            and score >= SCORE_THRESHOLD
        )
        status = Status.READ if is_told else Status.MISSING
        found = {lamp.name: Reading(status, float(is_other != lamp.lit), 0.0, score)}
        if lamp.light is not None:
            percent = PERCENT / WHITE
            found[lamp.light] = Reading(status, percent * max(level, 0.0), percent * sigma, score)
        return found


class LampKind(WindowKind):
    """A light that is on or off."""

    def owns(self, gauge: Gauge) -> bool:
        return gauge.lamp is not None

    def first(self, _: Gauge, grid: WindowGrid, drawn: UnwrappedGauge) -> LampPicture:
        return first_lamp(grid, drawn)

    def learned(
        self, gauge: Gauge, grid: WindowGrid, strips: Sequence[UnwrappedGauge], known: LampPicture
    ) -> LampPicture:
        return learn_lamp(_lamp(gauge), grid, strips, known)

    def window_reader(self, gauge: Gauge, grid: WindowGrid, picture: LampPicture) -> LampReader:
        return LampReader(_lamp(gauge), grid, picture)


def _lamp(gauge: Gauge) -> Lamp:
    if gauge.lamp is None:
        raise AssertionError(f"{gauge.name} is no lamp")
    return gauge.lamp
