"""`python -m benchmarks.cockpit [FLIGHT ...]`: the oblique cockpit, needle by needle, against its truth.

Without a name, every flight that `make fixtures` renders. A flight that cannot be decoded is one line that says why.
"""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.programs import FIXTURES, RENDERED
from decoder.instruments.reading import Status
from decoder.outputs.csv_output import text_table
from decoder.timeseries.accuracy import compare
from decoder.timeseries.tables import flight_table, read_table
from fixtures.cockpit.flights import COMMITTED, FLIGHTS, make_flight

READ = Status.READ.value
CLEAR, REALLY_COVERED = 0.05, 0.8
"""Parts of a needle's contrast that lights and hands took: up to the first it can be read, from the second not."""
VALUELESS = ("interpolated", "missing")
HEADER = (
    "needle",
    *(status.value for status in Status),
    "read: mean % FS",
    "max % FS",
    "within 95 %",
    "clear, no value read",
    "covered, a value read",
)


LEGEND = """\
The oblique cockpit of `fixtures/README.md`: what its cameras see, and how the decoder reads it.

![Frames of the oblique cockpit: 0, 20 and 35 degrees, a hand, reflections, the odd dials](cockpit.jpg)

Frames per status; errors on frames with status `read`, absolute, in percent of full scale; the part of these frames
whose error is within 1.96 sigma; frames in which the needle is clear but has no value read (`interpolated` or
`missing`); and frames in which lights or the hand took four fifths of its contrast and it claims to be read. Each of
the altimeter's pointers is held against what it shows by itself.
"""


@dataclass(frozen=True, slots=True)
class NeedleResult:
    """One needle of one flight.

    Attributes
    ----------
    statuses
        Frames per status.
    mean_pct_fs, max_pct_fs
        Absolute error of the frames with status `read`, percent of full scale; None without such frames.
    within_95
        Part of these frames whose error is within 1.96 sigma.
    clear_unread
        Of the frames in which the needle is clear, how many were not read: (unread, clear).
    covered_read
        Of the frames in which it is covered, how many claim to be read: (read, covered).
    """

    needle: str
    statuses: Counter[str]
    mean_pct_fs: float | None
    max_pct_fs: float | None
    within_95: float | None
    clear_unread: tuple[int, int]
    covered_read: tuple[int, int]


@dataclass(frozen=True, slots=True)
class FlightResult:
    """One flight: its needles, or why it could not be decoded."""

    flight: str
    needles: tuple[NeedleResult, ...]
    failure: str = ""


def measure(name: str, folder: Path) -> FlightResult:
    """Decodes a flight, rendered before if it is absent, and holds it against its truth."""
    home = FIXTURES / "oblique" if name in COMMITTED else RENDERED / "cockpit"
    if not (home / f"{name}_truth.csv").exists():
        make_flight(FLIGHTS[name], home)
    command = [str(Path(sys.executable).parent / "decode"), str(home / f"{name}.mcap"), "-o", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        return FlightResult(name, (), done.stderr.strip() or f"exit code {done.returncode}")
    flight, truth = read_table(folder / f"{name}.csv"), read_table(home / f"{name}_truth.csv")
    results = []
    for accuracy in compare(flight_table(flight), truth):
        needle = accuracy.needle
        statuses = flight.columns[f"{needle}_status"]
        covered = truth.numbers(f"{needle}_covered") if f"{needle}_covered" in truth.columns else [0.0] * len(statuses)
        clear = [status for status, part in zip(statuses, covered, strict=True) if part <= CLEAR]
        hidden = [status for status, part in zip(statuses, covered, strict=True) if part >= REALLY_COVERED]
        read = accuracy.by_status.get(READ)
        results.append(
            NeedleResult(
                needle,
                Counter(statuses),
                read.mean_abs_pct_fs if read else None,
                read.max_abs_pct_fs if read else None,
                read.within_95 if read else None,
                (sum(status in VALUELESS for status in clear), len(clear)),
                (sum(status == READ for status in hidden), len(hidden)),
            )
        )
    return FlightResult(name, tuple(results))


def table(result: FlightResult) -> str:
    """A flight's needles as a table for a terminal or a page."""
    if not result.needles:
        return result.failure
    rows = [
        (
            needle.needle,
            *(str(needle.statuses[status.value]) for status in Status),
            _number(needle.mean_pct_fs, "{:.3f}"),
            _number(needle.max_pct_fs, "{:.3f}"),
            _number(needle.within_95, "{:.1%}"),
            "{} of {}".format(*needle.clear_unread),
            "{} of {}".format(*needle.covered_read),
        )
        for needle in result.needles
    ]
    return text_table(HEADER, rows)


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else form.format(value)


def cockpit_page() -> str:
    """All flights, as a page."""
    with TemporaryDirectory() as name:
        sections = [f"## {flight}\n\n{_section(measure(flight, Path(name)))}\n" for flight in FLIGHTS]
    return "\n".join([LEGEND, *sections])


def _section(result: FlightResult) -> str:
    return f"```\n{table(result)}\n```"


def main(names: list[str]) -> None:
    """Prints a table for each flight."""
    with TemporaryDirectory() as name:
        for flight in names or FLIGHTS:
            print(f"{flight}\n\n{table(measure(flight, Path(name)))}\n", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
