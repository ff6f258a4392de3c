"""Each tick's own place, by least squares against the mean tick.

The picture's pixels are used as they are. Thin ticks are hardly wider than a pixel, and any interpolation between
pixels would move them back and forth. But many ticks are sampled at different phases, so together they show the mean
tick far more finely than any of them alone.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from decoder.calibration.profile import Array, Line
from decoder.calibration.thresholds import ALIKE, PER_PX
from decoder.imaging.pictures import GreyPicture
from decoder.imaging.thresholds import HALF
from decoder.panel.arrays import Mask

_BESIDE = (-1, 0, 1)
_ROUNDS = 5
_KNOTS = 200
_SEARCHES = 5
_PART = 0.45  # of a period on either side of a tick

Table = tuple[Array, Array]
"""A function of the distance from a tick: (M,) distances in pixels, (M,) levels."""


def fitted(picture: GreyPicture, line: Line, places_px: Array) -> tuple[Array, Mask]:
    """Fit ticks near the places where they are expected.

    Parameters
    ----------
    picture : (H, W) uint8
    line : across the ticks
    places_px : (K,) expected distances from the line's start

    Returns
    -------
    (K,) distances, (K,) whether it looks like the mean tick
    """
    period = float(np.median(np.diff(places_px)))
    along, levels = _windows(picture, line, places_px, _PART * period)
    centres, good = places_px.copy(), np.ones(len(places_px), bool)
    base, gain = np.median(levels, axis=1, keepdims=True), np.ones((len(places_px), 1))
    for _ in range(_ROUNDS):
        away = along - centres[:, None]
        shape = _mean_tick(away[good], ((levels - base) / gain)[good], period)
        shift, gain, base, alike = _fit(away, levels, shape)
        centres = centres + np.clip(shift, -0.1 * period, 0.1 * period)
        good = (alike > ALIKE) & (gain[:, 0] > HALF)  # of the mean tick
        if np.count_nonzero(good) < 2:  # noqa: PLR2004 - nothing to take a mean of
            break
    return centres, good


def _windows(picture: GreyPicture, line: Line, places_px: Array, reach_px: float) -> tuple[Array, Array]:
    """(K, n) distances along the line and (K, n) levels of the pixels around each place, three pixels wide."""
    axis = int(np.argmax(np.abs(line.direction)))  # one pixel after the other along the longer axis
    points = line.points(places_px)
    steps = np.arange(-max(1, round(reach_px)), max(1, round(reach_px)) + 1)
    main = np.round(points[:, axis, None]).astype(int) + steps
    slope = line.direction[1 - axis] / line.direction[axis]
    other = np.round(points[:, 1 - axis, None] + slope * (main - points[:, axis, None])).astype(int)
    pixels = np.empty((*main.shape, len(_BESIDE), 2), int)
    pixels[..., axis] = main[..., None]
    pixels[..., 1 - axis] = other[..., None] + np.array(_BESIDE)
    height, width = picture.shape
    column, row = np.clip(pixels[..., 0], 0, width - 1), np.clip(pixels[..., 1], 0, height - 1)
    along = (pixels - np.array(line.start_px)) @ line.direction
    shape = (len(places_px), -1)
    return along.reshape(shape), picture[row, column].astype(np.float64).reshape(shape)


def _mean_tick(away: Array, levels: Array, period: float) -> Table:
    """Fit the mean tick: the blurred bar that best fits pixels at all distances from their ticks.

    A bar has two parameters. If there are few ticks, a free shape would absorb each tick's own error.
    """
    reach = float(np.abs(away).max())
    count = max(int(reach * PER_PX), 2)
    which = np.minimum((np.abs(away) / reach * count).astype(int), count - 1)
    filled = [number for number in range(count) if np.any(which == number)]
    knots = np.array([np.median(np.abs(away)[which == number]) for number in filled])
    means = np.array([np.median(levels[which == number]) for number in filled])
    weights = np.sqrt(np.bincount(which.ravel(), minlength=count)[filled])
    breadth, blur, span = 0.1 * period, 0.08 * period, 8.0
    for _ in range(_SEARCHES):
        factors = span ** np.linspace(-1, 1, 9)
        tries = [(breadth * one, blur * other) for one in factors for other in factors]
        breadth, blur = min(tries, key=lambda pair: _miss(_bar(pair[0], pair[1], period), knots, means, weights))
        span **= 0.35
    table = _bar(breadth, blur, period)
    offset, gain = _line_through(table, knots, means, weights)
    return table[0], offset + gain * table[1]


def _bar(breadth: float, blur: float, period: float) -> Table:
    """Tabulate a bar of light 1, blurred by a Gaussian, with its neighbours, by the distance from its middle."""
    knots = np.linspace(0, 0.75 * period, _KNOTS)
    light = np.zeros_like(knots)
    for neighbour in (-period, 0.0, period):
        for side in (-0.5, 0.5):
            edge = (knots - neighbour - side * breadth) / blur
            light -= np.sign(side) * np.interp(edge, *_step())
    return knots, light


@cache
def _step() -> Table:
    """Tabulate a step from 0 to 1, blurred by a Gaussian of sigma 1."""
    places = np.linspace(-5, 5, 1001)
    return places, np.array([0.5 * (1 + math.erf(place / math.sqrt(2))) for place in places])


def _line_through(table: Table, knots: Array, means: Array, weights: Array) -> tuple[float, float]:
    """Return the offset and gain with which a bar fits the means best."""
    light = np.interp(knots, *table)
    rows = np.stack([np.ones_like(light), light], axis=1) * weights[:, None]
    offset, gain = np.linalg.lstsq(rows, means * weights, rcond=None)[0]
    return float(offset), float(gain)


def _miss(table: Table, knots: Array, means: Array, weights: Array) -> float:
    offset, gain = _line_through(table, knots, means, weights)
    return float(np.sum(((offset + gain * np.interp(knots, *table) - means) * weights) ** 2))


def _fit(away: Array, levels: Array, shape: Table) -> tuple[Array, Array, Array, Array]:
    """Fit each window as base + slope + gain * shifted mean tick: (K,) shift, (K, 1) gain, (K, n) base, (K,) NCC."""
    step = 1 / PER_PX
    tick = np.interp(np.abs(away), *shape)
    steep = (np.interp(np.abs(away + step), *shape) - np.interp(np.abs(away - step), *shape)) / (2 * step)
    base = np.stack([np.ones_like(away), away], axis=2)
    model = np.concatenate([base, tick[..., None], -steep[..., None]], axis=2)
    parts = (np.linalg.pinv(model, rcond=1e-4) @ levels[..., None])[..., 0]
    gain = np.where(np.abs(parts[:, 2]) > 1e-3, parts[:, 2], 1e-3)  # noqa: PLR2004 - a window without a tick
    below = (base @ parts[:, :2, None])[..., 0]
    flat, explained = levels - below, (model[..., 2:] @ parts[:, 2:, None])[..., 0]
    left = np.sum((flat - explained) ** 2, axis=1) / np.maximum(np.sum(flat**2, axis=1), 1e-9)
    return parts[:, 3] / gain, gain[:, None], below, np.sqrt(np.clip(1 - left, 0, 1))
