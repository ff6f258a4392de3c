"""The metadata records of a segment: `session` at its start, `attachments`, and `end` at its end.

MCAP gives metadata no CRC. Each of our records therefore carries the SHA-256 of its own items, and a reader believes
only a record that fits its digest.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field

from flight_file.frame import ClockReading

SESSION_RECORD = "session"
ATTACHMENTS_RECORD = "attachments"
END_RECORD = "end"

DIGEST_KEY = "sha256"
_VERSION_PREFIX = "version."
_LOST_BEFORE_KEY = "recovered_lost_before"
UNKNOWN_TIME = ClockReading(realtime_ns=0, monotonic_ns=0)


@dataclass(frozen=True, slots=True)
class Session:
    """What stands at the start of every segment.

    Attributes
    ----------
    recording
        Name of the recording; the same in all its segments.
    segment
        Number of the segment, from 0.
    started
        The clocks when the segment was opened.
    clock
        `system`, or `simulated` for a replay that runs as fast as possible.
    boot_id, host
        Which boot of which machine; empty where that was kept out on purpose.
    camera_driver, camera_model, camera_serial
        Empty where unknown when the segment was opened.
    versions
        Version by name of software.
    chain
        Value that the chain goes on from (see `chain`); empty in a file without a chain.
    """

    recording: str
    segment: int = 0
    started: ClockReading = UNKNOWN_TIME
    clock: str = "system"
    boot_id: str = ""
    host: str = ""
    camera_driver: str = ""
    camera_model: str = ""
    camera_serial: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    chain: str = ""


@dataclass(frozen=True, slots=True)
class EndRecord:
    """What stands at the end of every finished segment.

    Attributes
    ----------
    reason
        Why the segment ends: `next segment`, `no more pictures`, `stopped by SIGTERM`, ...
    frames
        Frames in this segment.
    dropped
        Frames of the recording that were taken but not stored, up to here.
    ended
        The clocks when it was written.
    chain
        Value of the chain after the last frame; empty in a file without a chain.
    recovered
        Whether the segment was put together again after a power cut or damage, so that frames may be lost at its end.
    lost_before
        Sequence numbers of frames before which a recovery found something lost.
    """

    reason: str
    frames: int
    dropped: int
    ended: ClockReading
    chain: str = ""
    recovered: bool = False
    lost_before: tuple[int, ...] = ()


def sealed(items: Mapping[str, str]) -> dict[str, str]:
    """The items with the digest of all of them."""
    return {**items, DIGEST_KEY: _digest(items)}


def is_sound(record: Mapping[str, str]) -> bool:
    """Whether the record carries a digest, and the digest fits."""
    items = {key: value for key, value in record.items() if key != DIGEST_KEY}
    return record.get(DIGEST_KEY) == _digest(items)


def _digest(items: Mapping[str, str]) -> str:
    return hashlib.sha256(json.dumps(dict(items), sort_keys=True).encode()).hexdigest()


def session_to_metadata(session: Session) -> dict[str, str]:
    """The `session` record."""
    items = {
        "recording": session.recording,
        "segment": str(session.segment),
        "started_realtime_ns": str(session.started.realtime_ns),
        "started_monotonic_ns": str(session.started.monotonic_ns),
        "clock": session.clock,
        "boot_id": session.boot_id,
        "host": session.host,
        "camera_driver": session.camera_driver,
        "camera_model": session.camera_model,
        "camera_serial": session.camera_serial,
        "chain": session.chain,
    }
    versions = {_VERSION_PREFIX + name: version for name, version in sorted(session.versions.items())}
    return sealed({**items, **versions})


def session_from_metadata(record: Mapping[str, str]) -> Session:
    """Inverse of `session_to_metadata`; raises KeyError or ValueError if it is no session record of ours."""
    return Session(
        recording=record["recording"],
        segment=int(record["segment"]),
        started=ClockReading(int(record["started_realtime_ns"]), int(record["started_monotonic_ns"])),
        clock=record.get("clock", ""),
        boot_id=record.get("boot_id", ""),
        host=record.get("host", ""),
        camera_driver=record.get("camera_driver", ""),
        camera_model=record.get("camera_model", ""),
        camera_serial=record.get("camera_serial", ""),
        versions={
            key.removeprefix(_VERSION_PREFIX): value for key, value in record.items() if key.startswith(_VERSION_PREFIX)
        },
        chain=record.get("chain", ""),
    )


def end_to_metadata(end: EndRecord) -> dict[str, str]:
    """The `end` record."""
    items = {
        "reason": end.reason,
        "frames": str(end.frames),
        "dropped": str(end.dropped),
        "ended_realtime_ns": str(end.ended.realtime_ns),
        "ended_monotonic_ns": str(end.ended.monotonic_ns),
        "chain": end.chain,
    }
    recovery = {_LOST_BEFORE_KEY: ",".join(map(str, end.lost_before))} if end.recovered else {}
    return sealed({**items, **recovery})


def end_from_metadata(record: Mapping[str, str]) -> EndRecord:
    """Inverse of `end_to_metadata`; raises KeyError or ValueError if it is no end record of ours."""
    return EndRecord(
        reason=record["reason"],
        frames=int(record["frames"]),
        dropped=int(record["dropped"]),
        ended=ClockReading(int(record["ended_realtime_ns"]), int(record["ended_monotonic_ns"])),
        chain=record.get("chain", ""),
        recovered=_LOST_BEFORE_KEY in record,
        lost_before=tuple(int(number) for number in record.get(_LOST_BEFORE_KEY, "").split(",") if number),
    )
