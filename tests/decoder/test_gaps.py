"""Gaps: filled between what was seen, never beyond it, and never surer than what was seen."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.flight_data import STATUSES, FlightData
from decoder.gaps import fill_gaps
from decoder.reading import Reading, Status

Fly = Callable[..., FlightData]
MakeReading = Callable[..., Reading]

BAD = Reading(Status.MISSING, 333.0, 0.5, 0.4)
LOST = "anchor knob not found (score 0.12)"


def seen(angle_deg: float) -> Reading:
    """The whole needle at an angle."""
    return Reading(Status.READ, angle_deg, 0.02, 0.99)


def speeds(fly: Fly, readings: Sequence[Reading | str], **more: Any) -> FlightData:  # noqa: ANN401
    """A flight of which the speed alone matters, its gaps filled."""
    frames: list[Mapping[str, Reading] | str] = [
        reading if isinstance(reading, str) else {"speed_kt": reading} for reading in readings
    ]
    return fill_gaps(fly(frames, **more))


def statuses(data: FlightData, series: int = 0) -> str:
    """The first letters of a needle's statuses."""
    return "".join(STATUSES[code].value[0] for code in data.series[series].status)


def test_flagged_readings_lie_on_the_line_between_their_neighbours(fly: Fly) -> None:
    """Two flagged frames are a third and two thirds of the way, whatever their best match was."""
    data = speeds(fly, [seen(195.0), BAD, BAD, seen(228.75)])

    assert statuses(data) == "riir"
    assert data.series[0].value == pytest.approx([200.0, 230.0, 260.0, 290.0])


def test_line_is_in_time_not_in_frames(fly: Fly) -> None:
    """A flagged frame nearer to one neighbour in time is nearer to it in value."""
    data = speeds(fly, [seen(120.0), BAD, seen(270.0)], times_s=[0.0, 0.4, 4.0])

    assert data.series[0].value[1] == pytest.approx(40.0)


def test_line_is_in_values_not_in_angles(fly: Fly) -> None:
    """Across a bend of the scale the value changes evenly."""
    data = speeds(fly, [seen(120.0), BAD, seen(420.0)])

    assert data.series[0].value[1] == pytest.approx(500.0)


def test_line_goes_the_short_way_round(fly: Fly, document: dict[str, Any]) -> None:
    """From 355 to 5 a heading goes by 0, and is no less sure there than anywhere else."""
    document["gauges"][0] |= {"sweep": [270, 630], "scale": [[270, 0], [450, 180]], "wraps": 360}
    over = speeds(fly, [seen(623.0), seen(625.0), BAD, BAD, BAD, seen(275.0)], content=document)
    away = speeds(fly, [seen(423.0), seen(425.0), BAD, BAD, BAD, seen(435.0)], content=document)

    assert over.series[0].value[2:5] == pytest.approx([357.5, 0.0, 2.5])
    assert over.series[0].sigma == pytest.approx(away.series[0].sigma)


def test_nothing_is_said_beyond_the_first_and_last_reading(fly: Fly) -> None:
    """Flagged frames before the first good one and after the last one stay missing."""
    data = speeds(fly, [BAD, seen(200.0), BAD, seen(210.0), BAD, BAD])

    assert statuses(data) == "mrirmm"
    assert np.isnan(data.series[0].value[[0, 4, 5]]).all()


def test_needle_that_is_never_seen_stays_missing(fly: Fly) -> None:
    """Without any good frame there is no value at all."""
    data = speeds(fly, [BAD, BAD, BAD])

    assert statuses(data) == "mmm"
    assert np.isnan(data.series[0].value).all()


def test_single_good_frame_fills_nothing(fly: Fly) -> None:
    """One good frame is both the first and the last."""
    assert statuses(speeds(fly, [BAD, seen(200.0), BAD])) == "mrm"


def test_frames_without_panel_stay_missing(fly: Fly) -> None:
    """Where the panel itself was lost nothing is interpolated, but flagged frames around it are."""
    data = speeds(fly, [seen(120.0), BAD, LOST, BAD, seen(270.0)])

    assert statuses(data) == "rimir"
    assert np.isnan(data.series[0].value[2])
    assert data.series[0].value[[1, 3]] == pytest.approx([100.0, 300.0])


def test_readings_that_stand_are_not_touched(fly: Fly) -> None:
    """Filling gaps changes nothing but the gaps."""
    before = fly([{"speed_kt": seen(120.0)}, {"speed_kt": BAD}, {"speed_kt": seen(270.0)}])
    after = fill_gaps(before)

    for old, new in zip(before.series, after.series, strict=True):
        stand = old.has(Status.READ)
        assert np.array_equal(old.value[stand], new.value[stand])
        assert np.array_equal(old.sigma[stand], new.sigma[stand])
        assert np.array_equal(old.score, new.score, equal_nan=True)


def test_interpolated_value_keeps_the_score_that_flagged_it(fly: Fly) -> None:
    """The low score stays beside the interpolated value."""
    assert speeds(fly, [seen(120.0), BAD, seen(270.0)]).series[0].score.tolist() == [0.99, 0.4, 0.99]


def test_sigma_grows_into_the_gap(fly: Fly) -> None:
    """The further from what was seen, the less is known: largest in the middle, and alike on both sides."""
    data = speeds(fly, [seen(200.0), seen(202.0), *[BAD] * 5, seen(206.0), seen(204.0)])
    gap = data.series[0].sigma[2:7]

    assert (np.diff(gap[:3]) > 0).all()
    assert (np.diff(gap[2:]) < 0).all()
    assert gap[0] == pytest.approx(gap[4])


@given(
    angles=st.lists(st.none() | st.floats(120.0, 420.0), min_size=2, max_size=25),
    sigma_deg=st.floats(0.001, 3.0),
)
def test_gap_is_never_surer_than_its_ends(fly: Fly, angles: list[float | None], sigma_deg: float) -> None:
    """Interpolated values lie between their ends, and their sigma is at least the smaller one's there."""
    readings = [BAD if angle is None else Reading(Status.READ, angle, sigma_deg, 0.9) for angle in angles]
    series = speeds(fly, readings).series[0]
    known = np.flatnonzero(series.has(Status.READ))

    for place in np.flatnonzero(series.has(Status.INTERPOLATED)):
        ends = [known[known < place][-1], known[known > place][0]]
        low, high = sorted(series.value[ends])
        assert low - 1e-9 <= series.value[place] <= high + 1e-9
        assert series.sigma[place] >= series.sigma[ends].min() - 1e-12
        assert math.isfinite(series.sigma[place])


def test_sigma_in_a_gap_is_at_least_that_of_its_ends(fly: Fly) -> None:
    """Halfway between two ends that are equally sure, a needle that moved is less sure than either."""
    data = speeds(fly, [seen(200.0), BAD, seen(230.0)])

    assert data.series[0].sigma[1] > data.series[0].sigma[[0, 2]].max()


def pair(al_deg: float, fr_deg: float, status: Status = Status.READ) -> dict[str, Reading]:
    """Both fuel needles, the status being the covered one's."""
    return {"al_lb": Reading(status, al_deg, 0.02, 0.95), "fr_lb": seen(fr_deg)}


def test_needle_that_goes_under_and_comes_out_is_hidden(fly: Fly) -> None:
    """Last seen beside its cover and next seen beside it, the needle was under it in between."""
    data = fill_gaps(fly([pair(296.0, 300.0), pair(300.5, 300.5, Status.HIDDEN), pair(304.5, 301.0)]))

    assert statuses(data, 1) == "rhr"
    assert data.series[1].value[1] == data.series[2].value[1]


@pytest.mark.parametrize("places", [(200.0, 201.0), (200.0, 300.0), (300.0, 200.0)])
def test_hidden_run_that_starts_or_ends_far_from_the_cover_is_doubted(fly: Fly, places: tuple[float, float]) -> None:
    """A needle last or next seen far from its cover was not under it: it is interpolated, not put there."""
    before, after = places
    still = [pair(before, 300.0)] * 5
    hidden = [pair(300.0, 300.0, Status.HIDDEN)] * 2
    data = fill_gaps(fly([*still, *hidden, *[pair(after, 300.0)] * 5]))

    assert statuses(data, 1) == "rrrrriirrrrr"
    step = (after - before) / 3 * 10
    assert data.series[1].value[5:7] == pytest.approx(data.series[1].value[4] + np.array([step, 2 * step]))


def test_edge_far_from_where_the_needle_was_is_doubted(fly: Fly) -> None:
    """An edge beside the cover, of a needle that is seen elsewhere before and after, is a glare's."""
    data = fill_gaps(fly([*[pair(200.0, 300.0)] * 5, pair(304.0, 300.0, Status.EDGE), *[pair(200.0, 300.0)] * 5]))

    assert statuses(data, 1) == "rrrrrirrrrr"
    assert data.series[1].value[5] == pytest.approx(800.0)


def test_doubted_run_at_the_end_of_the_flight_is_missing(fly: Fly) -> None:
    """Where nothing is seen afterwards, a doubted reading is missing, not extrapolated."""
    data = fill_gaps(fly([*[pair(200.0, 300.0)] * 5, pair(300.0, 300.0, Status.HIDDEN)]))

    assert statuses(data, 1) == "rrrrrm"
    assert np.isnan(data.series[1].value[5])


def test_needle_never_seen_whole_is_not_known_to_be_covered(fly: Fly) -> None:
    """Hidden in every frame means not there, as far as anybody can tell."""
    data = fill_gaps(fly([pair(300.0, 300.0, Status.HIDDEN)] * 4))

    assert statuses(data, 1) == "mmmm"


@pytest.mark.parametrize(
    "times_s", [(0.0, 100.0, 1.0, 2.0), (0.0, -100.0, 1.0, 2.0)], ids=["leaps ahead", "falls back"]
)
def test_clock_that_jumps_gives_no_value_beyond_its_ends(fly: Fly, times_s: tuple[float, ...]) -> None:
    """Where the clock was set in mid-flight, a flagged frame still lies between its neighbours or is missing."""
    data = speeds(fly, [seen(200.0), BAD, seen(210.0), seen(300.0)], times_s=times_s)
    low, high = data.series[0].value[[0, 2]]

    assert statuses(data) in {"rirr", "rmrr"}
    assert statuses(data) == "rmrr" or low <= data.series[0].value[1] <= high


def test_frames_of_one_moment_have_a_finite_spread(fly: Fly) -> None:
    """Frames with the same time give numbers, and no spread wider than the dial."""
    data = speeds(fly, [seen(200.0), BAD, seen(202.0), seen(204.0)], times_s=[1.0, 1.0, 1.0, 2.0])

    assert np.isfinite(data.series[0].value).all()
    assert data.series[0].sigma.max() < 1000.0


def test_flight_without_frames_has_no_gaps(fly: Fly) -> None:
    """Nothing stays nothing."""
    assert fill_gaps(fly([])).frame.size == 0
