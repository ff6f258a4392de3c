"""Flights of a fleet, made of the frames of a committed one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from flight_file.flight_writer import FlightWriter, Plan
from flight_file.frame import CameraStatus, ClockReading, Frame
from flight_file.reader import open_flight
from flight_file.session import Session
from tests.programs import A1

NS = 10**9
START_NS = 1_525_435_200 * NS


def write_flight(folder: Path, recording: str, frames: Sequence[Frame], *, per_segment: int = 1000) -> list[Path]:
    """Frames, four a second, as the finished segments of a recording with the animation's panel."""
    folder.mkdir(parents=True, exist_ok=True)

    def at(frame: int) -> ClockReading:
        return ClockReading(START_NS + frame * NS // 4, frame * NS // 4)

    plan = Plan(folder, Session(recording), panel(), segment_ns=per_segment * NS // 4)
    writer = FlightWriter(plan, status=CameraStatus("connected"), at=at(0))
    for number, frame in enumerate(frames):
        writer.write_frame(frame, at(number))
    return writer.finish("stopped", at(len(frames)))


def panel() -> dict[str, bytes]:
    """The attachments of the animation's flights."""
    return dict(open_flight([A1]).attachments)
