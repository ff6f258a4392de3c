"""Tables: `NAME.csv` and `NAME_alignment.tsv`, a row for each frame, written and read back; what `decode` prints."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from typing import IO, Any

import numpy as np

from decoder.imaging.alignment import Alignment
from decoder.instruments.reading import Status
from decoder.panel.errors import TableError
from decoder.panel.lens import Lens
from decoder.panel.panel import LEADING_COLUMNS, NEEDLE_SUFFIXES, Panel
from decoder.panel.scale import Quantity
from decoder.timeseries.flight_data import (
    CODE,
    STATUSES,
    AlignmentSeries,
    FlightData,
    MissingFrame,
    NeedleSeries,
    status_counts,
)
from decoder.timeseries.flight_part import FlightPart
from decoder.timeseries.tables import STATUS_SUFFIX, FlightTable, Table
from flight_file.thresholds import MAX_SIDE_PX
from flight_file.untrusted import printable, to_cell

SCORE_DECIMALS = 4
# A millionth of full scale, or if finer, a thousandth of the span between the outermost marks: on drums, these are only
# one count apart.
DIGITS_OF_FULL_SCALE, DIGITS_OF_MARKS = 6, 4
TIME_DECIMALS = 6

COLUMNS = ("frame", "time_utc", "alignment_score", "failed", "shift_x_px", "shift_y_px", "roll_deg", "scale", "matrix")


def write_csv(data: FlightData, stream: IO[str]) -> None:
    """Write flight data as CSV: UTF-8, LF, floats always with a decimal point."""
    writer = csv.writer(stream, lineterminator="\n")
    columns = () if data.gps is None else data.gps.columns
    needles = (series.quantity.name + suffix for series in data.series for suffix in NEEDLE_SUFFIXES)
    writer.writerow([*LEADING_COLUMNS, *needles, *(column.name for column in columns)])
    decimals = [value_decimals(series) for series in data.series]
    time_s = data.time_s
    for row in range(len(data.frame)):
        fields = [str(data.frame[row]), moment_text(data, int(data.time_ns[row])), f"{time_s[row]:.{TIME_DECIMALS}f}"]
        for series, places in zip(data.series, decimals, strict=True):
            fields += [
                value_field(series, row, places),
                STATUSES[series.status[row]].value,
                _number(series.score[row], SCORE_DECIMALS),
                _number(series.sigma[row], places + 1) if series.quantity.is_measured else "",
            ]
        fields += [_number(column.number(row), column.decimals) for column in columns]
        writer.writerow(fields)


def value_field(series: NeedleSeries, row: int, decimals: int) -> str:
    """Write a value as a field, by its row in the flight data: a number, true or false, or text."""
    value, written = float(series.value[row]), series.quantity.written
    if written is not None:
        return written.text_of(value)
    return _number(value_within_turn(value, decimals, series.quantity), decimals)


def value_decimals(series: NeedleSeries) -> int:
    """Return the decimals of a column's values: those of a display, or else finer than any reading; at least one."""
    quantity = series.quantity
    if quantity.written is not None:
        return max(1, quantity.written.decimals)
    marked = abs(quantity.marks[-1][1] - quantity.marks[0][1])
    spans = (DIGITS_OF_FULL_SCALE, quantity.full_scale), (DIGITS_OF_MARKS, marked)
    return max(1, *(digits - 1 - math.floor(math.log10(span)) for digits, span in spans))


def value_within_turn(value: float, decimals: int, quantity: Quantity) -> float:
    """Round a value as it is written; one that rounds up to a full turn becomes the lowest."""
    if quantity.wraps is None or not math.isfinite(value):
        return value
    return quantity.lowest + (round(value, decimals) - quantity.lowest) % quantity.wraps


def utc_text(time_ns: int) -> str:
    """Format a time as ISO 8601 UTC with microseconds."""
    seconds, rest = divmod(time_ns, 1_000_000_000)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{rest // 1000:06d}Z"


def moment_text(data: FlightData, time_ns: int) -> str:
    """Format a time as `utc_text`; empty if the flight's time of day is unknown."""
    return utc_text(time_ns) if data.knows_time_of_day else ""


def _number(value: float | None, decimals: int) -> str:
    return f"{value:.{decimals}f}" if value is not None and math.isfinite(value) else ""


def write_alignment(data: FlightData, size_px: tuple[int, int], stream: IO[str]) -> None:
    """Write one row for each frame; shift, roll and scale are those at the panel picture's middle.

    Parameters
    ----------
    size_px : width and height of the panel picture
    """
    writer = csv.writer(stream, delimiter="\t", lineterminator="\n")
    writer.writerow(COLUMNS)
    middle = ((size_px[0] - 1) / 2, (size_px[1] - 1) / 2)
    for row, (frame, time_ns) in enumerate(zip(data.frame.tolist(), data.time_ns.tolist(), strict=True)):
        alignment = data.alignments[row]
        fields = [str(frame), moment_text(data, time_ns)]
        failed = to_cell(";".join(data.alignments.failed(row)))
        if alignment is None:
            writer.writerow([*fields, "", failed, "", "", "", "", ""])
            continue
        motion = alignment.motion_at(middle)
        (right, down), roll_deg, scale = motion.shift_px, motion.roll_deg, motion.scale
        numbers = [f"{right:.3f}", f"{down:.3f}", f"{roll_deg:.4f}", f"{scale:.6f}"]
        matrix = " ".join(f"{element + 0.0:.9g}" for element in alignment.elements)
        writer.writerow([*fields, f"{alignment.score:.4f}", failed, *map(_unsigned, numbers), matrix])


def read_back(
    flight: FlightTable, alignments: Table, panel: Panel, size_px: tuple[int, int], lenses: Mapping[int, Lens | None]
) -> FlightData:
    """Make flight data from the tables that were written of them.

    Values are rounded as they were written. The tables contain neither angles nor how far a dial was from where the
    other dials put it.

    Parameters
    ----------
    flight, alignments : `NAME.csv` with its description, and `NAME_alignment.tsv`
    size_px : width and height of the panel picture
    lenses : by frame, for those whose lens is known

    Raises
    ------
    TableError
        If they are not of one flight with this panel, or contain what `decode` does not write.
    """
    table, told = flight.table, flight.description
    frame = table.numbers("frame")
    if not (np.isfinite(frame).all() and np.array_equal(frame, alignments.numbers("frame"))):
        raise TableError(f"{alignments.path}: is of other frames than {table.path.name}; decode the flight again")
    try:
        return FlightData(
            frame=frame.astype(np.int64),
            time_ns=flight.time_ns,
            series=tuple(_series_of(table, quantity) for quantity in panel.quantities),
            missing_frames=tuple(_missing_frames(frame.astype(int).tolist(), told["missing_frames"])),
            combinations=panel.combinations,
            moved_pivots_px={str(name): (float(x), float(y)) for name, (x, y) in told["moved_pivots_px"].items()},
            alignments=_alignments_of(alignments, size_px, [lenses.get(int(number)) for number in frame]),
            part=FlightPart(range(len(frame)), len(frame), flight.began_ns),
            time_of_day=str(told.get("time_of_day", "")),
            columns=panel.columns,
        )
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise TableError(
            f"{table.path}: it or the JSON beside it is not as `decode` writes them; decode the flight again"
        ) from error


def _series_of(table: Table, quantity: Quantity) -> NeedleSeries:
    value = table.numbers(quantity.name, quantity.written)
    score, sigma = (table.numbers(f"{quantity.name}{suffix}") for suffix in ("_score", "_sigma"))
    status = [CODE[Status(word)] for word in table.columns[f"{quantity.name}{STATUS_SUFFIX}"]]
    return NeedleSeries(quantity, np.array(status, np.uint8), value, sigma, score, np.full(len(value), np.nan))


def _missing_frames(frames: Sequence[int], runs: Sequence[Mapping[str, Any]]) -> Iterator[MissingFrame]:
    for run in runs:
        first, last = frames.index(run["first_frame"]), frames.index(run["last_frame"])
        yield from (MissingFrame(frame, str(run["reason"])) for frame in frames[first : last + 1])


def _alignments_of(table: Table, size_px: tuple[int, int], lenses: Sequence[Lens | None]) -> AlignmentSeries:
    corners = np.array([(x, y, 1.0) for x in (0, size_px[0]) for y in (0, size_px[1])]).T
    alignments = AlignmentSeries()
    for text, score, lens in zip(table.columns["matrix"], table.numbers("alignment_score"), lenses, strict=True):
        if not text:
            alignments.add_missing(())
            continue
        matrix = np.array([float(element) for element in text.split()]).reshape(3, 3)
        x, y, depth = matrix @ corners
        if not (matrix[2, 2] and (np.hypot(x, y) <= MAX_SIDE_PX * depth).all()):
            raise ValueError(text)
        alignments.add(Alignment.of(matrix, float(score), lens=lens))
    return alignments


def _unsigned(number: str) -> str:
    """Drop the sign that rounding leaves on a zero."""
    return number.removeprefix("-") if float(number) == 0 else number


def text_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Align rows under their header, two blanks between columns."""
    lines = [[printable(cell) for cell in row] for row in (header, *rows)]
    widths = [max(len(line[column]) for line in lines) for column in range(len(header))]

    def text(line: Sequence[str]) -> str:
        first, *others = line
        cells = [first.ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True))]
        return "  ".join(cells).rstrip()

    rule = "  ".join("-" * width for width in widths)
    return "\n".join([text(lines[0]), rule, *(text(line) for line in lines[1:])])


def summary_table(data: FlightData) -> str:
    """Summarize a flight in a text table, one row for each needle."""
    rows = []
    for series in data.series:
        score, counts = series.lowest_score, status_counts(series)
        rows.append(
            [
                series.quantity.name,
                series.quantity.unit,
                *(str(counts[status.value]) for status in STATUSES),
                "-" if score is None else f"{score:.3f}",
            ]
        )
    return text_table(["needle", "unit", *(status.value for status in STATUSES), "lowest score"], rows)
