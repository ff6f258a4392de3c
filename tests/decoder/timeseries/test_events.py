"""Events: limits that are exceeded, steps, phases of flight; and steps beside a pause that are no outliers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from decoder.panel.parameters import Column
from decoder.timeseries.events import What, find_events
from decoder.timeseries.outliers import find_outliers
from tests.decoder.timeseries.test_cross_checks import flight, flown, off_from

TIME_S = np.arange(0.0, 60.0, 0.5)


def test_a_limit_is_exceeded_where_a_value_is_beyond_it_by_more_than_it_is_uncertain_by() -> None:
    """Each run is told with how far it went; what may be within the limit is none."""
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


def test_what_leaves_its_neighbours_and_comes_back_is_an_outlier_and_no_step() -> None:
    """Two frames away."""

    def away(values: np.ndarray) -> np.ndarray:
        values[200:202] += 390.0
        return values

    data = flown({"altitude_ft": away})

    assert [event for event in find_events(data) if event.what is What.STEP and event.needle == "altitude_ft"] == []
    assert [(each.first, each.last) for each in find_outliers(data)] == [(200, 201)]


def test_frames_beside_a_pause_of_the_recording_are_no_outliers() -> None:
    """What a needle does during twenty seconds without a picture says nothing of the frames at either end."""
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
