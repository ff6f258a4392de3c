"""The messages of `NAME.mcap`: one flat JSON object for each value of each frame, and Foxglove's own for pictures.

JSON has no NaN, and neither Foxglove nor PlotJuggler takes `null` for a number: what is not known is left out. Because
PlotJuggler draws numbers only, the status is there as a number, too (`quality`).
"""

from __future__ import annotations

import json
import math
from typing import Any

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CircleAnnotation_pb2 import CircleAnnotation
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.Point2_pb2 import Point2
from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation
from foxglove_schemas_protobuf.TextAnnotation_pb2 import TextAnnotation
from google.protobuf.message import Message

from decoder.csv_output import SCORE_DECIMALS, value_decimals, value_within_turn
from decoder.drawn_readings import CONFIDENCE_SIGMAS, DrawnGauge, DrawnReading
from decoder.flight_data import STATUSES, NeedleSeries
from decoder.lens import Lens
from decoder.reading import Status
from decoder.status_colours import STATUS_COLOURS
from flight_file import moments
from flight_file.topics import FRAME_ID

READING_SCHEMA_NAME = "flight_data.Reading"
ANNOTATIONS_TOPIC = "/camera/annotations"
CALIBRATION_TOPIC = "/camera/calibration"

QUALITY: dict[Status, int] = {
    Status.READ: 4,
    Status.EDGE: 3,
    Status.HIDDEN: 2,
    Status.INTERPOLATED: 1,
    Status.MISSING: 0,
}

_NEEDLE_PX = 0.03  # of the dial's radius
_FONT = 0.26
_LABEL_BELOW = 1.25
_CORNER = 0.5  # Foxglove counts from the corner of the first pixel, we from its centre


def topic_of(name: str) -> str:
    """The topic of a needle's values."""
    return f"/{name}"


def _property(kind: str, description: str) -> dict[str, Any]:
    return {"type": kind, "description": description}


READING_SCHEMA: dict[str, Any] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": READING_SCHEMA_NAME,
    "type": "object",
    "properties": {
        "value": _property("number", "the value, in `unit`; absent where there is none"),
        "unit": _property("string", "of value, sigma and the 95 % bounds"),
        "status": {
            **_property("string", "how the value came about"),
            "enum": [status.value for status in STATUSES],
        },
        "quality": _property("integer", "the status as a number: 4 read, 3 edge, 2 hidden, 1 interpolated, 0 missing"),
        "score": _property("number", "normalized cross-correlation of needle and template, -1 to 1"),
        "sigma": _property("number", "standard uncertainty of the value"),
        "low_95": _property("number", "value - 1.96 sigma"),
        "high_95": _property("number", "value + 1.96 sigma"),
        "frame": _property("integer", "the frame's number in the recording"),
    },
    "required": ["unit", "status", "quality", "frame"],
    "additionalProperties": False,
}


def reading_message(series: NeedleSeries, index: int, frame: int) -> bytes:
    """One value of one frame."""
    quantity, decimals = series.quantity, value_decimals(series)
    status = STATUSES[series.status[index]]
    value = value_within_turn(float(series.value[index]), decimals, quantity)
    sigma = float(series.sigma[index])
    reach = CONFIDENCE_SIGMAS * sigma
    document = {
        "value": _rounded(value, decimals),
        "unit": quantity.unit,
        "status": status.value,
        "quality": QUALITY[status],
        "score": _rounded(float(series.score[index]), SCORE_DECIMALS),
        "sigma": _rounded(sigma, decimals + 1),
        "low_95": _rounded(value - reach, decimals),
        "high_95": _rounded(value + reach, decimals),
        "frame": frame,
    }
    known = {key: content for key, content in document.items() if content is not None}
    return json.dumps(known, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()


def _rounded(number: float, decimals: int) -> float | None:
    return round(number, decimals) if math.isfinite(number) else None


def annotations_message(gauges: tuple[DrawnGauge, ...], time_ns: int) -> bytes:
    """`foxglove.ImageAnnotations` of one frame: needles, pivots and values in their status's colour."""
    message = ImageAnnotations()
    _stamp(message, time_ns)
    for gauge in gauges:
        radius_px = gauge.radius_px
        for number, reading in enumerate(gauge.readings):
            if reading.line_px is not None:
                message.points.append(_needle(reading, radius_px, time_ns))
            message.texts.append(_label(reading, _below(gauge, radius_px, number), radius_px, time_ns))
        pivot = CircleAnnotation(
            position=_point(*gauge.pivot_px), diameter=radius_px / 8, thickness=radius_px * _NEEDLE_PX
        )
        pivot.outline_color.CopyFrom(_colour(gauge.readings[0].status))
        _stamp(pivot, time_ns)
        message.circles.append(pivot)
    return message.SerializeToString(deterministic=True)


def _needle(reading: DrawnReading, radius_px: float, time_ns: int) -> PointsAnnotation:
    line = PointsAnnotation(
        type=PointsAnnotation.LINE_STRIP,
        points=[_point(*point) for point in reading.line_px or ()],
        outline_color=_colour(reading.status),
        thickness=max(radius_px * _NEEDLE_PX, 1.0),
    )
    _stamp(line, time_ns)
    return line


def _below(gauge: DrawnGauge, radius_px: float, number: int) -> Point2:
    """Where the label of one of a gauge's readings begins."""
    x, y = gauge.pivot_px
    return _point(x - radius_px, y + radius_px * _LABEL_BELOW + number * 1.4 * _font_px(radius_px))


def _label(reading: DrawnReading, position: Point2, radius_px: float, time_ns: int) -> TextAnnotation:
    text = TextAnnotation(
        position=position,
        text=f"{reading.name} {reading.text}",
        font_size=_font_px(radius_px),
        text_color=_colour(reading.status),
        background_color=Color(r=0.0, g=0.0, b=0.0, a=0.7),
    )
    _stamp(text, time_ns)
    return text


def _font_px(radius_px: float) -> float:
    return max(radius_px * _FONT, 8.0)


def calibration_message(lens: Lens, time_ns: int) -> bytes:
    """`foxglove.CameraCalibration` of a lens at one zoom."""
    width, height = lens.size_px
    matrix = lens.matrix
    message = CameraCalibration(
        frame_id=FRAME_ID,
        width=width,
        height=height,
        distortion_model="plumb_bob",
        D=lens.coefficients.tolist(),
        K=matrix.ravel().tolist(),
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[*matrix[0], 0.0, *matrix[1], 0.0, *matrix[2], 0.0],
    )
    _stamp(message, time_ns)
    return message.SerializeToString(deterministic=True)


def _stamp(message: Any, time_ns: int) -> None:  # noqa: ANN401 - protobuf's classes share no type with a timestamp
    message.timestamp.seconds, message.timestamp.nanos = divmod(time_ns, moments.NS_PER_S)


def _point(x: float, y: float) -> Point2:
    return Point2(x=x + _CORNER, y=y + _CORNER)


def _colour(status: Status) -> Color:
    red, green, blue = (part / 255 for part in STATUS_COLOURS[status])
    return Color(r=red, g=green, b=blue, a=1.0)


PROTOBUF_TOPICS: dict[str, type[Message]] = {
    ANNOTATIONS_TOPIC: ImageAnnotations,
    CALIBRATION_TOPIC: CameraCalibration,
}
