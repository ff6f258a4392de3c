"""Occlusion: what a covering needle leaves in sight is all that counts."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from decoder.panel_reader import PanelReader
from decoder.pictures import GreyPicture
from decoder.reading import Reading, Status

Draw = Callable[..., GreyPicture]
COVER_DEG = 300.0


def fuel(reader: PanelReader, frame: GreyPicture) -> tuple[Reading, Reading]:
    """The covered and the covering needle."""
    readings = reader.read(frame).readings
    return readings["al_lb"], readings["fr_lb"]


@pytest.mark.parametrize("al_deg", [122.0, 200.0, 270.0, 330.0, 418.0])
def test_needle_in_the_open_is_read_whole(reader: PanelReader, draw: Draw, al_deg: float) -> None:
    """Far from the covering needle nothing is taken away."""
    lower, upper = fuel(reader, draw({"al_lb": al_deg, "fr_lb": COVER_DEG}))

    assert (lower.status, upper.status) == (Status.READ, Status.READ)
    assert lower.angle_deg == pytest.approx(al_deg, abs=0.05)


@pytest.mark.parametrize("apart_deg", [-12.0, 12.0])
def test_part_in_sight_is_matched_at_its_own_place(reader: PanelReader, draw: Draw, apart_deg: float) -> None:
    """A needle whose bottom lies under its cover is read by the rest, and says so."""
    lower, upper = fuel(reader, draw({"al_lb": COVER_DEG + apart_deg, "fr_lb": COVER_DEG}))

    assert lower.status is Status.EDGE
    assert lower.angle_deg == pytest.approx(COVER_DEG + apart_deg, abs=0.1)
    assert upper.angle_deg == pytest.approx(COVER_DEG, abs=0.1)


@pytest.mark.parametrize("cover_deg", [140.0, 233.3, 300.0, 411.7])
def test_wholly_covered_needle_takes_its_covers_place(reader: PanelReader, draw: Draw, cover_deg: float) -> None:
    """Right under its cover a needle is hidden, with the cover's angle and score and a spread of its own."""
    lower, upper = fuel(reader, draw({"al_lb": cover_deg, "fr_lb": cover_deg}))

    assert (lower.status, upper.status) == (Status.HIDDEN, Status.READ)
    assert lower.angle_deg == upper.angle_deg
    assert lower.score == upper.score
    assert upper.angle_deg == pytest.approx(cover_deg, abs=0.1)
    assert lower.sigma_deg > upper.sigma_deg


@pytest.mark.parametrize("cover_deg", [140.0, 233.3, 300.0, 411.7])
def test_covering_needle_alone_shows_no_other(reader: PanelReader, draw: Draw, cover_deg: float) -> None:
    """With no other needle on the dial, the covering one's own edges are not taken for it."""
    lower, upper = fuel(reader, draw({"fr_lb": cover_deg}))

    assert lower.status in (Status.HIDDEN, Status.MISSING)
    assert upper.angle_deg == pytest.approx(cover_deg, abs=0.1)


def test_glare_across_both_needles_hides_none(reader: PanelReader, draw: Draw) -> None:
    """Where the covering needle is not seen clearly the other is not said to lie under it."""
    frame = draw({"al_lb": 200.0, "fr_lb": COVER_DEG})
    glare = np.zeros(frame.shape, np.uint8)
    cv2.ellipse(glare, (236, 95), (60, 45), 0.0, 0.0, 360.0, 220, -1)
    lower, _ = fuel(reader, cv2.add(frame, cv2.GaussianBlur(glare, (0, 0), 6)))

    assert lower.status is Status.MISSING


@pytest.mark.parametrize("seed", range(4))
def test_noise_does_not_make_an_edge(reader: PanelReader, draw: Draw, seed: int) -> None:
    """Under its cover a needle stays hidden when the frame is noisy; no edge is read out of the noise."""
    frame = draw({"al_lb": COVER_DEG, "fr_lb": COVER_DEG}, noise=5.0, seed=seed)
    lower, upper = fuel(reader, frame)

    assert lower.status is Status.HIDDEN
    assert upper.angle_deg == pytest.approx(COVER_DEG, abs=0.4)
