"""Anchors: found where they usually are, or anywhere, or not at all."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from decoder.anchors import AnchorFinder
from decoder.errors import PanelError
from decoder.panel import Anchor
from decoder.pictures import GreyPicture

KNOB = Anchor(name="knob", box=(140, 12, 40, 40))
HANDS = {"speed_kt": 214.0, "al_lb": 200.0, "fr_lb": 330.0}
Draw = Callable[..., GreyPicture]


@pytest.fixture(scope="module")
def finder(draw: Draw) -> AnchorFinder:
    """A finder of the drawn knob."""
    return AnchorFinder(KNOB, draw(HANDS), path="anchors[0]")


@pytest.mark.parametrize("shift", [(0, 0), (7, -5), (60, 90), (-30, 120)], ids=str)
def test_shifted_anchor_is_found_to_the_pixel(finder: AnchorFinder, draw: Draw, shift: tuple[int, int]) -> None:
    """Near the usual place or far from it, the centre is found where it was drawn."""
    hit = finder.find(draw(HANDS, shift_px=shift), (0.0, 0.0))

    assert hit.centre_px == (finder.centre_px[0] + shift[0], finder.centre_px[1] + shift[1])
    assert hit.score > 0.99


@pytest.mark.parametrize("usual", [(500.0, 500.0), (-900.0, -900.0), (0.0, 0.0)], ids=str)
def test_wrong_usual_place_does_not_matter(finder: AnchorFinder, draw: Draw, usual: tuple[float, float]) -> None:
    """Where the search region holds no anchor, or lies outside the frame, the whole frame is searched."""
    hit = finder.find(draw(HANDS, shift_px=(40, 60)), usual)

    assert hit.centre_px == (finder.centre_px[0] + 40, finder.centre_px[1] + 60)


@pytest.mark.parametrize("level", [0, 128, 255])
def test_flat_frame_holds_no_anchor(finder: AnchorFinder, level: int) -> None:
    """A black, grey or white frame scores 0 for a match, never 1."""
    assert finder.find(np.full((220, 360), level, np.uint8), (0.0, 0.0)).score < 0.3


def test_noise_holds_no_anchor(finder: AnchorFinder) -> None:
    """Noise scores far below what counts as found."""
    noise = np.random.default_rng(41).integers(0, 255, (220, 360)).astype(np.uint8)

    assert finder.find(noise, (0.0, 0.0)).score < 0.5


def test_frame_smaller_than_the_anchor_holds_none(finder: AnchorFinder) -> None:
    """A tiny frame is no error and no match."""
    assert finder.find(np.zeros((20, 20), np.uint8), (0.0, 0.0)).score == 0.0


@pytest.mark.parametrize(
    "box",
    [(-1, 12, 40, 40), (140, -3, 40, 40), (330, 12, 40, 40), (140, 190, 40, 40)],
    ids=["left", "top", "right", "bottom"],
)
def test_anchor_outside_the_picture_is_refused(draw: Draw, box: tuple[float, float, float, float]) -> None:
    """An anchor that reaches beyond any side of the panel picture is named with its path."""
    with pytest.raises(PanelError, match=r"anchors\[3\]\.box: lies outside the 360 x 220 panel picture"):
        AnchorFinder(Anchor(name="knob", box=box), draw(HANDS), path="anchors[3]")


def test_flat_anchor_is_refused(draw: Draw) -> None:
    """An anchor without contrast could be found anywhere, so it is no anchor."""
    with pytest.raises(PanelError, match=r"anchors\[0\]\.box: holds nothing that could be found again"):
        AnchorFinder(Anchor(name="nothing", box=(150, 170, 20, 20)), draw(HANDS), path="anchors[0]")
