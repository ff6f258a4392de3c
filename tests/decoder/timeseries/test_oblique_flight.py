"""A flight seen obliquely by a camera that shakes, with glare and a hand in the picture: read whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decoder.imaging.panel_pictures import panel_from_attachments
from decoder.instruments.reading import Status
from decoder.learning.fit import reader_from_panel
from decoder.panel.camera import parse_camera
from decoder.panel.vocabulary import CAMERA_FILE, Method
from decoder.timeseries.flight_data import STATUSES, FlightData
from decoder.timeseries.flight_decoder import decode_flight
from decoder.timeseries.tables import Table, read_table
from flight_file.reader import open_flight
from tests.programs import FIXTURES

OBLIQUE = FIXTURES / "oblique"
READ = STATUSES.index(Status.READ)

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("oblique flight")]


@pytest.fixture(scope="module", params=["needle heights stated", "needle heights unknown"])
def data(request: pytest.FixtureRequest) -> FlightData:
    """Twelve needles, 20 degrees from the side, 808 x 606 pixels: they seem to turn a pixel beside their pivots."""
    flight = open_flight([OBLIQUE / "t1a_small.mcap"])
    camera = parse_camera(flight.attachments[CAMERA_FILE], source=CAMERA_FILE)
    source = replace(panel_from_attachments(flight.attachments, flight="t1a_small"), camera=camera)
    if request.param == "needle heights unknown":
        gauges = tuple(gauge.model_copy(update={"needle_height_inches": 0.0}) for gauge in source.panel.gauges)
        source = replace(source, panel=source.panel.model_copy(update={"gauges": gauges}))
    return decode_flight(flight, reader_from_panel(source, Method.NORMXCORR), lambda frames: frames)


@pytest.fixture(scope="module")
def truth() -> Table:
    """What the renderer was told."""
    return read_table(OBLIQUE / "t1a_small_truth.csv")


def test_needles_are_read_right(data: FlightData, truth: Table) -> None:
    """Within 0.3 % of full scale on average, and no value with the status read is off by 2 %."""
    for series in data.series:
        error = np.abs(series.value - truth.numbers(series.quantity.name)) / series.quantity.full_scale
        read = series.status == READ

        assert read.sum() > len(read) / 2, series.quantity.name
        assert error[read].mean() < 0.003, series.quantity.name
        assert error[read].max() < 0.02, series.quantity.name


def test_uncertainties_are_not_bold(data: FlightData, truth: Table) -> None:
    """At least 95 % of all values that were read lie within 1.96 sigma: the panel was drawn better than by hand."""
    within = [
        np.abs(series.value - truth.numbers(series.quantity.name))[series.status == READ]
        <= 1.96 * series.sigma[series.status == READ]
        for series in data.series
    ]

    assert np.concatenate(within).mean() >= 0.95


def test_needle_under_the_hand_is_not_guessed(data: FlightData, truth: Table) -> None:
    """If a hand or lights remove four fifths of a needle's contrast, its status is not read."""
    for series in data.series:
        covered = truth.numbers(f"{series.quantity.name}_covered") >= 0.8

        assert not (covered & (series.status == READ)).any(), series.quantity.name
