"""A flight as a row of segment files: `NAME_0000.mcap`, `NAME_0001.mcap`, ...

Four digits sort by name for ten thousand segments, almost a week of one-minute ones; readers sort by number in any
case.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from flight_file import moments
from flight_file.durable_file import refuse_existing
from flight_file.errors import FlightNotWrittenError
from flight_file.frame import ClockReading, Frame
from flight_file.log_clock import LogClock
from flight_file.reports import CameraStatus, Health, LogLine
from flight_file.session import Session
from flight_file.signature import Signer
from flight_file.writer import Remains, SegmentWriter

SEGMENT_SUFFIX = ".mcap"
NEXT_SEGMENT = "next segment"
EMPTY_SEGMENT_NS = 3600 * moments.NS_PER_S  # a box that waits for its camera all day shall not fill the disk with files

_NAME = re.compile(r"(?P<recording>.+)_(?P<segment>\d{4,})\.mcap(\.part)?")


def segment_path(directory: Path, recording: str, segment: int) -> Path:
    """Where a finished segment lies."""
    return directory / f"{recording}_{segment:04d}{SEGMENT_SUFFIX}"


def parse_segment_name(path: Path) -> tuple[str, int] | None:
    """Recording and segment number by the file's name, finished or in work; None if it is no segment's name."""
    match = _NAME.fullmatch(path.name)
    return (match["recording"], int(match["segment"])) if match else None


def free_recording_name(directory: Path, wanted: str) -> str:
    """The wanted name, or the first of `wanted-2`, `wanted-3`, ... that no segment in the directory has."""
    try:
        taken = {parsed[0] for path in directory.iterdir() if (parsed := parse_segment_name(path))}
    except OSError as error:
        raise FlightNotWrittenError(
            directory, reason=f"cannot be listed ({error.strerror}); check the directory"
        ) from error
    names = (wanted if number == 1 else f"{wanted}-{number}" for number in range(1, len(taken) + 2))
    return next(name for name in names if name not in taken)


@dataclass(frozen=True, slots=True)
class Plan:
    """What all segments of one recording have in common.

    Attributes
    ----------
    directory
        Where the segments lie; it exists.
    session
        As for the first segment; number, start and chain are filled in for each segment. One that goes on with a
        recording begun by another writer says so by its `segment` and `chain`.
    attachments
        Content by name; carried inside every segment.
    segment_ns, segment_bytes
        How long a segment may become, ns, and how large; one frame always has room in it.
    signer
        Signs each finished segment; None for no signatures.
    """

    directory: Path
    session: Session
    attachments: Mapping[str, bytes]
    segment_ns: int = 60 * moments.NS_PER_S
    segment_bytes: int | None = None
    signer: Signer | None = None


class FlightWriter:
    """A recording in work; takes what comes and starts a new segment when the old one is long or large enough.

    Parameters
    ----------
    log_clock
        Of the recording, if another writer began it; None for a new one.

    Raises
    ------
    FlightNotWrittenError
        From the constructor and from every method but `abandon`.
    """

    def __init__(
        self, plan: Plan, *, status: CameraStatus, at: ClockReading, log_clock: LogClock | None = None
    ) -> None:
        self._plan = plan
        self._log_clock = log_clock or LogClock()
        self._status = status
        self.finished: list[Path] = []
        self._dropped = status.dropped
        self._stored = 0
        self._segment = self._open(plan.session.segment, at, plan.session.chain)

    @property
    def chain(self) -> str:
        """Value of the chain after the last frame."""
        return self._segment.chain

    @property
    def unsynced(self) -> int:
        """How many frames and reports, the last that were given, are not on the disk for certain."""
        return self._segment.unsynced

    @property
    def stored(self) -> int:
        """Frames handed over so far."""
        return self._stored

    def write_frame(self, frame: Frame, at: ClockReading) -> None:
        """Store a frame that arrived at this time."""
        self.make_room(at, len(frame.jpeg))
        self._segment.write_frame(frame, at)
        self._stored += 1

    def write_status(self, status: CameraStatus, at: ClockReading) -> None:
        """Store a change of the camera's state; the next segment will start with it."""
        self._status = status
        self._dropped = max(self._dropped, status.dropped)
        self._segment.write_status(status, at)

    def write_remark(self, status: CameraStatus, at: ClockReading) -> None:
        """Store something that happened in this state of the camera; the next segment will not repeat it."""
        self._dropped = max(self._dropped, status.dropped)
        self._segment.write_status(status, at)

    def write_health(self, health: Health, at: ClockReading) -> None:
        """Store a health report."""
        self._dropped = max(self._dropped, health.dropped)
        self._segment.write_health(health, at)

    def write_log(self, line: LogLine, at: ClockReading) -> None:
        """Store a log line."""
        self._segment.write_log(line, at)

    def tick(self, at: ClockReading) -> None:
        """Do what is due while no frames come: sync, close a segment that is long enough."""
        if self._segment.frames or self._age_ns(at) >= EMPTY_SEGMENT_NS:
            self.make_room(at)
        self._segment.tick(at)

    def sync(self, at: ClockReading) -> None:
        """Come back when everything given so far is on the disk."""
        self._segment.sync(at)

    def make_room(self, at: ClockReading, coming_bytes: int = 0) -> None:
        """Start a new segment if this one is long enough, or too large for so many bytes more."""
        segment, limit = self._segment, self._plan.segment_bytes
        too_large = limit is not None and segment.frames > 0 and segment.written_bytes + coming_bytes > limit
        if too_large or self._age_ns(at) >= self._plan.segment_ns:
            self._close(NEXT_SEGMENT, at)
            self._segment = self._open(segment.session.segment + 1, at, self.chain)

    def name_camera(self, *, model: str, serial: str) -> None:
        """Say in the segments to come which camera it is."""
        self._plan = replace(self._plan, session=replace(self._plan.session, camera_model=model, camera_serial=serial))

    def finish(self, reason: str, at: ClockReading) -> list[Path]:
        """Close the last segment with this reason; returns all segments of the recording."""
        self._close(reason, at)
        return list(self.finished)

    def abandon(self) -> None:
        """Leave the open segment as it is, in work; for use after an error."""
        self._segment.abandon()

    def remains(self) -> Remains:
        """Leave the open segment, for somebody who will write again what is not on the disk for certain."""
        return self._segment.remains()

    def _age_ns(self, at: ClockReading) -> int:
        return at.monotonic_ns - self._segment.session.started.monotonic_ns

    def _open(self, segment: int, at: ClockReading, chain: str) -> SegmentWriter:
        session = replace(self._plan.session, segment=segment, started=at, chain=chain)
        path = segment_path(self._plan.directory, session.recording, segment)
        refuse_existing(path)
        plan = self._plan
        return SegmentWriter(
            path,
            session=session,
            status=self._status,
            attachments=plan.attachments,
            signer=plan.signer,
            log_clock=self._log_clock,
        )

    def _close(self, reason: str, at: ClockReading) -> None:
        self.finished.append(self._segment.finish(reason, dropped=self._dropped, at=at))
