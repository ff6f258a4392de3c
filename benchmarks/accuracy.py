"""Accuracy on the rendered flights, where the truth is known, beside what the thesis published."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.flights import Decoded, DecodedFlights
from benchmarks.published import Published
from benchmarks.tables import markdown, number
from decoder.accuracy import ALL_VALUED, Errors, compare
from decoder.reading import Status

COVERED = 0.8  # part of a needle's contrast that is gone; nobody can read what is left
CLEAR, CLEAR_GLARE, CLEAR_HIDDEN = 0.05, 2.0, 0.05  # as fixtures/README.md has it; and no other needle above it
SEEN = (Status.READ.value, Status.EDGE.value)

# Flight, method, and the tables of the thesis that stand beside it: errors row by row, and averages.
ROW_TABLES = {("thesis_a1", "xcorr"): "A.1", ("thesis_a1", "normxcorr"): "A.1", ("thesis_a2", "normxcorr"): "A.2"}
AVERAGE_TABLES = {("plain", "normxcorr"): "3.1", ("reflections", "normxcorr"): "3.3"}
MEASURED = (*ROW_TABLES, *AVERAGE_TABLES)


@dataclass(frozen=True, slots=True)
class Flagged:
    """How many frames of a needle are flagged, of those in which it is really covered, and of those where it is clear.

    Flagged is what has another status than `read` or `edge`.
    """

    covered: int
    covered_flagged: int
    clear: int
    clear_flagged: int


@dataclass(frozen=True, slots=True)
class NeedleResult:
    """One needle of one flight; `every` is over all frames that have a value, `read` over those with that status."""

    needle: str
    every: Errors
    read: Errors
    frames: int
    flagged: Flagged


def measure(decoded: Decoded) -> list[NeedleResult]:
    """All needles of a flight."""
    return [
        NeedleResult(
            result.needle,
            result.by_status[ALL_VALUED],
            result.by_status[Status.READ.value],
            result.frames_compared,
            flagged(decoded, result.needle),
        )
        for result in compare(decoded.data, decoded.truth)
    ]


def flagged(decoded: Decoded, needle: str) -> Flagged:
    """Counts a needle's flags against what could be seen of it."""
    truth = decoded.truth
    covered = truth.numbers(f"{needle}_covered")
    hidden = truth.numbers(f"{needle}_hidden") if f"{needle}_hidden" in truth.columns else np.zeros_like(covered)
    flags = ~np.isin(decoded.data.columns[f"{needle}_status"], SEEN)
    gone = covered >= COVERED
    clear = (covered <= CLEAR) & (truth.numbers(f"{needle}_glare") <= CLEAR_GLARE) & (hidden <= CLEAR_HIDDEN)
    return Flagged(_count(gone), _count(gone & flags), _count(clear), _count(clear & flags))


def _count(where: NDArray[np.bool_]) -> int:
    return int(where.sum())


def row_table(results: Sequence[NeedleResult], table: str, thesis: Published) -> str:
    """Errors in percent of the reading over all frames, beside table A.1 or A.2."""
    header = ["needle", "mean %", "thesis", "ratio", "max %", "thesis", "signed %", "mean %FS", "max %FS", "in 95 %"]
    rows = []
    for result in results:
        mean, largest = (thesis[table, result.needle, f"{kind}_error_pct"] for kind in ("mean", "max"))
        ours = result.every.mean_abs_pct or 0.0
        rows.append(
            [
                result.needle,
                number(ours),
                number(mean, 3),
                f"1/{mean / ours:.0f}",
                number(result.every.max_abs_pct),
                number(largest, 3),
                number(result.every.mean_signed_pct, sign=True),
                number(result.every.mean_abs_pct_fs),
                number(result.every.max_abs_pct_fs),
                f"{result.every.within_95:.0%}",
            ]
        )
    return markdown(header, rows)


def average_table(results: Sequence[NeedleResult], table: str, thesis: Published) -> str:
    """Errors over 400 frames, beside table 3.1 or 3.3, and whether flags are where they belong."""
    header = [
        "needle",
        "read",
        "%FS read",
        "max",
        "signed %",
        "thesis",
        "mean %",
        "max %",
        "in 95 %",
        "covered",
        "clear",
    ]
    rows = []
    for result in results:
        flags, every, read = result.flagged, result.every, result.read
        rows.append(
            [
                result.needle,
                f"{read.frames}/{result.frames}",
                number(read.mean_abs_pct_fs),
                number(read.max_abs_pct_fs, 3),
                number(every.mean_signed_pct, sign=True),
                number(100 - thesis[table, result.needle, "average_accuracy_pct"], 2),
                number(every.mean_abs_pct),
                number(every.max_abs_pct, 2),
                f"{read.within_95:.0%}",
                f"{flags.covered_flagged}/{flags.covered}",
                f"{flags.clear_flagged}/{flags.clear}",
            ]
        )
    return markdown(header, rows)


def all_results(flights: DecodedFlights) -> dict[tuple[str, str], list[NeedleResult]]:
    """Every flight and method that the thesis has numbers for."""
    return {key: measure(flights.get(*key)) for key in MEASURED}
