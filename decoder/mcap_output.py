"""`NAME.mcap`: the flight data for Foxglove and PlotJuggler, one topic for each needle, and the pictures if wanted.

Log time and publish time of every message are the frame's capture time: Foxglove plays by the first, PlotJuggler plots
by the second. Frames are read again one at a time, so memory does not grow with the pictures.
"""

from __future__ import annotations

import io
import json
from dataclasses import asdict, dataclass
from itertools import repeat
from typing import IO

from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import build_file_descriptor_set

from decoder.camera import Camera
from decoder.drawn_readings import ReadingPlaces
from decoder.errors import CameraError
from decoder.flight_data import FlightData
from decoder.frames_again import Frames, matched_frames
from decoder.json_output import Provenance, write_json
from decoder.lens import Lens
from decoder.mcap_topics import (
    ANNOTATIONS_TOPIC,
    CALIBRATION_TOPIC,
    PROTOBUF_TOPICS,
    READING_SCHEMA,
    READING_SCHEMA_NAME,
    annotations_message,
    calibration_message,
    reading_message,
    topic_of,
)
from decoder.panel_pictures import PanelPictures
from flight_file import codec
from flight_file.frame import Frame
from flight_file.moments import storable
from flight_file.topics import IMAGE_TOPIC, TOPICS, Topic

PROFILE = "flight_data"
PROVENANCE_RECORD = "provenance"
CHUNK_BYTES = 1024 * 1024


@dataclass(frozen=True, slots=True)
class Pictures:
    """What is known of the pictures behind the flight data.

    Attributes
    ----------
    frames
        Reads the flight's frames once more, to be put in; None for a file without pictures.
    size_px
        Width and height of those that do not tell theirs.
    focal_length_mm
        Of frames that do not tell theirs, if known.
    camera
        Whose lens they were taken with, if known.
    """

    frames: Frames | None
    size_px: tuple[int, int]
    focal_length_mm: float | None
    camera: Camera | None


def write_mcap(
    data: FlightData, source: PanelPictures, provenance: Provenance, pictures: Pictures, stream: IO[bytes]
) -> None:
    """Writes flight data as MCAP: values and annotations of every frame, and its picture and its lens where known.

    Raises
    ------
    OutputError
        If the flight file does not give the frames that it gave before.
    """
    places, lenses = ReadingPlaces(source, data), _Lenses(pictures)
    target = _Target(stream, data, provenance, pictures)
    frames = repeat(None, len(data.frame)) if pictures.frames is None else matched_frames(data, pictures.frames)
    for index, frame in enumerate(frames):
        time_ns, number = storable(int(data.time_ns[index])), int(data.frame[index])
        for series in data.series:
            target.add(topic_of(series.quantity.name), reading_message(series, index, number), time_ns, number)
        lens = lenses.changed(frame)
        if lens is not None:
            target.add(CALIBRATION_TOPIC, calibration_message(lens, time_ns), time_ns, number)
        if frame is not None:
            target.add(IMAGE_TOPIC, codec.encode_image(frame), time_ns, number)
        target.add(ANNOTATIONS_TOPIC, annotations_message(places.frame(index), time_ns), time_ns, number)
    target.finish()


class _Target:
    """The file in work: its head is written, its channels are there."""

    def __init__(self, stream: IO[bytes], data: FlightData, provenance: Provenance, pictures: Pictures) -> None:
        self._writer = Writer(stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._writer.start(profile=PROFILE, library=provenance.software)
        self._writer.add_metadata(PROVENANCE_RECORD, _texts(provenance))
        description = io.StringIO()
        write_json(data, provenance, description)
        start_ns = storable(int(data.time_ns[0])) if len(data.frame) else 0
        content = description.getvalue().encode()
        self._writer.add_attachment(start_ns, start_ns, f"{provenance.recording}.json", "application/json", content)
        schema = json.dumps(READING_SCHEMA, indent=1).encode()
        reading = self._writer.register_schema(READING_SCHEMA_NAME, "jsonschema", schema)
        self._channels = {
            topic: self._writer.register_channel(topic, "json", reading, {"unit": series.quantity.unit})
            for series in data.series
            for topic in [topic_of(series.quantity.name)]
        }
        for topic in _protobuf_topics(pictures):
            schema_id = self._writer.register_schema(topic.schema_name, topic.schema_encoding, topic.schema)
            self._channels[topic.name] = self._writer.register_channel(topic.name, topic.message_encoding, schema_id)

    def add(self, topic: str, content: bytes, time_ns: int, number: int) -> None:
        self._writer.add_message(self._channels[topic], time_ns, content, time_ns, number & 0xFFFFFFFF)

    def finish(self) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]


def _protobuf_topics(pictures: Pictures) -> list[Topic]:
    wanted = [ANNOTATIONS_TOPIC, *([CALIBRATION_TOPIC] if pictures.camera is not None else [])]
    topics = []
    for name in wanted:
        message = PROTOBUF_TOPICS[name]
        schema = build_file_descriptor_set(message).SerializeToString(deterministic=True)
        topics.append(Topic(name, "protobuf", message.DESCRIPTOR.full_name, "protobuf", schema))
    if pictures.frames is not None:
        topics += [topic for topic in TOPICS if topic.name == IMAGE_TOPIC]
    return topics


def _texts(provenance: Provenance) -> dict[str, str]:
    """The provenance as MCAP's metadata holds it, texts only."""
    return {
        key: value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
        for key, value in asdict(provenance).items()
    }


class _Lenses:
    """The lens of each frame, told when it is another than that of the frame before."""

    def __init__(self, pictures: Pictures) -> None:
        self._pictures = pictures
        self._known: tuple[float, tuple[int, int]] | None = None

    def changed(self, frame: Frame | None) -> Lens | None:
        """The lens from this frame on; None if it is the same as before, or not known."""
        focal_length_mm, size_px = self._pictures.focal_length_mm, self._pictures.size_px
        if frame is not None:
            focal_length_mm = frame.exif.focal_length_mm or focal_length_mm
            size_px = (frame.width_px or size_px[0], frame.height_px or size_px[1])
        camera = self._pictures.camera
        if camera is None or focal_length_mm is None or (focal_length_mm, size_px) == self._known:
            return None
        self._known = (focal_length_mm, size_px)
        try:
            return camera.lens(focal_length_mm, size_px)
        except CameraError:
            return None  # taken at a zoom that was never calibrated
