"""A flight's facts as a page for people and as JSON for scripts."""

from __future__ import annotations

from typing import Any

from flight_file.signature import signature_path
from recorder.info import FlightInfo, Range, gaps
from recorder.marks import is_marked
from recorder.utc import utc_text


def as_json(info: FlightInfo) -> dict[str, Any]:
    """Everything as plain values; None where it is not known."""
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
        "start_utc": utc_text(facts.captured_ns.least),
        "end_utc": utc_text(facts.captured_ns.most),
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
        "jpeg_bytes": _pair(facts.jpeg_bytes),
        "picture_sizes_px": [list(size) for size in sorted(facts.sizes_px)],
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


def as_text(info: FlightInfo) -> str:
    """A page, one fact a line."""
    facts = as_json(info)
    size_bytes = sum(file["size_bytes"] for file in facts["files"])
    camera = " ".join(value for value in facts["camera"].values() if value)
    rows = [
        ("recording", facts["recording"]),
        ("files", f"{len(facts['files'])}, {size_bytes / 1e6:.1f} MB"),
        ("start", facts["start_utc"]),
        ("end", facts["end_utc"]),
        ("duration", f"{facts['duration_s']:.1f} s"),
        ("frames", f"{facts['frames']}{_rate(facts['rate_hz'])}"),
        ("gaps", f"{facts['gaps']} ({facts['frames_missing']} frames missing, {facts['frames_dropped']} dropped)"),
        ("camera", camera),
        ("zoom", _span(facts["focal_length_mm"], "mm")),
        ("pictures", ", ".join(f"{width}x{height}" for width, height in facts["picture_sizes_px"])),
        ("JPEG size", _span(facts["jpeg_bytes"], "bytes")),
        ("attachments", ", ".join(facts["attachments"]) or "none"),
        ("evidence", ", ".join(_evidence(facts["files"]))),
    ]
    lines = [f"{name + ':':<13}{value or 'not known'}" for name, value in rows]
    return "\n".join(lines + _loss_lines(info))


def _evidence(files: list[dict[str, Any]]) -> list[str]:
    # Whether chain and signatures fit is what `recorder verify` says.
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
