"""`NAME.mcap` and a layout for it: the flight data for Foxglove and PlotJuggler, and the pictures if wanted.

JSON has no NaN, and neither Foxglove nor PlotJuggler accepts `null` for a number, so unknown numbers are left out.
Because PlotJuggler draws numbers only, the status is also given as a number (`quality`).

Log time and publish time of every message are the frame's capture time: Foxglove plays by the former, PlotJuggler plots
by the latter. Frames are read again one at a time, so memory does not grow with the pictures.

In the layout, the pictures with the readings are on the left; on the right are one plot per unit, with a band of every
value's status below. Values are drawn as points, since a line would run through the gaps.
"""

from __future__ import annotations

import io
import json
import math
from collections.abc import Iterable
from dataclasses import asdict
from itertools import repeat
from typing import IO, Any

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CircleAnnotation_pb2 import CircleAnnotation
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.Point2_pb2 import Point2
from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation
from foxglove_schemas_protobuf.TextAnnotation_pb2 import TextAnnotation
from google.protobuf.message import Message
from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import build_file_descriptor_set

from decoder.instruments.reading import Status
from decoder.outputs.csv_output import SCORE_DECIMALS, value_decimals, value_field, value_within_turn
from decoder.outputs.drawn_readings import STATUS_COLOURS, DrawnGauge, DrawnReading, ReadingPlaces
from decoder.outputs.frame_picture import matched_frames
from decoder.outputs.json_output import Provenance, write_json
from decoder.outputs.outputs import Decoded
from decoder.panel.errors import CameraError, OutputError
from decoder.panel.lens import DistortionModel, Lens
from decoder.panel.thresholds import CONFIDENCE_SIGMAS
from decoder.panel.units import FOOT_M
from decoder.timeseries.flight_data import STATUSES, NeedleSeries
from decoder.timeseries.gps import GpsData
from flight_file.frame import NS_PER_S, Frame, storable
from flight_file.messages import (
    FRAME_ID,
    IMAGE_TOPIC,
    TOPICS,
    VIDEO_TOPIC,
    Topic,
    encode_image,
    json_bytes,
    picture_topic,
    to_json,
)
from flight_file.untrusted import file_name

READING_SCHEMA_NAME = "flight_data.Reading"
ANNOTATIONS_TOPIC = "/camera/annotations"
CALIBRATION_TOPIC = "/camera/calibration"
GPS_TOPIC = "/gps/at_frames"
GPS_SCHEMA_NAME = "foxglove.LocationFix"  # maps recognise this name, and ignore additional fields

QUALITY: dict[Status, int] = {
    Status.READ: 4,
    Status.EDGE: 3,
    Status.HIDDEN: 2,
    Status.INTERPOLATED: 1,
    Status.MISSING: 0,
}

# As Foxglove names them.
_DISTORTION_MODELS = {
    DistortionModel.BROWN_CONRADY: "plumb_bob",
    DistortionModel.RATIONAL: "rational_polynomial",
    DistortionModel.FISHEYE: "kannala_brandt",
}

_NEEDLE_PX = 0.03  # of the dial's radius
_FONT = 0.26
_LABEL_BELOW = 1.25
_CORNER = 0.5  # Foxglove counts from the corner of the first pixel, we from its centre


PROTOBUF_TOPICS: dict[str, type[Message]] = {
    ANNOTATIONS_TOPIC: ImageAnnotations,
    CALIBRATION_TOPIC: CameraCalibration,
}

PROFILE = "flight_data"
PROVENANCE_RECORD = "provenance"
CHUNK_BYTES = 1024 * 1024

IMAGE_PART = 58
PLOTS_PART = 76

Tree = str | dict[str, Any]


def topic_of(name: str) -> str:
    """Name the topic of a needle's values."""
    return f"/{name}"


def _property(kind: str, description: str) -> dict[str, Any]:
    return {"type": kind, "description": description}


READING_SCHEMA: dict[str, Any] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": READING_SCHEMA_NAME,
    "type": "object",
    "properties": {
        "value": _property("number", "the value, in `unit`; absent where there is none"),
        "text": _property("string", "the value as it is written, of what is no number: `true`, `false`, digits"),
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
    """Encode one value of one frame."""
    quantity, decimals = series.quantity, value_decimals(series)
    status = STATUSES[series.status[index]]
    value = value_within_turn(float(series.value[index]), decimals, quantity)
    sigma = float(series.sigma[index])
    reach = CONFIDENCE_SIGMAS * sigma
    return json_bytes(
        {
            "value": _rounded(value, decimals),
            "text": None if quantity.is_measured else value_field(series, index, decimals) or None,
            "unit": quantity.unit,
            "status": status.value,
            "quality": QUALITY[status],
            "score": _rounded(float(series.score[index]), SCORE_DECIMALS),
            **(
                {
                    "sigma": _rounded(sigma, decimals + 1),
                    "low_95": _rounded(value - reach, decimals),
                    "high_95": _rounded(value + reach, decimals),
                }
                if quantity.is_measured
                else {}
            ),
            "frame": frame,
        }
    )


def gps_schema(gps: GpsData) -> dict[str, Any]:
    """Describe what the camera's GPS says of a frame for which it has a position."""
    own = {column.name: _property("number", f"{column.unit}; absent where there is none") for column in gps.columns}
    moment = {"sec": _property("integer", "s"), "nsec": _property("integer", "ns, 0 to 999999999")}
    return {
        "$schema": READING_SCHEMA["$schema"],
        "title": GPS_SCHEMA_NAME,
        "type": "object",
        "properties": {
            "timestamp": {**_property("object", "mid-exposure of the frame"), "properties": moment},
            "frame_id": _property("string", "gps"),
            "latitude": _property("number", "degrees north, WGS 84"),
            "longitude": _property("number", "degrees east, WGS 84"),
            "altitude": _property("number", "m"),
            "position_covariance_type": _property("integer", "0: not known"),
            "frame": _property("integer", "the frame's number in the recording"),
            **own,
        },
        "required": ["timestamp", "frame_id", "position_covariance_type", "frame"],
        "additionalProperties": False,
    }


def gps_message(gps: GpsData, index: int, time_ns: int, frame: int) -> bytes:
    """Encode what the camera's GPS says of one frame."""
    own = {column.name: column.number(index) for column in gps.columns}
    altitude_ft = own.get("gps_altitude_ft")
    return json_bytes(
        {
            "timestamp": to_json(time_ns),
            "frame_id": "gps",
            "latitude": own.get("gps_latitude_deg"),
            "longitude": own.get("gps_longitude_deg"),
            "altitude": None if altitude_ft is None else round(altitude_ft * FOOT_M, 2),
            "position_covariance_type": 0,
            "frame": frame,
            **own,
        }
    )


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
        thickness=_sized(_NEEDLE_PX, radius_px, least_px=1.0),
    )
    _stamp(line, time_ns)
    return line


def _below(gauge: DrawnGauge, radius_px: float, number: int) -> Point2:
    """Return where the label of one of a gauge's readings begins."""
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
    return _sized(_FONT, radius_px, least_px=8.0)


def _sized(part: float, radius_px: float, *, least_px: float) -> float:
    return max(radius_px * part, least_px)


def calibration_message(lens: Lens, time_ns: int) -> bytes:
    """`foxglove.CameraCalibration` of a lens at one zoom."""
    width, height = lens.size_px
    matrix = lens.matrix
    message = CameraCalibration(
        frame_id=FRAME_ID,
        width=width,
        height=height,
        distortion_model=_DISTORTION_MODELS[lens.distortion.model],
        D=lens.distortion.coefficients,
        K=matrix.ravel().tolist(),
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[*matrix[0], 0.0, *matrix[1], 0.0, *matrix[2], 0.0],
    )
    _stamp(message, time_ns)
    return message.SerializeToString(deterministic=True)


def _stamp(message: Any, time_ns: int) -> None:  # noqa: ANN401 - protobuf's classes share no type with a timestamp
    message.timestamp.seconds, message.timestamp.nanos = divmod(time_ns, NS_PER_S)


def _point(x: float, y: float) -> Point2:
    return Point2(x=x + _CORNER, y=y + _CORNER)


def _colour(status: Status) -> Color:
    red, green, blue = (part / 255 for part in STATUS_COLOURS[status])
    return Color(r=red, g=green, b=blue, a=1.0)


def write_mcap(decoded: Decoded, stream: IO[bytes]) -> None:
    """Write flight data as MCAP: values and annotations of every frame, its lens if known, its picture if wanted.

    Raises
    ------
    OutputError
        If the flight file does not give the same frames as before.
    """
    data, with_images = decoded.data, decoded.with_images
    places, lenses = ReadingPlaces(decoded.source, data), _Lenses(decoded)
    target = _Target(stream, decoded)
    frames = matched_frames(data, decoded.frames) if with_images else repeat(None, len(data.frame))
    for index, frame in enumerate(frames):
        time_ns, number = storable(int(data.time_ns[index])), int(data.frame[index])
        for series in data.series:
            target.add(topic_of(series.quantity.name), reading_message(series, index, number), time_ns, number)
        if data.gps is not None and data.gps.located[index]:
            target.add(GPS_TOPIC, gps_message(data.gps, index, time_ns, number), time_ns, number)
        lens = lenses.changed(frame)
        if lens is not None:
            target.add(CALIBRATION_TOPIC, calibration_message(lens, time_ns), time_ns, number)
        if frame is not None:
            target.add(picture_topic(frame), encode_image(frame), time_ns, number)
        target.add(ANNOTATIONS_TOPIC, annotations_message(places.frame(index), time_ns), time_ns, number)
    target.finish()


class _Target:
    """The file being written, with its header and channels."""

    def __init__(self, stream: IO[bytes], decoded: Decoded) -> None:
        data, provenance = decoded.data, decoded.provenance
        self._writer = Writer(stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._writer.start(profile=PROFILE, library=provenance.software)
        self._writer.add_metadata(PROVENANCE_RECORD, _texts(provenance))
        description = io.StringIO()
        write_json(data, provenance, description)
        start_ns = storable(int(data.time_ns[0])) if len(data.frame) else 0
        content = description.getvalue().encode()
        self._writer.add_attachment(
            start_ns, start_ns, f"{file_name(provenance.recording)}.json", "application/json", content
        )
        schema = json.dumps(READING_SCHEMA, indent=1).encode()
        reading = self._writer.register_schema(READING_SCHEMA_NAME, "jsonschema", schema)
        self._channels = {
            topic: self._writer.register_channel(topic, "json", reading, {"unit": series.quantity.unit})
            for series in data.series
            for topic in [topic_of(series.quantity.name)]
        }
        if data.gps is not None:
            schema_id = self._writer.register_schema(
                GPS_SCHEMA_NAME, "jsonschema", json.dumps(gps_schema(data.gps), indent=1).encode()
            )
            self._channels[GPS_TOPIC] = self._writer.register_channel(GPS_TOPIC, "json", schema_id)
        for topic in _protobuf_topics(decoded):
            schema_id = self._writer.register_schema(topic.schema_name, topic.schema_encoding, topic.schema)
            self._channels[topic.name] = self._writer.register_channel(topic.name, topic.message_encoding, schema_id)

    def add(self, topic: str, content: bytes, time_ns: int, number: int) -> None:
        self._writer.add_message(self._channels[topic], time_ns, content, time_ns, number & 0xFFFFFFFF)

    def finish(self) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]


def _protobuf_topics(decoded: Decoded) -> list[Topic]:
    wanted = [ANNOTATIONS_TOPIC, *([CALIBRATION_TOPIC] if decoded.camera is not None else [])]
    topics = []
    for name in wanted:
        message = PROTOBUF_TOPICS[name]
        schema = build_file_descriptor_set(message).SerializeToString(deterministic=True)
        topics.append(Topic(name, "protobuf", message.DESCRIPTOR.full_name, "protobuf", schema))
    if decoded.with_images:
        name = _topic_of_pictures(decoded)
        if name == VIDEO_TOPIC and decoded.data.part is not None and decoded.data.part.ranks.step > 1:
            raise OutputError("--with-images: of a video every picture is needed to show another; leave --every out")
        topics += [topic for topic in TOPICS if topic.name == name]
    return topics


def _topic_of_pictures(decoded: Decoded) -> str:
    first = next(decoded.frames(), None)
    return IMAGE_TOPIC if first is None else picture_topic(first)


def _texts(provenance: Provenance) -> dict[str, str]:
    """Turn the provenance into texts, the only type in MCAP's metadata."""
    return {
        key: value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
        for key, value in asdict(provenance).items()
    }


class _Lenses:
    """The lens of each frame, reported when it differs from that of the frame before."""

    def __init__(self, decoded: Decoded) -> None:
        self._source, self._camera = decoded.source, decoded.camera
        self._known: tuple[float, tuple[int, int]] | None = None

    def changed(self, frame: Frame | None) -> Lens | None:
        """Return the lens from this frame on; None if it is unchanged or unknown."""
        focal_length_mm, size_px = self._source.optics.focal_length_mm, self._source.optics.size_px
        if frame is not None:
            focal_length_mm = frame.exif.lens_mm or focal_length_mm
            size_px = (frame.width_px or size_px[0], frame.height_px or size_px[1])
            is_sideways = bool(frame.rotation_deg // 90 % 2)
            size_px = size_px[::-1] if is_sideways else size_px
        if self._camera is None or focal_length_mm is None or (focal_length_mm, size_px) == self._known:
            return None
        self._known = (focal_length_mm, size_px)
        try:
            return self._camera.lens(focal_length_mm, size_px)
        except CameraError:
            return None  # taken at a zoom that was never calibrated


def write_layout(decoded: Decoded, stream: IO[str]) -> None:
    """Write the layout for the values and the pictures of a flight."""
    units = [(series.quantity.name, series.quantity.unit) for series in decoded.data.series]
    json.dump(layout(units, _topic_of_pictures(decoded)), stream, indent=2, ensure_ascii=False)
    stream.write("\n")


def layout(units: Iterable[tuple[str, str]], pictures: str = IMAGE_TOPIC) -> dict[str, Any]:
    """Make a layout as Foxglove exports one."""
    by_unit: dict[str, list[str]] = {}
    names = []
    for name, unit in units:
        by_unit.setdefault(unit, []).append(name)
        names.append(name)
    plots = {f"Plot!values{number}": _plot(unit, of) for number, (unit, of) in enumerate(by_unit.items(), start=1)}
    right = _split("column", _stacked(list(plots)), "StateTransitions!status", PLOTS_PART)
    return {
        "configById": {"Image!camera": _image(pictures), **plots, "StateTransitions!status": _states(names)},
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split("row", "Image!camera", right, IMAGE_PART),
    }


def _image(topic: str) -> dict[str, Any]:
    return {
        "imageMode": {
            "imageTopic": topic,
            "annotations": {ANNOTATIONS_TOPIC: {"visible": True}},
        },
        "synchronize": False,
        "foxglovePanelTitle": "Camera",
    }


def _plot(unit: str, names: list[str]) -> dict[str, Any]:
    return {
        "paths": [
            {
                "value": f"{topic_of(name)}.value",
                "label": name,
                "enabled": True,
                "timestampMethod": "receiveTime",
                "showLine": False,
                "lineSize": 2.5,
            }
            for name in names
        ],
        "foxglovePanelTitle": unit or "values",
        "yAxisLabel": unit,
        "xAxisVal": "timestamp",
        "isSynced": True,
        "showLegend": True,
        "legendDisplay": "floating",
        "showPlotValuesInLegend": True,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
    }


def _states(names: list[str]) -> dict[str, Any]:
    paths = [{"value": f"{topic_of(name)}.status", "label": name, "timestampMethod": "receiveTime"} for name in names]
    return {"paths": paths, "isSynced": True, "foxglovePanelTitle": "Status"}


def _stacked(panels: list[str]) -> Tree:
    """Stack panels of equal height."""
    first, *others = panels
    return _split("column", first, _stacked(others), 100 / len(panels)) if others else first


def _split(direction: str, first: Tree, second: Tree, percentage: float) -> dict[str, Any]:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": round(percentage, 2)}
