"""Uncertainty beyond a frame's own: by the printed marks, by the pivot, by how well dials are found."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from decoder.camera import parse_camera
from decoder.gauge_reader import Method
from decoder.panel_needles import drawn_gauges
from decoder.panel_pictures import panel_from_file
from decoder.panel_reader import PanelReader
from decoder.pictures import GreyPicture
from decoder.pivots import Pivot
from decoder.uncertainty import DRAWN_PX, FOUND_PX, HEIGHT_PART, MODEL_PX, QuantityUncertainty, quantity_uncertainties

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


def test_height_of_needles_leaves_doubt_of_their_pivots() -> None:
    """By a part of it, the more pixels an inch has; all round, since a shadow falls anywhere."""
    folder = Path(__file__).parents[2] / "fixtures" / "oblique" / "t1a_small"
    camera = parse_camera((folder / "camera.yaml").read_bytes(), source="camera.yaml")
    drawn = replace(panel_from_file(folder / "panel.yaml"), camera=camera)
    zeros = [gauge.readings for gauge in drawn_gauges(PanelReader.from_panel(drawn, Method.NORMXCORR))]
    found = quantity_uncertainties(drawn, [KNOWN] * len(drawn.panel.gauges), zeros, dials_move=False)
    covariances = [found[name].pivot.covariance_px2 for name in ("n1_1_pct", "oil_temp_1_c")]
    first, *_, last = drawn.panel.reference_points
    px_an_inch = math.dist(first.at, last.at) / math.dist(first.inches, last.inches)

    for covariance in covariances:
        assert math.sqrt(covariance[0, 0]) == pytest.approx(HEIGHT_PART * 0.05 * px_an_inch, rel=0.1)
        assert covariance == pytest.approx(covariance[0, 0] * np.eye(2))
