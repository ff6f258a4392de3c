"""The topics of a flight file and the schemas of their messages.

The order of `TOPICS` is part of the format: our writer registers the channels in this order, so that their ids are 1
to 5 in each of our files. MCAP keeps the channel records only in the first chunk; a reader that finds this chunk lost
goes on with this table.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.Log_pb2 import Log
from mcap_protobuf.schema import build_file_descriptor_set

IMAGE_TOPIC = "/camera/image"
FRAME_TOPIC = "/camera/frame"
STATUS_TOPIC = "/camera/status"
HEALTH_TOPIC = "/recorder/health"
LOG_TOPIC = "/recorder/log"

PROFILE = "flight"
FRAME_ID = "camera"
IMAGE_FORMAT = "jpeg"


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
        "width_px": _number("width of the picture, px, before any EXIF orientation", kind="integer"),
        "height_px": _number("height of the picture, px, before any EXIF orientation", kind="integer"),
        "size_bytes": _number("size of the JPEG, bytes", kind="integer"),
        "sha256": _text("SHA-256 of the JPEG, hexadecimal"),
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


def _protobuf(name: str, message: type[CompressedImage | Log]) -> Topic:
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
)

CHANNEL_TOPICS: dict[int, str] = {number: topic.name for number, topic in enumerate(TOPICS, start=1)}
"""Topic by channel id, in every file that our writer made."""
