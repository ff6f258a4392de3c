"""Anchors: found where they usually are, or anywhere, or not at all."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from decoder.alignment import Alignment
from decoder.anchors import AnchorFinder, AnchorHit, check_anchor
from decoder.errors import PanelError
from decoder.panel import Anchor
from decoder.pictures import GreyPicture

HANDS = {"speed_kt": 214.0, "al_lb": 200.0, "fr_lb": 330.0}
Draw = Callable[..., GreyPicture]


def crop(picture: GreyPicture, turned_deg: float = 0.0) -> GreyPicture:
    """The knob cut from a picture; it is never turned here."""
    assert turned_deg == 0.0
    return np.ascontiguousarray(picture[12:52, 140:180])


@pytest.fixture(scope="module")
def finder(draw: Draw) -> AnchorFinder:
    """A finder of the drawn knob."""
    return AnchorFinder("knob", (159.5, 31.5), partial(crop, draw(HANDS)))


def anywhere(finder: AnchorFinder, frame: GreyPicture) -> AnchorHit:
    """The best match in the whole frame."""
    return max(finder.anywhere(frame), key=lambda hit: hit.score)


@pytest.mark.parametrize("shift", [(0, 0), (7, -5), (-16, 15)], ids=str)
def test_shifted_anchor_is_found_near_its_usual_place(finder: AnchorFinder, draw: Draw, shift: tuple[int, int]) -> None:
    """Within the margin the centre is found where it was drawn, to the pixel."""
    hit = finder.near(draw(HANDS, shift_px=shift), finder.centre_px, 16)

    assert hit.centre_px == (finder.centre_px[0] + shift[0], finder.centre_px[1] + shift[1])
    assert hit.score > 0.99


@pytest.mark.parametrize("shift", [(0, 0), (7, -5), (60, 90), (-31, 121)], ids=str)
def test_shifted_anchor_is_found_anywhere(finder: AnchorFinder, draw: Draw, shift: tuple[int, int]) -> None:
    """Far from its place too, the centre is found where it was drawn, to the pixel."""
    hit = anywhere(finder, draw(HANDS, shift_px=shift))

    assert hit.centre_px == (finder.centre_px[0] + shift[0], finder.centre_px[1] + shift[1])
    assert hit.score > 0.99


def test_turned_anchor_is_found_in_the_form_that_an_alignment_gives_it(finder: AnchorFinder, draw: Draw) -> None:
    """Where the alignment is some pixels off, the place is right to the pixel, and nothing is lost to the roll."""
    truth = Alignment.rigid(4.0, (12.0, -3.0), 1.0)
    frame = draw(HANDS, shift_px=(12.0, -3.0), roll_deg=4.0)
    hit = finder.seen_through(frame, Alignment.rigid(4.0, (7.0, 3.0), 1.0), 12)

    assert hit.centre_px == pytest.approx(truth.to_frame(finder.centre_px), abs=0.8)
    assert hit.score > 0.98
    assert finder.near(frame, hit.centre_px, 4).score < hit.score - 0.01


@pytest.mark.parametrize("place", [(500.0, 500.0), (-900.0, -900.0)], ids=str)
def test_nothing_is_found_near_a_place_outside_the_frame(
    finder: AnchorFinder, draw: Draw, place: tuple[float, float]
) -> None:
    """Where there is no room for the anchor the score is 0."""
    assert finder.near(draw(HANDS), place, 16).score == 0.0


def test_features_that_look_alike_are_all_found(finder: AnchorFinder, draw: Draw) -> None:
    """Of two knobs that are the same both places come out, neither twice."""
    frame = draw(HANDS)
    frame[172:212, 60:100] = frame[12:52, 140:180]
    best = sorted(hit.centre_px for hit in finder.anywhere(frame) if hit.score > 0.95)

    assert best == [(79.5, 191.5), (159.5, 31.5)]


@pytest.mark.parametrize("level", [0, 128, 255])
def test_flat_frame_holds_no_anchor(finder: AnchorFinder, level: int) -> None:
    """A black, grey or white frame scores 0 for a match, never 1."""
    assert max((hit.score for hit in finder.anywhere(np.full((220, 360), level, np.uint8))), default=0.0) < 0.3


def test_noise_holds_no_anchor(finder: AnchorFinder) -> None:
    """Noise scores far below what counts as found."""
    noise = np.random.default_rng(41).integers(0, 255, (220, 360)).astype(np.uint8)

    assert max((hit.score for hit in finder.anywhere(noise)), default=0.0) < 0.5


def test_frame_smaller_than_the_anchor_holds_none(finder: AnchorFinder) -> None:
    """A tiny frame is no error and no match."""
    assert finder.anywhere(np.zeros((20, 20), np.uint8)) == []


@pytest.mark.parametrize(
    "box",
    [(-1, 12, 40, 40), (140, -3, 40, 40), (330, 12, 40, 40), (140, 190, 40, 40)],
    ids=["left", "top", "right", "bottom"],
)
def test_anchor_outside_the_picture_is_refused(draw: Draw, box: tuple[float, float, float, float]) -> None:
    """An anchor that reaches beyond any side of the panel picture is named with its path."""
    with pytest.raises(PanelError, match=r"anchors\[3\]\.box: lies outside the 360 x 220 panel picture"):
        check_anchor(Anchor(name="knob", box=box), draw(HANDS), path="anchors[3]")


def test_flat_anchor_is_refused(draw: Draw) -> None:
    """An anchor without contrast could be found anywhere, so it is no anchor."""
    with pytest.raises(PanelError, match=r"anchors\[0\]\.box: holds nothing that could be found again"):
        check_anchor(Anchor(name="nothing", box=(150, 170, 20, 20)), draw(HANDS), path="anchors[0]")
