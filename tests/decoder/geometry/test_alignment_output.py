"""`NAME_alignment.tsv` and what the JSON says of alignment: every frame, also the lost ones."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import yaml

from decoder.alignment import Alignment
from decoder.alignment_output import COLUMNS, write_alignment
from decoder.alignment_series import AlignmentSeries
from decoder.csv_output import utc_text
from decoder.flight_data import FlightData, FlightDataBuilder
from decoder.json_output import Provenance, SourceFile, describe
from decoder.method import Method
from decoder.panel import Panel, parse_panel
from decoder.panel_pictures import PanelPictures
from decoder.panel_reader import FrameReadings, PanelReader
from decoder.reading import Reading, Status

SIZE_PX = (640, 480)
READ = {"speed_kt": Reading(Status.READ, 200.0, 0.02, 0.99)}


def flight_of(panel: Panel) -> FlightData:
    """One frame as it was drawn, one that moved under a hand, one that was lost, one that was damaged."""
    builder = FlightDataBuilder(panel)
    builder.add(0, 0, FrameReadings(Alignment.rigid(0.0, (0.0, 0.0), 0.99), READ, (0.01,)))
    moved = Alignment((1.02, 0.0, 1.61, 0.0, 1.02, -6.79, 0.0, 0.0, 1.0), 0.91, ("north", "level"))
    builder.add(1, 10**9, FrameReadings(moved, READ, (0.05,)))
    builder.add_missing(2, 2 * 10**9, "anchor north not found (score 0.10)", ("north", "south"))
    builder.add_missing(4, 4 * 10**9, "the picture is damaged or cut short")
    return builder.build(lambda _, angles_deg: np.zeros_like(angles_deg))


def test_rows_tell_score_failures_and_motion(panel_of: Callable[..., Any]) -> None:
    """Shift, roll and scale are those at the picture's middle; lost frames name what was looked for."""
    text = io.StringIO()
    write_alignment(flight_of(panel_of(("north", "south"))), SIZE_PX, text)
    rows = list(csv.reader(io.StringIO(text.getvalue()), delimiter="\t"))

    assert rows == [
        list(COLUMNS),
        ["0", utc_text(0), "0.9900", "", "0.000", "0.000", "0.0000", "1.000000"],
        ["1", utc_text(10**9), "0.9100", "north;level", "8.000", "-2.000", "0.0000", "1.020000"],
        ["2", utc_text(2 * 10**9), "", "north;south", "", "", "", ""],
        ["4", utc_text(4 * 10**9), "", "", "", "", "", ""],
    ]


def test_description_counts_failures(panel_of: Callable[..., Any]) -> None:
    """The JSON says in how many frames each anchor failed."""
    provenance = Provenance("r", "s", "m", (), SourceFile("panel.yaml", "0"), None, ())
    described = describe(flight_of(panel_of(("north", "south"))), provenance)

    assert described["failed_anchors"] == {"level": 1, "north": 2, "south": 1}
    assert described["warnings"] == []
    json.dumps(described, allow_nan=False)


def test_series_gives_back_what_it_was_given() -> None:
    """Alignments come out as they went in, single precision for the score; lost frames are None."""
    series = AlignmentSeries()
    series.add_missing(("knob",))
    one = Alignment((1.0, 0.1, 3.0, -0.1, 1.0, 4.0, 1e-5, 2e-5, 1.0), 0.5, ("knob",))
    series.add(one, (0.1, 0.2))
    series.add_missing(())

    assert (series[0], series[1], series[2], len(series)) == (None, one, None, 3)
    assert series.failures() == {"knob": 2}
    assert series.sigma_px.shape == (3, 2)
    assert series.sigma_px[1] == pytest.approx((0.1, 0.2))
    assert np.isnan(series.sigma_px[[0, 2]]).all()


def test_panel_with_anchors_on_one_side_is_warned_of(see: Callable[..., Any], panel_of: Callable[..., Any]) -> None:
    """What the panel leaves wanting comes out of its reader as a sentence."""
    panel = panel_of(("north_west",)).model_dump(mode="json")
    places = {"a": 40.0, "b": 50.0, "c": 60.0, "d": 68.0}
    panel["anchors"] = [{"name": name, "box": [left, 32.0, 12.0, 40.0]} for name, left in places.items()]
    source = PanelPictures(parse_panel(yaml.safe_dump(panel)), {"panel.png": see(np.eye(3))}, "0")
    (warning,) = PanelReader.from_panel(source, Method.NORMXCORR).warnings

    assert "add anchors on the other sides of the gauges" in warning


def test_reading_survives_any_view(
    see: Callable[..., Any], panel_of: Callable[..., Any], turn: Callable[..., Any]
) -> None:
    """A needle is read through shake, roll, zoom and perspective alike, and each gauge has its uncertainty."""
    source = PanelPictures(
        panel_of(("north_west", "north_east", "south_west", "south_east")), {"panel.png": see(np.eye(3))}, "0"
    )
    reader = PanelReader.from_panel(source, Method.NORMXCORR)
    for motion in ({}, {"shift_px": (20.3, -9.6), "roll_deg": 4.0}, {"tilt": (0.15, 0.1), "scale": 0.97}):
        readings = reader.read(see(turn(**motion), noise=1.0, seed=4))

        assert readings.readings["speed_kt"].angle_deg == pytest.approx(360.0, abs=0.15)
        assert readings.readings["speed_kt"].status is Status.READ
        assert len(readings.alignment_sigma_px) == 1
        assert 0.0 < readings.alignment_sigma_px[0] < 0.1
