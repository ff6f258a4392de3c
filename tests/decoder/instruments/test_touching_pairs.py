"""Touching pairs: two needles of one dial at any distance."""

from __future__ import annotations

import numpy as np
import pytest

from decoder.imaging.pictures import FramePicture, GreyPicture
from decoder.instruments.panel_reader import PanelReader, read_picture
from decoder.instruments.reading import FrameReadings, Status
from decoder.learning.fit import tune
from tests.decoder.cockpit import draw

# What templates of a single picture leave of two needles that touch.
KNOWN_DEG = 0.35
SCALE_DEG = (118.0, 422.0)
APART_DEG = np.concatenate([np.arange(-20.0, 20.5, 1.3), [-0.4, -0.2, 0.0, 0.2, 0.4]]).tolist()


@pytest.fixture(scope="module")
def tuned(reader: PanelReader) -> PanelReader:
    """The drawn cockpit's reader, fitted to frames of it."""
    rng = np.random.default_rng(5)
    places_deg = rng.uniform(125.0, 415.0, (24, 2)).tolist()
    return tune(
        reader,
        [draw({"al_lb": al, "fr_lb": fr}, noise=2.0, seed=seed) for seed, (al, fr) in enumerate(places_deg)],
    )


def read_together(reader: PanelReader, frames: list[GreyPicture]) -> list[FrameReadings]:
    """What is read of frames in one batch."""
    read = reader.read([FramePicture(frame) for frame in frames])
    return [one for one in read if isinstance(one, FrameReadings)]


@pytest.mark.parametrize("cover_deg", [119.0, 233.3, 300.0, 417.0])
def test_pairs_at_any_distance_are_read_where_they_are(reader: PanelReader, cover_deg: float) -> None:
    """Also at the ends of the scale: each needle lies where its reading says, or its sigma says how far beside it."""
    apart_on_the_scale = [apart for apart in APART_DEG if SCALE_DEG[0] <= cover_deg + apart <= SCALE_DEG[1]]
    frames = [draw({"al_lb": cover_deg + apart, "fr_lb": cover_deg}) for apart in apart_on_the_scale]
    statuses = set()
    for apart_deg, read in zip(apart_on_the_scale, read_together(reader, frames), strict=True):
        for name, there_deg in (("al_lb", cover_deg + apart_deg), ("fr_lb", cover_deg)):
            reading = read.readings[name]
            statuses.add(reading.status)
            if reading.status is not Status.MISSING:
                assert abs(reading.angle_deg - there_deg) < 3 * reading.sigma_deg + KNOWN_DEG
    assert statuses >= {Status.READ, Status.EDGE, Status.HIDDEN}


def test_what_is_read_of_a_pair_does_not_depend_on_the_frames_beside_it(tuned: PanelReader) -> None:
    """To the last bit, the uncertainty too."""
    frames = [draw({"al_lb": 300.0 + apart, "fr_lb": 300.0}, noise=2.0, seed=7) for apart in APART_DEG]
    together, alone = read_together(tuned, frames), [read_picture(tuned, frame) for frame in frames]

    assert {one.readings["al_lb"].status for one in together} >= {Status.READ, Status.EDGE, Status.HIDDEN}
    assert [one.readings for one in together] == [one.readings for one in alone]


@pytest.mark.parametrize("apart_deg", [-4.5, -3.7, -3.0, -2.5, -2.0, -1.5, 1.5, 2.0, 2.5, 3.0, 3.7, 4.5])
def test_mirrored_pair_is_no_surer_than_it_is(reader: PanelReader, apart_deg: float) -> None:
    """Two needles of one shade look the same with the one on either side: then neither is told, or sigma spans both."""
    rng = np.random.default_rng(79)
    for cover_deg in (150.3, 233.0, 287.2, 341.0):
        there_deg = {"al_lb": cover_deg + apart_deg, "fr_lb": cover_deg}
        frame = draw(there_deg)
        noisy = np.clip(frame + rng.normal(0.0, 4.0, frame.shape), 0, 255).astype(np.uint8)
        readings = read_picture(reader, noisy).readings
        for name, angle_deg in there_deg.items():
            if readings[name].status is not Status.MISSING:
                assert abs(readings[name].angle_deg - angle_deg) < 3 * readings[name].sigma_deg + KNOWN_DEG


@pytest.mark.parametrize("apart_deg", [-5.0, -4.2, 4.2, 5.0])
def test_learned_needles_tell_on_which_side_the_lower_one_lies(tuned: PanelReader, apart_deg: float) -> None:
    """From four degrees apart on, two needles of one shade are both read in their places, for all their soft edges."""
    for cover_deg in (152.3, 233.0, 287.2, 341.0):
        there_deg = {"al_lb": cover_deg + apart_deg, "fr_lb": cover_deg}
        readings = read_picture(tuned, draw(there_deg, noise=2.0, seed=int(cover_deg))).readings
        assert readings["al_lb"].status is Status.EDGE
        assert readings["fr_lb"].status is Status.READ
        for name, angle_deg in there_deg.items():
            assert readings[name].angle_deg == pytest.approx(angle_deg, abs=0.35)


def test_hidden_needle_s_sigma_spans_where_it_may_be(reader: PanelReader) -> None:
    """Three degrees apart, with a mirrored pair as likely, the lower needle is less sure than right below its cover."""
    apart, below = (
        read_picture(reader, draw({"al_lb": 233.0 + off, "fr_lb": 233.0})).readings["al_lb"] for off in (2.5, 0.0)
    )

    assert apart.status is below.status is Status.HIDDEN
    assert apart.sigma_deg > 1.5 * below.sigma_deg
