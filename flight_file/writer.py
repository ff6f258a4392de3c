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
from importlib.metadata import version
from pathlib import Path
from typing import IO, cast

from mcap.writer import CompressionType, Writer

from flight_file import codec, moments
from flight_file.durable_file import DurableFile, rename_durably, sync_directory
from flight_file.frame import ClockReading, Frame
from flight_file.reports import CameraStatus, Health, LogLine
from flight_file.session import (
    ATTACHMENTS_RECORD,
    END_RECORD,
    SESSION_RECORD,
    EndRecord,
    Session,
    end_to_metadata,
    sealed,
    session_to_metadata,
)
from flight_file.topics import FRAME_TOPIC, HEALTH_TOPIC, IMAGE_TOPIC, LOG_TOPIC, PROFILE, STATUS_TOPIC, TOPICS

PART_SUFFIX = ".part"
CHUNK_BYTES = 64 * 1024
SYNC_NS = 1 * moments.NS_PER_S
SYNC_BYTES = 32 * 1024 * 1024  # at most this much is lost to a power cut, whatever the clock says
LIBRARY = f"image-flight-recorder/{version('image-flight-recorder')}"

_NEVER_CLOSE_A_CHUNK = 2**62
_MEDIA_TYPES = {
    ".yaml": "application/yaml",
    ".yml": "application/yaml",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
    ".png": "image/png",
}


class SegmentWriter:
    """One segment in work.

    Parameters
    ----------
    path
        Final path, `....mcap`; the file is written beside it with `.part` appended.
    session
        What the segment says about itself; its `started` anchors the log times.
    status
        The camera's state at this moment.
    attachments
        Content by name.

    Raises
    ------
    FlightNotWrittenError
        From the constructor and from every method but `abandon`. Call `abandon` then: what was synced stays readable.
    """

    def __init__(self, path: Path, *, session: Session, status: CameraStatus, attachments: Mapping[str, bytes]) -> None:
        self.path = path
        self.session = session
        self.frames = 0
        self._last_log_ns = 0
        self._chunk_bytes = 0
        self._synced_at_ns = session.started.monotonic_ns
        self._file = DurableFile(path.with_name(path.name + PART_SUFFIX))
        try:
            self._writer = self._start(attachments)
            self._channels = self._register()
            self.write_status(status, session.started)
            self.sync(session.started)
            sync_directory(path.parent)
        except BaseException:
            self.abandon()
            raise

    def _start(self, attachments: Mapping[str, bytes]) -> Writer:
        writer = Writer(
            cast("IO[bytes]", self._file),
            chunk_size=_NEVER_CLOSE_A_CHUNK,
            compression=CompressionType.NONE,
            enable_crcs=True,
            enable_data_crcs=True,
        )
        writer.start(profile=PROFILE, library=LIBRARY)
        writer.add_metadata(SESSION_RECORD, session_to_metadata(self.session))
        digests = {name: hashlib.sha256(content).hexdigest() for name, content in attachments.items()}
        writer.add_metadata(ATTACHMENTS_RECORD, sealed(digests))
        log_ns = moments.storable(self.session.started.realtime_ns)
        for name, content in attachments.items():
            media_type = _MEDIA_TYPES.get(Path(name).suffix.lower(), "application/octet-stream")
            writer.add_attachment(create_time=0, log_time=log_ns, name=name, media_type=media_type, data=content)
        return writer

    def _register(self) -> dict[str, int]:
        channels = {}
        for topic in TOPICS:
            schema_id = self._writer.register_schema(topic.schema_name, topic.schema_encoding, topic.schema)
            channels[topic.name] = self._writer.register_channel(topic.name, topic.message_encoding, schema_id)
        return channels

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
            The recorder's clocks; a frame's log time follows the monotonic one and never runs back within a segment.
        """
        log_ns = self._log_time(at)
        publish_ns = moments.storable(frame.captured_ns)
        number = frame.sequence & 0xFFFFFFFF
        self._add(FRAME_TOPIC, codec.encode_frame(frame), log_ns, publish_ns, number)
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
        end = EndRecord(reason=reason, frames=self.frames, dropped=dropped, ended=at)
        self._writer.add_metadata(END_RECORD, end_to_metadata(end))
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.sync()
        self._file.close()
        rename_durably(self._file.path, self.path)
        return self.path

    def abandon(self) -> None:
        """Close the file as it is, under its name in work; for use after an error."""
        self._file.close()

    def _report(self, topic: str, data: bytes, at: ClockReading) -> None:
        log_ns = self._log_time(at)
        self._add(topic, data, log_ns, log_ns, 0)
        self._sync_if_due(at)

    def _add(self, topic: str, data: bytes, log_ns: int, publish_ns: int, number: int) -> None:
        self._writer.add_message(
            self._channels[topic], log_time=log_ns, data=data, publish_time=publish_ns, sequence=number
        )
        self._chunk_bytes += len(data)

    def _log_time(self, at: ClockReading) -> int:
        # Anchored once per segment: setting the wall clock does not move it.
        anchor = self.session.started
        log_ns = moments.storable(anchor.realtime_ns + at.monotonic_ns - anchor.monotonic_ns)
        self._last_log_ns = max(self._last_log_ns, log_ns)
        return self._last_log_ns

    def _close_chunk(self) -> None:
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._chunk_bytes = 0

    def _sync_if_due(self, at: ClockReading) -> None:
        waiting = self.written_bytes - self._file.synced_bytes
        if waiting and (at.monotonic_ns - self._synced_at_ns >= SYNC_NS or waiting >= SYNC_BYTES):
            self.sync(at)
