"""Committed flights, replayed through the recorder and decoded: what references are made of and held against."""

from __future__ import annotations

import io
from pathlib import Path

from recorder.config import parse_config
from recorder.host import SimulatedClock, fixed_host
from recorder.journal import Journal
from recorder.run import record
from tests.programs import ran

HERE = Path(__file__).parent
FLIGHTS = sorted((HERE.parents[1] / "fixtures").glob("*.mcap"))

Rows = list[dict[str, str]]


def reference_of(flight: Path) -> Path:
    """Where a flight's reference is."""
    return HERE / f"{flight.stem}.csv"


def replayed_flight_data(flight: Path, folder: Path) -> Path:
    """The CSV of a flight that went through recorder and decoder once more; everything is made in `folder`."""
    config = parse_config(
        {
            "camera": {"driver": "replay", "path": str(flight), "pace": "fastest"},
            "storage": {"directory": str(folder / "recorded"), "keep_free_gib": 0},
        }
    )
    outcome = record(config, host=fixed_host(SimulatedClock(0)), journal=Journal(io.StringIO()), name=flight.stem)
    ran("decode", *outcome.paths, "-o", folder).check_returncode()
    return folder / f"{flight.stem}.csv"


def needles_of(rows: Rows) -> list[str]:
    """The needles that flight data have."""
    return [column.removesuffix("_status") for column in rows[0] if column.endswith("_status")]
