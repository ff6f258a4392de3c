"""The messages of a flight file: topics and schemas, and frames and reports as bytes.

The order of `TOPICS` is part of the format: our writer registers the channels in this order, so their ids are 1 to 9 in
each of our files; files that do not need the last ones leave them out. MCAP keeps the channel records only in the chunk
in which they come first; if this chunk is lost, a reader uses this table.

Times in JSON are `{"sec": ..., "nsec": ...}`, Foxglove's form, exact in languages whose numbers are doubles.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import msgspec
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.message import DecodeError
from mcap_protobuf.schema import build_file_descriptor_set

from flight_file.frame import (
    JPEG,
    MAX_TIME_NS,
    NS_PER_S,
    VIDEO_FORMATS,
    CameraStatus,
    ClockReading,
    Exif,
    Frame,
    Health,
    HostTimes,
    LogLine,
    Origin,
)
from flight_file.untrusted import encodable

IMAGE_TOPIC = "/camera/image"
FRAME_TOPIC = "/camera/frame"
STATUS_TOPIC = "/camera/status"
HEALTH_TOPIC = "/recorder/health"
LOG_TOPIC = "/recorder/log"
VIDEO_TOPIC = "/camera/video"
FIX_TOPIC = "/gps/fix"
PEAKS_TOPIC = "/sound/peaks"
PACKET_TOPIC = "/sound/packet"
SOUND_TOPICS = frozenset({PEAKS_TOPIC, PACKET_TOPIC})
LATE_TOPICS = (VIDEO_TOPIC, FIX_TOPIC, PEAKS_TOPIC, PACKET_TOPIC)
"""They stand in a file only if it has such messages."""
PICTURE_TOPICS = frozenset({IMAGE_TOPIC, VIDEO_TOPIC})
"""A frame's picture is on one of them."""
PROFILE = "flight"
FRAME_ID = "camera"
MAX_TIME_S = MAX_TIME_NS // NS_PER_S - 1
_EXIF_FIELDS = ("focal_length_mm", "exposure_s", "f_number", "iso", "datetime")
Whole = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]


@dataclass(frozen=True, slots=True)
class Topic:
    """One channel of a flight file and the schema of its messages."""

    name: str
    message_encoding: str
    schema_name: str
    schema_encoding: str
    schema: bytes


def _number(description: str, *, kind: str = "number") -> dict[str, Any]:
    return {"type": kind, "description": description}


def _numbers(description: str) -> dict[str, Any]:
    return {"type": "array", "items": {"type": "number"}, "description": description}


def _text(description: str) -> dict[str, Any]:
    return {"type": "string", "description": description}


def _time(description: str) -> dict[str, Any]:
    return {
        "type": "object",
        "description": description,
        "properties": {"sec": _number("s", kind="integer"), "nsec": _number("ns, 0 to 999999999", kind="integer")},
        "required": ["sec", "nsec"],
    }


def _clocks(description: str) -> dict[str, Any]:
    return {
        "type": "object",
        "description": description,
        "properties": {
            "realtime": _time("UTC since the Unix epoch; may jump"),
            "monotonic": _time("time since an unknown start; never runs back within one boot"),
        },
        "required": ["realtime", "monotonic"],
    }


def _schema(title: str, required: list[str], properties: dict[str, Any]) -> bytes:
    document = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": title,
        "type": "object",
        "properties": properties,
        "required": required,
    }
    return json.dumps(document, sort_keys=True, separators=(",", ":")).encode()


_EXIF = {
    "type": "object",
    "description": "what the picture's EXIF says; a tag that it lacks is absent",
    "properties": {
        "focal_length_mm": _number("focal length, mm"),
        "exposure_s": _number("exposure time, s"),
        "f_number": _number("aperture, f-number"),
        "iso": _number("sensitivity, ISO", kind="integer"),
        "datetime": _text(
            "time of exposure by the camera's clock, ISO 8601, with an offset only if the picture gives one"
        ),
    },
}


_TIMES = {
    "type": "object",
    "description": "the recorder's clocks while it got the picture",
    "properties": {
        "before_request": _clocks("before the picture was asked for"),
        "after_answer": _clocks("after the camera answered"),
        "downloaded": _clocks("after the picture had arrived whole"),
    },
    "required": ["before_request", "after_answer", "downloaded"],
}


_ORIGIN = {
    "type": "object",
    "description": "where a picture of a video file stood in it",
    "properties": {
        "file": _number("which of the originals that the session record names, from 0", kind="integer"),
        "time": _time("its presentation time in that file; sec may be negative"),
        "sha256": _text("SHA-256 of the packet as it came from the file, hexadecimal"),
    },
    "required": ["file", "time", "sha256"],
}


_FRAME_SCHEMA = _schema(
    "flight.Frame",
    ["sequence", "captured", "times", "exif", "size_bytes", "sha256"],
    {
        "sequence": _number(
            "counts the frames of the recording from 0; a gap is a frame that was not stored", kind="integer"
        ),
        "captured": _time("best estimate of mid-exposure, UTC"),
        "captured_sigma": _time("standard deviation of captured"),
        "times": _TIMES,
        "exif": _EXIF,
        "zoom_position": _number("the camera's zoom position, 0 (wide) to 100 (tele) percent"),
        "width_px": _number("width of the picture, px, before any EXIF orientation or rotation", kind="integer"),
        "height_px": _number("height of the picture, px, before any EXIF orientation or rotation", kind="integer"),
        "format": _text("png, webp, h264 or h265; absent for a JPEG"),
        "rotation_deg": _number(
            "by how much a video's pictures are to be turned clockwise: 90, 180 or 270", kind="integer"
        ),
        "origin": _ORIGIN,
        "readout_s": _number("time from the sensor's first row to its last, s"),
        "size_bytes": _number("size of the picture as it is stored, bytes", kind="integer"),
        "sha256": _text("SHA-256 of the picture as it is stored, hexadecimal"),
        "chain": _text("SHA-256 over the chain value before and this record up to here, hexadecimal; the last member"),
    },
)


_STATUS_SCHEMA = _schema(
    "flight.CameraStatus",
    ["clocks", "state", "reason", "dropped"],
    {
        "clocks": _clocks("when it was noticed"),
        "state": _text("what the camera does now, e.g. connected, lost, finished"),
        "reason": _text("why, in words"),
        "dropped": _number("frames taken but not stored since the recording began", kind="integer"),
        "sequence": _number("the frame this is about", kind="integer"),
        "camera_clock_offset": _time("the camera's clock, as it stands in EXIF, minus UTC; sec may be negative"),
        "camera_clock_sigma": _time("standard deviation of camera_clock_offset"),
    },
)


_HEALTH_SCHEMA = _schema(
    "flight.Health",
    ["clocks", "frame_rate_hz", "stored", "dropped", "clock", "clock_offset"],
    {
        "clocks": _clocks("when it was measured"),
        "free_bytes": _number("room left where the recordings lie, bytes", kind="integer"),
        "frame_rate_hz": _number("frames stored per second since the message before, Hz"),
        "stored": _number("frames stored since the recording began", kind="integer"),
        "dropped": _number("frames taken but not stored since the recording began", kind="integer"),
        "queued": _number("frames that wait to be written", kind="integer"),
        "drops_by_reason": {
            "type": "object",
            "description": "dropped, split by reason",
            "additionalProperties": _number("frames", kind="integer"),
        },
        "temperatures_c": {
            "type": "object",
            "description": "by sensor",
            "additionalProperties": _number("degrees Celsius"),
        },
        "clock": _text("system, or simulated for a replay that runs as fast as possible"),
        "clock_offset": _time("realtime minus monotonic clock; constant unless somebody sets the clock"),
    },
)


# Foxglove's map shows messages of this name with its fields, and ignores further ones.
_FIX_SCHEMA = _schema(
    "foxglove.LocationFix",
    ["timestamp", "frame_id", "position_covariance_type", "fix", "file", "time"],
    {
        "timestamp": _time("when, by the frames' clock"),
        "frame_id": _text("gps"),
        "latitude": _number("degrees north, WGS 84; absent without a fix"),
        "longitude": _number("degrees east, WGS 84; absent without a fix"),
        "altitude": _number("m, as the receiver has it, above the ellipsoid or the sea; absent without a 3D fix"),
        "position_covariance_type": _number("0: not known", kind="integer"),
        "fix": _number("0 none, 2 without altitude, 3 with altitude", kind="integer"),
        "speed_mps": _number("speed over ground, m/s"),
        "speed_3d_mps": _number("speed in space, m/s"),
        "dop": _number("dilution of precision; below 5 is good"),
        "gps_time": _time("the receiver's own time, UTC; it need not agree with timestamp"),
        "file": _number("which of the originals that the session record names, from 0", kind="integer"),
        "time": _time("when in that file; sec may be negative"),
    },
)


_PEAKS_SCHEMA = _schema(
    "flight.SoundPeaks",
    ["time", "window_s", "frequencies_hz", "levels_db", "above_db"],
    {
        "time": _time("the middle of the window, by the frames' clock"),
        "window_s": _number("length of the window, s"),
        "frequencies_hz": _numbers("the strongest peaks of its spectrum, Hz, rising"),
        "levels_db": _numbers("of each peak: its level as a tone, dB relative to a full-scale sine"),
        "above_db": _numbers("of each peak: its level above the spectrum around it, dB"),
    },
)


_PACKET_SCHEMA = _schema(
    "flight.SoundPacket",
    ["time", "codec", "sample_rate_hz", "channels", "data"],
    {
        "time": _time("when the packet begins, by the frames' clock"),
        "codec": _text("what FFmpeg calls it, such as aac"),
        "sample_rate_hz": _number("samples a second", kind="integer"),
        "channels": _number("how many", kind="integer"),
        "header": _text("what a decoder needs before the first packet (FFmpeg's extradata), base64; absent if nothing"),
        "data": _text("the packet, byte for byte as it came from the file, base64"),
    },
)


def _protobuf(name: str, message: type[CompressedImage | CompressedVideo | Log]) -> Topic:
    descriptors = build_file_descriptor_set(message).SerializeToString(deterministic=True)
    return Topic(name, "protobuf", message.DESCRIPTOR.full_name, "protobuf", descriptors)


def _json(name: str, schema_name: str, schema: bytes) -> Topic:
    return Topic(name, "json", schema_name, "jsonschema", schema)


TOPICS: tuple[Topic, ...] = (
    _protobuf(IMAGE_TOPIC, CompressedImage),
    _json(FRAME_TOPIC, "flight.Frame", _FRAME_SCHEMA),
    _json(STATUS_TOPIC, "flight.CameraStatus", _STATUS_SCHEMA),
    _json(HEALTH_TOPIC, "flight.Health", _HEALTH_SCHEMA),
    _protobuf(LOG_TOPIC, Log),
    _protobuf(VIDEO_TOPIC, CompressedVideo),
    _json(FIX_TOPIC, "foxglove.LocationFix", _FIX_SCHEMA),
    _json(PEAKS_TOPIC, "flight.SoundPeaks", _PEAKS_SCHEMA),
    _json(PACKET_TOPIC, "flight.SoundPacket", _PACKET_SCHEMA),
)


CHANNEL_TOPICS: dict[int, str] = {number: topic.name for number, topic in enumerate(TOPICS, start=1)}
"""Topic by channel id, in every file that our writer made."""


def to_json(time_ns: int) -> dict[str, int]:
    """Nanoseconds as `{"sec", "nsec"}`, 0 <= nsec < 10**9, clipped to what a reader takes (see `Moment`)."""
    seconds, nanoseconds = divmod(min(max(time_ns, -MAX_TIME_S * NS_PER_S), MAX_TIME_S * NS_PER_S), NS_PER_S)
    return {"sec": seconds, "nsec": nanoseconds}


class Moment(msgspec.Struct, frozen=True):
    """Inverse of `to_json`."""

    sec: Annotated[int, msgspec.Meta(ge=-MAX_TIME_S, le=MAX_TIME_S)]
    nsec: Annotated[int, msgspec.Meta(ge=0, lt=NS_PER_S)]

    @property
    def time_ns(self) -> int:
        """Nanoseconds."""
        return self.sec * NS_PER_S + self.nsec


def reading_to_json(reading: ClockReading) -> dict[str, dict[str, int]]:
    """Convert both clocks."""
    return {"realtime": to_json(reading.realtime_ns), "monotonic": to_json(reading.monotonic_ns)}


class Clocks(msgspec.Struct, frozen=True):
    """Inverse of `reading_to_json`."""

    realtime: Moment
    monotonic: Moment

    @property
    def reading(self) -> ClockReading:
        """Both readings."""
        return ClockReading(self.realtime.time_ns, self.monotonic.time_ns)


def host_times_to_json(times: HostTimes) -> dict[str, dict[str, dict[str, int]]]:
    """Convert the three readings of a frame."""
    return {
        "before_request": reading_to_json(times.before_request),
        "after_answer": reading_to_json(times.after_answer),
        "downloaded": reading_to_json(times.downloaded),
    }


class HostClocks(msgspec.Struct, frozen=True):
    """Inverse of `host_times_to_json`."""

    before_request: Clocks
    after_answer: Clocks
    downloaded: Clocks

    @property
    def times(self) -> HostTimes:
        """Convert the three readings of a frame."""
        return HostTimes(self.before_request.reading, self.after_answer.reading, self.downloaded.reading)


class MalformedMessageError(ValueError):
    """A message whose bytes are whole but do not fit its topic; the reader turns it into a loss."""


@dataclass(frozen=True, slots=True)
class Image:
    """A message of `/camera/image` or `/camera/video`."""

    captured_ns: int
    encoded: bytes


def json_bytes(document: dict[str, Any]) -> bytes:
    """Encode a document, leaving out fields that are None; text that UTF-8 cannot encode becomes a question mark."""
    present = {key: value for key, value in document.items() if value is not None}
    return json.dumps(present, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode(errors="replace")


def time_or_none(time_ns: int | None) -> dict[str, int] | None:
    """Convert a time that may be unknown."""
    return None if time_ns is None else to_json(time_ns)


def _captured_ns(frame: Frame) -> int:
    """Clip a frame's time to the range that a reader accepts; a wall clock at 1970 may give an earlier one."""
    return min(max(frame.captured_ns, 0), MAX_TIME_S * NS_PER_S)


def picture_topic(frame: Frame) -> str:
    """Return the topic of a frame's picture."""
    return VIDEO_TOPIC if frame.format in VIDEO_FORMATS else IMAGE_TOPIC


def encode_image(frame: Frame) -> bytes:
    """Encode the picture as foxglove.CompressedImage, or as foxglove.CompressedVideo if it is one of a video."""
    kind = CompressedVideo if frame.format in VIDEO_FORMATS else CompressedImage
    message = kind(data=frame.encoded, format=frame.format, frame_id=FRAME_ID)
    message.timestamp.seconds, message.timestamp.nanos = divmod(_captured_ns(frame), NS_PER_S)
    return message.SerializeToString(deterministic=True)


def decode_image(data: memoryview, topic: str = IMAGE_TOPIC) -> Image:
    """Decode what `encode_image` encodes; raises MalformedMessageError."""
    kind = CompressedVideo if topic == VIDEO_TOPIC else CompressedImage
    try:
        message = kind.FromString(data)  # type: ignore[arg-type]  # takes any buffer, and copies once instead of twice
    except DecodeError as error:
        raise MalformedMessageError(f"a picture's message is not a {kind.DESCRIPTOR.full_name}") from error
    stamp = message.timestamp
    captured_ns = stamp.seconds * NS_PER_S + stamp.nanos
    if not 0 <= captured_ns <= MAX_TIME_NS:
        raise MalformedMessageError("a picture's message has a time that no flight is at")
    return Image(captured_ns=captured_ns, encoded=message.data)


def encode_frame(frame: Frame) -> bytes:
    """Encode everything about the picture except the picture itself, as JSON."""
    origin = frame.origin
    exif = {name: getattr(frame.exif, name) for name in _EXIF_FIELDS}
    return json_bytes(
        {
            "sequence": frame.sequence,
            "captured": to_json(_captured_ns(frame)),
            "captured_sigma": time_or_none(frame.captured_sigma_ns),
            "times": host_times_to_json(frame.times),
            "exif": {name: value for name, value in exif.items() if value is not None},
            "zoom_position": frame.zoom_position,
            "width_px": frame.width_px,
            "height_px": frame.height_px,
            "format": None if frame.format == JPEG else frame.format,
            "rotation_deg": frame.rotation_deg or None,
            "origin": None
            if origin is None
            else {"file": origin.file, "time": to_json(origin.time_ns), "sha256": origin.sha256},
            "readout_s": frame.readout_s,
            "size_bytes": len(frame.encoded),
            "sha256": frame.sha256,
        }
    )


class _OriginRecord(msgspec.Struct, frozen=True):
    """Where a video's picture came from."""

    file: Whole
    time: Moment
    sha256: str


class _FrameRecord(msgspec.Struct, frozen=True):
    """The fields written by `encode_frame` that are read again."""

    sequence: Whole
    captured: Moment
    sha256: str
    times: HostClocks
    exif: Exif
    width_px: Whole | None = None
    height_px: Whole | None = None
    zoom_position: float | None = None
    captured_sigma: Moment | None = None
    format: Literal["jpeg", "png", "webp", "h264", "h265"] = "jpeg"
    rotation_deg: Literal[0, 90, 180, 270] = 0
    origin: _OriginRecord | None = None
    readout_s: float | None = None


class _Report(msgspec.Struct, frozen=True):
    """The fields read of a camera status or a health report."""

    dropped: Whole


_FRAME_RECORD = msgspec.json.Decoder(_FrameRecord)


_REPORT = msgspec.json.Decoder(_Report)


def decode_frame(data: memoryview) -> Frame:
    """Decode what `encode_frame` encodes, with an empty `encoded`; raises MalformedMessageError."""
    try:
        record = _FRAME_RECORD.decode(data)
    except (ValueError, RecursionError) as error:
        raise MalformedMessageError("a frame's record is not what /camera/frame promises") from error
    if record.captured.sec < 0:
        raise MalformedMessageError("a frame's record has a time before 1970")
    sigma, origin = record.captured_sigma, record.origin
    return Frame(
        sequence=record.sequence,
        captured_ns=record.captured.time_ns,
        encoded=b"",
        sha256=record.sha256,
        times=record.times.times,
        exif=record.exif,
        width_px=record.width_px,
        height_px=record.height_px,
        zoom_position=record.zoom_position,
        captured_sigma_ns=None if sigma is None else sigma.time_ns,
        format=record.format,
        rotation_deg=record.rotation_deg,
        origin=None if origin is None else Origin(origin.file, origin.time.time_ns, origin.sha256),
        readout_s=record.readout_s,
    )


def decode_dropped(data: memoryview) -> int:
    """Decode the count of dropped frames in a status or health report; raises MalformedMessageError."""
    try:
        return _REPORT.decode(data).dropped
    except (ValueError, RecursionError) as error:
        raise MalformedMessageError("a report is not what its topic promises") from error


def encode_status(status: CameraStatus, at: ClockReading) -> bytes:
    """Encode a camera status as JSON."""
    return json_bytes(
        {
            "clocks": reading_to_json(at),
            "state": encodable(status.state),
            "reason": encodable(status.reason),
            "dropped": status.dropped,
            "sequence": status.sequence,
            "camera_clock_offset": time_or_none(status.camera_clock_offset_ns),
            "camera_clock_sigma": time_or_none(status.camera_clock_sigma_ns),
        }
    )


def encode_health(health: Health, at: ClockReading) -> bytes:
    """Encode a health report as JSON."""
    return json_bytes(
        {
            "clocks": reading_to_json(at),
            "free_bytes": health.free_bytes,
            "frame_rate_hz": health.frame_rate_hz,
            "stored": health.stored,
            "dropped": health.dropped,
            "queued": health.queued,
            "drops_by_reason": dict(sorted(health.drops_by_reason.items())),
            "temperatures_c": dict(sorted(health.temperatures_c.items())),
            "clock": health.clock,
            "clock_offset": to_json(health.clock_offset_ns),
        }
    )


def encode_log(line: LogLine, at: ClockReading) -> bytes:
    """Encode a log line as foxglove.Log."""
    message = Log(level=Log.Level.Value(line.level.name), message=encodable(line.message), name=encodable(line.name))
    message.timestamp.seconds, message.timestamp.nanos = divmod(at.realtime_ns, NS_PER_S)
    return message.SerializeToString(deterministic=True)
