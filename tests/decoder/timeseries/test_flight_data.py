"""Flight data: readings become values frame by frame; gaps are interpolated, never with more certainty."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from decoder.instruments.reading import Reading, Status
from decoder.panel.scale import Combination, Quantity
from decoder.timeseries.flight_data import CODE, STATUSES, FlightData, NeedleSeries
from decoder.timeseries.gaps import fill_gaps
from tests.decoder.cockpit import fly, reading


def test_sigma_is_in_units_of_the_value(document: dict[str, Any]) -> None:
    """The spread times the slope of the scale there, also of a falling one; systematic errors add in squares."""
    data = fly([{"speed_kt": reading(200.0, sigma_deg=0.3)}, {"speed_kt": reading(300.0, sigma_deg=0.3)}])
    both = fly([{"al_lb": reading(200.0, sigma_deg=0.3)}], panel_sigma_deg=0.4)
    document["gauges"][0]["scale"] = [[120, 1000], [420, 0]]
    falling = fly([{"speed_kt": reading(200.0, sigma_deg=0.3)}], content=document)

    assert data.series[0].sigma == pytest.approx([0.8, 1.2])
    assert falling.series[0].sigma == pytest.approx([1.0])
    assert both.series[1].sigma == pytest.approx([5.0])


BAD = Reading(Status.MISSING, 333.0, 0.5, 0.4)
LOST = "anchor knob not found (score 0.12)"


def seen(angle_deg: float) -> Reading:
    """The whole needle at an angle."""
    return Reading(Status.READ, angle_deg, 0.02, 0.99)


def speeds(readings: Sequence[Reading | str], **more: Any) -> FlightData:  # noqa: ANN401
    """A flight in which only the speed matters, its gaps filled."""
    frames: list[Mapping[str, Reading] | str] = [
        reading if isinstance(reading, str) else {"speed_kt": reading} for reading in readings
    ]
    return fill_gaps(fly(frames, **more))


def statuses(data: FlightData, series: int = 0) -> str:
    """The first letters of a needle's statuses."""
    return "".join(STATUSES[code].value[0] for code in data.series[series].status)


@pytest.mark.parametrize(
    ("angles", "times_s", "values"),
    [
        ((195.0, None, None, 228.75), None, (200.0, 230.0, 260.0, 290.0)),
        ((120.0, None, 270.0), (0.0, 0.4, 4.0), (0.0, 40.0, 400.0)),
        ((120.0, None, 420.0), None, (0.0, 500.0, 1000.0)),
    ],
    ids=["whatever the best match was", "in time, not in frames", "in values, not in angles"],
)
def test_flagged_readings_lie_on_the_line_between_their_neighbours(
    angles: tuple[float | None, ...], times_s: tuple[float, ...] | None, values: tuple[float, ...]
) -> None:
    """Their low score stays beside the interpolated value."""
    data = speeds([BAD if angle is None else seen(angle) for angle in angles], times_s=times_s)

    assert statuses(data) == "".join("i" if angle is None else "r" for angle in angles)
    assert data.series[0].value == pytest.approx(values)
    assert data.series[0].score.tolist() == [0.4 if angle is None else 0.99 for angle in angles]


def test_line_goes_the_short_way_round(document: dict[str, Any]) -> None:
    """From 355 to 5 a heading goes through 0, and is as certain there as elsewhere."""
    document["gauges"][0] |= {"sweep": [270, 630], "scale": [[270, 0], [450, 180]], "wraps": 360}
    over = speeds([seen(623.0), seen(625.0), BAD, BAD, BAD, seen(275.0)], content=document)
    away = speeds([seen(423.0), seen(425.0), BAD, BAD, BAD, seen(435.0)], content=document)

    assert over.series[0].value[2:5] == pytest.approx([357.5, 0.0, 2.5])
    assert over.series[0].sigma == pytest.approx(away.series[0].sigma)


@pytest.mark.parametrize("steady", [range(30), range(17, 19), ()], ids=["often seen", "seen twice in a row", "never"])
def test_a_hand_that_may_have_gone_round_in_a_gap_is_guessed_at_most(
    document: dict[str, Any], steady: Sequence[int]
) -> None:
    """Seen in one frame of eight it seems to creep, though it nearly goes round meanwhile."""
    document["gauges"][0] |= {"sweep": [270, 630], "scale": [[270, 0], [450, 30]], "wraps": 60}
    pace_deg, shown = 43.9, {*steady, *range(0, 60, 8)}
    readings = [seen(270.0 + pace_deg * frame % 360.0) if frame in shown else BAD for frame in range(60)]
    series = speeds(readings, content=document).series[0]

    bridged = series.has(Status.INTERPOLATED)
    off = (series.value - np.arange(60) * pace_deg / 6.0 + 30.0) % 60.0 - 30.0
    assert (np.abs(off) <= 1.96 * series.sigma)[bridged].all()
    assert bridged.any() == (len(steady) == 30)


def test_frames_without_panel_stay_missing() -> None:
    """Where the panel itself was lost nothing is interpolated, but flagged frames around it are."""
    data = speeds([seen(120.0), BAD, LOST, BAD, seen(270.0)])

    assert statuses(data) == "rimir"
    assert np.isnan(data.series[0].value[2])
    assert data.series[0].value[[1, 3]] == pytest.approx([100.0, 300.0])


@given(
    angles=st.lists(st.none() | st.floats(120.0, 420.0), min_size=2, max_size=25),
    sigma_deg=st.floats(0.001, 3.0),
)
def test_gap_is_never_surer_than_its_ends(angles: list[float | None], sigma_deg: float) -> None:
    """Interpolated values lie between their ends, and their sigma is at least the smaller one's there."""
    readings = [BAD if angle is None else Reading(Status.READ, angle, sigma_deg, 0.9) for angle in angles]
    series = speeds(readings).series[0]
    known = np.flatnonzero(series.has(Status.READ))

    for place in np.flatnonzero(series.has(Status.INTERPOLATED)):
        ends = [known[known < place][-1], known[known > place][0]]
        low, high = sorted(series.value[ends])
        assert low - 1e-9 <= series.value[place] <= high + 1e-9
        assert series.sigma[place] >= series.sigma[ends].min() - 1e-12
        assert math.isfinite(series.sigma[place])


def in_a_gap(angles: NDArray[np.float64], hidden: slice) -> tuple[NDArray[np.bool_], FlightData]:
    """The frames of a gap whose true value is within 1.96 sigma, and the flight."""
    readings = [seen(angle) for angle in angles]
    true = speeds(readings).series[0].value
    readings[hidden] = [BAD] * len(readings[hidden])
    data = speeds(readings)
    series = data.series[0]
    return (np.abs(series.value - true) <= 1.96 * series.sigma)[hidden], data


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(period=st.floats(10.0, 200.0), phase=st.floats(0.0, 1.0), size=st.floats(1.0, 100.0), frames=st.integers(2, 30))
def test_intervals_in_gaps_hold_for_a_needle_that_swings(period: float, phase: float, size: float, frames: int) -> None:
    """However fast, and however long the gap: its swing is estimated from the rest of the flight."""
    angles = 270.0 + size * np.sin(2 * np.pi * (np.arange(240) / period + phase))
    starts = [round(20 + part * period) for part in np.arange(0, 1, 0.05)]  # all through a swing
    holds = [in_a_gap(angles, slice(start, start + frames))[0].mean() for start in starts]

    assert np.mean(holds) >= 0.89  # the least of all is 0.894, in gaps of two thirds of a swing


@pytest.mark.parametrize("turns_at", [52, 55, 58])
def test_turn_that_begins_and_ends_in_a_gap_is_within_its_interval(turns_at: int) -> None:
    """Steady before and after: when it turned is unknown, and sigma covers that."""
    holds, data = in_a_gap(np.where(np.arange(120) < turns_at, 200.0, 260.0), slice(50, 60))

    assert holds.all()
    assert statuses(data)[50:60] == "i" * 10


def test_tape_that_goes_on_may_have_gone_beyond_its_marks_in_a_gap(document: dict[str, Any]) -> None:
    """Its marks are those that the panel picture shows: a climb and a descent in a gap leave them far behind."""
    corners = [[10, 10], [50, 10], [50, 90], [10, 90]]
    marks = [[30, 1080], [50, 1000], [80, 880]]
    document["gauges"].append(
        {"name": "tape", "window": corners, "tape": {"name": "alt_ft", "index": 50, "marks": marks}}
    )
    flown_ft = np.concatenate([60.0 * np.arange(20), 60.0 * np.arange(20, 0, -1), np.zeros(5)])
    true_ft = 1000.0 + np.concatenate([flown_ft, flown_ft[::-1], flown_ft])
    gap = slice(94, 126)
    frames: list[Mapping[str, Reading]] = [
        {"alt_ft": BAD if gap.start <= frame < gap.stop else seen(value_ft)}
        for frame, value_ft in enumerate(true_ft.tolist())
    ]
    series = next(each for each in fill_gaps(fly(frames, content=document)).series if each.quantity.name == "alt_ft")
    bridged = series.has(Status.INTERPOLATED)

    assert bridged[gap].all()
    assert (np.abs(series.value - true_ft) <= 1.96 * series.sigma)[bridged].all()


def test_nothing_is_interpolated_where_most_frames_are_not_read() -> None:
    """Then where it stands decides whether it is read, as of a tape seen only near its place in the panel picture."""
    true = 250.0 + 100.0 * np.sin(np.arange(120) / 8.0)
    near = [seen(angle) if abs(angle - 250.0) < 40.0 else BAD for angle in true.tolist()]

    assert set(statuses(speeds(near))) == {"r", "m"}


def test_frames_before_the_first_and_after_the_last_reading_count_as_not_read() -> None:
    """A compass was read in 15 of 47 frames, 12 of those not read in between: its line was 90 degrees off."""
    shown = "b" * 8 + "s" * 4 + "b" * 12 + "s" * 11 + "b" * 12
    frames = [seen(250.0 + number / 2) if each == "s" else BAD for number, each in enumerate(shown)]

    assert statuses(speeds(frames)) == shown.replace("b", "m").replace("s", "r")


def pair(al_deg: float, fr_deg: float, status: Status = Status.READ) -> dict[str, Reading]:
    """Both fuel needles, the status being the covered one's."""
    return {"al_lb": Reading(status, al_deg, 0.02, 0.95), "fr_lb": seen(fr_deg)}


AWAY, UNDER = pair(200.0, 300.0), pair(300.0, 300.0, Status.HIDDEN)
HIDING: dict[str, tuple[list[Mapping[str, Reading]], str]] = {
    "under and out again": ([pair(296.0, 300.0), pair(300.5, 300.5, Status.HIDDEN), pair(304.5, 301.0)], "rhr"),
    "far away before and after": ([*[AWAY] * 5, *[UNDER] * 2, *[pair(201.0, 300.0)] * 5], "rrrrriirrrrr"),
    "far away before": ([*[AWAY] * 5, *[UNDER] * 2, *[pair(300.0, 300.0)] * 5], "rrrrriirrrrr"),
    "far away afterwards": ([*[pair(300.0, 300.0)] * 5, *[UNDER] * 2, *[AWAY] * 5], "rrrrriirrrrr"),
    "an edge, far from where it is": ([*[AWAY] * 5, pair(304.0, 300.0, Status.EDGE), *[AWAY] * 5], "rrrrrirrrrr"),
    "far away before, and not seen again": ([*[AWAY] * 5, *[UNDER] * 2], "rrrrrmm"),
    "never seen": ([UNDER] * 2, "mm"),
}


@pytest.mark.parametrize(("score", "holds"), [(0.7, True), (0.5, False)], ids=["likely", "no better than print"])
def test_interval_in_a_gap_holds_where_a_refused_match_is_likely(score: float, *, holds: bool) -> None:
    """A ball at its stop looks different, is refused in all the gap, and stays nowhere near the line across it."""
    stop = Reading(Status.MISSING, 410.0, 0.5, score)
    steps = np.linspace(200.0, 206.0, 20).tolist()
    data = speeds([*map(seen, steps), *[stop] * 6, *map(seen, steps)])

    (series,) = (each for each in data.series if each.quantity.name == "speed_kt")
    gap = series.has(Status.INTERPOLATED)
    true_kt = 960.0
    assert gap.sum() == len(gap) - 2 * len(steps)
    assert (np.abs(series.value - true_kt) <= 1.96 * series.sigma + 1e-9)[gap].all() == holds


def test_hands_that_tell_no_value_together_are_not_read() -> None:
    """A lone hand that matches may be another one; its value stays, as `edge`."""

    def series(name: str, codes: str) -> NeedleSeries:
        of = {each.value[0]: CODE[each] for each in Status}
        shown = np.where([code == "m" for code in codes], np.nan, 25.0)
        quantity = Quantity(name, "dial", "", ((0.0, 0.0), (360.0, 100.0)), 100.0, None, None)
        status = np.array([of[code] for code in codes], np.uint8)
        return NeedleSeries(quantity, status, shown, 0.1 * shown, np.full(len(codes), 0.9), 3.6 * shown)

    fine, coarse, both = series("fine", "rrre"), series("coarse", "rmrr"), series("both", "rmmm")
    frames = np.arange(4)
    combination = Combination(both.quantity, ("fine", "coarse"), 100.0, 0.2)
    data = fill_gaps(FlightData(frames, frames * 10**9, (fine, coarse, both), (), (combination,)))

    assert [statuses(data, number) for number in range(2)] == ["reee", "riee"]
    assert data.series[0].value.tolist() == [25.0] * 4


@pytest.mark.parametrize(("agreed", "valued"), [(4, False), (5, False), (6, True)])
def test_value_whose_hands_contradict_each_other_as_often_as_they_agree_is_missing(
    agreed: int, *, valued: bool
) -> None:
    """Two hands with each other's names agree in some frames, by chance, on a value that is thousands of feet off."""
    flight = geared([42.0] * (5 + agreed), "r" * (5 + agreed), np.arange(5 + agreed) * 10**9)
    both = flight.series[2]
    at_odds = replace(both, status=np.where(np.arange(len(both.status)) < 5, CODE[Status.MISSING], both.status))
    data = fill_gaps(replace(flight, series=(*flight.series[:2], at_odds)))

    assert statuses(data, 2) == "m" * 5 + ("r" if valued else "m") * agreed


TURNS: dict[str, tuple[list[float], str, str]] = {
    "two frames, half a turn off": ([20, 21, 72, 73, 24, 25], "rrhhrr", "rriirr"),
    "a frame right, and one turns off": ([20, 21, 22, 73, 24, 25], "rrhhrr", "rrrirr"),
    "turns off to the end": ([20, 21, 72, 73], "rrhh", "rrmm"),
    "turns off from the beginning": ([72, 73, 24, 25], "hhrr", "mmrr"),
    "right all the time": ([20, 21, 22, 23, 24, 25], "rrhhrr", "rrrrrr"),
    "far off the line, step by step": ([20, *range(24, 60, 4), 60, 20], "r" + 9 * "h" + "rr", 12 * "r"),
    "past the end of its circle": ([97, 98, 99, 0, 1, 2], "rrhhhr", "rrrrrr"),
    "shown in no frame": ([20, 71, 22], "hhh", "mmm"),
}


@pytest.mark.parametrize(("values", "coarse", "expected"), TURNS.values(), ids=TURNS)
def test_value_is_not_turns_off_its_neighbours_where_a_hand_is_hidden(
    values: list[float], coarse: str, expected: str
) -> None:
    """What else hides the hand is not known: the value has to go on to a frame in which all hands show."""
    data = fill_gaps(geared(values, coarse, np.arange(len(values)) * 10**9))

    assert statuses(data, 2) == expected
    assert not any(one == "h" and other in "im" for one, other in zip(statuses(data, 1), expected, strict=True))


def test_clock_that_is_set_back_makes_no_value_turns_off() -> None:
    """Frames are compared in their order, whatever their times say."""
    values = [float(each) for each in range(10, 32, 2)]
    times_s = np.array([0, 1, 2, 3, 4, 5, -50, -49, 8, 9, 10])
    data = fill_gaps(geared(values, "rrhhrrhhrrr", times_s * 10**9))

    assert statuses(data, 2) == "r" * len(values)


@pytest.mark.parametrize(("sigma", "expected"), [(5.0, "rrir"), (5.2, "eeie")])
def test_value_is_as_uncertain_as_a_hand_that_does_not_tell_its_turns(sigma: float, expected: str) -> None:
    """That hand may be something printed, which agrees with the finer one by chance, and in every frame."""
    flight = geared([42.0, 43.0, 44.0, 45.0], "rrme", np.arange(4) * 10**9, coarse_sigma=sigma)
    both = flight.series[2]
    lost = replace(both, status=np.where([False, False, True, False], CODE[Status.MISSING], both.status))
    data = fill_gaps(replace(flight, series=(*flight.series[:2], lost)))

    assert statuses(data, 2) == expected
    assert (data.series[2].sigma >= sigma).all() == (expected[0] == "e")
    assert data.series[2].value == pytest.approx([42.0, 43.0, 44.0, 45.0])


def geared(
    values: Sequence[float], coarse: str, time_ns: NDArray[np.int64], *, coarse_sigma: float = 0.1
) -> FlightData:
    """Flight data of a value of two hands, its coarser one with such statuses."""

    def series(name: str, turn: float, codes: str) -> NeedleSeries:
        of = {each.value[0]: CODE[each] for each in Status}
        value = np.array(values, float) % turn
        quantity = Quantity(name, "dial", "", ((0.0, 0.0), (360.0, turn)), turn, None, None)
        status = np.array([of[code] for code in codes], np.uint8)
        return NeedleSeries(quantity, status, value, np.full(len(codes), 0.1), np.full(len(codes), 0.9), 3.6 * value)

    both = series("both", 100.0, "r" * len(values))
    fine, other = series("fine", 10.0, "r" * len(values)), series("coarse", 100.0, coarse)
    parts = fine, replace(other, sigma=np.full(len(values), coarse_sigma))
    combination = Combination(both.quantity, ("fine", "coarse"), 100.0, 0.2)
    return FlightData(np.arange(len(values)), time_ns, (*parts, both), (), (combination,))


@pytest.mark.parametrize(("frames", "expected"), HIDING.values(), ids=HIDING)
def test_needle_is_hidden_only_where_it_went_under_its_cover(
    frames: list[Mapping[str, Reading]], expected: str
) -> None:
    """Other apparent cases are due to glare: they are between the values before and after, or missing."""
    data = fill_gaps(fly(frames))
    value, cover = data.series[1].value, data.series[2].value
    seen = data.series[1].has(Status.READ)
    between = data.series[1].has(Status.INTERPOLATED)

    assert statuses(data, 1) == expected
    assert value[data.series[1].has(Status.HIDDEN)] == pytest.approx(cover[data.series[1].has(Status.HIDDEN)])
    if between.any():
        line = np.interp(np.flatnonzero(between), np.flatnonzero(seen), value[seen])
        assert value[between] == pytest.approx(line)
    assert np.isnan(value[data.series[1].has(Status.MISSING)]).all()


@pytest.mark.parametrize(
    "times_s",
    [(0.0, 100.0, 1.0, 2.0), (0.0, -100.0, 1.0, 2.0), (1.0, 1.0, 1.0, 2.0)],
    ids=["leaps ahead", "falls back", "stands still"],
)
def test_clock_that_jumps_gives_no_value_beyond_its_ends(times_s: tuple[float, ...]) -> None:
    """If the clock was set in mid-flight, a flagged frame is still between its neighbours or missing."""
    data = speeds([seen(200.0), BAD, seen(210.0), seen(300.0)], times_s=times_s)
    low, high = data.series[0].value[[0, 2]]

    assert statuses(data) in {"rirr", "rmrr"}
    assert statuses(data) == "rmrr" or low <= data.series[0].value[1] <= high
    assert np.nanmax(data.series[0].sigma) < 1000.0
