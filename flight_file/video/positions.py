"""Positions beside the pictures: the messages of `/gps/fix`, as bytes."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

from flight_file.frame import MOST_OF_A_FIX, NO_FIX, GpsFix
from flight_file.messages import MalformedMessageError, Moment, Whole, json_bytes, time_or_none, to_json

FRAME_ID = "gps"
_HIGHEST_M, _FASTEST_MPS, _WORST_DOP = MOST_OF_A_FIX
_Speed = Annotated[float, msgspec.Meta(ge=0, le=_FASTEST_MPS)]


def encode_fix(fix: GpsFix) -> bytes:
    """Encode a position as JSON."""
    return json_bytes(
        {
            "timestamp": to_json(fix.captured_ns),
            "frame_id": FRAME_ID,
            "latitude": fix.latitude_deg,
            "longitude": fix.longitude_deg,
            "altitude": fix.altitude_m,
            "position_covariance_type": 0,
            "fix": fix.fix,
            "speed_mps": fix.speed_mps,
            "speed_3d_mps": fix.speed_3d_mps,
            "dop": fix.dop,
            "gps_time": time_or_none(fix.gps_ns),
            "file": fix.origin_file,
            "time": to_json(fix.origin_ns),
        }
    )


class _FixRecord(msgspec.Struct, frozen=True):
    """What `encode_fix` writes."""

    timestamp: Moment
    fix: Literal[0, 2, 3]
    file: Whole
    time: Moment
    latitude: Annotated[float, msgspec.Meta(ge=-90, le=90)] | None = None
    longitude: Annotated[float, msgspec.Meta(ge=-180, le=180)] | None = None
    altitude: Annotated[float, msgspec.Meta(ge=-_HIGHEST_M, le=_HIGHEST_M)] | None = None
    speed_mps: _Speed | None = None
    speed_3d_mps: _Speed | None = None
    dop: Annotated[float, msgspec.Meta(gt=0, le=_WORST_DOP)] | None = None
    gps_time: Moment | None = None


_FIX_RECORD = msgspec.json.Decoder(_FixRecord)


def decode_fix(data: memoryview) -> GpsFix:
    """Decode what `encode_fix` encodes; raises MalformedMessageError."""
    try:
        record = _FIX_RECORD.decode(data)
    except (ValueError, RecursionError) as error:
        raise MalformedMessageError("a position is not what /gps/fix promises") from error
    located = record.latitude is not None and record.longitude is not None
    if record.timestamp.sec < 0 or located != (record.fix != NO_FIX):
        raise MalformedMessageError("a position has no place, no fix or no time that a flight is at")
    return GpsFix(
        record.timestamp.time_ns,
        record.file,
        record.time.time_ns,
        record.fix,
        record.latitude,
        record.longitude,
        record.altitude,
        record.speed_mps,
        record.speed_3d_mps,
        record.dop,
        None if record.gps_time is None else record.gps_time.time_ns,
    )
