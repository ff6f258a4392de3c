"""Accuracy on the fixture flights beside the thesis's tables."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

from benchmarks.error_plot import Track, tracks
from benchmarks.programs import FIXTURES, RENDERED, decode
from decoder.timeseries.accuracy import ALL_VALUED, NeedleAccuracy, compare
from decoder.timeseries.tables import Table, flight_table, read_table

PUBLISHED = Path(__file__).with_name("published.csv")
REALLY_COVERED = 0.8
CLEAR_COVERED, CLEAR_GLARE = 0.05, 2.0  # whether another needle is above it or not: `edge` and `hidden` are no flags
FLAGGED = ("interpolated", "missing")
TABLE_3_2 = range(265, 269)
"""Sequence numbers of the thesis's frames 266 to 269."""


@dataclass(frozen=True, slots=True)
class Run:
    """One decode that is held against a table of the thesis."""

    title: str
    flight: Path
    truth: Path
    method: str
    table: str


RUNS = (
    Run("table A.1, xcorr", FIXTURES / "thesis_a1.mcap", FIXTURES / "thesis_a1_truth.csv", "xcorr", "A.1"),
    Run("table A.1, normxcorr", FIXTURES / "thesis_a1.mcap", FIXTURES / "thesis_a1_truth.csv", "normxcorr", "A.1"),
    Run("table A.2, normxcorr", FIXTURES / "thesis_a2.mcap", FIXTURES / "thesis_a2_truth.csv", "normxcorr", "A.2"),
    Run("400 frames, plain", RENDERED / "plain.mcap", RENDERED / "plain_truth.csv", "normxcorr", "3.1"),
    Run(
        "400 frames, reflections", RENDERED / "reflections.mcap", RENDERED / "reflections_truth.csv", "normxcorr", "3.3"
    ),
)


@dataclass(frozen=True, slots=True)
class Measured:
    """A run's errors by needle, and for each how many frames of a kind were flagged, as (flagged, all)."""

    run: Run
    needles: list[NeedleAccuracy]
    covered: dict[str, tuple[int, int]]
    clear: dict[str, tuple[int, int]]
    tracks: list[Track]


def measure(run: Run, folder: Path) -> Measured:
    """Decodes a run's flight and compares it with its truth."""
    decode(run.flight, folder, "--method", run.method)
    flight, truth = read_table(folder / f"{run.flight.stem}.csv"), read_table(run.truth)
    needles = compare(flight_table(flight), truth)
    names = [needle.needle for needle in needles]
    return Measured(
        run,
        needles,
        {name: _flagged(flight, truth, name, covered=True) for name in names},
        {name: _flagged(flight, truth, name, covered=False) for name in names},
        tracks(flight, truth),
    )


def oblique_tracks(name: str, folder: Path) -> list[Track]:
    """The errors of a committed flight of the oblique cockpit."""
    decode(FIXTURES / "oblique" / f"{name}.mcap", folder)
    return tracks(read_table(folder / f"{name}.csv"), read_table(FIXTURES / "oblique" / f"{name}_truth.csv"))


def published(table: str, needle: str, measure: str) -> float | None:
    """What the thesis printed, or None where it did not."""
    with PUBLISHED.open(encoding="utf-8", newline="") as stream:
        rows = {(row["table"], row["needle"], row["measure"]): float(row["value"]) for row in csv.DictReader(stream)}
    return rows.get((table, needle, measure))


def thesis_mean(table: str, needle: str) -> float:
    """The thesis's mean error of a needle in percent: of its rows, or 100 less its average accuracy."""
    mean = published(table, needle, "mean_error_pct")
    return mean if mean is not None else 100.0 - (published(table, needle, "average_accuracy_pct") or 0.0)


def table_3_2(folder: Path, method: str) -> list[tuple[float, str, float]]:
    """AL's truth, status and error in percent in the thesis's four frames; NaN where it was not read."""
    decode(RENDERED / "table_3_2.mcap", folder, "--method", method)
    flight, truth = read_table(folder / "table_3_2.csv"), read_table(RENDERED / "table_3_2_truth.csv")
    wanted, found = truth.numbers("fuel_al_lb"), flight.numbers("fuel_al_lb")
    statuses = flight.columns["fuel_al_lb_status"]
    return [
        (float(wanted[row]), statuses[row], float((found[row] - wanted[row]) / wanted[row] * 100)) for row in TABLE_3_2
    ]


def mean_error(needle: NeedleAccuracy) -> float:
    """A needle's mean absolute error in percent of the truth over all frames with a value."""
    return needle.by_status[ALL_VALUED].mean_abs_pct or 0.0


def _flagged(flight: Table, truth: Table, name: str, *, covered: bool) -> tuple[int, int]:
    part, glare = truth.numbers(f"{name}_covered"), truth.numbers(f"{name}_glare")
    where = part >= REALLY_COVERED if covered else (part <= CLEAR_COVERED) & (glare <= CLEAR_GLARE)
    statuses = [status for status, kind in zip(flight.columns[f"{name}_status"], where, strict=True) if kind]
    return sum(status in FLAGGED for status in statuses), len(statuses)
