"""Flight data: readings become values with a status, frame by frame."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.flight_data import FlightData, MissingFrame, spans, status_counts
from decoder.reading import Reading, Status

Fly = Callable[..., FlightData]
MakeReading = Callable[..., Reading]


@given(where=st.lists(st.booleans()))
def test_spans_are_the_runs(where: list[bool]) -> None:
    """The spans cover what is true and nothing else, and no two of them touch."""
    runs = spans(where)
    covered = [False] * len(where)
    for first, last in runs:
        assert first <= last
        covered[first : last + 1] = [True] * (last + 1 - first)

    assert covered == where
    assert all(after[0] > before[1] + 1 for before, after in pairwise(runs))


def test_angles_become_values_of_the_scale(fly: Fly, reading: MakeReading) -> None:
    """Each needle's value is what its scale says at the angle, beyond the last mark too."""
    data = fly([{"speed_kt": reading(195.0)}, {"speed_kt": reading(270.0)}, {"speed_kt": reading(423.0)}])

    assert data.series[0].value.tolist() == [200.0, 400.0, 1012.0]
    assert data.series[0].angle_deg.tolist() == [195.0, 270.0, 423.0]


def test_sigma_is_in_units_of_the_value(fly: Fly, reading: MakeReading) -> None:
    """The spread in degrees is multiplied by the slope of the scale there, and is never negative."""
    data = fly([{"speed_kt": reading(200.0, sigma_deg=0.3)}, {"speed_kt": reading(300.0, sigma_deg=0.3)}])

    assert data.series[0].sigma == pytest.approx([0.8, 1.2])


def test_sigma_of_a_falling_scale_is_positive(fly: Fly, reading: MakeReading, document: dict[str, Any]) -> None:
    """On an anticlockwise scale the uncertainty is as positive as on any other."""
    document["gauges"][0]["scale"] = [[120, 1000], [420, 0]]
    data = fly([{"speed_kt": reading(200.0, sigma_deg=0.3)}], content=document)

    assert data.series[0].sigma == pytest.approx([1.0])


def test_systematic_uncertainty_is_added_in_squares(fly: Fly, reading: MakeReading) -> None:
    """What all readings may be off by together adds to each one's own spread."""
    data = fly([{"al_lb": reading(200.0, sigma_deg=0.3)}], panel_sigma_deg=0.4)

    assert data.series[1].sigma == pytest.approx([5.0])


def test_refused_match_has_no_value(fly: Fly, reading: MakeReading) -> None:
    """A reading that is missing keeps its score and the place of its best match, but has neither value nor sigma."""
    data = fly([{"speed_kt": reading(200.0, Status.MISSING, score=0.6)}])
    series = data.series[0]

    assert np.isnan([series.value[0], series.sigma[0]]).all()
    assert (series.score[0], series.angle_deg[0]) == (0.6, 200.0)


def test_missing_frame_is_missing_for_every_needle(fly: Fly) -> None:
    """A frame without the panel is a row of nothing, and its reason is kept."""
    data = fly([{}, "anchor knob not found (score 0.12)", {}])

    assert data.frame.tolist() == [0, 1, 2]
    assert data.time_s.tolist() == [0.0, 0.5, 1.0]
    assert data.missing_frames == (MissingFrame(1, "anchor knob not found (score 0.12)"),)
    for series in data.series:
        assert series.has(Status.MISSING).tolist() == [False, True, False]
        assert np.isnan([series.value[1], series.sigma[1], series.score[1], series.angle_deg[1]]).all()


def test_statuses_are_counted_all_of_them(fly: Fly, reading: MakeReading) -> None:
    """Every status has its number, those that do not occur 0."""
    data = fly([{"al_lb": reading(200.0, status)} for status in (Status.READ, Status.READ, Status.EDGE, Status.HIDDEN)])

    assert status_counts(data.series[1]) == {"read": 2, "edge": 1, "hidden": 1, "interpolated": 0, "missing": 0}


def test_flight_without_frames_has_no_times(fly: Fly) -> None:
    """Nothing recorded is nothing, not an error."""
    data = fly([])

    assert data.time_s.size == 0
    assert [len(series.value) for series in data.series] == [0, 0, 0]


def test_time_keeps_its_nanoseconds(fly: Fly) -> None:
    """Times are integers inside: an hour into the flight the microsecond is still right."""
    data = fly([{}, {}], times_s=[0.0, 3600.000001])

    assert data.time_s[1] == 3600.000001
