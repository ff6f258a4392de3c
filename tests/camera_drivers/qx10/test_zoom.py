"""The zoom: to its ends and to focal lengths, and what is done when it will not go."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest

from camera_drivers.qx10.simulator.methods import FORBIDDEN
from camera_drivers.qx10.zoom import MAX_PICTURES, NEAR

MakeBench = Callable[..., Any]


@pytest.mark.parametrize(("zoom", "position", "focal_length_mm"), [("wide", 0, 4.45), ("tele", 100, 44.5)])
def test_lens_goes_to_its_end(make_quick_bench: MakeBench, zoom: str, position: float, focal_length_mm: float) -> None:
    """From anywhere, before the first picture; the picture confirms it."""
    bench = make_quick_bench(zoom=zoom)
    bench.simulated.model._lens._at = 40.0
    (first, _) = bench.take(2)

    assert (first.zoom_position, first.exif.focal_length_mm) == (position, focal_length_mm)
    assert bench.listener.reasons("zoom") == [f"pictures are taken at {focal_length_mm:g} mm"]
    assert bench.simulated.model._lens._moving == 0


@pytest.mark.parametrize("goal_mm", [4.45, 7.0, 20.0, 44.5])
def test_focal_length_is_reached_as_near_as_steps_allow(make_quick_bench: MakeBench, goal_mm: float) -> None:
    """Every picture on the way is a frame; the last one is as near as a step."""
    bench = make_quick_bench(zoom=goal_mm)
    frames = bench.take(MAX_PICTURES + 2)
    reached = frames[-1].exif.focal_length_mm
    (said,) = bench.listener.reasons("zoom")

    assert [frame.sha256 for frame in frames] == bench.simulated.ledger.delivered()
    assert abs(reached / goal_mm - 1) <= 0.06  # half of the largest step
    assert said.startswith(f"{reached:g} mm is")
    assert ("reached" in said) == (abs(reached / goal_mm - 1) <= NEAR)
    assert frames[-1].exif.focal_length_mm == frames[-2].exif.focal_length_mm


def test_lens_that_is_left_alone_does_not_move(make_quick_bench: MakeBench) -> None:
    """`leave` means that."""
    bench = make_quick_bench(zoom="leave")
    bench.simulated.model._lens._at = 40.0

    assert {frame.zoom_position for frame in bench.take(2)} == {40.0}


def test_camera_that_does_not_zoom_takes_pictures(make_quick_bench: MakeBench) -> None:
    """A refusal is reported once."""
    bench = make_quick_bench(zoom="tele", behaviour={"forbidden": FORBIDDEN | {"actZoom"}})

    assert len(bench.take(2)) == 2
    assert bench.listener.reasons("zoom")[0] == "the camera does not zoom in (error 403)"


def test_pictures_without_focal_length_end_the_search(make_quick_bench: MakeBench) -> None:
    """Where the pictures do not tell, the guess stays, and it is said that it is one."""
    bench = make_quick_bench("without_exif@1", zoom=20.0)
    first, second = bench.take(2)

    assert any("where it is guessed to be" in reason for reason in bench.listener.reasons("zoom"))
    assert first.zoom_position == second.zoom_position
    assert 15 < second.exif.focal_length_mm < 25


def test_lens_is_set_again_after_the_camera_was_off(make_quick_bench: MakeBench) -> None:
    """It stands at wide then."""
    bench = make_quick_bench("reboot@2", zoom="tele")

    assert [frame.zoom_position for frame in bench.take(3)] == [100.0] * 3


@pytest.mark.parametrize("zoom", ["wide", 12.0])
def test_lens_that_somebody_moves_is_set_again(make_quick_bench: MakeBench, zoom: str | float) -> None:
    """The camera has a lever; a picture that shows it moved is followed by one as wanted."""
    bench = make_quick_bench(zoom=zoom)
    with bench.camera as camera:
        frames = [camera.next_frame(threading.Event()) for _ in range(MAX_PICTURES + 2)]
        bench.simulated.model._lens._at += 30
        frames += [camera.next_frame(threading.Event()) for _ in range(MAX_PICTURES + 2)]
    before, after = frames[MAX_PICTURES + 1], frames[-1]

    assert abs(after.exif.focal_length_mm / before.exif.focal_length_mm - 1) < 0.1
    assert sum("set again" in reason for reason in bench.listener.reasons("zoom")) == 1


def test_liveview_says_that_its_focal_length_is_guessed(make_quick_bench: MakeBench) -> None:
    """Its pictures have no EXIF to confirm it."""
    bench = make_quick_bench(zoom=20.0, mode="liveview")
    (frame,) = bench.take(1)

    assert 50 < frame.zoom_position < 80
    assert any("where it is guessed to be" in reason for reason in bench.listener.reasons("zoom"))
