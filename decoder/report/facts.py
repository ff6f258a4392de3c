"""The report's texts: what stands at its head, in its tables, and what alerts there are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from decoder.alignment_series import AlignmentSeries
from decoder.csv_output import utc_text
from decoder.flight_data import FlightData, NeedleSeries, status_counts
from decoder.panel_pictures import PanelPictures
from decoder.quantity import Quantity
from decoder.reading import Status
from decoder.report.alignment_summary import AlignmentTrack
from decoder.report.columns import Order
from decoder.report.flags import KINDS, Flag, Kind

MOST_FLAGS = 2000
DOTS = {Kind.LOST: Kind.MISSING.value}

STATUS_WORDS = (
    (Status.READ, "the whole needle matched"),
    (Status.EDGE, "a part of it is covered; what is left matched"),
    (Status.HIDDEN, "wholly under another needle; it takes that needle's place"),
    (Status.INTERPOLATED, "not seen; on the line between the nearest frames in which it was"),
    (Status.MISSING, "there is no value"),
)


@dataclass(frozen=True, slots=True)
class Fact:
    """A line with a state: `good`, `warn`, `bad`, or empty."""

    what: str
    says: str
    state: str = ""


def when(data: FlightData) -> str:
    """When the flight was, in a line."""
    if not len(data.frame):
        return "no frames"
    first, last = utc_text(int(data.time_ns.min())), utc_text(int(data.time_ns.max()))
    until = last[11:19] if first[:10] == last[:10] else f"{last[:10]} {last[11:19]}"
    return f"{first[:10]} {first[11:19]} to {until} UTC"


def head_facts(data: FlightData, flags: Sequence[Flag], losses: Sequence[str], integrity: Fact) -> list[Fact]:
    """The few numbers at the head."""
    values = len(data.frame) * len(data.series)
    seen = sum(int(series.has(Status.READ, Status.EDGE, Status.HIDDEN).sum()) for series in data.series)
    none = sum(int(series.has(Status.MISSING).sum()) for series in data.series)
    interpolated = sum(int(series.has(Status.INTERPOLATED).sum()) for series in data.series)
    outliers = sum(flag.kind is Kind.OUTLIER for flag in flags)
    return [
        Fact("duration", _duration(float(np.ptp(data.time_ns)) / 1e9 if len(data.frame) else 0.0)),
        Fact("frames", f"{len(data.frame):,}"),
        Fact("values seen", _share(seen, values)),
        Fact("interpolated", _share(interpolated, values), "warn" if interpolated else ""),
        Fact("no value", _share(none, values), "bad" if none else ""),
        Fact("outliers", str(outliers), "bad" if outliers else ""),
        Fact("lost in the file", str(len(losses)) if losses else "nothing", "bad" if losses else "good"),
        integrity,
    ]


def alerts(data: FlightData, losses: Sequence[str], order: Order) -> list[Fact]:
    """What the reader must not overlook."""
    found = [Fact("Lost:", loss, "bad") for loss in losses]
    found += [Fact("Warning:", warning, "warn") for warning in data.warnings]
    if data.part is not None:
        words = (
            f"{len(data.frame):,} of the flight's {data.part.frames_in_flight:,} frames were asked for, no others read."
        )
        found.append(Fact("A part of the flight:", words, "warn"))
    backward = int((np.diff(data.time_ns) < 0).sum())
    if backward:
        words = f"The clock ran backwards {backward} time(s); the plots show frames in the order of their times."
        found.append(Fact("Warning:", words, "warn"))
    if order.size == 1:
        found.append(Fact("Warning:", "The flight is a single frame; nothing can be told from changes.", "warn"))
    return found


def needle_facts(series: NeedleSeries) -> dict[str, Any]:
    """What stands beside a needle's plot."""
    counts = [(status, count) for status, count in status_counts(series).items() if count]
    words = ", ".join(f"{count} {status}" for status, count in counts) or "no frames"
    valued = series.value[np.isfinite(series.value)]
    if valued.size:
        words += f"; from {valued.min():.6g} to {valued.max():.6g}"
    return {
        "name": series.quantity.name,
        "unit": series.quantity.unit,
        "gauge": series.quantity.gauge,
        "counts": counts,
        "summary": words,
    }


def listed_flags(data: FlightData, flags: Sequence[Flag], position: Order) -> tuple[list[dict[str, Any]], int]:
    """The table's rows by time, and how many are left out; if some must be, the gravest and longest stay."""
    chosen = list(flags)
    if len(chosen) > MOST_FLAGS:
        chosen = sorted(chosen, key=lambda flag: (KINDS.index(flag.kind), -flag.frames))[:MOST_FLAGS]
        chosen.sort(key=lambda flag: (flag.first, KINDS.index(flag.kind)))
    return [_listed(data, flag, position) for flag in chosen], len(flags) - len(chosen)


def _listed(data: FlightData, flag: Flag, position: Order) -> dict[str, Any]:
    first, last = int(data.frame[flag.first]), int(data.frame[flag.last])
    start_ns, end_ns = int(data.time_ns[flag.first]), int(data.time_ns[flag.last])
    ends = sorted((int(position[flag.first]), int(position[flag.last])))
    return {
        "kind": flag.kind.value,
        "dot": DOTS.get(flag.kind, flag.kind.value),
        "needle": flag.needle,
        "place": next((place for place, one in enumerate(data.series) if one.quantity.name == flag.needle), -1),
        "start": utc_text(start_ns)[11:23],
        "duration": "one frame" if flag.frames == 1 else _duration(abs(end_ns - start_ns) / 1e9),
        "frames": str(first) if first == last else f"{first} to {last} ({flag.frames})",
        "reason": flag.reason,
        "first": ends[0],
        "last": ends[1],
    }


def gauge_rows(source: PanelPictures, data: FlightData) -> list[dict[str, str]]:
    """The table of what the panel says."""
    moved = data.moved_pivots_px
    return [
        {
            "gauge": quantity.gauge,
            "shows": quantity.name,
            "unit": quantity.unit,
            "scale": _scale_text(quantity),
            "moved": "{:+.2f}, {:+.2f}".format(*moved[quantity.gauge]) if quantity.gauge in moved else "-",
        }
        for quantity in source.panel.quantities
    ]


def alignment_facts(tracks: Sequence[AlignmentTrack]) -> list[dict[str, str]]:
    """What stands beside the plots of the alignment."""
    facts = []
    for track in tracks:
        known = track.values[np.isfinite(track.values)]
        words = f"{known.min():.4g} to {known.max():.4g}" if known.size else "never found"
        facts.append({"name": track.name, "unit": track.unit, "summary": words})
    return facts


def failed_anchors(alignments: AlignmentSeries) -> list[tuple[str, int]]:
    """Anchors that failed, and in how many frames."""
    return list(alignments.failures().items()) if alignments else []


def _scale_text(quantity: Quantity) -> str:
    low, high = quantity.range
    return f"{low:g} to {high:g}" + (", and round again" if quantity.wraps is not None else "")


def _duration(seconds: float) -> str:
    if seconds < 100:  # noqa: PLR2004 - up to here seconds are easily grasped
        return f"{seconds:.2f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"


def _share(count: int, whole: int) -> str:
    if not count or not whole:
        return "none"
    part = count / whole
    return f"{min(part, 0.9999):.2%}" if count < whole else "all"
