"""Events: limits, steps, phases of flight; and outliers: values that leave their neighbours and come back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.instruments.reading import Reading, Status
from decoder.panel.parameters import Column
from decoder.timeseries.events import What, find_events
from decoder.timeseries.flight_data import FlightData
from decoder.timeseries.gaps import fill_gaps
from decoder.timeseries.outliers import Reason, find_outliers
from tests.decoder.cockpit import fly
from tests.decoder.timeseries.test_cross_checks import flight, flown, off_from

TIME_S = np.arange(0.0, 60.0, 0.5)


def test_a_limit_is_exceeded_where_a_value_is_beyond_it_by_more_than_it_is_uncertain_by() -> None:
    """Each run is reported with its extreme; values possibly within the limit do not count."""
    airspeed_kt = 100.0 + 40.0 * np.sin(TIME_S / 5.0)
    data = flight(TIME_S, {"airspeed_kt": airspeed_kt}, airspeed_kt=Column(above=130.0, below=60.05))
    found = [event for event in find_events(data) if event.what is What.EXCEEDED]

    assert len(found) == 2
    assert all((airspeed_kt[event.first : event.last + 1] > 130.0).all() for event in found)
    assert found[0].words == "above 130 kt: up to 139.983 kt"


def test_what_goes_within_a_frame_and_stays_is_a_step_and_no_outlier() -> None:
    """A changed altimeter's setting; a course that is set; not the slow turn of a heading through north."""
    data = flown({"altitude_ft": off_from(200, 390.0)})
    steps = [event for event in find_events(data) if event.what is What.STEP and event.needle == "altitude_ft"]

    assert [(event.first, event.last) for event in steps] == [(199, 200)]
    assert find_outliers(data) == []


def test_frames_beside_a_pause_of_the_recording_are_no_outliers() -> None:
    """A needle's motion during twenty seconds without a picture says nothing about the frames at either end."""
    values = 1000.0 + np.where(np.arange(len(TIME_S)) < 60, 0.0, 50.0)
    values[60] = 3000.0
    whole = flight(TIME_S, {"torque_ft": values})
    paused = replace(whole, time_ns=whole.time_ns + np.where(np.arange(len(TIME_S)) > 60, 20_000_000_000, 0))

    assert [(each.first, each.last) for each in find_outliers(whole)] == [(60, 60)]
    assert find_outliers(paused) == []


def test_phases_are_told_by_altitude_and_airspeed() -> None:
    """On the ground, a climb, level, a descent: each where it is, to within the window."""
    time_s = np.arange(0.0, 400.0, 0.5)
    altitude_ft = np.interp(time_s, [0, 100, 200, 300, 400], [500.0, 500.0, 1700.0, 1700.0, 700.0])
    data = flight(time_s, {"altitude_ft": altitude_ft, "airspeed_kt": np.where(time_s < 90, 5.0, 90.0)})
    phases = [event for event in find_events(data) if event.what is What.PHASE]

    long = [event for event in phases if event.last - event.first > 100]
    assert [event.words.partition(":")[0] for event in long] == [
        "slower than it flies", "climb", "level flight", "descent",
    ]  # fmt: skip
    for event, begun_s, ended_s in zip(long, (0, 100, 200, 300), (90, 200, 300, 400), strict=True):
        assert abs(time_s[event.first] - begun_s) <= 10
        assert abs(time_s[event.last] - ended_s) <= 10


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
    """Neither value nor status of an outlier changes, and interpolated values are not outliers."""
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
    """An impossibly fast step of an engine is pointed out if the panel states its limit."""
    document["gauges"][0]["needles"][0]["max_rate"] = 50.0  # kt a second; frames are half a second apart
    angles = np.where(np.arange(FRAMES) < 30, 180.0, 195.0)  # 40 kt at once

    assert of_speed(fly(course(angles), content=document)) == [(30, 30, Reason.TOO_FAST)]
    assert of_speed(fly(course(angles))) == []


def test_doubt_about_a_value_is_room_for_it() -> None:
    """An uncertain value may be off the line."""
    angles = smooth()
    angles[20] += 8.0
    rows = course(angles)
    rows[20] = {"speed_kt": Reading(Status.EDGE, float(angles[20]), 3.0, 0.85)}

    assert of_speed(fly(rows)) == []
