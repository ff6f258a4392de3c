"""Outliers: what leaves its neighbours and comes back is pointed out; what moves, steps or trembles is not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.instruments.reading import Reading, Status
from decoder.timeseries.flight_data import FlightData
from decoder.timeseries.gaps import fill_gaps
from decoder.timeseries.outliers import Reason, find_outliers
from tests.decoder.cockpit import fly

Rows = list[Mapping[str, Reading] | str]
FRAMES = 60


def course(angles_deg: np.ndarray) -> Rows:
    """A needle at given angles, well read."""
    return [{"speed_kt": Reading(Status.READ, float(angle), 0.02, 0.99)} for angle in angles_deg]


def smooth() -> np.ndarray:
    """A slow wave over the dial."""
    return 250.0 + 60.0 * np.sin(np.arange(FRAMES) / 12.0)


def of_speed(data: FlightData) -> list[tuple[int, int, Reason]]:
    """The outliers of the needle under test, and of no other."""
    found = find_outliers(data)
    assert {outlier.needle for outlier in found} <= {"speed_kt"}
    return [(outlier.first, outlier.last, outlier.reason) for outlier in found]


@given(st.integers(2, FRAMES - 6), st.integers(1, 3), st.sampled_from([-60.0, -25.0, 25.0, 60.0]))
def test_values_that_go_and_come_back_are_found(start: int, frames: int, by_deg: float) -> None:
    """One to three frames off the line are one outlier, with its first and last frame."""
    angles = smooth()
    angles[start : start + frames] += by_deg

    assert of_speed(fly(course(angles))) == [(start, start + frames - 1, Reason.AWAY_AND_BACK)]


@pytest.mark.parametrize("shape", ["wave", "step", "ramp", "noise", "longer excursion"])
def test_what_needles_do_is_no_outlier(shape: str) -> None:
    """Waves, steps, ramps, trembling within its own noise, and a needle that stays away for long."""
    rng = np.random.default_rng(5)
    angles = {
        "wave": smooth(),
        "step": np.where(np.arange(FRAMES) < 30, 180.0, 330.0),
        "ramp": np.interp(np.arange(FRAMES), [0, 20, 25, 60], [150.0, 150.0, 380.0, 380.0]),
        "noise": 250.0 + rng.normal(0.0, 3.0, FRAMES),
        "longer excursion": np.where((np.arange(FRAMES) >= 20) & (np.arange(FRAMES) < 26), 330.0, 180.0),
    }[shape]

    assert of_speed(fly(course(angles))) == []


def test_outliers_are_pointed_out_and_left_as_they_are() -> None:
    """Neither value nor status of an outlier changes, and what is interpolated is none."""
    angles = smooth()
    angles[20] += 30.0
    rows = course(angles)
    rows[40] = {"speed_kt": Reading(Status.MISSING, 400.0, 1.0, 0.3)}
    before = fly(rows)
    after = fill_gaps(before)

    assert of_speed(after) == [(20, 20, Reason.AWAY_AND_BACK)]
    assert after.series[0].value[20] == before.series[0].value[20]
    assert after.series[0].has(Status.READ)[20]
    assert after.series[0].has(Status.INTERPOLATED)[40]


def test_a_known_rate_is_a_limit(document: dict[str, Any]) -> None:
    """A step that no engine makes is pointed out where the panel says how fast it can be."""
    document["gauges"][0]["needles"][0]["max_rate"] = 50.0  # kt a second; frames are half a second apart
    angles = np.where(np.arange(FRAMES) < 30, 180.0, 195.0)  # 40 kt at once

    assert of_speed(fly(course(angles), content=document)) == [(30, 30, Reason.TOO_FAST)]
    assert of_speed(fly(course(angles))) == []


def test_doubt_about_a_value_is_room_for_it() -> None:
    """A value that is known only roughly may lie off the line."""
    angles = smooth()
    angles[20] += 8.0
    rows = course(angles)
    rows[20] = {"speed_kt": Reading(Status.EDGE, float(angles[20]), 3.0, 0.85)}

    assert of_speed(fly(rows)) == []
