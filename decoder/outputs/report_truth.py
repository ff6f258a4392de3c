"""The truth in the report: the tables of `decode accuracy`, and the truth's values for the plots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256

import numpy as np

from decoder.outputs.json_output import Provenance, as_read_back
from decoder.panel.arrays import Floats
from decoder.timeseries.accuracy import truth_at
from decoder.timeseries.flight_data import FlightData
from decoder.timeseries.truth_comparison import (
    HEADER,
    LIMITS_HEADER,
    NO_LIMITS,
    Truth,
    accuracy_rows,
    compared,
    limit_rows,
    offset_text,
    source_lines,
)

COLUMNS_SAY = (
    "Percent columns: % of the true value, %FS of full scale, then in the gauge's own unit; mean and max are of the"
    " absolute error, signed of the signed one. in95%: frames whose error is within 1.96 sigma. Near a true value of 0,"
    " percentages of it become meaningless; those of full scale do not."
)
LIMITS_TITLE = "Compared with the requirements for recorders"
WORDS = frozenset({"needle", "status", "unit", "limit", "of", "verdict"})
BY_FRAME = "Rows were matched by frame."
BY_TIME = "Rows were matched by time_s, the truth interpolated between its rows."


@dataclass(frozen=True, slots=True)
class TruthTable:
    """A table with its notes."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    notes: Sequence[str] = ()

    @property
    def aligned(self) -> list[str]:
        """How the cells of each column are aligned: numbers to the right."""
        return ["" if title in WORDS else "number" for title in self.header]


@dataclass(frozen=True, slots=True)
class TruthSection:
    """What the flight was compared with.

    Attributes
    ----------
    name, sha256
        Of the file.
    words
        How its rows were matched.
    values
        By needle: (N,), the truth at every row of the flight data, NaN where there is none.
    places
        The index of each of those needles among the flight data's.
    """

    name: str
    sha256: str
    words: str
    tables: Sequence[TruthTable]
    values: Mapping[str, Floats]
    places: Sequence[int]


def truth_section(data: FlightData, provenance: Provenance, truth: Truth) -> TruthSection:
    """Compare the flight data with a truth, as `decode accuracy` would compare their CSV.

    Raises
    ------
    DecoderError
        As `compared`.
    OSError
        If the truth can no longer be read.
    """
    flight = as_read_back(data, provenance)
    result = compared(flight, truth)
    names = [needle for needle in flight.names if needle in result.truth.columns]
    tables = [TruthTable("Accuracy", HEADER, accuracy_rows(result.accuracies), [COLUMNS_SAY])]
    if truth.request.limits and result.limits:
        rows = limit_rows(result.limits)
        tables.append(TruthTable(LIMITS_TITLE, LIMITS_HEADER, rows, source_lines(result.limits)))
    elif truth.request.limits:
        tables.append(TruthTable(LIMITS_TITLE, LIMITS_HEADER, [], [NO_LIMITS]))
    by_frame = result.applied_s is None and "frame" in result.truth.columns
    found = {
        name: truth_at(flight.table, result.truth, name, flight.described(name), result.applied_s) for name in names
    }
    values = {name: own for name, own in found.items() if np.isfinite(own).any()}
    return TruthSection(
        name=truth.table.path.name,
        sha256=sha256(truth.table.path.read_bytes()).hexdigest(),
        words=offset_text(result) + "." if truth.request.has_own_clock else BY_FRAME if by_frame else BY_TIME,
        tables=tables,
        values=values,
        places=[place for place, name in enumerate(flight.names) if name in values],
    )
