"""Settings: asked for, set, read back, and not insisted upon."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from camera_drivers.qx10.simulator.methods import CHOICES, FORBIDDEN, offered

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


def test_every_setting_is_as_wanted(make_bench: MakeBench) -> None:
    """Modes first: only then the camera offers what depends on them."""
    bench = make_bench(**WANTED)
    bench.take(1)

    assert set(SHOWN) == set(CHOICES)
    assert bench.simulated.model.settings.chosen == SHOWN
    assert bench.listener.reasons("setting") == []


def test_setting_that_shows_late_is_waited_for(make_quick_bench: MakeBench) -> None:
    """The answer comes before the camera has done it."""
    bench = make_quick_bench(behaviour={"apply_s": 0.3}, **WANTED)
    bench.take(1)

    assert bench.listener.reasons("setting") == []
    assert bench.simulated.model.settings.chosen == SHOWN


def test_setting_that_never_shows_is_reported(make_quick_bench: MakeBench) -> None:
    """Pictures come all the same."""
    bench = make_quick_bench(behaviour={"apply_s": 60.0}, beep_mode="Off", picture="2M")
    bench.take(1)

    assert bench.listener.reasons("setting") == ["BeepMode is not as wanted: it was accepted and does not show"]


def test_setting_that_is_not_offered_is_reported_once(make_bench: MakeBench) -> None:
    """However often the camera is connected again."""
    bench = make_bench(exposure_compensation=2)
    bench.take(1)
    bench.take(1)

    assert bench.listener.reasons("setting") == [
        "ExposureCompensation is not as wanted: the camera does not offer it in its present mode"
    ]


def test_setting_that_is_refused_though_listed_is_reported(make_bench: MakeBench) -> None:
    """Error 403 on a call that the camera itself lists."""
    bench = make_bench(behaviour={"forbidden": FORBIDDEN | {"setBeepMode"}}, beep_mode="Off")
    bench.take(1)

    assert bench.listener.reasons("setting") == ["BeepMode is not as wanted: the camera refuses it (error 403)"]


def test_value_that_the_camera_does_not_know_is_reported(make_bench: MakeBench) -> None:
    """A wrong word in the configuration costs no pictures."""
    bench = make_bench(exposure_mode="Manual")

    assert len(bench.take(1)) == 1
    assert bench.listener.reasons("setting") == ["ExposureMode is not as wanted: the camera refuses it (error 3)"]


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


def test_small_pictures_are_small(make_bench: MakeBench) -> None:
    """What the camera calls 2M."""
    bench = make_bench(picture="2M")
    bench.take(1)

    assert bench.simulated.model.settings.chosen["PostviewImageSize"] == "2M"


def test_camera_in_its_movie_mode_is_set_to_stills(make_bench: MakeBench) -> None:
    """Its list of calls is asked for again after that."""
    bench = make_bench(**WANTED)
    bench.simulated.model.settings.chosen["ShootMode"] = "movie"
    bench.take(1)

    assert bench.simulated.model.settings.chosen == SHOWN


def test_simulated_lists_have_the_recorded_lengths() -> None:
    """Fifty calls in the automatic modes and 59 in Program Auto, as recorded from a real camera."""
    assert len(offered("still", "Intelligent Auto")) == 50
    assert len(offered("still", "Program Auto")) == 59
