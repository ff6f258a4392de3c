"""An explanation of one value of a flight: how certain it is, why, and what else affects it.

Everything comes from the files that `decode` wrote: the value's row, and the description of the flight data beside it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.instruments.reading import Status
from decoder.learning.budget import Budget, Cause
from decoder.panel.arrays import Floats
from decoder.panel.errors import TableError
from decoder.panel.thresholds import CONFIDENCE_SIGMAS
from decoder.registration.thresholds import SCORE_THRESHOLD
from decoder.timeseries.gaps import SEEN_STATUSES
from decoder.timeseries.health import WELL
from decoder.timeseries.tables import STATUS_SUFFIX, FlightTable, Table
from decoder.timeseries.thresholds import SMALLEST_PART

STATUS_WORDS = {
    Status.READ: "the whole needle matched",
    Status.EDGE: "it matched, but it is not certain enough to be `read`",
    Status.HIDDEN: "completely under another needle; it is given that needle's value",
    Status.INTERPOLATED: "not seen; on a straight line between the nearest frames in which it was",
    Status.MISSING: "there is no value",
}
CAUSE_WORDS = {
    Cause.DRAWN: "how precisely its marks and its moving part are drawn",
    Cause.PIVOT: "the position of its pivot",
    Cause.VIEWED: "parallax between the moving part and the marks",
    Cause.PLACED: "where its dial was found in the frames",
}
FRAME_WORDS = {
    Status.READ: "how sharp it and the panel are in this frame",
    Status.EDGE: "how sharp it and the panel are in this frame, and what may hide part of it",
    Status.HIDDEN: "how far it may be from its assumed place while it is hidden",
    Status.INTERPOLATED: "what it may have done between the frames in which it was seen",
}


@dataclass(frozen=True, slots=True)
class Share:
    """One cause's share of a value's uncertainty: a standard uncertainty in its unit, and its part of the variance."""

    cause: str
    sigma: float
    part: float


@dataclass(frozen=True, slots=True)
class Explanation:
    """One value, as its files describe it.

    Attributes
    ----------
    value, status, score
        As in the CSV; "" where a field is empty.
    sigma, low_95, high_95
        Of measured values, in their unit.
    shares
        The parts of sigma, largest first; none if the description has no budget.
    remarks
        Other remarks on it, a sentence each.
    """

    name: str
    frame: int
    time_utc: str
    time_s: str
    value: str
    unit: str
    status: str
    score: str
    sigma: float | None
    low_95: float | None
    high_95: float | None
    shares: tuple[Share, ...]
    remarks: tuple[str, ...]


def explained(flight: FlightTable, name: str, row: int, alignments: Table | None = None) -> Explanation:
    """Explain the value of a column in one row; `alignments` is the table of alignments written beside it.

    Raises
    ------
    TableError
        If there is no such column, the row has no frame, or the files are not what `decode` writes.
    """
    wanted = ("frame", "time_utc", "time_s", name, name + STATUS_SUFFIX, f"{name}_score", f"{name}_sigma")
    if name not in flight.names or not set(wanted) <= set(flight.table.columns):
        raise TableError(f"{flight.table.path}: has no {name}; its columns are {', '.join(flight.names)}")
    _, time_utc, time_s, value, status_text, score, _ = (flight.table.columns[each][row] for each in wanted)
    frame = float(flight.table.numbers("frame")[row])
    if not math.isfinite(frame):
        raise TableError(f"{flight.table.path}: row {row + 1} has no number in `frame`")
    status, described = _status(status_text, flight.table), flight.described(name)
    number = float(flight.table.numbers(name, described.written)[row])
    sigma = float(flight.table.numbers(f"{name}_sigma")[row])
    is_known = math.isfinite(sigma) and math.isfinite(number)
    return Explanation(
        name=name,
        frame=int(frame),
        time_utc=time_utc,
        time_s=time_s,
        value=value,
        unit="" if described.written is not None and not is_known else described.unit,
        status=status.value,
        score=score,
        sigma=sigma if is_known else None,
        low_95=number - CONFIDENCE_SIGMAS * sigma if is_known else None,
        high_95=number + CONFIDENCE_SIGMAS * sigma if is_known else None,
        shares=tuple(_shares(budget, number, sigma, status))
        if is_known and (budget := _budget(flight.said_of(name).get("uncertainty"))) is not None
        else (),
        remarks=tuple(_remarks(flight, name, row, status, alignments)),
    )


def row_of_frame(flight: FlightTable, frame: int) -> int:
    """Find the row of a frame by its sequence number.

    Raises
    ------
    TableError
        If the flight data do not have it, or no numbers in `frame`.
    """
    frames = _known(flight, "frame")
    rows = np.flatnonzero(frames == frame)
    if not rows.size:
        raise TableError(
            f"{flight.table.path}: has no frame {frame}; it has {np.nanmin(frames):.0f} to {np.nanmax(frames):.0f}"
        )
    return int(rows[0])


def row_at(flight: FlightTable, time_s: float) -> int:
    """Find the row that is nearest to a time in seconds since the flight's first frame.

    Raises
    ------
    TableError
        If the flight data begin later or end before, or have no numbers in `time_s`.
    """
    times_s = _known(flight, "time_s")
    if not np.nanmin(times_s) <= time_s <= np.nanmax(times_s):
        lasts = f"it lasts from {np.nanmin(times_s):g} to {np.nanmax(times_s):g} s"
        raise TableError(f"{flight.table.path}: has nothing at {time_s:g} s; {lasts}")
    return int(np.nanargmin(np.abs(times_s - time_s)))


def _known(flight: FlightTable, column: str) -> Floats:
    """(N,): a column that has a number in at least one row."""
    numbers = flight.table.numbers(column)
    if not np.isfinite(numbers).any():
        raise TableError(f"{flight.table.path}: has no number in `{column}`; give the CSV that `decode` wrote")
    return numbers


def explanation_text(told: Explanation) -> str:
    """Put an explanation in words, on several lines."""
    when = f"{told.time_utc}, {told.time_s} s" if told.time_utc else f"{told.time_s} s"
    lines = [f"{told.name} in frame {told.frame} ({when}): {told.status}"]
    if told.value:
        was_matched = told.status in (Status.READ.value, Status.EDGE.value)  # else it is the score of what was refused
        score = f", score {told.score}" if told.score and was_matched else ""
        lines.append(f"  value    {told.value} {told.unit}".rstrip() + score)
    if told.sigma is not None:
        decimals = len(told.value.partition(".")[2])
        lines.append(f"  95 %     {told.low_95:.{decimals}f} to {told.high_95:.{decimals}f} {told.unit}".rstrip())
        lines.append(
            f"  sigma    {told.sigma:.3g} {told.unit}".rstrip() + ("; its variance, by cause:" if told.shares else "")
        )
    lines += [f"    {_percent(share.part)}   {share.sigma:<9.3g} {share.cause}" for share in told.shares]
    return "\n".join([*lines, *(f"  - {remark}" for remark in told.remarks)])


def _percent(part: float) -> str:
    text = f"{part:4.0%}"
    return " <1%" if text == "  0%" else text


def _status(text: str, table: Table) -> Status:
    try:
        return Status(text)
    except ValueError as error:
        raise TableError(f"{table.path}: {text!r} is no status; give the CSV that `decode` wrote") from error


def _budget(said: object) -> Budget | None:
    """Read a budget back; None if there is none, or none that makes sense."""
    if not isinstance(said, dict):
        return None
    try:
        values = np.array(said.get("values", [0.0]), np.float64)
        turn = None if said.get("turn") is None else float(said["turn"])
        sigmas = {cause: np.broadcast_to(np.array(said[cause.value], np.float64), values.shape) for cause in Cause}
    except (KeyError, TypeError, ValueError, OverflowError):
        return None
    return Budget(values, turn, sigmas) if values.ndim == 1 and values.size and turn != 0 else None


def _shares(budget: Budget, value: float, sigma: float, status: Status) -> Iterator[Share]:
    """Split a value's variance by cause; the rest is its own frame's."""
    parts = {CAUSE_WORDS[cause]: own for cause, own in budget.at(value).items()}
    known = math.hypot(*parts.values())
    own_frame = math.sqrt(max(sigma - known, 0.0)) * math.sqrt(sigma + known)
    parts[FRAME_WORDS.get(status, FRAME_WORDS[Status.READ])] = own_frame
    whole = math.hypot(known, own_frame)
    for cause, part in sorted(parts.items(), key=lambda item: -item[1]):
        if part > 0.0:
            yield Share(cause, part, (part / whole) ** 2)


def _remarks(flight: FlightTable, name: str, row: int, status: Status, alignments: Table | None) -> Iterator[str]:
    description, frame = flight.description, int(flight.table.numbers("frame")[row])
    yield f"{status.value}: {STATUS_WORDS[status]}"
    if not description:
        beside = flight.table.path.with_suffix(".json").name
        yield f"nothing is known of the gauge and of where its uncertainty comes from: put {beside} next to the CSV"
    lost = _runs(description.get("missing_frames"), frame)
    for run in lost:
        yield f"the frame could not be read: {run.get('reason', 'no reason is known')}"
    yield from _why_not_read(flight, name, row, None if lost else status)
    if status in (Status.INTERPOLATED, Status.MISSING, Status.HIDDEN):
        yield from _seen_around(flight, name, row)
    if alignments is not None and row < len(alignments.columns.get("alignment_score", ())):
        yield from _alignment(alignments, row)
    gauge, health = flight.said_of(name).get("gauge"), description.get("health")
    if isinstance(gauge, str) and isinstance(health, dict):
        yield f"its gauge, {gauge}: {health.get(gauge, WELL)}"
    for run in _runs(description.get("outliers"), frame):
        if run.get("needle") == name:
            yield f"an outlier: {run.get('reason')}"
    for run in _runs(description.get("events"), frame):
        if run.get("needle") == name:
            yield f"{run.get('what')}: {run.get('words')}"
    yield from _cross_checks(description.get("cross_checks"), name, frame)


def _uncertain(flight: FlightTable, name: str, row: int) -> Iterator[str]:
    """Say why a value that matched is an `edge`, as far as its sigma and the other values of its gauge tell."""
    described, gauge = flight.described(name), flight.said_of(name).get("gauge")
    part = float(flight.table.numbers(f"{name}_sigma")[row]) / (described.full_scale or math.nan)
    if part > SMALLEST_PART:
        yield (
            f"one value in twenty may be off by {CONFIDENCE_SIGMAS * part:.1%} of full scale or more, which alone may"
            " keep it from being `read`"
        )
    elif part <= SMALLEST_PART:
        yield (
            "something may hide part of it, such as another needle, glare or a bug; or it contradicts the other hands"
            " of its gauge"
        )
    beside = [each for each in flight.names if each != name and flight.said_of(each).get("gauge") == gauge]
    lost = [each for each in beside if flight.table.columns[each + STATUS_SUFFIX][row] == Status.MISSING.value]
    if gauge is not None and lost:
        yield f"missing in this frame on the same gauge: {', '.join(lost)}"


def _why_not_read(flight: FlightTable, name: str, row: int, status: Status | None) -> Iterator[str]:
    """Say why it is not `read` in a frame that could be read, and not interpolated where it has no value."""
    if status is Status.EDGE:
        yield from _uncertain(flight, name, row)
    if status in (Status.INTERPOLATED, Status.MISSING):
        yield from _refused(flight, name, row)
    if status is Status.MISSING:
        yield from _without_line(flight, name, row)


def _refused(flight: FlightTable, name: str, row: int) -> Iterator[str]:
    """Say what was seen in its place, and why that was not taken for it, as far as its score tells."""
    score = float(flight.table.numbers(f"{name}_score")[row])
    if score == 0.0:
        yield "its gauge was not found in this frame, or is not whole in it"
    elif score < SCORE_THRESHOLD:
        yield (
            f"nothing there looked enough like it: the best match has a score of {score:.4f}, where {SCORE_THRESHOLD:g}"
            " is needed; glare, a hand or blur may hide it"
        )
    elif flight.described(name).written is not None and math.isfinite(score):
        yield f"what looked most like it, with a score of {score:.4f}, was not clear enough to tell what it shows"
    elif math.isfinite(score):
        yield (
            f"what looked most like it, with a score of {score:.4f}, was not taken for it: something else there looks"
            " as much like it, such as print, a tail or another needle, or what else is read contradicts it"
        )


def _without_line(flight: FlightTable, name: str, row: int) -> Iterator[str]:
    """Say why a value that is missing was not interpolated, where the table shows it."""
    statuses = flight.table.columns[name + STATUS_SUFFIX]
    seen = np.flatnonzero(np.isin(statuses, [status.value for status in SEEN_STATUSES]))
    if flight.described(name).written is not None:
        yield "not interpolated: there is nothing between two states"
    elif seen.size and not seen[0] < row < seen[-1]:
        yield f"not interpolated: it was not seen {'before' if row < seen[0] else 'after'} this frame"
    elif seen.size < HALF * len(statuses):
        yield (
            f"not interpolated: it was seen in {seen.size} of {len(statuses)} frames, and where it stood may be why it"
            " was not seen in the others"
        )


def _seen_around(flight: FlightTable, name: str, row: int) -> Iterator[str]:
    """Say when it was last and next seen."""
    columns = flight.table.columns
    is_seen = np.isin(columns[name + STATUS_SUFFIX], [Status.READ.value, Status.EDGE.value])
    before, after = np.flatnonzero(is_seen[:row]), np.flatnonzero(is_seen[row + 1 :]) + row + 1
    for words, rows in (("last seen", before[-1:]), ("next seen", after[:1])):
        for there in rows.tolist():
            yield f"{words} in frame {columns['frame'][there]}, at {columns['time_s'][there]} s: {columns[name][there]}"
        if not rows.size:
            yield f"{words}: never"


def _alignment(alignments: Table, row: int) -> Iterator[str]:
    score, failed = alignments.columns["alignment_score"][row], alignments.columns.get("failed", [""] * (row + 1))[row]
    if score:
        yield f"the panel was found with a score of {score}" + (f"; not found: {failed}" if failed else "")


def _cross_checks(checks: object, name: str, frame: int) -> Iterator[str]:
    """Say how it compares with other instruments that show the same thing."""
    for check in checks if isinstance(checks, list) else []:
        columns = check.get("columns") if isinstance(check, dict) else None
        if not isinstance(columns, list) or name not in columns:
            continue
        runs = list(_runs(check.get("disagreements"), frame))
        unit, compared = check.get("unit", ""), check.get("frames_compared", 0)
        for run in runs:
            yield (
                f"{check.get('what')}: they differ by {run.get('apart')} {unit} here, of which {run.get('explained')}"
                f" {unit} can be explained"
            )
        if not runs and compared:
            yield f"{check.get('what')}: no disagreement here ({compared} frames of the flight compared)"


def _runs(runs: object, frame: int) -> Sequence[Mapping[str, Any]]:
    """Select the runs in a description that include a frame."""
    found = [run for run in (runs if isinstance(runs, list) else []) if isinstance(run, dict)]
    ends = [(run.get("first_frame"), run.get("last_frame")) for run in found]
    return [
        run
        for run, (first, last) in zip(found, ends, strict=True)
        if isinstance(first, int) and isinstance(last, int) and first <= frame <= last
    ]
