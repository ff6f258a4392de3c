"""The report's texts: its header and tables, what was checked, and the panel's alignment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decoder.imaging.panel_pictures import PanelPictures
from decoder.instruments.reading import Status
from decoder.outputs.csv_output import moment_text, utc_text
from decoder.outputs.report.flags import KINDS, Flag, Kind
from decoder.outputs.thresholds import MOST_FLAGS, MOST_LISTED
from decoder.panel.arrays import Floats
from decoder.panel.scale import Quantity
from decoder.timeseries.flight_data import AlignmentSeries, FlightData, NeedleSeries, status_counts
from decoder.timeseries.health import health_line
from flight_file.errors import FindingKind
from flight_file.session import UNKNOWN, Session
from flight_file.untrusted import printable
from flight_file.verification import RecordingCheck, Verdict

TRACKS = (
    ("score", "NCC", 0.01),
    ("shift right", "px", 0.2),
    ("shift down", "px", 0.2),
    ("roll", "deg", 0.02),
    ("scale", "", 0.0005),
)

DOTS = {Kind.LOST: Kind.MISSING.value, Kind.EXCEEDED: "exceeded"}


@dataclass(frozen=True, slots=True)
class AlignmentTrack:
    """One curve: its name, unit, the size below which a change is insignificant, and (N,) values, NaN where lost."""

    name: str
    unit: str
    least: float
    values: Floats


def alignment_tracks(data: FlightData, size_px: tuple[int, int]) -> list[AlignmentTrack]:
    """Compute the curves of score, shift, roll and scale; none if the alignments were not recorded.

    Parameters
    ----------
    size_px : width and height of the panel picture, at whose middle they are taken
    """
    if not data.alignments:
        return []
    middle = ((size_px[0] - 1) / 2, (size_px[1] - 1) / 2)
    values = np.full((len(TRACKS), len(data.frame)), np.nan)
    for row in range(len(data.frame)):
        alignment = data.alignments[row]
        if alignment is not None:
            motion = alignment.motion_at(middle)
            values[:, row] = alignment.score, *motion.shift_px, motion.roll_deg, motion.scale
    return [AlignmentTrack(name, unit, least, own) for (name, unit, least), own in zip(TRACKS, values, strict=True)]


@dataclass(frozen=True, slots=True)
class Checked:
    """One line; `state` is `good`, `warn`, `bad` or `open` (not checked)."""

    state: str
    what: str
    says: str


def checked(recordings: Sequence[RecordingCheck]) -> list[Checked]:
    """Put the result of a verification in words."""
    segments = [segment for recording in recordings for segment in recording.segments]
    findings = [finding for recording in recordings for finding in recording.findings]
    lines = [_chain(recordings, len(segments)), _signatures([segment.signed_by for segment in segments])]
    for finding in findings[:MOST_LISTED]:
        frame = "" if finding.sequence is None else f", frame {finding.sequence}"
        state = "bad" if finding.is_fault else "warn"
        lines.append(Checked(state, finding.kind.value, printable(f"{finding.path.name}{frame}: {finding.reason}")))
    if len(findings) > MOST_LISTED:
        more = len(findings) - MOST_LISTED
        lines.append(Checked("warn", "and more", f"{more} more findings; `recorder verify` lists all"))
    return lines + NOT_CHECKED


_TIME_BY = {
    "start": "as it was typed when the flight file was made",
    "creation": "from the video's creation time, which was trusted",
    "timecode": "from the video's timecode, which was trusted",
    "gps": "from the video's GPS time, which was trusted",
    UNKNOWN: "unknown: no clock was trusted; only differences between times mean anything",
}


def recorded_by(session: Session) -> list[tuple[str, str]]:
    """List a recording's facts about its recorder and camera, as (label, text) pairs."""
    versions = ", ".join(f"{name} {version}" for name, version in session.versions.items())
    camera = " ".join(filter(None, [session.camera_model, session.camera_serial])) or session.camera_driver
    says = {
        "recorded with": versions,
        "camera": camera,
        "recorder's clock": session.clock,
        "recorder's host": session.host,
        "time of day": _TIME_BY.get(session.time_of_day, session.time_of_day),
    }
    told = [(what, text) for what, text in says.items() if text]
    for original in session.originals:
        told.append(("made of", f"{original.name}, SHA-256 {original.sha256}"))
        told += [(f"{original.name}: {name}", fact) for name, fact in original.facts.items()]
    return [(printable(what), printable(text)) for what, text in told]


def _chain(recordings: Sequence[RecordingCheck], segments: int) -> Checked:
    files = "the flight file" if segments == 1 else f"all {segments} flight files"
    verdicts = {recording.verdict for recording in recordings}
    kinds = {finding.kind for recording in recordings for finding in recording.findings}
    if Verdict.FAULT in verdicts:
        return Checked("bad", "chain and digests", f"{files}: does not fit; what was found is listed below")
    if FindingKind.NO_CHAIN in kinds:
        says = f"pictures of {files} fit their digests, but there is no chain: a removed frame would not show"
        return Checked("warn", "chain and digests", says)
    if Verdict.LOSS in verdicts:
        return Checked("warn", "chain and digests", f"{files}: fits as far as it goes; something is not there")
    says = f"{files}: every picture fits its digest, and every frame follows the one before, none removed or added"
    return Checked("good", "chain and digests", says)


def _signatures(keys: Sequence[bytes | None]) -> Checked:
    signed = [key for key in keys if key is not None]
    if not signed:
        says = "not signed: a chain holds no secret, so whoever rewrites the whole recording leaves one that fits"
        return Checked("open", "signature", says)
    names = ", ".join(sorted({key.hex()[:16] for key in signed}))
    if len(signed) < len(keys):
        says = f"{len(signed)} of {len(keys)} segments signed, by key {names}; the others are not"
        return Checked("warn", "signature", says)
    says = (
        f"signed, every byte, by key {names}. Compare the key with the recorder's own: nothing here says whose it is"
        " (`recorder verify --public-key`)"
    )
    return Checked("good", "signature", says)


NOT_CHECKED = [
    Checked("open", "times", "not checked: they are the recorder's clock, as it was set"),
    Checked("open", "instruments", "not checked: a gauge that shows a wrong value is read as it shows"),
]


@dataclass(frozen=True, slots=True)
class Fact:
    """A line with a state: `good`, `warn`, `bad`, or empty."""

    what: str
    says: str
    state: str = ""


def when(data: FlightData) -> str:
    """Return when the flight was, in a line."""
    if not len(data.frame):
        return "no frames"
    if not data.knows_time_of_day:
        return "time of day unknown"
    first, last = utc_text(int(data.time_ns.min())), utc_text(int(data.time_ns.max()))
    until = last[11:19] if first[:10] == last[:10] else f"{last[:10]} {last[11:19]}"
    return f"{first[:10]} {first[11:19]} to {until} UTC"


def clock(data: FlightData, session: Session) -> str:
    """Say which clock times come from."""
    if not data.knows_time_of_day:
        return "no clock was trusted: times count from the first frame"
    if session.time_of_day in _TIME_BY:
        return f"time {_TIME_BY[session.time_of_day]}"
    return f"time by the recorder's clock{f' ({session.clock})' if session.clock else ''}"


def head_facts(data: FlightData, flags: Sequence[Flag], losses: Sequence[str], integrity: Fact) -> list[Fact]:
    """Collect the few figures in the header."""
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
    """Collect what a reader must not overlook."""
    found = [Fact("Lost:", loss, "bad") for loss in losses]
    found += [Fact("Warning:", warning, "warn") for warning in data.warnings]
    found += [Fact(f"{gauge}:", health_line(findings), "warn") for gauge, findings in data.health.items() if findings]
    if data.part is not None:
        words = (
            f"{len(data.frame):,} of the flight's {data.part.frames_in_flight:,} frames were requested, no others read."
        )
        found.append(Fact("A part of the flight:", words, "warn"))
    backward = int((np.diff(data.time_ns) < 0).sum())
    if backward:
        words = f"The clock ran backwards {backward} time(s); the plots show frames in the order of their times."
        found.append(Fact("Warning:", words, "warn"))
    if order.size == 1:
        found.append(Fact("Warning:", "The flight is a single frame, so nothing can be learned from changes.", "warn"))
    return found


def needle_facts(series: NeedleSeries) -> dict[str, Any]:
    """Collect the texts beside a needle's plot."""
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
    """List flags by time, and count those left out; if there are too many, the most serious and longest stay."""
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
        "start": moment_text(data, start_ns)[11:23] or f"{data.time_s[flag.first]:.3f} s",
        "duration": "one frame" if flag.frames == 1 else _duration(abs(end_ns - start_ns) / 1e9),
        "frames": str(first) if first == last else f"{first} to {last} ({flag.frames})",
        "reason": flag.reason,
        "first": ends[0],
        "last": ends[1],
    }


def gauge_rows(source: PanelPictures, data: FlightData) -> list[dict[str, str]]:
    """Tabulate what the panel says."""
    moved = data.moved_pivots_px
    return [
        {
            "gauge": quantity.gauge,
            "shows": quantity.name,
            "unit": quantity.unit,
            "scale": _scale_text(quantity),
            "health": health_line(data.health.get(quantity.gauge, ())),
            "moved": "{:+.2f}, {:+.2f}".format(*moved[quantity.gauge]) if quantity.gauge in moved else "-",
        }
        for quantity in source.panel.quantities
    ]


def alignment_facts(tracks: Sequence[AlignmentTrack]) -> list[dict[str, str]]:
    """Collect the texts beside the plots of the alignment."""
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
    if seconds < 100:  # noqa: PLR2004 - up to here seconds are easy to grasp
        return f"{seconds:.2f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"


def _share(count: int, whole: int) -> str:
    if not count or not whole:
        return "none"
    part = count / whole
    return f"{min(part, 0.9999):.2%}" if count < whole else "all"


Order = NDArray[np.int64]
"""(N,): rows of the flight data, in the order of time."""


def order_of(data: FlightData) -> Order:
    """Return the order of rows by time, which differs from that of recording if a clock was set back."""
    return np.argsort(data.time_ns, kind="stable").astype(np.int64)
