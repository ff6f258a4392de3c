"""Write a recording: the common parts of its segments, and when the next one begins."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from flight_file.files import refuse_existing
from flight_file.frame import NS_PER_S, CameraStatus, ClockReading, Frame, Health, LogClock, LogLine
from flight_file.session import Session, segment_path
from flight_file.signature import Signer
from flight_file.thresholds import EMPTY_SEGMENT_NS
from flight_file.writer import Remains, SegmentWriter

NEXT_SEGMENT = "next segment"


@dataclass(frozen=True, slots=True)
class Plan:
    """The common parts of a recording's segments.

    Attributes
    ----------
    directory
        Directory of the segments; it exists.
    session
        As for the first segment; number, start and chain are filled in for each segment. To continue a recording of
        another writer, set its `segment` and `chain`.
    attachments
        Content by name; carried inside every segment.
    segment_ns, segment_bytes, segment_frames
        Longest duration of a segment, ns, largest size, and most frames; one frame always fits.
    signer
        Signs each finished segment; None for no signatures.
    """

    directory: Path
    session: Session
    attachments: Mapping[str, bytes]
    segment_ns: int = 60 * NS_PER_S
    segment_bytes: int | None = None
    segment_frames: int | None = None
    signer: Signer | None = None


class FlightWriter:
    """Writes a recording, starting a new segment whenever the old one is long or large enough.

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
        self._segment = self._open(plan.session.segment, at, plan.session.chain)

    @property
    def chain(self) -> str:
        """Value of the chain after the last frame."""
        return self._segment.chain

    @property
    def unsynced(self) -> int:
        """The number of frames and reports, counted from the last, that are not certain to be on the disk."""
        return self._segment.unsynced

    def write_frame(self, frame: Frame, at: ClockReading) -> None:
        """Store a frame that arrived at this time."""
        self.make_room(at, len(frame.encoded))
        self._segment.write_frame(frame, at)

    def write_status(self, status: CameraStatus, at: ClockReading) -> None:
        """Store a change of the camera's state; the next segment starts with it."""
        self._status = status
        self._dropped = max(self._dropped, status.dropped)
        self._segment.write_status(status, at)

    def write_remark(self, status: CameraStatus, at: ClockReading) -> None:
        """Store an event in this state of the camera; the next segment does not repeat it."""
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
        """Sync, and close a segment that is long enough; call it while no frames come."""
        if self._segment.frames or self._age_ns(at) >= EMPTY_SEGMENT_NS:
            self.make_room(at)
        self._segment.tick(at)

    def sync(self, at: ClockReading) -> None:
        """Wait until everything given so far is on the disk."""
        self._segment.sync(at)

    def make_room(self, at: ClockReading, coming_bytes: int = 0) -> None:
        """Start a new segment if this one is long enough, has all its frames, or no room for `coming_bytes` more."""
        segment, plan = self._segment, self._plan
        too_many = plan.segment_frames is not None and segment.frames >= plan.segment_frames
        too_large = plan.segment_bytes is not None and segment.written_bytes + coming_bytes > plan.segment_bytes
        if (segment.frames and (too_many or too_large)) or self._age_ns(at) >= plan.segment_ns:
            self._close(NEXT_SEGMENT, at)
            self._segment = self._open(segment.session.segment + 1, at, self.chain)

    def name_camera(self, *, model: str, serial: str) -> None:
        """Name the camera in the segments to come."""
        self._plan = replace(self._plan, session=replace(self._plan.session, camera_model=model, camera_serial=serial))

    def finish(self, reason: str, at: ClockReading) -> list[Path]:
        """Close the last segment with this reason; returns all segments of the recording."""
        self._close(reason, at)
        return list(self.finished)

    def abandon(self) -> None:
        """Leave the open segment as it is, in work; for use after an error."""
        self._segment.abandon()

    @property
    def is_gone(self) -> bool:
        """Whether the open segment was deleted, renamed or replaced."""
        return self._segment.is_gone

    def refuse_gone(self) -> None:
        """Raise FlightNotWrittenError if it is gone."""
        self._segment.refuse_gone()

    def remains(self) -> Remains:
        """Close the open segment as it is; the next writer writes again whatever is not certain to be on the disk."""
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
        try:
            self._segment.finish(reason, dropped=self._dropped, at=at)
        finally:
            if self._segment.has_final_name:
                self.finished.append(self._segment.path)
