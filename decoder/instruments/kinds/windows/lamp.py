"""Lamps: whether a warning light is lit, and how much light it adds.

A window brightens when its lamp is lit, but also when the sun moves around. The surroundings of the window tell the two
apart: they give the strength and the gradient of the light on the panel, and whatever the window shows beyond the panel
picture in that light is the lamp's own. A sample of the flight shows which of its pixels are most informative; those of
a reflecting bezel, for example, are not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from decoder.imaging.sorting import MAD_TO_SIGMA
from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import UnwrappedGauge, WindowGrid
from decoder.instruments.appearance import Appearance
from decoder.instruments.kinds.windows.window import WindowKind
from decoder.instruments.reading import Reading, Status
from decoder.instruments.thresholds import (
    BEYOND_CHANCE_SPREADS,
    CLEARLY_WORSE,
    DIMMEST_LEVELS,
    FRAMES_TO_LEARN,
    SATURATED_LEVEL,
)
from decoder.matching.correlation import products
from decoder.matching.thresholds import FACE_NOISE_LEVELS, MIN_LIGHT_GAIN, MIN_VIEWS
from decoder.panel.arrays import Floats, Mask
from decoder.panel.gauge import Gauge
from decoder.panel.kinds.lamp import Lamp
from decoder.registration.thresholds import NOISE_LEVELS, SCORE_THRESHOLD

WHITE = 255.0
# The part of a window's margin whose light a lamp is read in; the rest only contradicts that.
NEAR_PART = 1 / 3
PERCENT = 100.0
# Passes of the fit of the light around a window; pixels that do not fit count less each time.
PASSES = 3
# Flat surroundings cannot tell gain from haze. The weight of the prior that there is no haze, as a part of theirs.
HAZE_PRIOR = 0.1
# The part of a window's margin, next to the window, on which the lamp's own light may fall by blur and bloom, and how
# much of it at most there, and further away.
SPILT_ON_PART, SPILT_PART, SPILT_LIGHT = 0.5, 0.5, 0.1
# How much the light of a lamp varies with the camera's exposure, which is unknown if its surroundings are dark.
EXPOSURE_PART = 0.05
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
    steady
        (R, C): the weights of the pixels around the window.
    halo
        (R, C): how much light the lamp casts on each of them, as a part of its own.
    weights
        (r, c), sum 1: how much each pixel of the window counts.
    sigma
        The scatter of the weighted level by itself, grey levels.
    response
        (r, c): how many grey levels more than expected from the light around it the window shows, per unit of gain;
        negative for a lamp that is lit in the panel picture, since it does not shine more in the sun.
    shining
        By how many grey levels it is brighter than the panel around it in the panel picture, if it is lit there.
    left
        The usual residual variance around the window after fitting the light there.
    others
        How far away its other state may be, if the sample shows it: one or two possibilities.
    shape, inside
        (r, c): what that state adds to each pixel per grey level of the window's light, and each pixel's usual variance
        that this does not explain.
    is_doubtful
        Whether it may not be read. The sample may show it darker than off, or brighter than lit, and not far more often
        in its other state: then the panel states the wrong state. Or it is often between both, and looks like neither:
        then more than its state changes.
    is_strict
        Whether clearly more frames of the sample are away from the panel picture's state, but look like neither, than
        are in the other: that may be glare then, and what is between them the lamp.
    """

    drawn: UnwrappedGauge
    steady: Floats
    halo: Floats
    weights: Floats
    sigma: float
    response: Floats
    shining: float
    left: float = NOISE_LEVELS**2
    others: tuple[Other, ...] = ()
    shape: Floats | None = None
    inside: Floats | float = math.inf
    is_doubtful: bool = False
    is_strict: bool = False

    def told(self, added: Added) -> Floats:
        """(F,): how much light the window adds, grey levels."""
        weights = self.weights * added.is_clear(self.response)
        told: Floats = (added.levels(self.response) * weights).sum(axis=(1, 2)) / self._clear(added)
        return told

    def sigmas(self, added: Added) -> Floats:
        """(F,): the uncertainty of `told`, larger if the surroundings are unusual, as with a hand or a shadow's edge.

        It is also larger if pixels of the window are saturated, or if it looks like neither state, as in glare.
        """
        beyond = np.maximum(self.unlike(added) - self.inside, 0.0)
        # A reflecting bezel is less than a quarter of a window; a card or glare is more.
        return self._sigmas(added, self._unusual(added.left) + np.quantile(beyond, 1.0 - HALF * HALF, axis=(1, 2)))

    def sigmas_alike(self, added: Added) -> Floats:
        """(F,): the uncertainty of `told` of a window that looks like one of its states, whatever it looks like.

        If `is_strict`, what looks like neither is no reason to take a level further off for the panel picture's.
        """
        if not self.is_strict:
            return self.sigmas(added)
        return self._sigmas(added, self._unusual(added.left))

    def between(self, added: Added) -> tuple[Floats, Floats]:
        """(F,), (F,): halfway to its other state in each frame, grey levels, and what that state adds at least.

        That is more than half of the way, if it varies less: a reflection may add as much. If the sample does not show
        that state, both are the least light that a lamp may have.
        """
        if not self.others:
            dimmest = DIMMEST_LEVELS * np.minimum(added.gain, 1.0)
            return dimmest, dimmest
        halves = [HALF * other.away * _grown(added, other.power) for other in self.others]
        nearly = [(1 - HALF * HALF) * other.least * _grown(added, other.power) for other in self.others]
        return np.min(halves, axis=0), np.max([*halves, *nearly], axis=0)

    def is_only_dimmed(self, added: Added) -> Mask:
        """(F,): whether the panel picture's lit lamp would show about as little light if the exposure dimmed it.

        A shorter exposure dims a lamp along with the panel; one that is off differs from that by as much as it shines.
        """
        dimmed = (added.levels() * self.weights * added.is_clear(0.0)).sum(axis=(1, 2))
        shines = max((other.away for other in self.others), default=self.shining)
        is_only_dimmed: Mask = -dimmed < HALF * shines * np.minimum(added.gain, 1.0)
        return is_only_dimmed & (self.shining > 0)

    def scores(self, added: Added) -> Floats:
        """(F,): how well the surroundings match the panel picture in the fitted light."""
        shown = added.shown + NOISE_LEVELS**2
        scores: Floats = np.sqrt(shown / (shown + self._unusual(added.left)))
        return scores

    def alike(self, added: Added) -> Floats:
        """(F,): how well the window's pixels, however bright, match the panel picture's.

        A change of less than half the least light of a lamp is no other picture.
        """
        clear = added.is_clear(self.response).astype(np.float64)
        drawn, seen = (each - _mean(each, clear)[:, None, None] for each in (added.expected, added.seen))
        ours, both, theirs = (_mean(each, clear) for each in (drawn**2, drawn * seen, seen**2))
        matched = np.square(np.maximum(both, 0.0)) / np.maximum(ours, np.finfo(np.float64).eps)
        unlike = np.maximum(theirs - matched - NOISE_LEVELS**2, 0.0)
        matched += np.square(HALF * DIMMEST_LEVELS)
        alike: Floats = np.sqrt(matched / (matched + unlike))
        return alike

    def unlike(self, added: Added) -> Floats:
        """(F, r, c): squared residuals of the window after fitting the lamp's light; 0 if its `shape` is unknown."""
        if self.shape is None:
            return np.zeros_like(added.seen)
        levels = added.levels(self.response) * added.is_clear(self.response)
        lit = (levels * self.shape).sum(axis=(1, 2)) / np.square(self.shape).sum()
        unlike: Floats = np.square(levels - lit[:, None, None] * self.shape)
        return unlike

    def _sigmas(self, added: Added, unusual: Floats) -> Floats:
        sigmas: Floats = np.sqrt(self.sigma**2 / self._clear(added) + unusual / PATCHES)
        return sigmas

    def _clear(self, added: Added) -> Floats:
        """(F,): the part of the weights on pixels that are not saturated."""
        clear: Floats = (self.weights * added.is_clear(self.response)).sum(axis=(1, 2))
        return np.maximum(clear, np.finfo(np.float64).eps)

    def _unusual(self, left: Floats) -> Floats:
        unusual: Floats = np.maximum(left - self.left, 0.0)
        return unusual


@dataclass(frozen=True, slots=True)
class Other:
    """How far the state that the panel picture does not show may be from the one that it shows.

    `away` is that distance at a gain of 1, in grey levels, and `least` the smallest in the sample. Both grow with the
    `power` of the gain: 0 for a lamp that shines the same in the sun, 1 for one that the camera's exposure dims along
    with the panel.
    """

    power: float
    away: float
    least: float


@dataclass(frozen=True, slots=True)
class Added:
    """What windows show in F frames, `seen` (F, r, c), and what the panel picture shows in that light, `expected`.

    `gain` (F,) is the light around the window, `shown` the variance of the surroundings, and `left` the part of that
    variance that the fitted light does not explain.
    """

    seen: Floats
    expected: Floats
    gain: Floats
    shown: Floats
    left: Floats

    def of(self, frames: Mask) -> Added:
        """Return some of the frames, (F,)."""
        return Added(*(getattr(self, each.name)[frames] for each in fields(self)))

    def levels(self, response: Floats | float = 0.0) -> Floats:
        """(F, r, c): light in excess of what the panel picture, with this response, would show, up to white."""
        levels: Floats = self.seen - np.minimum(self._expected(response), WHITE)
        return levels

    def is_clear(self, response: Floats | float) -> Mask:
        """(F, r, c): which pixels can show more or less light: not those that are white and are expected to be."""
        is_clear: Mask = np.minimum(self.seen, self._expected(response)) < SATURATED_LEVEL
        return is_clear

    def _expected(self, response: Floats | float) -> Floats:
        expected: Floats = self.expected + response * (self.gain - 1.0)[:, None, None]
        return expected


def _mean(levels: Floats, weights: Floats) -> Floats:
    """(F,): the weighted mean of windows (F, r, c); 0 where nothing has weight."""
    mean: Floats = (levels * weights).sum(axis=(1, 2)) / np.maximum(weights.sum(axis=(1, 2)), 1.0)
    return mean


def added_light(grid: WindowGrid, known: LampPicture, strips: Floats) -> Added:
    """Measure what windows show beyond the panel picture, in the light that falls around them.

    Dark surroundings do not show that light: the little that they show is noise, or the lamp's own. The light is then
    assumed to be as in the panel picture.

    Parameters
    ----------
    known
        What the lamp looks like.
    strips
        (F, R, C): the window and its surroundings in frames.
    """
    around, (own, expected, light, off) = _around(grid, 0), _in_its_light(grid, known, strips)
    beyond = (own - np.minimum(expected, WHITE)).mean(axis=(1, 2))[:, None]
    beside_it = SPILT_PART * np.abs(beyond) * ~_beside(grid)[around]
    left = np.maximum(np.abs(off - beyond * known.halo[around]) - beside_it, 0.0)
    weights = known.steady[around] / known.steady[around].sum()
    seen = strips[:, around].astype(np.float64)
    shown = seen - (seen @ weights)[:, None]
    return Added(own, expected, light[:, 0] / WHITE, np.square(shown) @ weights, np.square(left) @ weights)


def _in_its_light(grid: WindowGrid, known: LampPicture, strips: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Fit the light around windows (F, R, C).

    Returns the windows, what they would show in that light (both (F, r, c)), the light (F, L), and how far each pixel
    around them is off it, (F, P).
    """
    around, beside, terms = _around(grid, 0), _beside(grid), _terms(known.drawn)
    spilt = SPILT_LIGHT * np.maximum(_stands_out(grid, strips), _stands_out(grid, known.drawn))
    light = _light(terms[beside], strips[:, beside].astype(np.float64), known.steady[beside], spilt)
    expected = np.einsum("fi,rci->frc", light, terms[grid.within])
    return strips[:, *grid.within], expected, light, strips[:, around] - light @ terms[around].T


def _halo(grid: WindowGrid, known: LampPicture, strips: Floats) -> Floats:
    """(R, C): how much of a lamp's light falls on each pixel around it, by frames (F, R, C) in which it changed.

    Its light spreads by bloom, or lights a bezel; what lies over the panel changes the surroundings far more.
    """
    around, (own, expected, _, off) = _around(grid, 0), _in_its_light(grid, known, strips)
    beyond = (own - np.minimum(expected, WHITE)).mean(axis=(1, 2))
    has_changed, halo = np.abs(beyond) >= DIMMEST_LEVELS, np.zeros_like(known.steady)
    if has_changed.sum() >= MIN_VIEWS:
        most = np.where(_beside(grid)[around], SPILT_LIGHT, SPILT_PART)
        halo[around] = np.clip(np.median(off[has_changed] / beyond[has_changed, None], axis=0), 0.0, most)
    return halo


def _beside(grid: WindowGrid) -> Mask:
    """(R, C): the surroundings of a window on which little of its lamp's own light falls."""
    return _around(grid, math.ceil(SPILT_ON_PART * grid.margin))


def _steady(grid: WindowGrid, drawn: UnwrappedGauge, strips: Floats) -> Floats:
    """(R, C): weights of the pixels around a window: small where frames differ more than elsewhere, as on a display."""
    around, known = _around(grid, 0), _terms(drawn)
    seen = strips[:, around].astype(np.float64)
    light = _light(known[around], seen, np.ones(seen.shape[1]), np.zeros(len(seen)))
    scatter = np.square(seen - light @ known[around].T).mean(axis=0)
    usual = max(float(np.median(scatter)), NOISE_LEVELS**2)
    steady = np.ones(drawn.shape)
    steady[around] = usual / (usual + scatter)
    return steady


def _terms(drawn: UnwrappedGauge) -> Floats:
    """(R, C, L): the terms of light on a panel: a gain on the panel picture, a constant, and gradients."""
    down, across = np.indices(drawn.shape) / max(drawn.shape) - 0.5
    terms: Floats = np.stack([drawn / WHITE, np.ones_like(drawn), across, down], axis=-1).astype(np.float64)
    return terms


def _around(grid: WindowGrid, more: int) -> Mask:
    """(R, C): the surroundings of a window that is larger by so many cells on each side."""
    around = np.ones((grid.rows, grid.columns), bool)
    first = grid.margin - more
    around[first : grid.rows - first, first : grid.columns - first] = False
    return around


def _light(known: Floats, seen: Floats, steady: Floats, spilt: Floats) -> Floats:
    """(F, L): fit the terms of light (P, L) to frames' pixels (F, P), with the panel picture's light as a prior.

    `steady` (P,) are the pixels' weights, and `spilt` (F,) how many grey levels of them may be the lamp's own.
    """
    prior = np.zeros((len(seen), known.shape[1], known.shape[1]))
    prior[:, 0, 0] = (NOISE_LEVELS**2 + spilt**2) / WHITE**2
    prior[:, 1:, 1:] = HAZE_PRIOR * np.eye(known.shape[1] - 1)
    weights = np.broadcast_to(steady, seen.shape)
    outer = (known[:, :, None] * known[:, None, :]).reshape(len(known), -1)
    for _ in range(PASSES):
        total = weights.sum(axis=1)[:, None]
        normal = products(weights, outer.T).reshape(prior.shape) + total[..., None] * prior
        wanted = products(weights * seen, known.T) + total * WHITE * prior[:, 0]
        light: Floats = np.linalg.solve(normal, wanted[..., None])[..., 0]
        left = seen - (light[:, None] @ known.T)[:, 0]
        spread = np.maximum(MAD_TO_SIGMA * np.median(np.abs(left), axis=1, keepdims=True), FACE_NOISE_LEVELS)
        weights = steady / (1.0 + np.square(left / (2.0 * spread)))
    return light


def first_lamp(lamp: Lamp, grid: WindowGrid, drawn: UnwrappedGauge) -> LampPicture:
    """Build a lamp's picture from the panel picture alone: all pixels of its window count equally."""
    shape = drawn[grid.within].shape
    shining = _shining(grid, drawn) if lamp.lit else np.zeros(shape)
    even, light = np.full(shape, 1.0 / np.prod(shape)), float(shining.mean())
    sigma = math.hypot(NOISE_LEVELS, EXPOSURE_PART * light)
    return LampPicture(drawn, np.ones(drawn.shape), np.zeros(drawn.shape), even, sigma, -shining, light)


def _stands_out(grid: WindowGrid, strips: Floats) -> Floats:
    """(...): by how many grey levels a window (..., R, C) is brighter or darker than what is around it."""
    own, around = strips[..., *grid.within].mean(axis=(-2, -1)), np.median(strips[..., _around(grid, 0)], axis=-1)
    apart: Floats = np.abs(own - around)
    return apart


def _shining(grid: WindowGrid, drawn: UnwrappedGauge) -> Floats:
    """(r, c): by how much a lit lamp is brighter than the panel around it, which is about as bright as it is off."""
    shining: Floats = np.maximum(drawn[grid.within] - np.median(drawn[_around(grid, 0)]), 0.0)
    return shining


def learn_lamp(lamp: Lamp, grid: WindowGrid, strips: Sequence[UnwrappedGauge], known: LampPicture) -> LampPicture:
    """Learn from a sample's frames (R, C) how both states look, and which pixels are most informative.

    Frames in which something else lies over the panel are left out. If some frames show the window darker than off, or
    brighter than lit, the panel states the wrong state; unless far more frames show the other state as expected: then
    the former are odd ones, such as in glare.
    """
    if len(strips) < FRAMES_TO_LEARN:
        return known
    views = np.stack(strips)
    known = replace(known, steady=_steady(grid, known.drawn, views))
    known = replace(known, halo=_halo(grid, known, views))
    added = added_light(grid, known, views)
    known = replace(known, left=float(np.median(added.left)))
    added = added.of(known.scores(added) >= SCORE_THRESHOLD)
    is_odd, is_other = (_is_beyond(lamp, known, added, side) for side in (-1, 1))
    if CLEARLY_WORSE * is_odd.sum() > is_other.sum():
        return replace(known, is_doubtful=True)
    added = added.of(~is_odd)
    return known if len(added.gain) < FRAMES_TO_LEARN else _told_apart(lamp, grid, known, added)


def _told_apart(lamp: Lamp, grid: WindowGrid, known: LampPicture, added: Added) -> LampPicture:
    """Learn how the light on the panel changes the window, and so tell its states apart.

    The response is estimated from all frames first. Once these are divided into states, it is estimated again, from
    those that show the panel picture's state.
    """
    usual = known.response
    response = _response(added, known, grid, most=HALF * usual) if lamp.lit else usual
    learned = _with_response(lamp, grid, known, added, response)
    away, powers = _away(lamp, learned, added), _powers(lamp, learned, added)
    is_own = _is_own(away, added, powers[0])
    if is_own.all() or is_own.sum() < MIN_VIEWS:
        return learned
    if np.median(away[~is_own]) < BEYOND_CHANCE_SPREADS * learned.sigma:
        return learned
    response = _response(added.of(is_own), known, grid, most=np.zeros_like(usual))
    return _with_response(lamp, grid, known, added, response)


def _with_response(lamp: Lamp, grid: WindowGrid, known: LampPicture, added: Added, response: Floats) -> LampPicture:
    """Weigh the pixels by how informative they are, and learn how the states look."""
    levels = added.levels(response)
    clear = np.maximum(added.is_clear(response).mean(axis=0), np.finfo(np.float64).eps)
    weights = clear / (np.square(_scatter(levels)) + NOISE_LEVELS**2)
    shining = _shining(grid, known.drawn)
    weights *= (shining if lamp.lit else np.ptp(levels, axis=0)) + NOISE_LEVELS  # by how much each changes
    weights /= weights.sum()
    shines = float((weights * shining).sum()) * lamp.lit
    return _with_states(lamp, replace(known, weights=weights, sigma=0.0, response=response, shining=shines), added)


def _with_states(lamp: Lamp, learned: LampPicture, added: Added) -> LampPicture:
    """Learn how much each of its states scatters, how far they lie apart, and whether there are two."""
    away, powers = _away(lamp, learned, added), _powers(lamp, learned, added)
    is_own = _is_own(away, added, powers[0])
    near = away[is_own] if is_own.sum() > 1 else away  # its other state may scatter more or less
    learned = replace(learned, sigma=max(float(_scatter(near)), FACE_NOISE_LEVELS))
    is_seen = away >= 2 * BEYOND_CHANCE_SPREADS * learned.sigmas(added)
    if is_seen.any():
        lit = {power: (away / _grown(added, power))[is_seen] for power in powers}
        seen = [Other(power, float(np.median(far)), float(far.min())) for power, far in lit.items()]
        lights = added.levels(learned.response)[is_seen] / learned.told(added)[is_seen, None, None]
        learned = replace(learned, others=tuple(seen), shape=np.median(lights, axis=0))
        learned = replace(learned, inside=MAD_TO_SIGMA**2 * np.median(learned.unlike(added), axis=0))
        strict = replace(learned, is_strict=True)
        is_away = (away > HALF * BEYOND_CHANCE_SPREADS * strict.sigmas_alike(added)) & ~is_seen
        learned = strict if is_away.sum() > CLEARLY_WORSE * is_seen.sum() else learned
    sure = BEYOND_CHANCE_SPREADS * learned.sigmas(added)
    is_between = (np.abs(away) > sure) & (learned.scores(added) >= SCORE_THRESHOLD)
    for other in learned.others:
        apart = other.away * _grown(added, other.power)
        is_between &= np.abs(away - apart) > np.maximum(sure, apart / 4)
    if learned.others:
        # What looks like the lamp, only dimmer, is the lamp dimmed.
        dimmed = np.square(replace(learned, is_strict=True).sigmas_alike(added))
        is_between &= np.square(learned.sigmas(added)) > CLEARLY_WORSE * dimmed
    return replace(learned, is_doubtful=int(is_between.sum()) >= MIN_VIEWS)


def _is_beyond(lamp: Lamp, known: LampPicture, added: Added, side: int) -> Mask:
    """(F,): which frames are surely beyond the panel picture's state, towards the other state (1) or away from it (-1).

    All pixels count equally: if the panel states the wrong state, their weights are wrong too.
    """
    away = (-side if lamp.lit else side) * added.levels().mean(axis=(1, 2))
    is_beyond: Mask = away >= np.maximum(BEYOND_CHANCE_SPREADS * known.sigmas(added), DIMMEST_LEVELS)
    return is_beyond


def _away(lamp: Lamp, learned: LampPicture, added: Added) -> Floats:
    """(F,): how far frames are from the state in the panel picture towards the other one, grey levels."""
    told = learned.told(added)
    return -told if lamp.lit else told


def _is_own(away: Floats, added: Added, power: float) -> Mask:
    """(F,): which frames show the panel picture's state, if the other's distance grows with this power of the gain."""
    grown = _grown(added, power)
    is_own: Mask = away / grown < max(_in_two(away, grown)[0], DIMMEST_LEVELS / 2)
    return is_own


def _powers(lamp: Lamp, learned: LampPicture, added: Added) -> tuple[float, ...]:
    """Find the powers of the gain with which the states' distance may grow, the one that divides frames best first."""
    away = _away(lamp, learned, added)
    unexplained = {power: 1.0 - _in_two(away, _grown(added, power))[1] for power in (0.0, 1.0)}
    least = min(unexplained.values())
    return tuple(
        sorted((p for p in unexplained if unexplained[p] <= CLEARLY_WORSE * least), key=unexplained.__getitem__)
    )


def _grown(added: Added, power: float) -> Floats:
    """(F,): how many times further apart the states lie in these frames than at a gain of 1."""
    grown: Floats = np.maximum(added.gain, MIN_LIGHT_GAIN) ** power
    return grown


def _in_two(away: Floats, grown: Floats) -> tuple[float, float]:
    """Divide frames (F,) into one state at 0 and another at a distance proportional to `grown`.

    Returns the threshold between the two at a gain of 1, and the part of the frames' sum of squares that the division
    explains (as Otsu, 1979).
    """
    order = np.argsort(away / grown)
    away, grown = away[order], grown[order]
    like, power = (np.cumsum(each[::-1])[::-1] for each in (away * grown, np.square(grown)))
    explained = np.square(like) / power / max(float(np.square(away).sum()), FACE_NOISE_LEVELS)
    first = int(np.argmax(explained))
    even = away / grown
    return float(even[max(first - 1, 0) : first + 1].mean()), float(explained[first])


def _response(added: Added, known: LampPicture, grid: WindowGrid, *, most: Floats) -> Floats:
    """(r, c): the slope of levels over gains, by the repeated median (Siegel, 1982), with a prior at the known one.

    The median keeps a few frames in odd light from changing much; the prior decides if all gains are alike. White
    pixels are assumed to have the known response, since nothing makes them brighter. The slope is at least that of a
    window that shows only its lamp, and at most `most`. For a lit lamp, in frames of both states, that is the slope of
    a window half of whose brightness is the lamp's: if levels seem to grow more with the gain, the reason is that the
    lamp goes out and so dims its surroundings.
    """
    levels, is_white = added.seen - added.expected, added.seen >= SATURATED_LEVEL
    apart, prior = np.abs(added.gain[:, None] - added.gain), EXPOSURE_PART**2
    is_told = apart >= np.median(apart, axis=0)
    by_frame = []
    for one, others in enumerate(is_told):
        run, rise = (added.gain[others] - added.gain[one])[:, None, None], levels[others] - levels[one]
        slopes = (rise * run + known.response * prior) / (np.square(run) + prior)
        slopes = np.where(is_white[others] | is_white[one], known.response, slopes)
        by_frame.append(np.median(slopes, axis=0))
    response: Floats = np.median(by_frame, axis=0)
    return np.clip(response, -known.drawn[grid.within], most)


def _scatter(levels: Floats) -> Floats:
    """(...): the spread within a state of levels (F, ...) in two states, however many are in each.

    About half of all pairs or more are in the same state, and so is nearly all of the nearest quarter of pairs.
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
        added = added_light(self._grid, picture, strips)
        scores = np.where(_is_beyond(self._lamp, picture, added, -1), 0.0, picture.scores(added))
        told, (least, most) = picture.told(added), picture.between(added)
        most = np.where(picture.is_only_dimmed(added), np.inf, most)
        # Words or colours may change in a window that is as bright as before.
        scores = np.where(np.abs(told) <= HALF * least, np.minimum(scores, picture.alike(added)), scores)
        sigmas = zip(picture.sigmas(added).tolist(), picture.sigmas_alike(added).tolist(), strict=True)
        halves = zip(least.tolist(), most.tolist(), strict=True)
        return [self._reading(*own) for own in zip(told.tolist(), sigmas, scores.tolist(), halves, strict=True)]

    def _reading(
        self, level: float, sigmas: tuple[float, float], score: float, halves: tuple[float, float]
    ) -> dict[str, Reading]:
        """Convert the light beyond the panel picture's, in grey levels, to readings.

        The panel picture's state is read only up to a quarter of the way to the other state. The other state is read
        only beyond half of that way, and beyond three quarters of the least that the sample showed; if it showed none,
        only beyond what the flank of a reflection or an uneven shadow would add. In between, nothing is read. A lamp
        that never seems to change is read only if it scatters no more than noise: otherwise it may change, but be too
        dim to tell.
        """
        lamp, picture, (sigma, alike), (least, most) = self._lamp, self._picture, sigmas, halves
        away = -level if lamp.lit else level
        if not picture.others:
            most = max(2 * BEYOND_CHANCE_SPREADS * sigma, DIMMEST_LEVELS, picture.shining / 2)
        narrow = BEYOND_CHANCE_SPREADS * (alike if picture.others else picture.sigma)
        if picture.is_strict or not picture.others:
            narrow *= HALF
        is_same = abs(away) <= min(narrow, HALF * least)
        is_other = away >= most
        is_told = (
            not picture.is_doubtful
            and least >= BEYOND_CHANCE_SPREADS * sigma
            and is_same != is_other
            and (bool(picture.others) or picture.sigma <= NOISE_LEVELS)
            and (bool(picture.others) or not lamp.lit or picture.shining >= DIMMEST_LEVELS)
            and score >= SCORE_THRESHOLD
        )
        status = Status.READ if is_told else Status.MISSING
        found = {lamp.name: Reading(status, float(is_other != lamp.lit), 0.0, score)}
        if lamp.light is not None:
            percent = PERCENT / WHITE
            found[lamp.light] = Reading(status, percent * max(level, 0.0), percent * sigma, score)
        return found


@dataclass(frozen=True, slots=True)
class SurroundedLamp:
    """What a lamp looks like in the light next to its window, and in the light further away.

    The window `is_inside` its bulb if in several frames of the sample only the light further away shows a change.
    """

    near: LampPicture
    far: LampPicture
    is_inside: bool = False


def first_surrounded(lamp: Lamp, grid: WindowGrid, drawn: UnwrappedGauge) -> SurroundedLamp:
    """Build a lamp's pictures from the panel picture (R, C) alone."""
    return SurroundedLamp(first_lamp(lamp, _nearest(grid), drawn[_cut(grid)]), first_lamp(lamp, grid, drawn))


def learn_surrounded(
    lamp: Lamp, grid: WindowGrid, strips: Sequence[UnwrappedGauge], known: SurroundedLamp
) -> SurroundedLamp:
    """Learn a lamp's pictures from a sample's frames (R, C)."""
    near = learn_lamp(lamp, _nearest(grid), [strip[_cut(grid)] for strip in strips], known.near)
    far = learn_lamp(lamp, grid, strips, known.far)
    if near.others or not strips:
        return SurroundedLamp(near, far)
    changed = _is_beyond(lamp, far, added_light(grid, far, np.stack(strips)), 1)
    return SurroundedLamp(near, far, is_inside=int(changed.sum()) >= MIN_VIEWS)


class SurroundedLampReader:
    """Reads a lamp in the light next to its window, and no state that the light further away contradicts.

    If the window is drawn inside its bulb, what is next to it brightens as much, and the lamp seems never to change.
    The light further away alone would tell less: the other lamps of an annunciator panel are there.
    """

    def __init__(self, lamp: Lamp, grid: WindowGrid, picture: SurroundedLamp) -> None:
        self._lamp, self._grid, self._far = lamp, grid, picture.far
        self._near = LampReader(lamp, _nearest(grid), picture.near)

    def read(self, strips: Floats, place_sigmas_px: Floats) -> list[dict[str, Reading]]:
        """Read F frames of the window and its surroundings, (F, R, C)."""
        added = added_light(self._grid, self._far, strips)
        has_changed = _is_beyond(self._lamp, self._far, added, 1).tolist()
        near = self._near.read(strips[:, *_cut(self._grid)], place_sigmas_px)
        return [
            _missing(own) if changed and self._seems_unchanged(own) else own
            for changed, own in zip(has_changed, near, strict=True)
        ]

    def _seems_unchanged(self, readings: dict[str, Reading]) -> bool:
        """Whether the lamp is read as the panel picture shows it."""
        return readings[self._lamp.name].angle_deg == float(self._lamp.lit)


def _missing(readings: dict[str, Reading]) -> dict[str, Reading]:
    return {name: replace(reading, status=Status.MISSING) for name, reading in readings.items()}


class LampKind(WindowKind):
    """A light that is on or off."""

    def owns(self, gauge: Gauge) -> bool:
        return gauge.lamp is not None

    def first(self, gauge: Gauge, grid: WindowGrid, drawn: UnwrappedGauge) -> SurroundedLamp:
        return first_surrounded(_lamp(gauge), grid, drawn)

    def learned(
        self, gauge: Gauge, grid: WindowGrid, strips: Sequence[UnwrappedGauge], known: SurroundedLamp
    ) -> SurroundedLamp:
        return learn_surrounded(_lamp(gauge), grid, strips, known)

    def window_reader(self, gauge: Gauge, grid: WindowGrid, picture: SurroundedLamp) -> SurroundedLampReader:
        return SurroundedLampReader(_lamp(gauge), grid, picture)

    def findings(self, gauge: Gauge, appearance: Appearance) -> Sequence[str]:
        name = _lamp(gauge).name
        inside = (
            f"{name} is not read where it changes, since what is next to its window brightens with it: draw the window"
            " around all that shines"
        )
        return (inside,) if appearance.pictures[name].is_inside else ()


def _nearest(grid: WindowGrid) -> WindowGrid:
    """Return the grid with only those of its surroundings that are next to the window."""
    cells = grid.margin - math.ceil(NEAR_PART * grid.margin)
    return replace(grid, rows=grid.rows - 2 * cells, columns=grid.columns - 2 * cells, margin=grid.margin - cells)


def _cut(grid: WindowGrid) -> tuple[slice, slice]:
    """Return the rows and columns of the window and of what is next to it."""
    cells = grid.margin - _nearest(grid).margin
    return slice(cells, grid.rows - cells), slice(cells, grid.columns - cells)


def _lamp(gauge: Gauge) -> Lamp:
    if gauge.lamp is None:
        raise AssertionError(f"{gauge.name} is no lamp")
    return gauge.lamp
