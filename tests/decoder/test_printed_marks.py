"""Printed marks: how far a drawn scale lies from the printed marks is measured to some hundredths of a pixel."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decoder.alignment import IDENTITY
from decoder.pictures import GreyPicture
from decoder.printed_marks import drawn_to_deg, marks_off_deg
from decoder.unwrapping import polar_grid

CENTRE, OUTER_PX, FINE = (120.3, 119.6), 80.0, 8
MARKS_DEG = (130.0, 165.0, 200.0, 250.0, 301.0, 350.0, 400.0)


def dial(marks_deg: tuple[float, ...], noise_levels: float = 2.0) -> GreyPicture:
    """A dark dial with light marks just outside of its outer radius, drawn eightfold and made smaller."""
    fine = np.full((240 * FINE, 240 * FINE), 40, np.uint8)
    middle = (np.array(CENTRE) + 0.5) * FINE - 0.5
    for angle in marks_deg:
        way = np.array([math.cos(math.radians(angle)), math.sin(math.radians(angle))])
        ends = [tuple(np.rint((middle + way * radius * FINE) * 16).astype(int).tolist()) for radius in (78, 90)]
        cv2.line(fine, *ends, 220, 2 * FINE + 1, cv2.LINE_AA, 4)
    picture = cv2.resize(fine, (240, 240), interpolation=cv2.INTER_AREA).astype(np.float64)
    picture += np.random.default_rng(3).normal(0, noise_levels, picture.shape)
    return np.clip(picture, 0, 255).astype(np.uint8)


def off_px(drawn_deg: tuple[float, ...], picture: GreyPicture) -> np.ndarray:
    """How far the marks lie beside the drawing, along the outer radius."""
    grid = polar_grid(CENTRE, (30.0, OUTER_PX), 120.0, 410.0)
    return np.radians(marks_off_deg(drawn_deg, OUTER_PX, grid, picture, IDENTITY)) * OUTER_PX


@given(st.floats(-0.8, 0.8))
@settings(max_examples=15, deadline=None)
def test_marks_tell_how_far_the_drawing_is_off(by_px: float) -> None:
    """Whatever part of a pixel that is."""
    drawn_deg = tuple(angle - math.degrees(by_px / OUTER_PX) for angle in MARKS_DEG)

    assert off_px(drawn_deg, dial(MARKS_DEG)) == pytest.approx(np.full(len(MARKS_DEG), by_px), abs=0.06)


def test_a_scale_drawn_by_hand_is_as_precise_as_the_hand() -> None:
    """A tenth of a degree to and fro is found again."""
    rng = np.random.default_rng(5)
    drawn_deg = tuple(angle + rng.normal(0, 0.1) for angle in MARKS_DEG)
    off_deg = np.degrees(off_px(drawn_deg, dial(MARKS_DEG)) / OUTER_PX)

    assert drawn_to_deg(off_deg, OUTER_PX) == pytest.approx(0.1, abs=0.05)


def test_one_mark_that_is_covered_counts_little() -> None:
    """The others agree with the drawing to some hundredths of a pixel."""
    picture = dial(MARKS_DEG)
    cv2.line(picture, (120, 119), (int(120 + 95 * math.cos(3.52)), int(119 + 95 * math.sin(3.52))), 250, 7)
    off_deg = np.degrees(off_px(MARKS_DEG, picture) / OUTER_PX)
    sigma_deg = drawn_to_deg(off_deg, OUTER_PX)

    assert sigma_deg is not None
    assert math.radians(sigma_deg) * OUTER_PX < 0.05


@pytest.mark.parametrize("kind", ["no marks", "two marks", "other marks"])
def test_marks_that_are_not_the_scales_tell_nothing(kind: str) -> None:
    """A dial without marks, one with too few, and one whose scale does not follow them."""
    drawn_deg, picture = {
        "no marks": (MARKS_DEG, dial(())),
        "two marks": (MARKS_DEG[:2], dial(MARKS_DEG[:2])),
        "other marks": (tuple(angle + 0.7 for angle in MARKS_DEG), dial(MARKS_DEG)),
    }[kind]

    assert drawn_to_deg(np.degrees(off_px(drawn_deg, picture) / OUTER_PX), OUTER_PX) is None
