"""Drafts of an oblique cockpit: carried to another frame, needles above their face; problems beside their fields."""

from __future__ import annotations

import traceback
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from decoder.imaging.alignment import IDENTITY, Alignment
from decoder.imaging.panel_pictures import PanelPictures, panel_from_file
from decoder.imaging.pictures import FramePicture, GreyPicture, grey_picture
from decoder.learning.fit import reader_from_panel
from decoder.panel.camera import camera_from_file
from decoder.panel.errors import AlignmentLost
from decoder.panel.vocabulary import Method
from decoder.registration.aligner import Aligner
from decoder.setup.answers import trial_answer
from decoder.setup.drafts import AlignmentMemory, problems_of
from decoder.setup.drawn_plane import Planes
from decoder.setup.pasting import pasted
from decoder.setup.requests import TrialQuestion
from decoder.setup.session import SetupSession
from decoder.setup.sources import open_source
from decoder.setup.trial import tried
from flight_file.reader import open_flight
from tests.programs import FIXTURES, yaml_of

FOLDER = FIXTURES / "oblique" / "t1a_small"
FLIGHT = FIXTURES / "oblique" / "t1a_small.mcap"

Draft = dict[str, Any]


@pytest.fixture
def written() -> Draft:
    """The panel that was written with the renderer's own numbers."""
    content: Draft = yaml_of(FOLDER / "panel.yaml")
    return content


def test_squared_up_angles_stay_when_a_panel_is_carried_over(written: Draft) -> None:
    """On a frame that is rolled by five degrees the places move, and the angles of dials seen square on do not."""
    panel = panel_from_file(FOLDER / "panel.yaml")
    camera = camera_from_file(FOLDER / "camera.yaml")
    reader = reader_from_panel(PanelPictures(panel.panel, panel.pictures, "", camera), Method.NORMXCORR)
    frame = list(open_flight([FLIGHT]).frames())[5]
    target = FramePicture(grey_picture(frame.encoded), frame.exif.focal_length_mm)
    done = pasted(written, reader.aligner, target, {}, camera)

    assert abs(done.roll_deg) > 3.0
    height, width = target.pixels.shape
    before, after = (Planes.of(each, (width, height), camera) for each in (written, done.document))
    alignment = reader.aligner.align(target.pixels, target.focal_length_mm)
    for own, carried in zip(written["gauges"], done.document["gauges"], strict=True):
        assert carried["sweep"] == pytest.approx(own["sweep"], abs=0.1)
        assert carried["scale"][0][0] == pytest.approx(own["scale"][0][0], abs=0.1)
        mark = before.drawn(tuple(own["centre"])).place(own["sweep"][0], own["radius"][1])
        seen = after.drawn(tuple(carried["centre"])).place(carried["sweep"][0], carried["radius"][1])
        assert seen == pytest.approx(alignment.to_frame(mark), abs=0.2)


def test_height_of_needles_is_offered(written: Draft, tmp_path: Path) -> None:
    """Seen from the side, their apparent offset from the pivot gives the needles' height above the face."""
    session = SetupSession(open_source([FLIGHT]), None, tmp_path / "panel.yaml")
    gauge = written["gauges"][0]
    truth = gauge.pop("needle_height_inches")
    draft = {**written, "gauges": [gauge], "anchors": written["anchors"][::2]}
    answer = trial_answer(session, TrialQuestion(document=draft, picture="panel", gauge=0, tab="t"), lambda: False)

    assert answer["height"] == pytest.approx(truth, abs=0.02)


@pytest.mark.parametrize(
    ("changes", "path"),
    [
        ({"stops": [200, 300]}, "gauges[0].stops"),
        ({"wraps": 360}, "gauges[0].wraps"),
        ({"card": {"name": "n1_1", "index": 270}}, "gauges[0].card"),
        ({"needles": []}, "gauges[0].needles"),
        ({"combined": {"name": "all", "needles": ["n1_1_pct", "none"]}}, "gauges[0].combined"),
        ({"combined": {"name": "all", "needles": ["n1_1_pct"]}}, "gauges[0].combined.needles"),
        ({"stops": [None, 300]}, "gauges[0].stops[0]"),
        ({"needle_height_inches": "high"}, "gauges[0].needle_height_inches"),
        ({"rim": [[0, 0], [1, 1]]}, "gauges[0].rim"),
        ({"covered_by": "nobody"}, "gauges[2].needles[0].covered_by"),
        ({"template": {"picture": "cut.png"}}, "gauges[2].needles[0].template"),
        ({"wraps": 12}, "gauges[2].needles[0]"),
        ({"name": "n1_1_pct"}, "gauges[2].needles[0].name"),
        ({"max_rate": -1}, "gauges[2].needles[0].max_rate"),
    ],
)
def test_problem_is_placed_beside_its_field(written: Draft, changes: Draft, path: str) -> None:
    """Also what is judged with a gauge as a whole, or with the panel, is said beside the field that it is about."""
    of_needle = path.startswith("gauges[2]")
    changed = written["gauges"][2]["needles"][0] if of_needle else written["gauges"][0]
    changed |= changes

    assert path in [each.path for each in problems_of(written, {})]


def test_camera_on_the_command_line_is_used(written: Draft, tmp_path: Path) -> None:
    """Needles above their face can be read where the camera is known, and only there."""
    source, target = open_source([FOLDER / "panel.jpg"]), tmp_path / "panel.yaml"  # a picture alone carries no camera
    camera = camera_from_file(FOLDER / "camera.yaml")
    without = SetupSession(source, None, target).problems(written, "frame-0")
    known = SetupSession(source, None, target, camera=camera).problems(written, "frame-0")

    assert {each.path for each in without} == {f"gauges[{index}].needle_height_inches" for index in range(12)}
    assert known == []


def test_a_gauge_that_is_tried_again_is_searched_for_in_no_frame(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The panel lies elsewhere in each frame; where is remembered from one trial to the next, with the same answer."""
    session, searched, search = SetupSession(open_source([FLIGHT]), None, tmp_path / "panel.yaml"), [], Aligner.search

    def counted(aligner: Aligner, frame: GreyPicture, focal_length_mm: float | None = None) -> Alignment:
        searched.append(1)
        return search(aligner, frame, focal_length_mm)

    monkeypatch.setattr(Aligner, "search", counted)
    source, frames = session.panel_of_gauge(session.document, session.picture_key, 0), session.frames()
    first = tried(source, frames, lambda: False)
    count = len(searched)

    assert tried(source, frames, lambda: False) == first
    assert len(searched) == count > len(frames)


def test_alignment_that_fails_is_remembered_and_does_not_grow() -> None:
    """However often it is asked for, the frame is looked at once, and the error has no longer history."""
    memory, frame, looks = AlignmentMemory(), np.zeros((4, 4), np.uint8), []

    def find() -> Alignment:
        looks.append(1)
        raise AlignmentLost("not found")

    depths = []
    for _ in range(4):
        with pytest.raises(AlignmentLost) as caught:
            memory.recall(("align", 1, None, IDENTITY.elements), frame, find)
        depths.append(len(traceback.extract_tb(caught.value.__traceback__)))

    assert looks == [1]
    assert len(set(depths[1:])) == 1
