"""What was read of frames, as lines of JSON and back, to the last bit; a line that was torn or changed is known.

JSON writes each double with as many digits as tell it from its neighbours; NaN stands as `NaN`, which Python reads.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Sequence
from dataclasses import astuple
from typing import Any

from decoder.alignment import Alignment
from decoder.frame_batch import Batch, LeftOut, Outcome, Unread
from decoder.lens import Lens
from decoder.panel_reader import FrameReadings
from decoder.reading import Reading, Status


def line_of(content: object) -> bytes:
    """A line that carries its own CRC-32."""
    body = json.dumps(content, separators=(",", ":"), default=float).encode()
    return b"%08x %s\n" % (zlib.crc32(body), body)


def content_of(line: bytes) -> Any:  # noqa: ANN401 - whatever was written
    """What a line says; None if it is not whole."""
    crc, _, body = line.rstrip(b"\n").partition(b" ")
    if not line.endswith(b"\n") or crc != b"%08x" % zlib.crc32(body):
        return None
    return json.loads(body)


def plain_batch(batch: Batch, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """A batch's frames by number and time, and what was read of each; nothing where one of them was left out."""
    is_read = not any(isinstance(outcome, LeftOut) for outcome in outcomes)
    return {
        "frames": [[frame.sequence, frame.captured_ns] for frame in batch],
        "read": [_plain(outcome) for outcome in outcomes] if is_read else [],
    }


def outcomes_of(content: dict[str, Any], batch: Batch) -> list[Outcome] | None:
    """Inverse of `plain_batch`, empty where it is to be read again; None if it is about other frames."""
    if content["frames"] != [[frame.sequence, frame.captured_ns] for frame in batch]:
        return None
    return [_outcome(each) for each in content["read"]]


def _plain(outcome: Outcome) -> dict[str, Any]:
    if isinstance(outcome, Unread):
        return {"reason": outcome.reason, "failed": outcome.failed}
    alignment = outcome.alignment
    return {
        "elements": alignment.elements,
        "score": alignment.score,
        "failed": alignment.failed,
        "lens": None if alignment.lens is None else astuple(alignment.lens),
        "sigma_px": outcome.alignment_sigma_px,
        "shifts_px": outcome.dial_shifts_px,
        "readings": {
            name: [reading.status, reading.angle_deg, reading.sigma_deg, reading.score]
            for name, reading in outcome.readings.items()
        },
    }


def _outcome(content: dict[str, Any]) -> Outcome:
    failed = tuple(content["failed"])
    if "reason" in content:
        return Unread(content["reason"], failed)
    lens = None if content["lens"] is None else Lens(*(_frozen(field) for field in content["lens"]))
    return FrameReadings(
        Alignment(tuple(content["elements"]), content["score"], failed, lens),
        {name: Reading(Status(status), *numbers) for name, (status, *numbers) in content["readings"].items()},
        tuple(content["sigma_px"]),
        tuple((x, y) for x, y in content.get("shifts_px", ())),
    )


def _frozen(field: Any) -> Any:  # noqa: ANN401 - a number, or a list of them
    return tuple(field) if isinstance(field, list) else field
