"""`RECORDING.json`: what the flight data are made of and where they have gaps."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from decoder.instruments.reading import Reading, Status
from decoder.outputs.json_output import Provenance, SourceFile, write_json
from decoder.timeseries.gaps import fill_gaps
from tests.decoder.cockpit import fly

GOOD = Reading(Status.READ, 200.0, 0.02, 0.98765)
BAD = Reading(Status.MISSING, 333.0, 0.5, 0.41234)
PROVENANCE = Provenance(
    recording="flight",
    software="image-flight-recorder 0.1.0",
    method="normxcorr",
    flight_files=(SourceFile("flight.mcap", "a" * 64),),
    panel=SourceFile("panel.yaml", "b" * 64),
    camera=None,
    losses=("flight.mcap: cut short",),
)


def described(frames: list[Mapping[str, Reading] | str]) -> dict[str, Any]:
    """The JSON of a flight, read again."""
    stream = io.StringIO()
    write_json(fill_gaps(fly(frames)), PROVENANCE, stream)
    content: dict[str, Any] = json.loads(stream.getvalue())
    return content


def test_sources_times_and_pivots_are_told() -> None:
    """Software, files, panel, camera and losses as they were given; start, end, number of frames; moved pivots."""
    stream = io.StringIO()
    write_json(replace(fly([{}, {}, {}]), moved_pivots_px={"fuel": (0.61234, -0.2)}), PROVENANCE, stream)
    content = json.loads(stream.getvalue())

    assert content["software"] == "image-flight-recorder 0.1.0"
    assert content["flight_files"] == [{"name": "flight.mcap", "sha256": "a" * 64}]
    assert content["panel"] == {"name": "panel.yaml", "sha256": "b" * 64}
    assert content["camera"] is None
    assert content["losses"] == ["flight.mcap: cut short"]
    assert (content["frames"], content["duration_s"]) == (3, 1.0)
    assert (content["start_utc"], content["end_utc"]) == ("2018-05-04T12:00:00.000000Z", "2018-05-04T12:00:01.000000Z")
    assert content["moved_pivots_px"] == {"fuel": [0.612, -0.2]}


def test_gaps_name_needle_frames_and_status() -> None:
    """Each run of flagged frames is one gap; a needle has its unit, scale, frames by status and lowest score."""
    worse = Reading(Status.MISSING, 333.0, 0.5, 0.2)
    content = described([{"speed_kt": reading} for reading in (GOOD, GOOD, BAD, worse, GOOD, BAD)])

    assert content["needles"]["speed_kt"] == {
        "gauge": "speed",
        "unit": "kt",
        "scale_min": 0.0,
        "scale_max": 1000.0,
        "frames": {"read": 3, "edge": 0, "hidden": 0, "interpolated": 2, "missing": 1},
        "lowest_score": 0.2,
    }
    assert content["gaps"] == [
        {"needle": "speed_kt", "status": "interpolated", "first_frame": 2, "last_frame": 3, "lowest_score": 0.2},
        {"needle": "speed_kt", "status": "missing", "first_frame": 5, "last_frame": 5, "lowest_score": 0.4123},
    ]


def test_frames_without_panel_are_told_once_not_as_gaps() -> None:
    """Neighbouring frames with one reason are one run, whatever their scores; another reason starts a new one."""
    lost = ["anchor knob not found (score 0.12)", "anchor knob not found (score 0.33)"]
    content = described([{}, *lost, "the picture is damaged", {}, lost[0]])

    assert content["missing_frames"] == [
        {"first_frame": 1, "last_frame": 2, "reason": lost[0]},
        {"first_frame": 3, "last_frame": 3, "reason": "the picture is damaged"},
        {"first_frame": 5, "last_frame": 5, "reason": lost[0]},
    ]
    assert content["gaps"] == []


def test_flight_without_frames_is_valid_json() -> None:
    """An empty recording is described without NaN."""
    content = described([])

    assert (content["frames"], content["start_utc"], content["duration_s"]) == (0, None, 0.0)
    assert content["needles"]["speed_kt"]["lowest_score"] is None
