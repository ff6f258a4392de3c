"""The messages of a flight file as bytes: frames both ways, reports one way."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import msgspec
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.message import DecodeError

from flight_file import moments
from flight_file.frame import ClockReading, Exif, Frame
from flight_file.reports import CameraStatus, Health, LogLine
from flight_file.topics import FRAME_ID, IMAGE_FORMAT

_EXIF_FIELDS = ("focal_length_mm", "exposure_s", "f_number", "iso", "datetime")


class MalformedMessageError(ValueError):
    """A message whose bytes are whole but which is not what its topic promises; the reader turns it into a loss."""


@dataclass(frozen=True, slots=True)
class Image:
    """An `/camera/image` message."""

    captured_ns: int
    jpeg: bytes


def _json_bytes(document: dict[str, Any]) -> bytes:
    present = {key: value for key, value in document.items() if value is not None}
    return json.dumps(present, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()


def _time_or_none(time_ns: int | None) -> dict[str, int] | None:
    return None if time_ns is None else moments.to_json(time_ns)


def encode_image(frame: Frame) -> bytes:
    """The picture as foxglove.CompressedImage."""
    message = CompressedImage(data=frame.jpeg, format=IMAGE_FORMAT, frame_id=FRAME_ID)
    message.timestamp.seconds, message.timestamp.nanos = divmod(frame.captured_ns, moments.NS_PER_S)
    return message.SerializeToString(deterministic=True)


def decode_image(data: memoryview) -> Image:
    """Inverse of `encode_image`; raises MalformedMessageError."""
    try:
        message = CompressedImage.FromString(data)  # type: ignore[arg-type]  # takes any buffer, and copies once instead of twice
    except DecodeError as error:
        raise MalformedMessageError("a picture's message is not a foxglove.CompressedImage") from error
    stamp = message.timestamp
    return Image(captured_ns=stamp.seconds * moments.NS_PER_S + stamp.nanos, jpeg=message.data)


def encode_frame(frame: Frame) -> bytes:
    """Everything about the picture but its JPEG, as JSON."""
    exif = {name: getattr(frame.exif, name) for name in _EXIF_FIELDS}
    return _json_bytes(
        {
            "sequence": frame.sequence,
            "captured": moments.to_json(frame.captured_ns),
            "captured_sigma": _time_or_none(frame.captured_sigma_ns),
            "times": moments.host_times_to_json(frame.times),
            "exif": {name: value for name, value in exif.items() if value is not None},
            "zoom_position": frame.zoom_position,
            "width_px": frame.width_px,
            "height_px": frame.height_px,
            "size_bytes": len(frame.jpeg),
            "sha256": frame.sha256,
        }
    )


class _FrameRecord(msgspec.Struct, frozen=True):
    """What `encode_frame` writes, as far as it is asked for again."""

    sequence: int
    captured: moments.Moment
    sha256: str
    times: moments.HostClocks
    exif: Exif
    width_px: int | None = None
    height_px: int | None = None
    zoom_position: float | None = None
    captured_sigma: moments.Moment | None = None


class _Report(msgspec.Struct, frozen=True):
    """Of a camera status or a health report."""

    dropped: int


_FRAME_RECORD = msgspec.json.Decoder(_FrameRecord)
_REPORT = msgspec.json.Decoder(_Report)


def decode_frame(data: memoryview) -> Frame:
    """Inverse of `encode_frame`, with an empty `jpeg`; raises MalformedMessageError."""
    try:
        record = _FRAME_RECORD.decode(data)
    except (ValueError, RecursionError) as error:
        raise MalformedMessageError("a frame's record is not what /camera/frame promises") from error
    sigma = record.captured_sigma
    return Frame(
        sequence=record.sequence,
        captured_ns=record.captured.time_ns,
        jpeg=b"",
        sha256=record.sha256,
        times=record.times.times,
        exif=record.exif,
        width_px=record.width_px,
        height_px=record.height_px,
        zoom_position=record.zoom_position,
        captured_sigma_ns=None if sigma is None else sigma.time_ns,
    )


def decode_dropped(data: memoryview) -> int:
    """How many frames a camera status or health report says were not stored so far; raises MalformedMessageError."""
    try:
        return _REPORT.decode(data).dropped
    except (ValueError, RecursionError) as error:
        raise MalformedMessageError("a report is not what its topic promises") from error


def encode_status(status: CameraStatus, at: ClockReading) -> bytes:
    """A camera status as JSON."""
    return _json_bytes(
        {
            "clocks": moments.reading_to_json(at),
            "state": status.state,
            "reason": status.reason,
            "dropped": status.dropped,
            "sequence": status.sequence,
            "camera_clock_offset": _time_or_none(status.camera_clock_offset_ns),
            "camera_clock_sigma": _time_or_none(status.camera_clock_sigma_ns),
        }
    )


def encode_health(health: Health, at: ClockReading) -> bytes:
    """A health report as JSON."""
    return _json_bytes(
        {
            "clocks": moments.reading_to_json(at),
            "free_bytes": health.free_bytes,
            "frame_rate_hz": health.frame_rate_hz,
            "stored": health.stored,
            "dropped": health.dropped,
            "queued": health.queued,
            "drops_by_reason": dict(sorted(health.drops_by_reason.items())),
            "temperatures_c": dict(sorted(health.temperatures_c.items())),
            "clock": health.clock,
            "clock_offset": moments.to_json(health.clock_offset_ns),
        }
    )


def encode_log(line: LogLine, at: ClockReading) -> bytes:
    """A log line as foxglove.Log."""
    message = Log(level=Log.Level.Value(line.level.name), message=line.message, name=line.name)
    message.timestamp.seconds, message.timestamp.nanos = divmod(at.realtime_ns, moments.NS_PER_S)
    return message.SerializeToString(deterministic=True)
