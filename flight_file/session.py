"""A segment's statements about itself: its name, its metadata records, and the chain that links its frames.

| name                       | what                                                                              |
| -------------------------- | --------------------------------------------------------------------------------- |
| `NAME_0001.mcap`           | a finished segment                                                                |
| `NAME_0001.mcap.part`      | one in work                                                                       |
| `NAME_0001.mcap.begun`     | one whose head is being written; what a power cut leaves of it is removed         |
| `NAME_0001.recovered.mcap` | what is whole of a damaged finished one; `.recovered-2` and so on for another     |
| `NAME_0001.mcap.unproven`  | frames that a recovery did not sign; `.unproven-2` and so on. `*.mcap` misses it  |
| with `.recovering` behind  | one that a recovery is writing; what a power cut leaves of it is removed, too     |

Four digits sort by name for ten thousand segments, almost a week of one-minute ones; readers sort by number in any
case.

The records are `session` at its start, `attachments`, and `end`. MCAP gives metadata no CRC. Each of our records
therefore contains the SHA-256 of its own items, and a reader accepts only a record that fits its digest.

The chain is a value that depends on all frames recorded so far, and on their order.

A value is a SHA-256, written as 64 hexadecimal digits. Each is computed from the one before and something recorded:

    link(before, content) = SHA-256(the digits of `before` as ASCII, then `content`)

| value                | before                    | content                                                         |
| -------------------- | ------------------------- | --------------------------------------------------------------- |
| first of a recording | nothing                   | `flight chain 1` and the recording's identity: `first_value`    |
| start of a segment   | end of the segment before | digits of the digests of its `session`, `attachments` records   |
| after a frame        | after the frame before    | the frame's record up to its last member, `chain`               |

The content of a frame is its bytes in the file, so no convention on writing JSON is needed. It contains the SHA-256 of
the picture, the sequence number, all times and the EXIF, so all of these are chained.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

from flight_file.errors import FlightNotWrittenError
from flight_file.frame import ClockReading
from flight_file.untrusted import encodable

SEGMENT_SUFFIX = ".mcap"
UNPROVEN_SUFFIX = ".unproven"
_NAME = re.compile(
    r"(?P<recording>.+)_(?P<segment>\d{4,})(?P<recovered>\.recovered(-\d+)?)?\.mcap(?P<state>\.part|\.unproven(-\d+)?)?",
    re.ASCII,
)

PART_SUFFIX = ".part"
BEGUN_SUFFIX = ".begun"
RECOVERING_SUFFIX = ".recovering"
_UNFINISHED = re.compile(r"(?P<of>.+)(?P<end>\.begun|\.recovering(-\d+)?|\.sig\.new(-\d+)?)", re.ASCII | re.DOTALL)

SESSION_RECORD = "session"
ATTACHMENTS_RECORD = "attachments"
END_RECORD = "end"
CHECKPOINT_RECORD = "checkpoint"  # the only one that may occur in a segment more than once; see `signature`
DIGEST_KEY = "sha256"
_VERSION_PREFIX = "version."
_ORIGINAL_PREFIX = "original."
_OF_ORIGINALS = ("name", "size_bytes", "sha256")
UNKNOWN = "unknown"
_LOST_BEFORE_KEY = "recovered_lost_before"
NO_SOUND = "none"
"""What a video without sound says of it."""
UNKNOWN_TIME = ClockReading(realtime_ns=0, monotonic_ns=0)
_MEMBER = b',"chain":"%s"}'
_SEALED = re.compile(rb'(?P<content>\{.*),"chain":"(?P<value>[0-9a-f]{64})"\}', re.DOTALL)


@dataclass(frozen=True, slots=True)
class Original:
    """A video file that a flight was made of.

    Attributes
    ----------
    sha256
        Of all its bytes, hexadecimal.
    facts
        Its further statements about itself, by name, each in words: its codec, its clocks.
    """

    name: str
    size_bytes: int
    sha256: str
    facts: Mapping[str, str] = field(default_factory=dict)

    @property
    def has_sound(self) -> bool:
        """Whether it has sound that was processed."""
        return self.facts.get("sound", NO_SOUND) != NO_SOUND


@dataclass(frozen=True, slots=True)
class Session:
    """The record at the start of every segment.

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
        Boot and machine; empty if left out on purpose.
    camera_driver, camera_model, camera_serial
        Empty where unknown when the segment was opened.
    versions
        Version by name of software.
    chain
        Value from which the chain continues; empty in a file without a chain.
    time_of_day
        Which clock the pictures' times are by: empty for the recorder's and the camera's own, `start` if a person gave
        it, `creation`, `timecode` or `gps` for a video's; UNKNOWN if none does. Then times count from 1970, and only
        their differences are meaningful.
    originals
        Video files that the flight was made of, in their order.
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
    time_of_day: str = ""
    originals: tuple[Original, ...] = ()

    @property
    def knows_time_of_day(self) -> bool:
        """Whether times in the flight are moments, not only differences."""
        return self.time_of_day != UNKNOWN


@dataclass(frozen=True, slots=True)
class EndRecord:
    """The record at the end of every finished segment.

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
        Whether the segment was recovered after a power cut or damage, so that frames may be lost at its end.
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
    """Add the digest of all items."""
    return {**items, DIGEST_KEY: _digest(items)}


def is_sound(record: Mapping[str, str]) -> bool:
    """Whether the record carries a digest, and the digest fits."""
    items = {key: value for key, value in record.items() if key != DIGEST_KEY}
    return record.get(DIGEST_KEY) == _digest(items)


def _digest(items: Mapping[str, str]) -> str:
    return hashlib.sha256(json.dumps(dict(items), sort_keys=True).encode()).hexdigest()


def _number(text: str) -> int:
    number = int(text)
    if abs(number) >= 2**63:
        raise ValueError("no count and no time of ours has more than 64 bits")
    return number


def session_to_metadata(session: Session) -> dict[str, str]:
    """Encode the `session` record."""
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
    time_of_day = {"time_of_day": session.time_of_day} if session.time_of_day else {}
    return sealed({**items, **versions, **time_of_day, **_originals_to_metadata(session.originals)})


def _originals_to_metadata(originals: tuple[Original, ...]) -> dict[str, str]:
    items: dict[str, str] = {}
    for number, original in enumerate(originals):
        own = {"name": original.name, "size_bytes": str(original.size_bytes), "sha256": original.sha256}
        items |= {f"{_ORIGINAL_PREFIX}{number}.{key}": text for key, text in {**original.facts, **own}.items()}
    return items


def _originals_from_metadata(record: Mapping[str, str]) -> Iterator[Original]:
    for number in count():
        prefix = f"{_ORIGINAL_PREFIX}{number}."
        own = {key.removeprefix(prefix): text for key, text in record.items() if key.startswith(prefix)}
        if not own:
            return
        facts = {key: text for key, text in own.items() if key not in _OF_ORIGINALS}
        yield Original(own["name"], _number(own["size_bytes"]), own["sha256"], facts)


def session_from_metadata(record: Mapping[str, str]) -> Session:
    """Decode the `session` record; raises KeyError or ValueError if it is not ours."""
    return Session(
        recording=record["recording"],
        segment=_number(record["segment"]),
        started=ClockReading(_number(record["started_realtime_ns"]), _number(record["started_monotonic_ns"])),
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
        time_of_day=record.get("time_of_day", ""),
        originals=tuple(_originals_from_metadata(record)),
    )


def end_to_metadata(end: EndRecord) -> dict[str, str]:
    """Encode the `end` record."""
    items = {
        "reason": encodable(end.reason),
        "frames": str(end.frames),
        "dropped": str(end.dropped),
        "ended_realtime_ns": str(end.ended.realtime_ns),
        "ended_monotonic_ns": str(end.ended.monotonic_ns),
        "chain": end.chain,
    }
    recovery = {_LOST_BEFORE_KEY: ",".join(map(str, end.lost_before))} if end.recovered else {}
    return sealed({**items, **recovery})


def end_from_metadata(record: Mapping[str, str]) -> EndRecord:
    """Decode the `end` record; raises KeyError or ValueError if it is not ours."""
    return EndRecord(
        reason=record["reason"],
        frames=_number(record["frames"]),
        dropped=_number(record["dropped"]),
        ended=ClockReading(_number(record["ended_realtime_ns"]), _number(record["ended_monotonic_ns"])),
        chain=record.get("chain", ""),
        recovered=_LOST_BEFORE_KEY in record,
        lost_before=tuple(_number(number) for number in record.get(_LOST_BEFORE_KEY, "").split(",") if number),
    )


def link(before: str, content: bytes) -> str:
    """Compute the value that follows `before` when `content` is recorded."""
    return hashlib.sha256(before.encode() + content).hexdigest()


def first_value(session: Session) -> str:
    """Compute a recording's first value: the SHA-256 of six lines, each ended by a line feed.

    Parameters
    ----------
    session
        Of the recording's first segment.
    """
    started = session.started
    identity = (session.recording, started.realtime_ns, started.monotonic_ns, session.boot_id, session.host)
    return link("", "".join(f"{line}\n" for line in ("flight chain 1", *identity)).encode())


def start_of_segment(before: str, session_digest: str, attachments_digest: str) -> str:
    """Compute the value before a segment's first frame.

    Parameters
    ----------
    before
        The previous segment's last value; `first_value` for the first segment.
    session_digest, attachments_digest
        The digests stated in the two metadata records, hexadecimal.
    """
    return link(before, (session_digest + attachments_digest).encode("ascii"))


def sealed_frame(record: bytes, before: str) -> tuple[bytes, str]:
    """Add to a frame's record its value in the chain; return both.

    Parameters
    ----------
    record
        A JSON object that has members.
    """
    content = record[:-1]
    value = link(before, content)
    return content + _MEMBER % value.encode("ascii"), value


def opened_frame(record: bytes) -> tuple[bytes, str]:
    """Split a frame's record into its content and its stated chain value; empty if there is none."""
    match = _SEALED.fullmatch(record)
    return (match["content"], match["value"].decode("ascii")) if match else (record, "")


def segment_path(directory: Path, recording: str, segment: int) -> Path:
    """Return the path of a finished segment."""
    return directory / f"{recording}_{segment:04d}{SEGMENT_SUFFIX}"


def parse_segment_name(path: Path) -> tuple[str, int] | None:
    """Parse the name of a finished segment or one in work: recording and number; None for another name."""
    match = _NAME.fullmatch(path.name)
    return _place(match) if match and not match["recovered"] and match["state"] in (None, PART_SUFFIX) else None


def claimed_place(path: Path) -> tuple[str, int] | None:
    """Parse any name of the table above: the recording and number that it claims; None if it claims none."""
    match = _NAME.fullmatch(path.name)
    return _place(match) if match else None


def is_left_over(name: str) -> bool:
    """Whether an interrupted write left a file of this name, unless somebody is at it now: nobody will look for it."""
    match = _UNFINISHED.fullmatch(name)
    if match is None:
        return False
    of = Path(match["of"])
    return bool(parse_segment_name(of) if match["end"] == BEGUN_SUFFIX else claimed_place(of))


def unproven_names(segment: Path) -> Iterator[Path]:
    """Iterate over the names for a segment's unproven frames; use the first free one."""
    yield segment.with_name(segment.name + UNPROVEN_SUFFIX)
    yield from (segment.with_name(f"{segment.name}{UNPROVEN_SUFFIX}-{number}") for number in count(2))


def is_unproven(path: Path) -> bool:
    """Whether the file is unproven by its name."""
    return path.suffix.startswith(UNPROVEN_SUFFIX)


def _place(match: re.Match[str]) -> tuple[str, int]:
    return match["recording"], int(match["segment"])


def free_recording_name(directory: Path, wanted: str) -> str:
    """Return the wanted name, or the first of `wanted-2`, ... that no segment in the directory has, even one begun."""
    try:
        with os.scandir(directory) as entries:
            # A directory may have hundreds of thousands of files: look only at those with such a name.
            alike = [entry.name.removesuffix(BEGUN_SUFFIX) for entry in entries if entry.name.startswith(wanted)]
    except OSError as error:
        raise FlightNotWrittenError(
            directory, reason=f"cannot be listed ({error.strerror}); check the directory"
        ) from error
    taken = {place[0] for name in alike if (place := claimed_place(Path(name)))}
    names = (wanted if number == 1 else f"{wanted}-{number}" for number in range(1, len(taken) + 2))
    return next(name for name in names if name not in taken)
