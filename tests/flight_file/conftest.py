"""Small flights to write, damage and read."""

from __future__ import annotations

import hashlib
import random
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pytest

from flight_file.flight_writer import FlightWriter, Plan
from flight_file.frame import CameraStatus, ClockReading, Exif, Frame, HostTimes
from flight_file.session import Session
from flight_file.signature import Signer

START_NS = 1_525_435_200_000_000_000
SECOND_NS = 1_000_000_000

MAGIC_BYTES, HEAD_BYTES = 8, 9
NEAR_BYTES = 56  # a chunk's own fields and its first record's head are no longer
STRIDE = 17  # no multiple of any field's length

MakeFrame = Callable[..., Frame]
WriteFlight = Callable[..., list[Path]]


@pytest.fixture
def make_frame() -> MakeFrame:
    """A frame by its number: one a second, a JPEG of this many seeded bytes."""

    def make(sequence: int, size: int = 200) -> Frame:
        jpeg = random.Random(sequence).randbytes(size)  # noqa: S311 - content for a test
        reading = ClockReading(START_NS + sequence * SECOND_NS, sequence * SECOND_NS)
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

    return make


@pytest.fixture
def write_flight() -> WriteFlight:
    """Write frames as a flight, two seconds apart and each in a chunk of its own; gives its finished files."""

    def write(
        directory: Path,
        frames: Sequence[Frame],
        *,
        recording: str = "flight",
        attachments: Mapping[str, bytes] | None = None,
        frames_per_segment: int = 1000,
        signer: Signer | None = None,
    ) -> list[Path]:
        def later(seconds: int) -> ClockReading:
            return ClockReading(START_NS + seconds * SECOND_NS, seconds * SECOND_NS)

        readings = [later(2 * index) for index in range(len(frames))]
        segment_ns = 2 * frames_per_segment * SECOND_NS
        plan = Plan(directory, Session(recording), attachments or {}, segment_ns, signer=signer)
        writer = FlightWriter(plan, status=CameraStatus("connected"), at=later(0))
        for frame, at in zip(frames, readings, strict=True):
            writer.write_frame(frame, at)
            writer.tick(ClockReading(at.realtime_ns + SECOND_NS, at.monotonic_ns + SECOND_NS))
        return writer.finish("stopped", later(2 * len(frames)))

    return write


@pytest.fixture
def frames(make_frame: MakeFrame) -> list[Frame]:
    """Six frames, one a second, each in a chunk of its own."""
    return [make_frame(sequence) for sequence in range(6)]


@pytest.fixture
def flight(tmp_path: Path, frames: list[Frame], write_flight: WriteFlight) -> Path:
    """A finished flight of one file with the six frames and two attachments."""
    (path,) = write_flight(
        tmp_path, frames, attachments={"panel.yaml": b"name: F-16\n", "panel.jpg": bytes(range(256))}
    )
    return path


@pytest.fixture(scope="session")
def telling_places() -> Callable[[bytes], list[int]]:
    """Where to damage a sound file so that nothing is left out.

    Every byte in and around the fields of every record; of what a record merely carries, whose bytes are all hit alike,
    every seventeenth.
    """

    def places(data: bytes) -> list[int]:
        borders, end = [MAGIC_BYTES], len(data) - MAGIC_BYTES
        while borders[-1] < end:
            length = int.from_bytes(data[borders[-1] + 1 : borders[-1] + HEAD_BYTES], "little")
            borders.append(borders[-1] + HEAD_BYTES + length)
        assert borders[-1] == end
        near = {place for border in borders for place in range(border - HEAD_BYTES, border + NEAR_BYTES)}
        return sorted(near.union(range(0, len(data), STRIDE)) & set(range(MAGIC_BYTES, len(data))))

    return places
