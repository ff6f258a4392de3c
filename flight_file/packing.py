"""How a segment is packed: the same whether it is recorded, or put together again after a power cut."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import IO, cast

from mcap.writer import CompressionType, Writer

from flight_file.durable_file import DurableFile
from flight_file.session import ATTACHMENTS_RECORD, SESSION_RECORD
from flight_file.topics import PROFILE, TOPICS

LIBRARY = f"image-flight-recorder/{version('image-flight-recorder')}"

_NEVER_CLOSE_A_CHUNK = 2**62
_MEDIA_TYPES = {
    ".yaml": "application/yaml",
    ".yml": "application/yaml",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
    ".png": "image/png",
}


def packed_head(
    file: DurableFile,
    *,
    session: Mapping[str, str],
    attachment_digests: Mapping[str, str],
    attachments: Mapping[str, bytes],
    log_ns: int,
) -> Writer:
    """Write all that stands before the chunks; gives the writer for the rest.

    Parameters
    ----------
    session, attachment_digests
        The two metadata records, sealed.
    attachments
        Content by name.
    log_ns
        What the attachments say they were recorded at.

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
    """Put all schemas and channels into the chunk that is open; gives channel ids by topic."""
    channels = {}
    for topic in TOPICS:
        schema_id = writer.register_schema(topic.schema_name, topic.schema_encoding, topic.schema)
        channels[topic.name] = writer.register_channel(topic.name, topic.message_encoding, schema_id)
    return channels
