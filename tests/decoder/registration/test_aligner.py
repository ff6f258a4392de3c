"""The aligner: the panel is where it was drawn, or the frame is lost and says why."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from decoder.imaging.alignment import Alignment
from decoder.imaging.pictures import GreyPicture
from decoder.panel.errors import AlignmentLost, PanelError
from decoder.registration.aligner import Aligner
from tests.decoder.cockpit import PANEL_ANGLES_DEG as HANDS
from tests.decoder.cockpit import draw, parse

MOVED = {"speed_kt": 290.0, "al_lb": 260.0, "fr_lb": 160.0}
FAR = (60.0, 180.0)


@pytest.fixture
def aligner(document: dict[str, Any]) -> Aligner:
    """An aligner of the drawn cockpit: one knob and the level edge."""
    return Aligner(parse(document), draw(HANDS))


SHAKEN = [((0.0, 0.0), 0.0), ((3.4, -2.7), -0.4), ((-17.3, 21.6), 1.1)]
# Out of the anchor's usual region, whatever lies there instead; rolled further than the first search reaches.
JOLTED = [((x, y), 0.0) for x, y in ((8.0, 31.25), (-40.0, 50.0))]
ROLLED = [((0.0, 0.0), roll_deg) for roll_deg in (-3.0, -1.7, 2.25)]


@pytest.mark.parametrize(("shift", "roll_deg"), [*SHAKEN, *JOLTED, *ROLLED], ids=str)
def test_shift_and_roll_are_recovered(aligner: Aligner, shift: tuple[float, float], roll_deg: float) -> None:
    """Whatever the needles show, a point far from the anchor is right to a twentieth of a pixel, or a fifth."""
    found = aligner.align(draw(MOVED, shift_px=shift, roll_deg=roll_deg))
    far = abs(roll_deg) > 1.5

    assert found.roll_deg == pytest.approx(roll_deg, abs=0.05 if far else 0.01)
    assert found.to_frame(FAR) == pytest.approx(
        Alignment.rigid(roll_deg, shift, 1.0).to_frame(FAR), abs=0.2 if far else 0.05
    )
    assert found.score > (0.95 if far else 0.99)


@pytest.mark.parametrize(
    ("shift_x", "roll_deg"),
    [*((x, 0.0) for x in (20.0, 30.0, 34.0)), *((0.0, roll) for roll in (-8, 5, 6))],
)
def test_view_at_the_limit_is_right_or_refused(aligner: Aligner, shift_x: float, roll_deg: float) -> None:
    """A repeated border outside the frame is not taken for the level edge, nor the end of a search for a roll."""
    shift = (shift_x, 10.0 if shift_x else 0.0)
    try:
        found = aligner.align(draw(MOVED, shift_px=shift, roll_deg=roll_deg))
    except AlignmentLost:
        return

    assert found.to_frame(FAR) == pytest.approx(Alignment.rigid(roll_deg, shift, 1.0).to_frame(FAR), abs=0.2)


def covered(rows: slice, columns: slice, level: int) -> GreyPicture:
    """The panel with something over a part of it."""
    frame = draw(HANDS)
    frame[rows, columns] = level
    return frame


NOWHERE: dict[str, tuple[GreyPicture, str]] = {
    "black": (np.zeros((220, 360), np.uint8), r"anchor knob not found \(score 0\.00\)"),
    "noise": (np.random.default_rng(52).integers(0, 255, (220, 360)).astype(np.uint8), "anchor knob not found"),
    "a hand over the anchor": (covered(slice(5, 60), slice(135, 185), 200), "anchor knob not found"),
    "no level edge": (covered(slice(None), slice(315, None), 60), "level edge not found"),
    "in a mirror": (np.ascontiguousarray(draw(HANDS)[:, ::-1]), "not found"),
}


@pytest.mark.parametrize(("frame", "says"), NOWHERE.values(), ids=NOWHERE)
def test_frame_without_the_whole_panel_is_lost(aligner: Aligner, frame: GreyPicture, says: str) -> None:
    """It is missing, not read by guess, and names what was looked for."""
    with pytest.raises(AlignmentLost, match=says):
        aligner.align(frame)


@pytest.mark.parametrize(
    ("usual", "shift", "roll_deg"),
    [((-0.2, (-40.0, 35.0)), (4.0, -3.0), 0.3), ((11.8, (18.0, -21.0)), (20.0, -20.0), 12.0)],
    ids=["wrong", "far from the panel picture"],
)
def test_usual_alignment_is_where_the_search_starts(
    document: dict[str, Any], usual: tuple[float, tuple[float, float]], shift: tuple[float, float], roll_deg: float
) -> None:
    """A wrong usual alignment leads to the same place; a right one also to a roll that is far off."""
    frame = draw(MOVED, shift_px=shift, roll_deg=roll_deg)
    found = Aligner(parse(document), draw(HANDS), Alignment.rigid(*usual, 1.0)).align(frame)

    assert found.to_frame(FAR) == pytest.approx(Alignment.rigid(roll_deg, shift, 1.0).to_frame(FAR), abs=0.2)


def with_second_anchor(document: dict[str, Any]) -> dict[str, Any]:
    """The panel held by two anchors, without the level edge: the second boxes the edge of a dial."""
    del document["level"]
    document["anchors"].append({"name": "rim", "box": [20, 45, 60, 40]})
    return document


@pytest.mark.parametrize("roll_deg", [-3.0, 0.7, 4.0])
def test_two_anchors_give_the_roll_too(document: dict[str, Any], roll_deg: float) -> None:
    """Without a level edge the roll comes from the direction between two anchors."""
    aligner = Aligner(parse(with_second_anchor(document)), draw(HANDS))
    found = aligner.align(draw(HANDS, shift_px=(1.7, 2.2), roll_deg=roll_deg))

    assert found.roll_deg == pytest.approx(roll_deg, abs=0.05)
    assert found.to_frame(FAR) == pytest.approx(Alignment.rigid(roll_deg, (1.7, 2.2), 1.0).to_frame(FAR), abs=0.1)


@pytest.mark.parametrize("roll_deg", [-2.0, 3.0])
def test_roll_is_not_guessed_when_one_of_two_anchors_is_covered(document: dict[str, Any], roll_deg: float) -> None:
    """Without a level edge one anchor alone cannot tell the roll: the frame is right or lost, never taken as level."""
    aligner = Aligner(parse(with_second_anchor(document)), draw(HANDS))
    frame = draw(HANDS, roll_deg=roll_deg)
    frame[35:95, 5:95] = 60
    try:
        found = aligner.align(frame)
    except AlignmentLost:
        return

    assert found.roll_deg == pytest.approx(roll_deg, abs=0.1)


def test_flat_anchor_is_left_out_and_named(document: dict[str, Any]) -> None:
    """It cannot be found again: the others align the frame as without it."""
    without = Aligner(parse(with_second_anchor(document)), draw(HANDS))
    document["anchors"].insert(1, {"name": "bare metal", "box": [150, 170, 20, 20]})
    aligner = Aligner(parse(document), draw(HANDS))
    frame = draw(HANDS, shift_px=(1.7, 2.2), roll_deg=0.7)

    assert aligner.align(frame) == without.align(frame)
    assert not without.shortcomings
    assert [said for said in aligner.shortcomings if said.startswith("anchors[1].box: holds nothing")]


@pytest.mark.parametrize(
    ("edge", "says"),
    [
        ([[330, 20], [330, 500]], r"level: lies outside the 360 x 220 panel picture"),
        ([[345, 60], [345, 200]], r"level: lies on no visible edge"),
    ],
)
def test_level_edge_that_cannot_be_found_is_refused(document: dict[str, Any], edge: list[list[int]], says: str) -> None:
    """An edge that leaves the panel picture, or is drawn where that is flat, is an error in the panel."""
    document["level"] = edge

    with pytest.raises(PanelError, match=says):
        Aligner(parse(document), draw(HANDS))


OUTSIDE = r"anchors\[0\]\.box: lies outside the 360 x 220 panel picture"


@pytest.mark.parametrize(
    ("box", "says"),
    [
        ([-1, 12, 40, 40], OUTSIDE),
        ([140, 190, 40, 40], OUTSIDE),
        ([150, 170, 20, 20], r"anchors\[0\]\.box: holds nothing that could be found again"),
    ],
    ids=["left", "bottom", "flat"],
)
def test_anchor_that_cannot_be_found_again_is_refused(document: dict[str, Any], box: list[int], says: str) -> None:
    """An anchor that reaches beyond the panel picture, or a single one without contrast, is named with its path."""
    document["anchors"][0]["box"] = box

    with pytest.raises(PanelError, match=says):
        Aligner(parse(document), draw(HANDS))
