"""Three pointers over each other: each is read where it shows, and together they are one value or none."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from decoder.imaging.alignment import IDENTITY
from decoder.imaging.pictures import GreyPicture
from decoder.instruments.kinds.dials.geared import told_together
from decoder.instruments.panel_reader import PanelReader, read_picture
from decoder.instruments.reading import FrameReadings, Reading, Status
from decoder.panel.panel import parse_panel
from decoder.panel.scale import shortest
from decoder.timeseries.flight_data import STATUSES, FlightData, FlightDataBuilder
from decoder.timeseries.gaps import fill_gaps
from tests.decoder.instruments.altimeters import ALTIMETER, FORMS, PANEL_DEG, TURNS_FT, angles_of, drawn
from tests.decoder.instruments.dials import CENTRE, Hand, paint, reader_for

BAD = Reading(Status.MISSING, 300.0, 0.5, 0.4)


# The long pointer's tail, and the gauge that knows of it.
TAILS_PX = {"plain": 0.0, "tailed": 26.0}


@pytest.fixture(scope="module", params=TAILS_PX.values(), ids=TAILS_PX)
def tail_px(request: pytest.FixtureRequest) -> float:
    """The length of the long pointer's tail."""
    return float(request.param)


def draw(angles_deg: tuple[float, ...], seed: int, tail_px: float) -> GreyPicture:
    """Draws an altimeter whose long pointer may have a tail."""
    return drawn(angles_deg, (*FORMS[:2], replace(FORMS[2], tail=tail_px, tail_half=2.2)), seed)


@pytest.fixture(scope="module")
def reader(tail_px: float) -> PanelReader:
    """Its reader, tuned to a flight up and down."""
    altitudes_ft = np.random.default_rng(5).uniform(0, 99_999, 16)
    frames = [draw(angles_of(altitude_ft), 100 + seed, tail_px) for seed, altitude_ft in enumerate(altitudes_ft)]
    return reader_for([ALTIMETER | {"tail": tail_px > 0}], draw(PANEL_DEG, 1, tail_px), frames)


def combined(readings: list[Mapping[str, Reading]], **gauge: Any) -> FlightData:  # noqa: ANN401
    """The flight data of such readings, half a second apart; systematic errors are none."""
    content = {
        "name": "altimeter",
        "picture": "panel.png",
        "anchors": [{"name": "texture", "box": [196, 22, 36, 36]}],
        "gauges": [copy.deepcopy(ALTIMETER) | {"centre": list(CENTRE)} | gauge],
    }
    panel = parse_panel(yaml.safe_dump(content))
    (own,), builder = panel.gauges, FlightDataBuilder(panel)
    for index, frame in enumerate(readings):
        together = dict(frame) if "altitude_ft" in frame else {**frame, "altitude_ft": told_together(own, frame)}
        builder.add(index, index * 500_000_000, FrameReadings(IDENTITY, together))
    return fill_gaps(builder.build(lambda _, angles_deg: np.zeros_like(angles_deg)))


def pointing(altitude_ft: float, off_deg: Mapping[str, float] | None = None) -> dict[str, Reading]:
    """The three pointers of an altitude, each off by so many degrees."""
    angles = zip(TURNS_FT, angles_of(altitude_ft), strict=True)
    return {
        name: Reading(Status.READ, 270.0 + (angle_deg + (off_deg or {}).get(name, 0.0) - 270.0) % 360.0, 0.05, 0.99)
        for name, angle_deg in angles
    }


ALTITUDES_FT = {
    "anywhere": np.random.default_rng(6).uniform(0, 99_000, 60),
    "all at the top": np.linspace(-60.0, 60.0, 13) % 100_000,
    "coarse ones together": np.linspace(10_700.0, 11_500.0, 21),
}


@pytest.mark.slow
@pytest.mark.parametrize("altitudes_ft", ALTITUDES_FT.values(), ids=ALTITUDES_FT)
def test_pointers_are_read_where_they_show(reader: PanelReader, tail_px: float, altitudes_ft: np.ndarray) -> None:
    """The long pointer always is, the others wherever they show; none is taken for another, and few hide one."""
    errors: dict[str, list[float]] = {name: [] for name in TURNS_FT}
    frames = []
    for seed, altitude_ft in enumerate(altitudes_ft):
        angles_deg = angles_of(altitude_ft)
        readings = read_picture(reader, draw(angles_deg, seed, tail_px)).readings
        frames.append(readings)
        assert readings["hundreds_ft"].status is Status.READ
        for name, angle_deg in zip(TURNS_FT, angles_deg, strict=True):
            if readings[name].status in (Status.READ, Status.EDGE):
                errors[name].append(float(abs(shortest(np.array(readings[name].angle_deg - angle_deg), 360.0))))

    assert np.mean(errors["hundreds_ft"]) < 0.1
    assert max(errors["hundreds_ft"]) < 0.4
    assert max(errors["thousands_ft"], default=0.0) < 1.2
    assert max(errors["ten_thousands_ft"], default=0.0) < 2.5
    altitude = combined(frames).series[-1]
    valued = altitude.has(Status.READ)
    assert valued.mean() >= 0.9 or altitudes_ft is not ALTITUDES_FT["anywhere"]
    off_ft = shortest(altitude.value - altitudes_ft, 100_000.0)
    assert np.abs(off_ft[valued]).max(initial=0.0) < 2.0  # a finest turn is 1000 ft: a miscounted one would show


def dim(angles_deg: tuple[float, ...], seed: int = 0) -> GreyPicture:
    """Draws an altimeter whose long pointer, above the others, is the darkest."""
    forms = (
        Hand(tip=34.0, root_half=3.0, tip_half=1.5, level=235.0),
        Hand(tip=46.0, root_half=4.0, tip_half=3.0, level=235.0),
        Hand(tip=64.0, root_half=2.2, tip_half=1.2, level=150.0),
    )
    return paint(
        lambda canvas: (
            canvas.dial(range(0, 360, 36)),
            [canvas.hand(form, angle_deg) for form, angle_deg in zip(forms, angles_deg, strict=True)],
        ),
        seed=seed,
    )


@pytest.mark.slow
@pytest.mark.parametrize("tuned", [False, True])
def test_pointer_dimmer_than_those_below_it_is_not_taken_for_them(tuned: bool) -> None:  # noqa: FBT001
    """Near a brighter pointer it may be lost; what is read is right to two hundredths of full scale."""
    altitudes_ft = np.random.default_rng(5).uniform(0, 99_999, 16)
    frames = [dim(angles_of(altitude_ft), 100 + seed) for seed, altitude_ft in enumerate(altitudes_ft)]
    reader = reader_for([ALTIMETER], dim(PANEL_DEG, 1), frames if tuned else [])
    read, wrong = 0, []
    for seed, altitude_ft in enumerate([*np.random.default_rng(11).uniform(0, 99_000, 40), *np.arange(200, 1200, 50)]):
        readings = read_picture(reader, dim(angles_of(altitude_ft), seed)).readings
        for name, angle_deg in zip(TURNS_FT, angles_of(altitude_ft), strict=True):
            if readings[name].status is Status.READ:
                read += 1
                off_deg = float(abs(shortest(np.array(readings[name].angle_deg - angle_deg), 360.0)))
                wrong += [(altitude_ft, name, off_deg)] if off_deg > 0.02 * 360.0 else []

    assert wrong == []
    assert read > 90


@given(
    altitude_ft=st.floats(0.0, 99_999.0),
    off_deg=st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0)),
)
@settings(max_examples=60)
def test_coarse_pointers_count_and_the_finest_measures(altitude_ft: float, off_deg: tuple[float, float]) -> None:
    """Coarse pointers may be off by several degrees: the value is the finest one's all the same."""
    off = {"ten_thousands_ft": off_deg[0], "thousands_ft": off_deg[1]}
    (altitude,) = combined([pointing(altitude_ft, off)]).series[-1:]

    assert altitude.quantity.name == "altitude_ft"
    assert altitude.has(Status.READ).all()
    assert abs(shortest(altitude.value - altitude_ft, 100_000.0)) < 1e-4
    assert 0.0 <= altitude.value[0] < 100_000.0


@given(altitude_ft=st.floats(0.0, 99_999.0), off_deg=st.floats(8.0, 28.0) | st.floats(-28.0, -8.0))
@pytest.mark.parametrize("pointer", ["ten_thousands_ft", "thousands_ft"])
def test_pointers_that_contradict_each_other_are_no_value(pointer: str, altitude_ft: float, off_deg: float) -> None:
    """The altitude is missing and stays so between good ones; the pointers keep what was read of them."""
    good, bad = pointing(altitude_ft), pointing(altitude_ft, {pointer: off_deg})
    data = combined([good, bad, good])
    altitude = data.series[-1]

    assert [STATUSES[code] for code in altitude.status] == [Status.READ, Status.MISSING, Status.READ]
    assert np.isnan(altitude.value[1])
    assert all(series.has(Status.READ).all() for series in data.series[:-1])


def test_altitude_of_a_pointer_that_is_not_seen_is_interpolated() -> None:
    """A gap in one pointer is a gap in the value, filled like any other."""
    good = [pointing(altitude_ft) for altitude_ft in (9_800.0, 9_900.0, 10_000.0, 10_100.0)]
    data = combined([good[0], good[1] | {"thousands_ft": BAD}, good[2] | {"hundreds_ft": BAD}, good[3]])
    altitude = data.series[-1]

    assert [STATUSES[code].value[0] for code in altitude.status] == ["r", "i", "i", "r"]
    assert altitude.value == pytest.approx([9_800.0, 9_900.0, 10_000.0, 10_100.0])
    assert (altitude.sigma[1:3] > altitude.sigma[0]).all()


def test_values_begin_at_the_lowest() -> None:
    """Below zero an altitude is below zero if the panel says that it can be."""
    own = ALTIMETER["combined"] | {"lowest": -1000}

    assert combined([pointing(-40.0)], combined=own).series[-1].value[0] == pytest.approx(-40.0)
    assert combined([pointing(-40.0)]).series[-1].value[0] == pytest.approx(99_960.0)
