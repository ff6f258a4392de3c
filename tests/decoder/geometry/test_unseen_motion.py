"""A frame that shows too few anchors for a perspective says so: it may have moved as the flight's others did."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from decoder.flight_tuning import tune
from decoder.gauge_reader import Method
from decoder.panel import Panel
from decoder.panel_pictures import PanelPictures
from decoder.panel_reader import PanelReader
from decoder.pictures import FramePicture, GreyPicture

CORNERS = ("north_west", "north_east", "south_west", "south_east")
GAUGE_PX = (320.0, 240.0)
SMALL_PX = 12.0
TILTS = [(0.1, 0.05), (-0.12, 0.08), (0.05, -0.1), (-0.08, -0.1), (0.1, 0.0), (0.0, 0.12), (-0.1, 0.03), (0.03, -0.05)]


def reader_tuned_on(
    see: Callable[..., GreyPicture],
    panel: Panel,
    motions: list[np.ndarray],
) -> PanelReader:
    """Of a flight whose sample moves like this."""
    source = PanelPictures(panel, {"panel.png": see(np.eye(3), noise=1.0, seed=5)}, "")
    reader = PanelReader.from_panel(source, Method.NORMXCORR)
    return tune(reader, [FramePicture(see(motion, noise=1.5, seed=seed)) for seed, motion in enumerate(motions)])


def with_small_anchors(panel: Panel, side_px: float) -> Panel:
    """The same with so little of each anchor that its pixels tell its place, but hardly how it is squeezed."""
    anchors = []
    for anchor in panel.anchors:
        left, top, width, height = anchor.box
        box = (left + (width - side_px) / 2, top + (height - side_px) / 2, side_px, side_px)
        anchors.append(anchor.model_copy(update={"box": box}))
    return panel.model_copy(update={"anchors": tuple(anchors)})


def covered(frame: GreyPicture) -> GreyPicture:
    """The anchor in the north-west under a hand."""
    under = frame.copy()
    under[10:95, 5:115] = np.random.default_rng(1).integers(120, 200, (85, 110))
    return under


def test_a_frame_with_an_anchor_covered_is_as_uncertain_as_the_flight_moves(
    see: Callable[..., GreyPicture], panel_of: Callable[..., Any], turn: Callable[..., np.ndarray]
) -> None:
    """Three of four small anchors tell no perspective: the dial may be off by pixels, and is not said to be certain."""
    motions = [turn(tilt=tilt) for tilt in TILTS]
    reader = reader_tuned_on(see, with_small_anchors(panel_of(CORNERS), SMALL_PX), motions)
    whole, less, off = [], [], []
    for motion in motions:
        frame = see(motion, noise=1.5, seed=30)
        whole.append(reader.read(frame).alignment_sigma_px[0])
        read = reader.read(covered(frame))
        truth = motion @ (*GAUGE_PX, 1.0)
        less.append(read.alignment_sigma_px[0])
        off.append(math.dist(read.alignment.to_frame(GAUGE_PX), truth[:2] / truth[2]))

    assert max(whole) < 0.1
    assert np.sqrt(np.mean(np.square(off))) > 0.3
    assert 0.5 < np.sqrt(np.mean(np.square(off)) / 2) / np.mean(less) < 2.0


def test_a_frame_with_an_anchor_covered_is_read_by_what_the_others_look_like(
    see: Callable[..., GreyPicture], panel_of: Callable[..., Any], turn: Callable[..., np.ndarray]
) -> None:
    """Three larger ones tell the perspective by how they are squeezed: the dial is found, and claims less."""
    motions = [turn(tilt=tilt) for tilt in TILTS]
    reader = reader_tuned_on(see, panel_of(CORNERS), motions)
    for motion in motions:
        read = reader.read(covered(see(motion, noise=1.5, seed=30)))
        truth = motion @ (*GAUGE_PX, 1.0)
        off_px = math.dist(read.alignment.to_frame(GAUGE_PX), truth[:2] / truth[2])

        assert read.alignment.failed == ("north_west",)
        assert off_px < 0.15
        assert off_px / math.sqrt(2) < 3 * read.alignment_sigma_px[0] < 1.0


def test_a_flight_that_only_shifts_leaves_nothing_unseen(
    see: Callable[..., GreyPicture], panel_of: Callable[..., Any], turn: Callable[..., np.ndarray]
) -> None:
    """Then three anchors tell all there is."""
    motions = [turn(shift_px=(2.0 * step, -step), roll_deg=0.2 * step) for step in range(-4, 5)]
    reader = reader_tuned_on(see, panel_of(CORNERS), motions)
    read = reader.read(covered(see(motions[1], noise=1.5, seed=31)))

    assert read.alignment.failed == ("north_west",)
    assert read.alignment_sigma_px[0] < 0.1
