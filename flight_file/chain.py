"""The chain: one value that depends on every frame recorded so far, and on the order they came in.

A value is a SHA-256, written as 64 hexadecimal digits. Each comes from the one before and from something that was
recorded:

    link(before, content) = SHA-256(the digits of `before` as ASCII, then `content`)

| value                | before                    | content                                                         |
| -------------------- | ------------------------- | --------------------------------------------------------------- |
| first of a recording | nothing                   | `flight chain 1` and the recording's identity: `first_value`    |
| start of a segment   | end of the segment before | digits of the digests of its `session`, `attachments` records   |
| after a frame        | after the frame before    | the frame's record up to its last member, `chain`               |

The content of a frame is the bytes that stand in the file: nobody has to agree on how JSON is written. It holds the
SHA-256 of the picture, the sequence number, all times and the EXIF, so all of these are chained.
"""

from __future__ import annotations

import hashlib
import re

from flight_file.session import Session

_MEMBER = b',"chain":"%s"}'
_SEALED = re.compile(rb'(?P<content>\{.*),"chain":"(?P<value>[0-9a-f]{64})"\}', re.DOTALL)


def link(before: str, content: bytes) -> str:
    """The value that follows when `content` was recorded after the value `before`."""
    return hashlib.sha256(before.encode() + content).hexdigest()


def first_value(session: Session) -> str:
    """Where the chain of a recording begins: the SHA-256 of six lines, each ended by a line feed.

    Parameters
    ----------
    session
        Of the recording's first segment.
    """
    started = session.started
    identity = (session.recording, started.realtime_ns, started.monotonic_ns, session.boot_id, session.host)
    return link("", "".join(f"{line}\n" for line in ("flight chain 1", *identity)).encode())


def start_of_segment(before: str, session_digest: str, attachments_digest: str) -> str:
    """The value before a segment's first frame.

    Parameters
    ----------
    before
        The value that the segment before ended with; `first_value` for the first segment.
    session_digest, attachments_digest
        What the two metadata records say their items' digests are, hexadecimal.
    """
    return link(before, (session_digest + attachments_digest).encode("ascii"))


def sealed_frame(record: bytes, before: str) -> tuple[bytes, str]:
    """A frame's record with its value in the chain, and that value.

    Parameters
    ----------
    record
        A JSON object that has members.
    """
    content = record[:-1]
    value = link(before, content)
    return content + _MEMBER % value.encode("ascii"), value


def opened_frame(record: bytes) -> tuple[bytes, str]:
    """The content of a frame's record, and the value that it states; the value is empty if it states none."""
    match = _SEALED.fullmatch(record)
    return (match["content"], match["value"].decode("ascii")) if match else (record, "")
