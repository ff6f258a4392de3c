"""Lamps: whether a warning light is lit, and how much light it adds.

A window brightens when its lamp is lit, but also when the sun moves around. The surroundings of the window tell the two
apart: they give the strength and the gradient of the light on the panel, and whatever the window shows beyond the panel
picture in that light is the lamp's own. A sample of the flight teaches which of its pixels tell most; those of a
reflecting bezel, for example, tell little.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from decoder.imaging.sorting import MAD_TO_SIGMA
from decoder.imaging.unwrapping import UnwrappedGauge, WindowGrid
from decoder.instruments.kinds.windows.window import WindowKind
from decoder.instruments.reading import Reading, Status
from decoder.instruments.thresholds import BEYOND_CHANCE_SPREADS, DIMMEST_LEVELS, FRAMES_TO_LEARN
from decoder.matching.correlation import products
from decoder.matching.thresholds import FACE_NOISE_LEVELS
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.panel.kinds.lamp import Lamp
from decoder.registration.thresholds import NOISE_LEVELS, SCORE_THRESHOLD

WHITE = 255.0
PERCENT = 100.0
# Passes of the fit of the light around a window; pixels that do not fit count less each time.
PASSES = 3
# Where flat surroundings cannot tell gain from haze, assume gain: this part of them says that there is no haze.
HAZE_PRIOR = 0.1
# Residuals around a window are correlated within patches: the number of independent ones.
PATCHES = 8
# In a normal distribution, a quarter of all pairs are no further apart than sigma / 2.2219 (Rousseeuw and Croux, 1993).
QUARTER_OF_PAIRS, PAIRS_TO_SIGMA = 0.25, 2.2219


@dataclass(frozen=True, slots=True)
class LampPicture:
    """What a lamp looks like.

    Attributes
    ----------
    drawn
        (R, C): its window and surroundings in the panel picture.
    weights
        (r, c), sum 1: how much each pixel of the window tells.
    sigma
        The scatter of the weighted level by itself, grey levels.
    left
        The usual residual variance around the window after fitting the light there.
    response
        (r, c): how many grey levels more it shows than the light around it explains, per unit of gain: a lamp that is
        lit in the panel picture does not shine more in the sun.
    other
        The distance of its other state in grey levels, if the sample shows it.
    is_contradicted
        Whether the sample shows it darker than off, or brighter than lit: then the panel states the wrong state.
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
        """(F,): the uncertainty of that, larger if the surroundings are unusual, as with a hand or a shadow's edge."""
        sigmas: Floats = np.sqrt(self.sigma**2 + self._unusual(added.left) / PATCHES)
        return sigmas

    def scores(self, added: Added) -> Floats:
        """(F,): how well the surroundings match the panel picture in the fitted light."""
        shown = added.shown + NOISE_LEVELS**2
        scores: Floats = np.sqrt(shown / (shown + self._unusual(added.left)))
        return scores

    def _unusual(self, left: Floats) -> Floats:
        unusual: Floats = np.maximum(left - self.left, 0.0)
        return unusual


@dataclass(frozen=True, slots=True)
class Added:
    """Light beyond the panel picture's in F frames: (F, r, c) per pixel.

    `gain` (F,) is the light around the window, `shown` the variance of the surroundings, and `left` their variance that
    the fitted light does not explain.
    """

    levels: Floats
    gain: Floats
    shown: Floats
    left: Floats


def added_light(grid: WindowGrid, drawn: UnwrappedGauge, strips: Floats) -> Added:
    """Measure what windows show beyond the panel picture, in the light that falls around them.

    Parameters
    ----------
    drawn, strips
        (R, C) and (F, R, C): the window and its surroundings, in the panel picture and in frames.
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
    """Build a lamp's picture from the panel picture alone: all of its window counts equally."""
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
    seen = away[away >= 2 * BEYOND_CHANCE_SPREADS * learned.sigmas(added)]
    whole = added.levels.mean(axis=(1, 2))  # unweighted: if the state is wrong, so are the most telling pixels
    is_contradicted = bool(((-whole if lamp.lit else whole) <= -DIMMEST_LEVELS).any())
    return replace(learned, other=float(np.median(seen)) if seen.size else None, is_contradicted=is_contradicted)


def _response(gains: Floats, levels: Floats) -> Floats:
    """(r, c): the slope of levels (F, r, c) over gains (F,), by the median over pairs of frames (Sen, 1968).

    It is never positive: where levels seem to grow with the gain, it is the lamp going out that dims its surroundings.
    """
    one, other = np.triu_indices(len(gains), 1)
    apart = gains[one] - gains[other]
    is_told = np.abs(apart) >= np.median(np.abs(apart))
    if not apart.any():
        return np.zeros(levels.shape[1:])
    slopes: Floats = np.median((levels[one] - levels[other])[is_told] / apart[is_told, None, None], axis=0)
    return np.minimum(slopes, 0.0)


def _scatter(levels: Floats) -> Floats:
    """(...): the spread of levels (F, ...), each in one of two states, however many are in either.

    At least half of all pairs are in the same state, so the nearest quarter of pairs is.
    """
    one, other = np.triu_indices(len(levels), 1)
    scatter: Floats = PAIRS_TO_SIGMA * np.quantile(np.abs(levels[one] - levels[other]), QUARTER_OF_PAIRS, axis=0)
    return scatter


class LampReader:
    """Reads one lamp: its state and, if asked for, its light."""

    def __init__(self, lamp: Lamp, grid: WindowGrid, picture: LampPicture) -> None:
        self._lamp, self._grid, self._picture = lamp, grid, picture

    def read(self, strips: Floats, _: Floats) -> list[dict[str, Reading]]:
        """Read F frames of the window and its surroundings, (F, R, C)."""
        picture = self._picture
        added = added_light(self._grid, picture.drawn, strips)
        told = (picture.told(added), picture.sigmas(added), picture.scores(added))
        return [self._reading(*own) for own in zip(*(each.tolist() for each in told), strict=True)]

    def _reading(self, level: float, sigma: float, score: float) -> dict[str, Reading]:
        """Convert the light beyond the panel picture's, in grey levels, to readings.

        The state that the panel picture does not show is only read if the light is further off than a reflection's
        flank or an uneven shadow would bring it, or is nearer to what the flight showed of it. In between, nothing is
        read.
        """
        lamp, picture = self._lamp, self._picture
        away, other = -level if lamp.lit else level, picture.other
        far = DIMMEST_LEVELS if other is None else other / 2
        is_same = abs(away) <= BEYOND_CHANCE_SPREADS * sigma
        is_other = away >= (max(2 * BEYOND_CHANCE_SPREADS * sigma, far) if other is None else far)
        is_told = (
            not picture.is_contradicted
            and BEYOND_CHANCE_SPREADS * sigma <= far
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
