"""Windows drawn from formulas: levels at their sample points, and gauges that describe them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from decoder.imaging.unwrapping import WindowGrid, windowed
from decoder.imaging.unwrapping import grid_of as grid_of_gauge
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge

Levels = Callable[[Floats, Floats], Floats]
"""Grey levels at x and y of the panel picture."""


def gauge_of(corners: list[list[float]], **kind: Any) -> tuple[Gauge, WindowGrid]:  # noqa: ANN401 - as in YAML
    """A gauge with a window, and its grid."""
    gauge = Gauge.model_validate({"name": "g", "window": corners, **kind})
    return gauge, windowed(grid_of_gauge(gauge))


def seen(grid: WindowGrid, levels: Levels, seed: int, *, gain: float = 1.0, slope: float = 0.0) -> Floats:
    """A window as it is sampled, with a sensor's noise, in a light that changes across it."""
    x, y = grid.points().astype(np.float64)
    light = gain * (1.0 + slope * (x - x.mean()) / np.ptp(x))
    noise = np.random.default_rng(seed).normal(0.0, 2.0, x.shape)
    return np.clip(light * levels(x, y) + noise, 0.0, 255.0).astype(np.float32)


def bar(place: Floats, half_px: float, blur_px: float = 1.0) -> Floats:
    """From 0 to 1: how much a bar with soft edges covers, by the distance from its middle."""
    ends = [1.0 / (1.0 + np.exp(-(half_px + side * place) / (blur_px / 2))) for side in (-1.0, 1.0)]
    covered: Floats = ends[0] * ends[1]
    return covered
