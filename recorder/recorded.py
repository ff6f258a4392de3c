"""What may be recorded, and how each kind of it is written."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from flight_file.frame import ClockReading, Frame
from flight_file.reports import CameraStatus, Health, LogLine
from flight_file.segments import FlightWriter


@dataclass(frozen=True, slots=True)
class Remark:
    """Something that happened and is worth a line in the flight; the camera's state does not change by it."""

    status: CameraStatus


Recorded = Frame | CameraStatus | Remark | Health | LogLine

_WRITE: Mapping[type, Callable[[FlightWriter, Any, ClockReading], None]] = {
    Frame: FlightWriter.write_frame,
    CameraStatus: FlightWriter.write_status,
    Remark: lambda writer, remark, at: writer.write_remark(remark.status, at),
    Health: FlightWriter.write_health,
    LogLine: FlightWriter.write_log,
}


def write(writer: FlightWriter, what: Recorded, at: ClockReading) -> None:
    """Write it as what it is; raises FlightNotWrittenError."""
    _WRITE[type(what)](writer, what, at)
