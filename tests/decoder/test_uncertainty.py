"""Uncertainty beyond a frame's own: by the printed marks, by the pivot, by how well dials are found."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from decoder.panel_needles import drawn_gauges
from decoder.panel_reader import PanelReader
from decoder.pictures import GreyPicture
from decoder.pivots import Pivot
from decoder.uncertainty import DRAWN_PX, FOUND_PX, MODEL_PX, QuantityUncertainty, quantity_uncertainties

Draw = Callable[..., GreyPicture]
MakeReader = Callable[..., PanelReader]
KNOWN = Pivot((0.0, 0.0), np.zeros((2, 2)))
AT_DEG = np.array([200.0])
PANEL_HANDS = {"speed_kt": 225.0, "al_lb": 195.0, "fr_lb": 345.0}


def uncertainty_of_speed(reader: PanelReader, *, pivot: Pivot = KNOWN, dials_move: bool = False) -> QuantityUncertainty:
    """Of a panel's first gauge, all pivots alike."""
    pivots = [pivot] * len(reader.source.panel.gauges)
    zeros = [gauge.readings for gauge in drawn_gauges(reader)]
    return quantity_uncertainties(reader.source, pivots, zeros, dials_move=dials_move)["speed_kt"]


def test_a_scale_on_its_printed_marks_is_certain(reader_of: MakeReader, draw: Draw) -> None:
    """To little more than how the needle's zero is seen; without marks it is what can be drawn."""
    with_marks = uncertainty_of_speed(reader_of(panel=draw(PANEL_HANDS, ticks=True)))
    without = uncertainty_of_speed(reader_of(panel=draw(PANEL_HANDS, ticks=False)))

    assert MODEL_PX <= math.radians(with_marks.drawn_deg) * with_marks.radius_px < 3 * MODEL_PX
    assert math.radians(without.drawn_deg) * without.radius_px == pytest.approx(DRAWN_PX)


def test_tilts_that_scatter_say_that_dials_are_not_where_they_are_unwrapped(reader_of: MakeReader) -> None:
    """Scatter below a needle's own noise says nothing."""
    scattered, quiet = replace(KNOWN, scatter_px2=0.09, tilts=40), replace(KNOWN, scatter_px2=-0.02, tilts=40)
    reader = reader_of()

    assert uncertainty_of_speed(reader, pivot=scattered).place_px == pytest.approx(0.3)
    assert uncertainty_of_speed(reader, pivot=quiet).place_px == 0.0
    assert uncertainty_of_speed(reader, pivot=quiet, dials_move=True).place_px == FOUND_PX


def test_all_parts_add_in_squares() -> None:
    """The drawing, the place and the pivot know nothing of each other."""
    pivot = replace(KNOWN, covariance_px2=0.04 * np.eye(2))
    uncertainty = QuantityUncertainty(0.03, 0.1, 50.0, pivot, 20.0)
    expected_deg = math.hypot(0.03, math.degrees(0.1 / 50.0), math.degrees(0.2 * 2.0 / 50.0))

    assert uncertainty.sigma_deg(AT_DEG) == pytest.approx([expected_deg])
    assert replace(uncertainty, zero_deg=None).sigma_deg(AT_DEG) < expected_deg
