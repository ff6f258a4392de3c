"""Two needles of one dial, one over the other: at any distance each is read, uncertain or missing, never invented."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest

from decoder.imaging.pictures import FramePicture, GreyPicture
from decoder.instruments.panel_reader import PanelReader, read_picture
from decoder.instruments.reading import FrameReadings, Reading, Status
from decoder.learning.fit import tune
from tests.decoder.cockpit import PANEL_ANGLES_DEG, draw, reader_of

# What templates of a single picture leave of two needles that touch.
KNOWN_DEG = 0.35
# A panel drawn on a picture is good to a tenth of a pixel: so much all readings of a dial may be off together.
SYSTEMATIC_DEG = 0.16
COVER_DEG = 270.3
LEVELS = {"alike": {}, "dim below": {"al_lb": 150.0}, "dim above": {"fr_lb": 150.0}}
# A covering needle dimmer than the one below it, as no instrument has it, may be lost beside that:
# docs/adr/0004-kinds-of-instrument.md.
CLEAR = ("alike", "dim below")


@cache
def pairs_of(kind: str) -> list[tuple[float, Reading, Reading]]:
    """Distances of the lower needle from the upper one, up to thirty degrees to either side, and both readings."""
    levels = LEVELS[kind]
    reader = reader_of(panel=draw(PANEL_ANGLES_DEG, levels=levels))
    pairs = []
    for apart_deg in np.arange(-30.0, 31.0).tolist():
        frame = draw({"speed_kt": 214.0, "al_lb": COVER_DEG + apart_deg, "fr_lb": COVER_DEG}, levels=levels)
        readings = read_picture(reader, frame).readings
        pairs.append((apart_deg, readings["al_lb"], readings["fr_lb"]))
    return pairs


@pytest.mark.slow
@pytest.mark.parametrize("kind", LEVELS)
def test_pair_is_right_or_doubted_at_any_distance(kind: str) -> None:
    """No certain value is wrong; a hidden needle is at its cover's place, no more certain than that, and invisible."""
    for apart_deg, lower, upper in pairs_of(kind):
        for reading, truth_deg in ((lower, COVER_DEG + apart_deg), (upper, COVER_DEG)):
            if reading.status is not Status.MISSING:
                assert abs(reading.angle_deg - truth_deg) <= 4 * np.hypot(reading.sigma_deg, SYSTEMATIC_DEG)
                assert 0.001 < reading.sigma_deg < np.inf
        if lower.status is Status.EDGE:
            assert abs(lower.angle_deg - COVER_DEG - apart_deg) <= 0.5
        if lower.status is Status.HIDDEN:
            assert abs(apart_deg) <= 4.0
            assert (lower.angle_deg, lower.sigma_deg >= upper.sigma_deg) == (upper.angle_deg, True)


@pytest.mark.slow
@pytest.mark.parametrize("kind", CLEAR)
def test_lower_needle_is_hidden_then_an_edge_then_whole(kind: str) -> None:
    """From under its cover outwards, on its own side of it, and never missing; the upper one is always read."""
    pairs, order = pairs_of(kind), [Status.HIDDEN, Status.EDGE, Status.READ]
    for apart_deg, lower, upper in pairs:
        assert upper.status is Status.READ
        assert abs(upper.angle_deg - COVER_DEG) <= max(0.5, 3 * upper.sigma_deg)
        assert lower.status is not Status.READ or abs(lower.angle_deg - COVER_DEG - apart_deg) <= 0.1
        if lower.status in {Status.EDGE, Status.READ} and abs(apart_deg) >= 1.0:
            assert np.sign(lower.angle_deg - upper.angle_deg) == np.sign(apart_deg)
    for side in (pairs[30::-1], pairs[30:]):
        seen = [lower.status for _, lower, _ in side]
        assert seen == sorted(seen, key=order.index)
        assert set(seen) == set(order)


@pytest.mark.parametrize("cover_deg", [119.0, 417.0])
def test_pair_at_an_end_of_the_scale_is_right_or_doubted(reader: PanelReader, cover_deg: float) -> None:
    """Each reading is right, or off within its sigma."""
    for apart_deg in (-2.7, -1.4, -0.2, 0.4, 1.3, 4.0):
        there_deg = {"al_lb": float(np.clip(cover_deg + apart_deg, 118.0, 422.0)), "fr_lb": cover_deg}
        assert_right_or_doubted(reader, draw(there_deg), there_deg)


def assert_right_or_doubted(reader: PanelReader, frame: GreyPicture, there_deg: dict[str, float]) -> None:
    """Whatever has a value is within three sigma, beyond what a single picture leaves unknown."""
    readings = read_picture(reader, frame).readings
    for name, angle_deg in there_deg.items():
        off_deg = abs(readings[name].angle_deg - angle_deg)
        assert readings[name].status is Status.MISSING or off_deg < 3 * readings[name].sigma_deg + KNOWN_DEG


@pytest.mark.parametrize("apart_deg", [-4.5, -3.0, -2.0, 1.5, 2.5, 3.7])
def test_mirrored_pair_is_no_surer_than_it_is(reader: PanelReader, apart_deg: float) -> None:
    """Two needles of one shade look the same mirrored: then neither is read, or sigma covers both."""
    for cover_deg in (150.3, 287.2):
        there_deg = {"al_lb": cover_deg + apart_deg, "fr_lb": cover_deg}
        assert_right_or_doubted(reader, draw(there_deg, noise=4.0, seed=79), there_deg)


@pytest.fixture(scope="module")
def tuned(reader: PanelReader) -> PanelReader:
    """The drawn cockpit's reader, fitted to frames of it."""
    places_deg = np.random.default_rng(5).uniform(125.0, 415.0, (24, 2)).tolist()
    return tune(
        reader,
        [draw({"al_lb": al, "fr_lb": fr}, noise=2.0, seed=seed) for seed, (al, fr) in enumerate(places_deg)],
    )


@pytest.mark.parametrize("apart_deg", [-5.0, -4.2, 4.2, 5.0])
def test_learned_needles_tell_on_which_side_the_lower_one_lies(tuned: PanelReader, apart_deg: float) -> None:
    """From four degrees apart, two needles of one shade are both read in their places despite their soft edges."""
    for cover_deg in (152.3, 287.2):
        there_deg = {"al_lb": cover_deg + apart_deg, "fr_lb": cover_deg}
        readings = read_picture(tuned, draw(there_deg, noise=2.0, seed=int(cover_deg))).readings
        assert readings["al_lb"].status is Status.EDGE
        assert readings["fr_lb"].status is Status.READ
        for name, angle_deg in there_deg.items():
            assert readings[name].angle_deg == pytest.approx(angle_deg, abs=0.35)


def test_what_is_read_of_a_pair_does_not_depend_on_the_frames_beside_it(tuned: PanelReader) -> None:
    """To the last bit, the uncertainty too."""
    apart_deg = np.concatenate([np.arange(-20.0, 20.5, 1.3), [-0.4, -0.2, 0.0, 0.2, 0.4]])
    frames = [draw({"al_lb": 300.0 + apart, "fr_lb": 300.0}, noise=2.0, seed=7) for apart in apart_deg.tolist()]
    together = [
        one.readings for one in tuned.read([FramePicture(frame) for frame in frames]) if isinstance(one, FrameReadings)
    ]

    assert {one["al_lb"].status for one in together} >= {Status.READ, Status.EDGE, Status.HIDDEN}
    assert together == [read_picture(tuned, frame).readings for frame in frames]


def test_hidden_needle_s_sigma_spans_where_it_may_be(reader: PanelReader) -> None:
    """Three degrees apart, with a mirrored pair as likely, the lower needle is less certain than below its cover."""
    apart, below = (
        read_picture(reader, draw({"al_lb": 233.0 + off, "fr_lb": 233.0})).readings["al_lb"] for off in (2.5, 0.0)
    )

    assert apart.status is below.status is Status.HIDDEN
    assert apart.sigma_deg > 1.5 * below.sigma_deg


def glaring(middle_px: tuple[float, float], size_px: tuple[float, float], levels: float) -> GreyPicture:
    """Both needles well apart, under a light with soft edges."""
    glare = np.zeros((220, 360), np.float64)
    cv2.ellipse(glare, (middle_px, size_px, 0.0), levels, -1)
    return np.clip(draw({"al_lb": 200.0, "fr_lb": 300.0}) + cv2.GaussianBlur(glare, (0, 0), 6), 0, 255).astype(np.uint8)


UNSEEN: dict[str, tuple[GreyPicture, set[Status], float | None]] = {
    "the cover alone": (draw({"fr_lb": 140.0}), {Status.HIDDEN, Status.MISSING}, 140.0),
    "noise over both": (draw({"al_lb": 300.0, "fr_lb": 300.0}, noise=5.0, seed=3), {Status.HIDDEN}, 300.0),
    "glare across both": (glaring((236, 95), (120, 90), 220.0), {Status.MISSING}, None),
    "glare over the lower": (glaring((203, 96), (50, 50), 400.0), {Status.HIDDEN, Status.MISSING}, 300.0),
}
"""A frame, what may be said of the lower needle, and where the upper one is."""


@pytest.mark.parametrize(("frame", "statuses", "upper_deg"), UNSEEN.values(), ids=UNSEEN)
def test_lower_needle_that_is_not_seen_is_not_made_up(
    reader: PanelReader, frame: GreyPicture, statuses: set[Status], upper_deg: float | None
) -> None:
    """No edge of its cover, noise or light is read for it, nor is it hidden if its cover is not seen."""
    readings = read_picture(reader, frame).readings

    assert readings["al_lb"].status in statuses
    assert upper_deg is None or readings["fr_lb"].angle_deg == pytest.approx(upper_deg, abs=0.4)


def test_lower_needle_is_read_when_its_cover_is_lost(reader: PanelReader) -> None:
    """Without the upper one on the dial it is read on its own."""
    readings = read_picture(reader, draw({"speed_kt": 214.0, "al_lb": 250.0})).readings

    assert readings["al_lb"].status is Status.READ
    assert readings["al_lb"].angle_deg == pytest.approx(250.0, abs=0.1)
    assert readings["fr_lb"].status is Status.MISSING
