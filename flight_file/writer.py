"""Write one segment of a flight.

While it is in work the file is `NAME.mcap.part`. Its layout:

    header        profile `flight`, our library string
    metadata      `session`, then `attachments` (name to SHA-256)
    attachments   panel.yaml, its pictures, camera.yaml, recorder.yaml
    chunk         all schemas and channels, and the camera's status          <- synced before the first picture
    chunk ...     whole pictures: the record and the image of a frame are always in one chunk
    metadata      `end` with the reason
    summary

Chunks are closed by us, not by the MCAP library, which would close one between a frame's two messages.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from mcap.writer import Writer

from flight_file import codec, moments
from flight_file.chain import first_value, sealed_frame, start_of_segment
from flight_file.durable_file import DurableFile, refuse_existing, rename_durably, sync_directory
from flight_file.frame import ClockReading, Frame
from flight_file.log_clock import LogClock
from flight_file.packing import packed_head, registered_topics
from flight_file.reports import CameraStatus, Health, LogLine
from flight_file.session import (
    DIGEST_KEY,
    END_RECORD,
    EndRecord,
    Session,
    end_to_metadata,
    sealed,
    session_to_metadata,
)
from flight_file.signature import Signer, write_signature
from flight_file.topics import FRAME_TOPIC, HEALTH_TOPIC, IMAGE_TOPIC, LOG_TOPIC, STATUS_TOPIC

PART_SUFFIX = ".part"
CHUNK_BYTES = 64 * 1024
SYNC_NS = 1 * moments.NS_PER_S
SYNC_BYTES = 8 * 1024 * 1024  # at most this much is lost to a power cut, or has to be kept to be written again


@dataclass(frozen=True, slots=True)
class Remains:
    """What a segment leaves that could not be written on, and where another one goes on.

    Attributes
    ----------
    path
        The file in work; None if nothing but its head was on the disk, then it was removed.
    synced_bytes
        How much of it is on the disk for certain; what lies behind may be anything.
    segment
        Number of the next segment.
    chain
        What the next segment goes on from.
    """

    path: Path | None
    synced_bytes: int
    segment: int
    chain: str


class SegmentWriter:
    """One segment in work.

    Parameters
    ----------
    path
        Final path, `....mcap`; the file is written beside it with `.part` appended.
    session
        What the segment says about itself; its `started` anchors the log times. If it names no `chain` to go on from,
        the segment is the first of its recording.
    status
        The camera's state at this moment.
    attachments
        Content by name.
    signer
        Signs the finished file, into a file of its own beside it; None for no signature.
    log_clock
        Of the recording; None for the first segment of one.

    Attributes
    ----------
    chain
        Value of the chain after the last frame; what the next segment goes on from.
    unsynced
        How many frames and reports, the last that were given, are not on the disk for certain.

    Raises
    ------
    FlightNotWrittenError
        From the constructor and from every method but `abandon`. Call `abandon` then: what was synced stays readable.
    """

    def __init__(
        self,
        path: Path,
        *,
        session: Session,
        status: CameraStatus,
        attachments: Mapping[str, bytes],
        signer: Signer | None = None,
        log_clock: LogClock | None = None,
    ) -> None:
        self.path = path
        self.session = replace(session, chain=session.chain or first_value(session))
        self.chain = self.session.chain
        self.frames = 0
        self.unsynced = 0
        self._synced = 0
        self._synced_chain = self.chain
        self._given_chain = session.chain
        self._log_clock = log_clock or LogClock()
        self._log_clock.begin_segment(session.started)
        self._chunk_bytes = 0
        self._synced_at_ns = session.started.monotonic_ns
        self._signer = signer
        self._file = DurableFile(path.with_name(path.name + PART_SUFFIX), digested=signer is not None)
        try:
            self._writer = self._start(attachments)
            self._channels = registered_topics(self._writer)
            self.write_status(status, session.started)
            self.sync(session.started)
            self._synced = 0
            sync_directory(path.parent)
        except BaseException:
            self._file.discard()  # nothing is in it yet, and whoever tries again shall not litter the disk
            raise

    def _start(self, attachments: Mapping[str, bytes]) -> Writer:
        session = session_to_metadata(self.session)
        digests = sealed({name: hashlib.sha256(content).hexdigest() for name, content in attachments.items()})
        self.chain = start_of_segment(self.session.chain, session[DIGEST_KEY], digests[DIGEST_KEY])
        return packed_head(
            self._file,
            session=session,
            attachment_digests=digests,
            attachments=attachments,
            log_ns=moments.storable(self.session.started.realtime_ns),
        )

    @property
    def written_bytes(self) -> int:
        """Size of the file and of what waits to be written to it, bytes."""
        return self._file.tell() + self._chunk_bytes

    def write_frame(self, frame: Frame, at: ClockReading) -> None:
        """Store a frame that arrived at this time.

        Parameters
        ----------
        frame
            Its host times may be of another boot (a replayed flight): they are stored, not used.
        at
            The recorder's clocks; a frame's log time follows the monotonic one and never runs back (see `log_clock`).
        """
        self.unsynced += 1
        log_ns = self._log_clock.time_ns(at)
        publish_ns = moments.storable(frame.captured_ns)
        number = frame.sequence & 0xFFFFFFFF
        record, self.chain = sealed_frame(codec.encode_frame(frame), self.chain)
        self._add(FRAME_TOPIC, record, log_ns, publish_ns, number)
        self._add(IMAGE_TOPIC, codec.encode_image(frame), log_ns, publish_ns, number)
        self.frames += 1
        if self._chunk_bytes >= CHUNK_BYTES:
            self._close_chunk()
        self._sync_if_due(at)

    def write_status(self, status: CameraStatus, at: ClockReading) -> None:
        """Store a change of the camera's state."""
        self._report(STATUS_TOPIC, codec.encode_status(status, at), at)

    def write_health(self, health: Health, at: ClockReading) -> None:
        """Store a health report."""
        self._report(HEALTH_TOPIC, codec.encode_health(health, at), at)

    def write_log(self, line: LogLine, at: ClockReading) -> None:
        """Store a log line."""
        self._report(LOG_TOPIC, codec.encode_log(line, at), at)

    def tick(self, at: ClockReading) -> None:
        """Sync if it is time; call it about each second while no frames come."""
        self._sync_if_due(at)

    def sync(self, at: ClockReading) -> None:
        """Close the open chunk and come back when everything written so far is on the disk."""
        self._close_chunk()
        self._file.sync()
        self._note_synced()
        self._synced_at_ns = at.monotonic_ns

    def finish(self, reason: str, *, dropped: int, at: ClockReading) -> Path:
        """Close the segment and give it its final name.

        Parameters
        ----------
        reason
            Goes into the end record.
        dropped
            Frames of the recording that were not stored, so far.

        Returns
        -------
        Path
            The finished file.
        """
        self._close_chunk()
        end = EndRecord(reason=reason, frames=self.frames, dropped=dropped, ended=at, chain=self.chain)
        self._writer.add_metadata(END_RECORD, end_to_metadata(end))
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.sync()
        self._note_synced()
        if self._signer is not None:
            refuse_existing(self.path)
            write_signature(self.path, self._file.sha256, self._signer)
        rename_durably(self._file.path, self.path)
        self._file.close()  # only now: closing gives up the lock that keeps others from recovering the file in work
        return self.path

    def abandon(self) -> None:
        """Close the file as it is, under its name in work; for use after an error."""
        self._file.close()

    def remains(self) -> Remains:
        """Close the file as it is, for somebody who will write again what is not on the disk for certain."""
        if not self._synced:
            self._file.discard()
            return Remains(None, 0, self.session.segment, self._given_chain)
        self._file.close()
        return Remains(self._file.path, self._file.synced_bytes, self.session.segment + 1, self._synced_chain)

    def _note_synced(self) -> None:
        self._synced += self.unsynced
        self.unsynced = 0
        self._synced_chain = self.chain

    def _report(self, topic: str, data: bytes, at: ClockReading) -> None:
        self.unsynced += 1
        log_ns = self._log_clock.time_ns(at)
        self._add(topic, data, log_ns, log_ns, 0)
        self._sync_if_due(at)

    def _add(self, topic: str, data: bytes, log_ns: int, publish_ns: int, number: int) -> None:
        self._writer.add_message(
            self._channels[topic], log_time=log_ns, data=data, publish_time=publish_ns, sequence=number
        )
        self._chunk_bytes += len(data)

    def _close_chunk(self) -> None:
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._chunk_bytes = 0

    def _sync_if_due(self, at: ClockReading) -> None:
        waiting = self.written_bytes - self._file.synced_bytes
        if waiting and (at.monotonic_ns - self._synced_at_ns >= SYNC_NS or waiting >= SYNC_BYTES):
            self.sync(at)
