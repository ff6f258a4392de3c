"""Write one segment of a flight.

While in work, the file is `NAME.mcap.part`. It gets that name once its head and the first checkpoint are on the disk.
Before, it is `NAME.mcap.begun`, which contains no picture and is removed at the next start. So a power cut never leaves
a file in work that does not say which recording it belongs to and who wrote it. Its layout:

    header        profile `flight`, our library string
    metadata      `session`, then `attachments` (name to SHA-256)
    attachments   panel.yaml, its pictures, camera.yaml, recorder.yaml
    chunk         all schemas and channels, and the camera's status
    metadata      `checkpoint`, if the box has a key                         <- synced before it is named
    chunk ...     whole pictures: the record and the image of a frame are always in one chunk
    metadata ...  `checkpoint` after each chunk
    metadata      `end` with the reason
    summary

We close chunks ourselves, since the MCAP library might close one between a frame's two messages. A chunk and its
checkpoint are written one right after the other and synced together: everything reported as stored is also proven.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import IO, cast

from mcap.writer import CompressionType, Writer

from flight_file.files import DurableFile, refuse_existing
from flight_file.frame import CameraStatus, ClockReading, Frame, Health, LogClock, LogLine, storable
from flight_file.messages import (
    FIX_TOPIC,
    FRAME_TOPIC,
    HEALTH_TOPIC,
    LATE_TOPICS,
    LOG_TOPIC,
    PROFILE,
    STATUS_TOPIC,
    TOPICS,
    Topic,
    encode_frame,
    encode_health,
    encode_image,
    encode_log,
    encode_status,
    picture_topic,
)
from flight_file.session import (
    ATTACHMENTS_RECORD,
    BEGUN_SUFFIX,
    CHECKPOINT_RECORD,
    DIGEST_KEY,
    END_RECORD,
    PART_SUFFIX,
    SESSION_RECORD,
    EndRecord,
    Session,
    end_to_metadata,
    first_value,
    sealed,
    sealed_frame,
    session_to_metadata,
    start_of_segment,
)
from flight_file.signature import Signer, checkpoint, write_signature
from flight_file.thresholds import CHUNK_BYTES, MAX_READ_BYTES, SYNC_BYTES, SYNC_NS
from flight_file.video.positions import encode_fix
from flight_file.video.sound import encode_sound, sound_topic

LIBRARY = f"image-flight-recorder/{version('image-flight-recorder')}"
_NEVER_CLOSE_A_CHUNK = 2**62
_MEDIA_TYPES = {
    ".yaml": "application/yaml",
    ".yml": "application/yaml",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
    ".png": "image/png",
    ".webp": "image/webp",
}


def packed_head(
    file: DurableFile,
    *,
    session: Mapping[str, str],
    attachment_digests: Mapping[str, str],
    attachments: Mapping[str, bytes],
    log_ns: int,
) -> Writer:
    """Write everything before the chunks; return the writer for the rest.

    Parameters
    ----------
    session, attachment_digests
        The two metadata records, sealed.
    attachments
        Content by name.
    log_ns
        Log time of the attachments.

    Raises
    ------
    FlightNotWrittenError
        If the disk fails.
    """
    writer = Writer(
        cast("IO[bytes]", file),
        chunk_size=_NEVER_CLOSE_A_CHUNK,
        compression=CompressionType.NONE,
        enable_crcs=True,
        enable_data_crcs=True,
    )
    writer.start(profile=PROFILE, library=LIBRARY)
    writer.add_metadata(SESSION_RECORD, dict(session))
    writer.add_metadata(ATTACHMENTS_RECORD, dict(attachment_digests))
    for name, content in attachments.items():
        media_type = _MEDIA_TYPES.get(Path(name).suffix.lower(), "application/octet-stream")
        writer.add_attachment(create_time=0, log_time=log_ns, name=name, media_type=media_type, data=content)
    return writer


def registered_topics(writer: Writer) -> dict[str, int]:
    """Put the schemas and channels that every file has into the open chunk; return channel ids by topic."""
    return {topic.name: _registered(writer, topic) for topic in TOPICS if topic.name not in LATE_TOPICS}


def register_late(writer: Writer, channels: dict[str, int], name: str) -> None:
    """Put schemas and channels up to this late topic into the open chunk, unless that is done.

    So channels have the ids that a reader assumes if the chunk that defines them is lost.
    """
    if name in LATE_TOPICS and name not in channels:
        for topic in TOPICS:
            if topic.name not in channels:
                channels[topic.name] = _registered(writer, topic)
            if topic.name == name:
                return


def _registered(writer: Writer, topic: Topic) -> int:
    schema_id = writer.register_schema(topic.schema_name, topic.schema_encoding, topic.schema)
    return writer.register_channel(topic.name, topic.message_encoding, schema_id)


@dataclass(frozen=True, slots=True)
class Remains:
    """The remains of a segment that could not be continued, and where the next one continues.

    Attributes
    ----------
    file
        The file in work, with the data that are certain to be on the disk; closed, unless its name was taken away. None
        if it was finished, or if only its head was on the disk and the file could be removed.
    segment
        Number of the next segment.
    chain
        Value from which the next segment continues.
    frames
        Number of frames on the disk for certain.
    """

    file: DurableFile | None
    segment: int
    chain: str
    frames: int = 0


class SegmentWriter:
    """One segment in work.

    Parameters
    ----------
    path
        Final path, `....mcap`; the file is written beside it with `.part` appended.
    session
        The segment's statements about itself; its `started` anchors the log times. Without a `chain` to continue, the
        segment is the first of its recording.
    status
        The camera's state at this moment.
    attachments
        Content by name.
    signer
        Signs each chunk with everything before it, in the file, and the finished file, in a file beside it; None for no
        signatures.
    log_clock
        Of the recording; None for the first segment of one.

    Attributes
    ----------
    chain
        Value of the chain after the last frame; the next segment continues from it.
    unsynced
        Number of frames and reports, counted from the last, not on the disk for certain.

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
        self._synced_frames = 0
        self._synced_chain = self.chain
        self._given_chain = session.chain
        self._log_clock = log_clock or LogClock()
        self._log_clock.begin_segment(session.started)
        self._chunk_bytes = 0
        self._synced_at_ns = session.started.monotonic_ns
        self._signer = signer
        self._file = DurableFile(path.with_name(path.name + BEGUN_SUFFIX), digested=signer is not None)
        try:
            self._writer = self._start(attachments)
            self._channels = registered_topics(self._writer)
            self.write_status(status, session.started)
            self.sync(session.started)
            self._synced = 0
            self._file.rename(path.with_name(path.name + PART_SUFFIX))
        except BaseException:
            self._file.discard()  # nothing is in it yet, and retries must not litter the disk
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
            log_ns=storable(self.session.started.realtime_ns),
        )

    @property
    def written_bytes(self) -> int:
        """Size of the file, including what waits to be written, bytes."""
        return self._file.tell() + self._chunk_bytes

    def write_frame(self, frame: Frame, at: ClockReading) -> None:
        """Store a frame that arrived at this time, and the positions and the sound that came with it.

        Parameters
        ----------
        frame
            Its host times may be of another boot (a replayed flight): they are stored, not used. One with an
            `objection` would be a loss to every reader.
        at
            The recorder's clocks; a frame's log time follows the monotonic one and never goes back (see `LogClock`).
        """
        self.unsynced += 1  # first, since whatever fails below leaves this frame unsynced
        if self._chunk_bytes + len(frame.encoded) > MAX_READ_BYTES:
            self._close_chunk()
        log_ns = self._log_clock.time_ns(at)
        publish_ns = storable(frame.captured_ns)
        number = frame.sequence & 0xFFFFFFFF
        record, self.chain = sealed_frame(encode_frame(frame), self.chain)
        register_late(self._writer, self._channels, picture_topic(frame))
        self._add(FRAME_TOPIC, record, log_ns, publish_ns, number)
        self._add(picture_topic(frame), encode_image(frame), log_ns, publish_ns, number)
        for fix in frame.fixes:
            register_late(self._writer, self._channels, FIX_TOPIC)
            self._add(FIX_TOPIC, encode_fix(fix), log_ns, storable(fix.captured_ns), 0)
        for sound in frame.sound:
            register_late(self._writer, self._channels, sound_topic(sound))
            self._add(sound_topic(sound), encode_sound(sound), log_ns, storable(sound.time_ns), 0)
        self.frames += 1
        if self._chunk_bytes >= CHUNK_BYTES:
            self._close_chunk()
        self._sync_if_due(at)

    def write_status(self, status: CameraStatus, at: ClockReading) -> None:
        """Store a change of the camera's state."""
        self._report(STATUS_TOPIC, lambda: encode_status(status, at), at)

    def write_health(self, health: Health, at: ClockReading) -> None:
        """Store a health report."""
        self._report(HEALTH_TOPIC, lambda: encode_health(health, at), at)

    def write_log(self, line: LogLine, at: ClockReading) -> None:
        """Store a log line."""
        self._report(LOG_TOPIC, lambda: encode_log(line, at), at)

    def tick(self, at: ClockReading) -> None:
        """Sync if it is time; call it about every second while no frames come."""
        self._sync_if_due(at)

    def sync(self, at: ClockReading) -> None:
        """Close the open chunk and return when everything written so far is on the disk."""
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
        self._file.refuse_gone()
        self._file.rename(self.path)
        self._file.close()  # only now: closing releases the lock that keeps others from recovering the file in work
        return self.path

    def abandon(self) -> None:
        """Close the file as it is, under its name in work; for use after an error."""
        self._file.close()

    def remains(self) -> Remains:
        """Close the file as it is; the next writer writes again whatever is not certain to be on the disk."""
        if self.has_final_name:
            # Its name becomes durable with that of the next segment, which is in the same directory.
            self._file.close()
            return Remains(None, self.session.segment + 1, self.chain)
        if not self._synced and self._file.discard():
            return Remains(None, self.session.segment, self._given_chain)
        if not self._file.is_gone:
            self._file.close()
        return Remains(self._file, self.session.segment + 1, self._synced_chain, self._synced_frames)

    @property
    def has_final_name(self) -> bool:
        """Whether it is complete under its final name, even if the disk did not confirm that the name is durable."""
        return self._file.path == self.path

    @property
    def is_gone(self) -> bool:
        """Whether the file in work was deleted, renamed or replaced."""
        return self._file.is_gone

    def refuse_gone(self) -> None:
        """Raise FlightNotWrittenError if it is gone."""
        self._file.refuse_gone()

    def _note_synced(self) -> None:
        self._synced += self.unsynced
        self._synced_frames = self.frames
        self.unsynced = 0
        self._synced_chain = self.chain

    def _report(self, topic: str, encode: Callable[[], bytes], at: ClockReading) -> None:
        self.unsynced += 1
        log_ns = self._log_clock.time_ns(at)
        self._add(topic, encode(), log_ns, log_ns, 0)
        self._sync_if_due(at)

    def _add(self, topic: str, data: bytes, log_ns: int, publish_ns: int, number: int) -> None:
        self._writer.add_message(
            self._channels[topic], log_time=log_ns, data=data, publish_time=publish_ns, sequence=number
        )
        self._chunk_bytes += len(data)

    def _close_chunk(self) -> None:
        written = self._file.tell()
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._chunk_bytes = 0
        if self._signer is not None and self._file.tell() > written:
            record = checkpoint(self._file.tell(), self._file.sha256, self._signer)
            self._writer.add_metadata(CHECKPOINT_RECORD, record)

    def _sync_if_due(self, at: ClockReading) -> None:
        waiting = self.written_bytes - self._file.synced_bytes
        if waiting and (at.monotonic_ns - self._synced_at_ns >= SYNC_NS or waiting >= SYNC_BYTES):
            self.sync(at)
