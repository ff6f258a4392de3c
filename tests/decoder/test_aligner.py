"""The aligner: the panel is where it was drawn, or the frame is lost and says why."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest

from decoder.aligner import Aligner
from decoder.alignment import IDENTITY, Alignment
from decoder.errors import AlignmentLost, PanelError
from decoder.panel import Panel
from decoder.pictures import GreyPicture

HANDS = {"speed_kt": 214.0, "al_lb": 200.0, "fr_lb": 330.0}
MOVED = {"speed_kt": 290.0, "al_lb": 260.0, "fr_lb": 160.0}
FAR = (60.0, 180.0)
Draw = Callable[..., GreyPicture]
Parse = Callable[[Any], Panel]


@pytest.fixture
def aligner(draw: Draw, parse: Parse, document: dict[str, Any]) -> Aligner:
    """An aligner of the drawn cockpit: one knob and the level edge."""
    return Aligner(parse(document), draw(HANDS))


@pytest.mark.parametrize("shift", [(0.0, 0.0), (3.4, -2.7), (-17.3, 21.6)], ids=str)
@pytest.mark.parametrize("roll_deg", [0.0, -0.4, 1.1])
def test_shift_and_roll_are_recovered(
    aligner: Aligner, draw: Draw, shift: tuple[float, float], roll_deg: float
) -> None:
    """Whatever the needles show, a point far from the anchor is found to a twentieth of a pixel."""
    found = aligner.align(draw(MOVED, shift_px=shift, roll_deg=roll_deg))

    assert found.roll_deg == pytest.approx(roll_deg, abs=0.01)
    assert found.to_frame(FAR) == pytest.approx(Alignment.rigid(roll_deg, shift, 1.0).to_frame(FAR), abs=0.05)
    assert found.score > 0.99


@pytest.mark.parametrize("shift", [(8.0, 31.25), (15.0, 45.0), (-40.0, 50.0)], ids=str)
def test_anchor_beyond_the_search_region_is_found(aligner: Aligner, draw: Draw, shift: tuple[float, float]) -> None:
    """A jolt that carries the anchor out of its usual region loses no frame, whatever lies in that region instead."""
    found = aligner.align(draw(MOVED, shift_px=shift))

    assert found.to_frame(FAR) == pytest.approx((FAR[0] + shift[0], FAR[1] + shift[1]), abs=0.05)


@pytest.mark.parametrize("shift_x", [20.0, 25.0, 28.0, 30.0, 31.0, 34.0])
def test_level_edge_at_the_border_of_the_frame_is_right_or_refused(
    aligner: Aligner, draw: Draw, shift_x: float
) -> None:
    """A border that repeats outside the frame is not taken for the level edge."""
    try:
        found = aligner.align(draw(MOVED, shift_px=(shift_x, 10.0)))
    except AlignmentLost:
        return

    assert found.to_frame(FAR) == pytest.approx((FAR[0] + shift_x, FAR[1] + 10.0), abs=0.2)


@pytest.mark.parametrize("roll_deg", [-3.0, -2.5, -2.0, -1.7, 1.7, 2.0, 2.25, 2.5, 3.0])
def test_roll_away_from_the_usual_is_right_or_refused(aligner: Aligner, draw: Draw, roll_deg: float) -> None:
    """A frame that is rolled further than the first search reaches is never placed at that search's end."""
    found = aligner.align(draw(MOVED, roll_deg=roll_deg))

    assert found.roll_deg == pytest.approx(roll_deg, abs=0.05)
    assert found.to_frame(FAR) == pytest.approx(Alignment.rigid(roll_deg, (0.0, 0.0), 1.0).to_frame(FAR), abs=0.2)


@pytest.mark.parametrize("roll_deg", [-8.0, -5.0, 5.0, 6.0, 7.0, 8.0])
def test_large_roll_is_settled_or_refused(aligner: Aligner, draw: Draw, roll_deg: float) -> None:
    """At the limit of the search an alignment that is accepted is as good as any other."""
    try:
        found = aligner.align(draw(MOVED, roll_deg=roll_deg))
    except AlignmentLost:
        return

    assert found.to_frame(FAR) == pytest.approx(Alignment.rigid(roll_deg, (0.0, 0.0), 1.0).to_frame(FAR), abs=0.2)


@pytest.mark.parametrize(("gain", "offset", "noise"), [(0.5, 0.0, 0.0), (0.6, 90.0, 0.0), (1.0, 0.0, 6.0)])
def test_light_and_noise_hardly_matter(aligner: Aligner, draw: Draw, gain: float, offset: float, noise: float) -> None:
    """Darker, brighter and noisier frames lie in the same place."""
    frame = draw(MOVED, shift_px=(2.3, -1.8), roll_deg=0.6, gain=gain, offset=offset, noise=noise, seed=51)
    found = aligner.align(frame)

    assert found.to_frame(FAR) == pytest.approx(Alignment.rigid(0.6, (2.3, -1.8), 1.0).to_frame(FAR), abs=0.2)


@pytest.mark.parametrize("level", [0, 90, 255])
def test_flat_frame_is_lost(aligner: Aligner, level: int) -> None:
    """A black, grey or white frame has no alignment, and the reason names the anchor and its score."""
    with pytest.raises(AlignmentLost, match=r"anchor knob not found \(score 0\.00\)"):
        aligner.align(np.full((220, 360), level, np.uint8))


def test_noise_is_lost(aligner: Aligner) -> None:
    """Noise is no panel."""
    with pytest.raises(AlignmentLost, match=r"anchor knob not found"):
        aligner.align(np.random.default_rng(52).integers(0, 255, (220, 360)).astype(np.uint8))


def test_covered_anchor_is_lost(aligner: Aligner, draw: Draw) -> None:
    """A hand over the only anchor makes the frame missing, not read by guess."""
    frame = draw(HANDS)
    frame[5:60, 135:185] = 200

    with pytest.raises(AlignmentLost, match=r"anchor knob not found"):
        aligner.align(frame)


def test_covered_level_edge_is_lost(aligner: Aligner, draw: Draw) -> None:
    """With the anchor found but the level edge gone the roll is unknown, so the frame is missing."""
    frame = draw(HANDS)
    frame[:, 315:] = 60

    with pytest.raises(AlignmentLost, match=r"level edge not found"):
        aligner.align(frame)


def test_frame_after_a_lost_one_is_found(aligner: Aligner, draw: Draw) -> None:
    """Nothing is carried from a lost frame to the next."""
    frame = draw(MOVED, shift_px=(5.0, 3.0), roll_deg=0.5)
    before = aligner.align(frame)
    with pytest.raises(AlignmentLost):
        aligner.align(np.zeros((220, 360), np.uint8))

    assert aligner.align(frame) == before


def test_usual_alignment_changes_nothing_but_where_the_search_starts(
    draw: Draw, parse: Parse, document: dict[str, Any]
) -> None:
    """A wrong idea of where the camera mostly was leads to the same place."""
    frame = draw(MOVED, shift_px=(4.0, -3.0), roll_deg=0.3)
    lost_camera = Aligner(parse(document), draw(HANDS), Alignment.rigid(-0.2, (-40.0, 35.0), 1.0))
    found, expected = lost_camera.align(frame), Aligner(parse(document), draw(HANDS), IDENTITY).align(frame)

    assert found.to_frame(FAR) == pytest.approx(expected.to_frame(FAR), abs=0.02)


def with_second_anchor(document: dict[str, Any]) -> dict[str, Any]:
    """The panel held by two anchors, without the level edge: the second boxes the edge of a dial."""
    del document["level"]
    document["anchors"].append({"name": "rim", "box": [20, 45, 60, 40]})
    return document


@pytest.mark.parametrize("roll_deg", [-3.0, 0.0, 0.7, 4.0])
def test_two_anchors_give_the_roll_too(draw: Draw, parse: Parse, document: dict[str, Any], roll_deg: float) -> None:
    """Without a level edge the roll comes from the direction between two anchors."""
    aligner = Aligner(parse(with_second_anchor(document)), draw(HANDS))
    found = aligner.align(draw(HANDS, shift_px=(1.7, 2.2), roll_deg=roll_deg))

    assert found.roll_deg == pytest.approx(roll_deg, abs=0.05)
    assert found.to_frame(FAR) == pytest.approx(Alignment.rigid(roll_deg, (1.7, 2.2), 1.0).to_frame(FAR), abs=0.1)


@pytest.mark.parametrize("roll_deg", [-2.0, 1.5, 3.0])
def test_roll_is_not_guessed_when_one_of_two_anchors_is_covered(
    draw: Draw, parse: Parse, document: dict[str, Any], roll_deg: float
) -> None:
    """Without a level edge one anchor alone cannot tell the roll: the frame is right or lost, never taken as level."""
    aligner = Aligner(parse(with_second_anchor(document)), draw(HANDS))
    frame = draw(HANDS, roll_deg=roll_deg)
    frame[35:95, 5:95] = 60
    try:
        found = aligner.align(frame)
    except AlignmentLost:
        return

    assert found.roll_deg == pytest.approx(roll_deg, abs=0.1)


def test_level_edge_outside_the_picture_is_refused(draw: Draw, parse: Parse, document: dict[str, Any]) -> None:
    """A level edge that leaves the panel picture is a mistake in the panel."""
    document["level"] = [[330, 20], [330, 500]]

    with pytest.raises(PanelError, match=r"level: lies outside the 360 x 220 panel picture"):
        Aligner(parse(document), draw(HANDS))


def test_level_edge_on_nothing_is_refused(draw: Draw, parse: Parse, document: dict[str, Any]) -> None:
    """A level edge drawn where the panel picture is flat could never be found."""
    document["level"] = [[345, 60], [345, 200]]

    with pytest.raises(PanelError, match=r"level: lies on no visible edge"):
        Aligner(parse(document), draw(HANDS))


def test_mirrored_panel_is_lost(aligner: Aligner, draw: Draw) -> None:
    """A panel seen in a mirror is not the panel."""
    with pytest.raises(AlignmentLost):
        aligner.align(np.ascontiguousarray(cv2.flip(draw(HANDS), 1)))
