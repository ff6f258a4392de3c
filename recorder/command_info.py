"""`recorder info`: the facts of a flight, as a page for people and as JSON for scripts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click

from flight_file.errors import Loss, LossKind
from flight_file.frame import Frame, SoundPacket, SoundPeaks
from flight_file.reader import Flight, open_flight
from flight_file.session import UNKNOWN, Session
from flight_file.signature import signature_path
from flight_file.untrusted import say, say_json
from recorder.cli import DONE_WITH_LOSS, FAILED, failures_as_sentences
from recorder.host import utc_text
from recorder.marks import is_marked

_TIME_BY = {
    "start": "what was typed as --start",
    "creation": "the creation time of the video, which was trusted",
    "timecode": "the timecode of the video, which was trusted",
    "gps": "the GPS time of the video, which was trusted",
    UNKNOWN: "no clock: only differences between times mean anything",
}


@dataclass(slots=True)
class Range:
    """Smallest and largest of what was seen; both None if nothing was."""

    least: float | None = None
    most: float | None = None

    def add(self, value: float | None) -> None:
        """Include one more value; None is ignored."""
        if value is not None:
            self.least = value if self.least is None else min(self.least, value)
            self.most = value if self.most is None else max(self.most, value)


@dataclass(slots=True)
class FrameFacts:
    """Facts of all frames together."""

    frames: int = 0
    missing: int = 0
    captured_ns: Range = field(default_factory=Range)
    focal_length_mm: Range = field(default_factory=Range)
    picture_bytes: Range = field(default_factory=Range)
    sizes_px: set[tuple[int, int]] = field(default_factory=set)
    formats: set[str] = field(default_factory=set)

    @property
    def duration_s(self) -> float:
        """From the first picture to the last, s."""
        if self.captured_ns.least is None or self.captured_ns.most is None:
            return 0.0
        return (self.captured_ns.most - self.captured_ns.least) / 1e9

    @property
    def rate_hz(self) -> float | None:
        """Mean rate, Hz; None with fewer than two pictures."""
        return (self.frames - 1) / self.duration_s if self.frames > 1 and self.duration_s > 0 else None


@dataclass(frozen=True, slots=True)
class FlightInfo:
    """A flight, the facts of its frames, what was lost, and how much of its sound there is."""

    flight: Flight
    facts: FrameFacts
    losses: tuple[Loss, ...]
    sound_windows: int = 0
    sound_packets: int = 0

    @property
    def dropped(self) -> int:
        """Frames that the recorder took but did not store, according to the last end record."""
        return max((segment.end.dropped for segment in self.flight.segments if segment.end is not None), default=0)


def inspect(flight: Flight) -> FlightInfo:
    """Read the whole flight once.

    Raises
    ------
    FlightNotReadableError
        If the disk fails.
    """
    facts, sounds = summarize(flight.frames()), Counter(map(type, flight.heard()))
    return FlightInfo(flight, facts, tuple(flight.losses), sounds[SoundPeaks], sounds[SoundPacket])


def summarize(frames: Iterable[Frame]) -> FrameFacts:
    """Collect the facts of these frames."""
    facts = FrameFacts()
    expected: int | None = None
    for frame in frames:
        facts.frames += 1
        facts.missing += max(0, frame.sequence - expected) if expected is not None else 0
        expected = frame.sequence + 1
        facts.captured_ns.add(frame.captured_ns)
        facts.focal_length_mm.add(frame.exif.focal_length_mm)
        facts.picture_bytes.add(len(frame.encoded))
        facts.formats.add(frame.format)
        if frame.width_px is not None and frame.height_px is not None:
            facts.sizes_px.add((frame.width_px, frame.height_px))
    return facts


def gaps(losses: Iterable[Loss]) -> int:
    """Count the runs of missing frames."""
    return sum(loss.kind is LossKind.GAP for loss in losses)


def as_json(info: FlightInfo) -> dict[str, Any]:
    """Convert everything to plain values; None where unknown."""
    flight, facts = info.flight, info.facts
    return {
        "recording": flight.recording,
        "files": [
            {
                "path": str(segment.path),
                "segment": segment.session.segment,
                "size_bytes": segment.size_bytes,
                "finished": segment.finished,
                "end_reason": segment.end.reason if segment.end else None,
                "chained": bool(segment.session.chain),
                "signed": signature_path(segment.path).exists(),
                "marked": is_marked(segment.path),
            }
            for segment in flight.segments
        ],
        "start_utc": utc_text(facts.captured_ns.least) if flight.session.knows_time_of_day else None,
        "end_utc": utc_text(facts.captured_ns.most) if flight.session.knows_time_of_day else None,
        "time_of_day": flight.session.time_of_day or None,
        "duration_s": facts.duration_s,
        "frames": facts.frames,
        "rate_hz": facts.rate_hz,
        "gaps": gaps(info.losses),
        "frames_missing": facts.missing,
        "frames_dropped": info.dropped,
        "camera": {
            "driver": flight.session.camera_driver or None,
            "model": flight.session.camera_model or None,
            "serial": flight.session.camera_serial or None,
        },
        "focal_length_mm": _pair(facts.focal_length_mm),
        "picture_bytes": _pair(facts.picture_bytes),
        "formats": sorted(facts.formats),
        "picture_sizes_px": [list(size) for size in sorted(facts.sizes_px)],
        "sound": {"windows": info.sound_windows, "packets": info.sound_packets},
        "originals": [
            {"name": one.name, "size_bytes": one.size_bytes, "sha256": one.sha256, "facts": dict(one.facts)}
            for one in flight.session.originals
        ],
        "attachments": {name: len(content) for name, content in sorted(flight.attachments.items())},
        "losses": [
            {
                "path": str(loss.path),
                "offset": loss.offset,
                "length_bytes": loss.length,
                "kind": loss.kind.value,
                "reason": loss.reason,
            }
            for loss in info.losses
        ],
    }


def as_text(info: FlightInfo) -> list[str]:
    """Format a page, one fact a line."""
    facts, session = as_json(info), info.flight.session
    size_bytes = sum(file["size_bytes"] for file in facts["files"])
    camera = " ".join(value for value in facts["camera"].values() if value)
    rows = [
        ("recording", facts["recording"]),
        ("files", f"{len(facts['files'])}, {size_bytes / 1e6:.1f} MB"),
        ("start", facts["start_utc"] if session.knows_time_of_day else "time of day unknown"),
        ("end", facts["end_utc"] if session.knows_time_of_day else "time of day unknown"),
        ("duration", f"{facts['duration_s']:.1f} s"),
        ("frames", f"{facts['frames']}{_rate(facts['rate_hz'])}"),
        ("gaps", f"{facts['gaps']} ({facts['frames_missing']} frames missing, {facts['frames_dropped']} dropped)"),
        ("camera", camera),
        ("zoom", _span(facts["focal_length_mm"], "mm")),
        ("pictures", ", ".join(f"{width}x{height}" for width, height in facts["picture_sizes_px"])),
        ("format", ", ".join(facts["formats"])),
        ("size", _span(facts["picture_bytes"], "bytes")),
        *([("sound", _sound(info))] if session.originals else []),
        ("attachments", ", ".join(facts["attachments"]) or "none"),
        ("evidence", ", ".join(_evidence(facts["files"]))),
    ]
    lines = [f"{name + ':':<13}{value or 'not known'}" for name, value in rows]
    return lines + list(_original_lines(session)) + _loss_lines(info)


def _sound(info: FlightInfo) -> str:
    """Describe the sound in the flight, or say that there is none."""
    if not info.sound_windows:
        return "none"
    whole = f", and all of it in {info.sound_packets} packets" if info.sound_packets else ", never speech"
    return f"the strongest tones of {info.sound_windows} windows{whole}"


def _original_lines(session: Session) -> Iterator[str]:
    if session.time_of_day:
        yield f"{'time by:':<13}{_TIME_BY.get(session.time_of_day, session.time_of_day)}"
    for original in session.originals:
        yield f"{'made of:':<13}{original.name}, {original.size_bytes} bytes, SHA-256 {original.sha256}"
        yield from (f"  {name}: {fact}" for name, fact in original.facts.items())


def _evidence(files: list[dict[str, Any]]) -> list[str]:
    # Whether chain and signatures are right is left to `recorder verify`.
    return [f"{word} {sum(file[word] for file in files)} of {len(files)}" for word in ("chained", "signed", "marked")]


def _loss_lines(info: FlightInfo) -> list[str]:
    if not info.losses:
        return [f"{'losses:':<13}none"]
    return ["losses:", *(f"  {loss.path.name} at byte {loss.offset}: {loss.reason}" for loss in info.losses)]


def _rate(rate_hz: float | None) -> str:
    return "" if rate_hz is None else f", {rate_hz:.2f} Hz"


def _pair(values: Range) -> list[float] | None:
    return None if values.least is None or values.most is None else [values.least, values.most]


def _span(pair: list[float] | None, unit: str) -> str:
    if pair is None:
        return ""
    least, most = pair
    return f"{least:g} {unit}" if least == most else f"{least:g} to {most:g} {unit}"


@click.command(
    epilog="""\b
Examples:
  recorder info flights/20180504T120000Z_*.mcap
  recorder info --json flights/20180504T120000Z_0000.mcap.part | jq .losses

\b
Exit codes: 0 all is there, 1 nothing can be read, 2 wrong usage, 3 something is lost.""",
)
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--json", "as_document", is_flag=True, help="Print a JSON document instead of a page.")
@click.pass_context
def info(context: click.Context, files: tuple[Path, ...], *, as_document: bool) -> None:
    """Say what is in a flight: times, frames, gaps, camera, zoom, attachments, and what is lost.

    Several segments of one recording are one flight. All of it is read, and every digest checked.
    """
    with failures_as_sentences():
        found = inspect(open_flight(files))
    if as_document:
        say_json(as_json(found))
    else:
        say(*as_text(found))
    if not found.facts.frames:
        say("Error: no picture in it can be read.", err=True)
        context.exit(FAILED)
    context.exit(DONE_WITH_LOSS if found.losses else 0)
