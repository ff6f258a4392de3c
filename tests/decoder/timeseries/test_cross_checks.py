"""Instruments that show the same: compared, and pointed out where they disagree, and nowhere else."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from decoder.instruments.reading import Status
from decoder.panel.arrays import Floats
from decoder.panel.parameters import Column, parameter_of
from decoder.panel.scale import Quantity
from decoder.timeseries.cross_checks import CrossCheck, cross_checks
from decoder.timeseries.flight_data import CODE, FlightData, NeedleSeries
from tests.programs import rows_of

COCKPIT = Path(__file__).parents[4] / "shared" / "data" / "cockpit_flight"
TURN = {"heading": 360.0, "compass": 360.0, "roll": 360.0}
UNITS = {
    "ft": "ft", "kt": "kt", "fpm": "fpm", "deg": "deg", "norm": "standard rate", "inHg": "inHg",
}  # fmt: skip
SCALES = {"ft": 20000.0, "kt": 200.0, "fpm": 4000.0, "deg": 360.0, "norm": 6.0, "inHg": 3.0}
G_MPS2, KT_MPS = 9.80665, 0.514444
Change = Callable[[Floats], Floats]


def flight(time_s: Floats, values: Mapping[str, Floats], **columns: Column) -> FlightData:
    """Flight data all of which were read, with an uncertainty of a three-thousandth of full scale."""
    series = []
    for name, own in values.items():
        unit = name.rpartition("_")[2]
        wraps = TURN.get(parameter_of(name) or "")
        half = SCALES[unit] / 2
        lowest = -180.0 if parameter_of(name) == "roll" else 0.0
        marks = ((0.0, -half), (300.0, half))
        quantity = Quantity(name, "g", UNITS[unit], marks, wraps, None, None, lowest)
        status, sigma = np.full(len(own), CODE[Status.READ], np.uint8), np.full(len(own), SCALES[unit] / 3000)
        series.append(NeedleSeries(quantity, status, own, sigma, np.ones(len(own)), np.zeros(len(own))))
    rows = np.arange(len(time_s))
    return FlightData(rows, (time_s * 1e9).astype(np.int64), tuple(series), (), columns=columns)


def flown(changes: Mapping[str, Change] | None = None, step_s: float = 0.5, **columns: Column) -> FlightData:
    """Four minutes: climb, level, descent, with turns to both sides; the vertical speed lags by seven seconds."""
    time_s = np.arange(0.0, 240.0, step_s)
    climb_fpm = 900.0 * np.sin(time_s / 25.0)
    altitude_ft = 4000.0 + np.cumsum(climb_fpm) / 60.0 * step_s
    shown_fpm = np.zeros(len(time_s))
    for row in range(1, len(time_s)):
        shown_fpm[row] = shown_fpm[row - 1] + (climb_fpm[row] - shown_fpm[row - 1]) * step_s / 7.0
    roll_deg = np.where((time_s > 60) & (time_s < 180), 25.0 * np.sin(time_s / 12.0), 0.0)
    mps = 100.0 * KT_MPS * (1 - 6.8756e-6 * altitude_ft) ** -2.1279
    rate_dps = np.degrees(G_MPS2 * np.tan(np.radians(roll_deg)) / mps)
    heading_deg = np.mod(350.0 + np.cumsum(rate_dps) * step_s, 360.0)
    values = {
        "airspeed_kt": np.full(len(time_s), 100.0),
        "altitude_ft": altitude_ft,
        "vertical_speed_fpm": shown_fpm,
        "roll_deg": roll_deg,
        "heading_deg": heading_deg,
        "turn_rate_norm": rate_dps / 3.0,
        "compass_deg": np.mod(heading_deg + 4.0 + 1.5 * roll_deg, 360.0),
    }
    for name, change in (changes or {}).items():
        values[name] = change(values[name].copy())
    for name in ("heading_deg", "compass_deg"):
        values[name] = np.mod(values[name], 360.0)
    return flight(time_s, values, **columns)


def frozen_from(row: int) -> Change:
    """A hand that stands still from then on."""

    def change(values: Floats) -> Floats:
        values[row:] = values[row]
        return values

    return change


def off_from(row: int, by: float) -> Change:
    """A hand that is off from then on."""

    def change(values: Floats) -> Floats:
        values[row:] += by
        return values

    return change


def disagreeing(data: FlightData) -> dict[frozenset[str], CrossCheck]:
    """The checks in which something disagrees, by their columns."""
    return {frozenset(check.columns): check for check in cross_checks(data) if check.disagreements}


def test_sound_instruments_agree_though_they_lag_and_a_compass_errs_in_turns() -> None:
    """All possible comparisons are made, in most of the flight, and nothing disagrees."""
    checks = cross_checks(flown())

    assert len(checks) == 5
    assert [check.words for check in checks if check.disagreements] == []
    assert all(check.compared > 350 for check in checks if "compass_deg" not in check.columns)
    assert all(check.compared > 100 for check in checks)


@pytest.mark.parametrize(
    ("name", "change", "other", "where"),
    [
        ("altitude_ft", off_from(200, 1000.0), "vertical_speed_fpm", 200),
        ("vertical_speed_fpm", frozen_from(60), "altitude_ft", 200),
        ("heading_deg", off_from(300, -30.0), "roll_deg", 300),
        ("heading_deg", off_from(0, 30.0), "compass_deg", 60),
        ("heading_deg", frozen_from(130), "roll_deg", 265),
    ],
)
def test_an_instrument_that_fails_is_found_where_it_does(name: str, change: Change, other: str, where: int) -> None:
    """By the other one that shows the same; its time is about right, and that of a step exact."""
    found = disagreeing(flown({name: change}))

    (check,) = (each for columns, each in found.items() if {name, other} <= columns)
    assert any(each.first <= where <= each.last for each in check.disagreements)
    assert all(name in columns for columns in found)
    assert "DISAGREE" in check.words


def test_bank_may_be_counted_from_0_to_360() -> None:
    """A ring that does so agrees, and a frozen one is found too."""
    ring: Change = lambda values: np.mod(values, 360.0)  # noqa: E731 - as the others

    assert disagreeing(flown({"roll_deg": ring})) == {}
    assert (
        disagreeing(flown({"roll_deg": lambda values: ring(frozen_from(130)(values))})).keys()
        == disagreeing(flown({"roll_deg": frozen_from(130)})).keys()
    )


def test_a_change_of_the_altimeters_setting_is_no_disagreement_where_a_column_has_it() -> None:
    """Without that column it is pointed out, with the remark that it may be only that."""
    setting_inhg = np.where(np.arange(480) < 200, 29.92, 30.42)
    moved = {"altitude_ft": off_from(200, 463.0)}

    (told,) = disagreeing(flown(moved)).values()
    data = flown(moved)
    with_setting = flight(
        data.time_s,
        {**{each.quantity.name: each.value for each in data.series}, "altimeter_setting_inHg": setting_inhg},
    )
    assert "setting" in told.words
    assert disagreeing(with_setting) == {}


def test_two_columns_of_one_parameter_are_compared_and_the_panel_can_say_what_they_are() -> None:
    """A copilot's altimeter is known by its name; a column that the panel declares as none is left out."""
    data = flown()
    values = {each.quantity.name: each.value for each in data.series}
    values["altitude_2_ft"] = off_from(300, 400.0)(values["altitude_ft"].copy())
    both = flight(data.time_s, values)
    silent = flight(data.time_s, values, altitude_2_ft=Column(means="none"))

    check = disagreeing(both)[frozenset({"altitude_ft", "altitude_2_ft"})]
    assert [(each.first, each.last) for each in check.disagreements] == [(300, 479)]
    assert disagreeing(silent) == {}
    odd = flight(data.time_s, {"left_ft": values["altitude_ft"], "right_ft": values["altitude_2_ft"]})
    assert cross_checks(odd) == []
    named = flight(
        data.time_s,
        {"left_ft": values["altitude_ft"], "right_ft": values["altitude_2_ft"]},
        left_ft=Column(means="altitude"),
        right_ft=Column(means="altitude"),
    )
    assert len(disagreeing(named)) == 1


def test_what_was_not_seen_is_not_compared() -> None:
    """A disagreement of interpolated values does not count, and pictures too far apart give no rate."""
    data = flown({"altitude_ft": off_from(200, 1000.0)})
    for each in data.series:
        if each.quantity.name == "altitude_ft":
            each.status[180:260] = CODE[Status.INTERPOLATED]

    assert disagreeing(data) == {}
    slow = cross_checks(flown(step_s=6.0))
    assert [check.compared for check in slow if "vertical_speed_fpm" in check.columns] == [0]


@pytest.mark.parametrize(
    ("name", "parameter"),
    [
        ("hi_heading_deg", "heading"),
        ("altitude_2_ft", "altitude"),
        ("mag_compass_deg", "compass"),
        ("heading_bug_deg", None),
        ("hundreds_ft", None),
    ],
)
def test_a_name_tells_the_parameter_by_its_last_word(name: str, parameter: str | None) -> None:
    """Unless a word before says that it is something else."""
    assert parameter_of(name) == parameter


@pytest.mark.skipif(not COCKPIT.is_dir(), reason="needs shared data")
@pytest.mark.parametrize("name", ["flight_a", "sixpack_a"])
def test_in_a_simulated_flight_nothing_disagrees_but_what_is_planted(name: str) -> None:
    """Steep turns, slips, a lagging turn coordinator and changed settings are explained; a step of 1000 ft is not."""
    columns = {
        "asi_kt": "asi_kt", "vsi_fpm": "vsi_fpm", "alt_ft": "alt_ft", "alt_setting_inHg": "alt_setting_inHg",
        "turn_rate_norm": "turn_rate_norm", "hi_heading_deg": "hi_heading_deg", "ai_roll_deg": "ai_roll_deg",
        "mag_compass_deg": "mag_compass_deg",
    }  # fmt: skip
    rows = rows_of(COCKPIT / f"{name}_truth.csv")
    time_s = np.array([float(row["time_s"]) for row in rows])
    values = {ours: np.array([float(row[theirs]) for row in rows]) for ours, theirs in columns.items()}

    assert disagreeing(flight(time_s, values)) == {}
    for row in range(8, len(rows), 15):
        wrong = {**values, "alt_ft": off_from(row, 1000.0)(values["alt_ft"].copy())}
        (check,) = disagreeing(flight(time_s, wrong)).values()
        assert [(each.first, each.last) for each in check.disagreements] == [(row - 1, row)]
