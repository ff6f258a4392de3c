"""Needle layers: what a template says of a needle, whatever it was cut from."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from decoder.flight_tuning import tune
from decoder.needle_layer import first_layer
from decoder.panel_reader import PanelReader
from decoder.pictures import GreyPicture
from decoder.reading import Status

Draw = Callable[..., GreyPicture]
MakeReader = Callable[..., PanelReader]


def too_narrow(content: dict[str, Any]) -> None:
    """A panel whose template is narrower than the needle's root."""
    gauge = content["gauges"][0]
    gauge["radius"] = [6, 52]
    gauge["needles"][0]["template"]["span"] = 8


def angles_of(seed: int) -> dict[str, float]:
    """Needles in random places, those of the fuel gauge well apart."""
    rng = np.random.default_rng(seed)
    return {"speed_kt": rng.uniform(125, 415), "al_lb": rng.uniform(125, 240), "fr_lb": rng.uniform(290, 415)}


def test_needle_wider_than_its_template_near_the_pivot_is_read_all_the_same(reader_of: MakeReader, draw: Draw) -> None:
    """Where the needle fills the template it has no edges; the rest of it is enough."""
    tuned = tune(reader_of(too_narrow), [draw(angles_of(seed), noise=2.0, seed=seed) for seed in range(16)])
    for seed in range(20, 28):
        truth = angles_of(seed)
        reading = tuned.read(draw(truth)).readings["speed_kt"]
        assert reading.status is Status.READ
        assert reading.score > 0.97
        assert reading.angle_deg == pytest.approx(truth["speed_kt"], abs=0.1)


def test_columns_without_an_edge_are_not_trusted() -> None:
    """A column that the needle fills says nothing; one whose needle ends on one side at least does."""
    plain = np.full(3, 40.0, np.float32)
    pixels = np.full((21, 3), 40.0, np.float32)
    pixels[:, 0] = 200.0  # filled
    pixels[:12, 1] = 200.0  # reaches over one end
    pixels[8:13, 2] = 200.0  # stands free
    layer = first_layer(pixels, plain, 0.5)

    assert layer.trust.max(axis=0).tolist() == [0.0, 1.0, 1.0]


def test_needle_that_fills_all_columns_keeps_them() -> None:
    """A template with no edge anywhere is as good as it gets."""
    pixels = np.full((21, 3), 200.0, np.float32)
    layer = first_layer(pixels, np.full(3, 40.0, np.float32), 0.5)

    assert layer.trust.min() == 1.0
