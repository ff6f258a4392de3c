"""Settings and zoom: asked for, set, read back, and what is done when the camera will not."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest

from camera_drivers.qx10.options import Qx10Limits
from camera_drivers.qx10.simulator.methods import CHOICES, FORBIDDEN
from camera_drivers.thresholds import ZOOM_MAX_PICTURES, ZOOM_NEAR
from flight_file.thresholds import MAX_READ_BYTES
from tests.camera_drivers.qx10.conftest import LIMITS

MakeBench = Callable[..., Any]
WANTED = {
    "picture": "Original",
    "exposure_mode": "Program Auto",
    "exposure_compensation": -3,
    "iso_speed_rate": "400",
    "white_balance": "Daylight",
    "still_size": ("4:3", "5M"),
    "beep_mode": "Off",
}
SHOWN = {
    "ShootMode": "still",
    "ExposureMode": "Program Auto",
    "PostviewImageSize": "Original",
    "SelfTimer": 0,
    "BeepMode": "Off",
    "StillSize": ("4:3", "5M"),
    "ExposureCompensation": -3,
    "IsoSpeedRate": "400",
    "WhiteBalance": "Daylight",
}


@pytest.mark.parametrize(
    ("apply_s", "picture", "mode"), [(0.0, "Original", "still"), (0.3, "2M", "still"), (0.3, "Original", "movie")]
)
def test_every_setting_is_as_wanted(make_quick_bench: MakeBench, apply_s: float, picture: str, mode: str) -> None:
    """Modes first: only then the camera offers what depends on them. A setting that shows late is waited for."""
    bench = make_quick_bench(behaviour={"apply_s": apply_s}, **(WANTED | {"picture": picture}))
    bench.simulated.model.settings.chosen["ShootMode"] = mode
    bench.take(1)

    assert set(SHOWN) == set(CHOICES)
    assert bench.simulated.model.settings.chosen == SHOWN | {"PostviewImageSize": picture}
    assert bench.listener.reasons("setting") == []


@pytest.mark.parametrize(
    ("behaviour", "wanted", "reason"),
    [
        (
            {"apply_s": 60.0},
            {"beep_mode": "Off", "picture": "2M"},
            "BeepMode is not as wanted: it was accepted, but did not take effect",
        ),
        (
            {},
            {"exposure_compensation": 2},
            "ExposureCompensation is not as wanted: the camera does not offer it in its present mode",
        ),
        (
            {"forbidden": FORBIDDEN | {"setBeepMode"}},  # though the camera lists the call
            {"beep_mode": "Off"},
            "BeepMode is not as wanted: the camera refuses it (error 403)",
        ),
        ({}, {"exposure_mode": "Manual"}, "ExposureMode is not as wanted: the camera refuses it (error 3)"),
    ],
)
def test_setting_that_cannot_be_had_is_reported_once(
    make_quick_bench: MakeBench, behaviour: dict[str, Any], wanted: dict[str, Any], reason: str
) -> None:
    """However often the camera is connected again; pictures come all the same."""
    bench = make_quick_bench(behaviour=behaviour, **wanted)

    assert [len(bench.take(1)) for _ in range(2)] == [1, 1]
    assert bench.listener.reasons("setting") == [reason]


def test_larger_pictures_than_a_flight_takes_are_not_fetched(make_quick_bench: MakeBench) -> None:
    """A limit above that is one of an older box: it starts all the same, and says what holds."""
    bench = make_quick_bench(limits=LIMITS.model_copy(update={"picture_mib": 256}))

    assert [len(bench.take(1)) for _ in range(2)] == [1, 1]
    assert bench.listener.reasons("setting") == [
        "limits.picture_mib is not as wanted: a flight file takes pictures of 60 MiB at most"
    ]
    assert Qx10Limits(picture_mib=256).picture_bytes == MAX_READ_BYTES
    assert Qx10Limits(picture_mib=60).picture_bytes == MAX_READ_BYTES


@pytest.mark.parametrize("order", [1, -1])
def test_size_is_set_in_whichever_order_the_camera_takes_it(
    make_bench: MakeBench, monkeypatch: pytest.MonkeyPatch, order: int
) -> None:
    """Aspect and size, or size and aspect: the second is tried where the first is refused."""
    bench = make_bench(still_size=("16:9", "2M"))
    model = bench.simulated.model
    set_as_is = model._set
    monkeypatch.setattr(model, "_set", lambda name, params: set_as_is(name, params[::order]))
    bench.take(1)

    assert model.settings.chosen["StillSize"] == ("16:9", "2M")


@pytest.mark.parametrize(("zoom", "position", "focal_length_mm"), [("wide", 0, 4.45), ("tele", 100, 44.5)])
def test_lens_goes_to_its_end(make_quick_bench: MakeBench, zoom: str, position: float, focal_length_mm: float) -> None:
    """From anywhere, before the first picture; the picture confirms it."""
    bench = make_quick_bench(zoom=zoom)
    bench.simulated.model._lens._at = 40.0
    (first, _) = bench.take(2)

    assert (first.zoom_position, first.exif.focal_length_mm) == (position, focal_length_mm)
    assert bench.listener.reasons("zoom") == [f"pictures are taken at {focal_length_mm:g} mm"]
    assert bench.simulated.model._lens._moving == 0


@pytest.mark.parametrize("goal_mm", [4.45, 20.0, 44.5])
def test_focal_length_is_reached_as_near_as_steps_allow(make_quick_bench: MakeBench, goal_mm: float) -> None:
    """Every picture on the way is a frame; the last one is as near as a step."""
    bench = make_quick_bench(zoom=goal_mm)
    frames = bench.take(ZOOM_MAX_PICTURES + 2)
    reached = frames[-1].exif.focal_length_mm
    (said,) = bench.listener.reasons("zoom")

    assert [frame.sha256 for frame in frames] == bench.simulated.ledger.delivered()
    assert abs(reached / goal_mm - 1) <= 0.06  # half of the largest step
    assert said.startswith(f"{reached:g} mm is")
    assert ("reached" in said) == (abs(reached / goal_mm - 1) <= ZOOM_NEAR)
    assert frames[-1].exif.focal_length_mm == frames[-2].exif.focal_length_mm


def test_camera_that_does_not_zoom_takes_pictures(make_quick_bench: MakeBench) -> None:
    """A refusal is reported once."""
    bench = make_quick_bench(zoom="tele", behaviour={"forbidden": FORBIDDEN | {"actZoom"}})

    assert len(bench.take(2)) == 2
    assert bench.listener.reasons("zoom")[0] == "the camera does not zoom in (error 403)"


def test_pictures_without_focal_length_end_the_search(make_quick_bench: MakeBench) -> None:
    """Where the pictures do not tell, as in a liveview, the guess stays, and it is said that it is one."""
    bench = make_quick_bench("without_exif@1", zoom=20.0)
    first, second = bench.take(2)

    assert any("where it is guessed to be" in reason for reason in bench.listener.reasons("zoom"))
    assert first.zoom_position == second.zoom_position
    assert 15 < second.exif.focal_length_mm < 25
    blind = make_quick_bench(zoom=20.0, mode="liveview")
    assert 50 < blind.take(1)[0].zoom_position < 80


@pytest.mark.parametrize("zoom", ["wide", 12.0])
def test_lens_that_somebody_moves_is_set_again(make_quick_bench: MakeBench, zoom: str | float) -> None:
    """The camera has a lever; a picture that shows it moved is followed by one as wanted."""
    bench = make_quick_bench(zoom=zoom)
    with bench.camera as camera:
        frames = [camera.next_frame(threading.Event()) for _ in range(ZOOM_MAX_PICTURES + 2)]
        bench.simulated.model._lens._at += 30
        frames += [camera.next_frame(threading.Event()) for _ in range(ZOOM_MAX_PICTURES + 2)]
    before, after = frames[ZOOM_MAX_PICTURES + 1], frames[-1]

    assert abs(after.exif.focal_length_mm / before.exif.focal_length_mm - 1) < 0.1
    assert sum("set again" in reason for reason in bench.listener.reasons("zoom")) == 1
