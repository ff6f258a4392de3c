"""Small flights to write, damage and read."""

from __future__ import annotations

import hashlib
import random
from collections.abc import Mapping, Sequence
from pathlib import Path

from flight_file.flight_writer import FlightWriter, Plan
from flight_file.frame import CameraStatus, ClockReading, Exif, Frame, HostTimes
from flight_file.records import ChunkPlace
from flight_file.scan import scan_file
from flight_file.segment import opened
from flight_file.session import Session
from flight_file.signature import Signer

START_NS = 1_525_435_200_000_000_000
SECOND_NS = 1_000_000_000

MAGIC_BYTES, HEAD_BYTES = 8, 9
NEAR_BYTES = 56  # a chunk's own fields and its first record's head are no longer
STRIDE = 17  # no multiple of any field's length


def after(seconds: float) -> ClockReading:
    """So long after the start."""
    elapsed_ns = int(seconds * SECOND_NS)
    return ClockReading(START_NS + elapsed_ns, elapsed_ns)


def make_frame(sequence: int, size: int = 200) -> Frame:
    """A frame by its number: one a second, a JPEG of this many seeded bytes."""
    jpeg = random.Random(sequence).randbytes(size)  # noqa: S311 - content for a test
    reading = after(sequence)
    return Frame(
        sequence=sequence,
        captured_ns=reading.realtime_ns,
        encoded=jpeg,
        sha256=hashlib.sha256(jpeg).hexdigest(),
        times=HostTimes(reading, reading, reading),
        exif=Exif(4.45, 0.01, 3.3, 100, "2018-05-04T12:00:00"),
        width_px=1024,
        height_px=768,
        zoom_position=0.0,
    )


def write_flight(
    directory: Path,
    frames: Sequence[Frame],
    *,
    recording: str = "flight",
    attachments: Mapping[str, bytes] | None = None,
    frames_per_segment: int = 1000,
    signer: Signer | None = None,
) -> list[Path]:
    """Write frames as a flight, two seconds apart and each in a chunk of its own; gives its finished files."""
    segment_ns = 2 * frames_per_segment * SECOND_NS
    plan = Plan(directory, Session(recording), attachments or {}, segment_ns, signer=signer)
    writer = FlightWriter(plan, status=CameraStatus("connected"), at=after(0))
    for index, frame in enumerate(frames):
        writer.write_frame(frame, after(2 * index))
        writer.tick(after(2 * index + 1))
    return writer.finish("stopped", after(2 * len(frames)))


def chunks(path: Path) -> list[ChunkPlace]:
    """Where the chunks of a sound file are; the first has no frame."""
    with opened(path) as source:
        return scan_file(path, source).chunks


def flipped(data: bytes, bit: int) -> bytes:
    """The same with one bit changed."""
    at = bit // 8
    return data[:at] + bytes([data[at] ^ 1 << bit % 8]) + data[at + 1 :]


def telling_places(data: bytes) -> list[int]:
    """Where to damage a sound file so that nothing is left out.

    Every byte in and around the fields of every record; of what a record merely carries, whose bytes are all hit alike,
    every seventeenth.
    """
    borders, end = [MAGIC_BYTES], len(data) - MAGIC_BYTES
    while borders[-1] < end:
        length = int.from_bytes(data[borders[-1] + 1 : borders[-1] + HEAD_BYTES], "little")
        borders.append(borders[-1] + HEAD_BYTES + length)
    assert borders[-1] == end
    near = {place for border in borders for place in range(border - HEAD_BYTES, border + NEAR_BYTES)}
    return sorted(near.union(range(0, len(data), STRIDE)) & set(range(MAGIC_BYTES, len(data))))
