"""`NAME.mcap`, read with MCAP's own reader and checked against the schemas in the file itself."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from decoder.imaging.panel_pictures import PanelPictures, panel_from_file
from decoder.instruments.reading import Status
from decoder.outputs.drawn_readings import STATUS_COLOURS
from decoder.outputs.json_output import Provenance, SourceFile
from decoder.outputs.mcap_output import layout, write_mcap
from decoder.outputs.outputs import Decoded
from decoder.panel.camera import Camera, parse_camera
from decoder.panel.errors import OutputError
from decoder.timeseries.flight_data import FlightData
from flight_file.frame import ClockReading, Exif, Frame, HostTimes
from flight_file.session import Session
from tests.decoder.cockpit import fly, reading
from tests.programs import ROOT

PROVENANCE = Provenance(
    "demo", "tests 1", "normxcorr", (SourceFile("demo.mcap", "0" * 64),), SourceFile("panel.yaml", "1" * 64), None, ()
)
CAMERA = parse_camera(
    "picture_size: [360, 220]\nfocal: {pixels_per_radian: [0, 100, 0], range_mm: [4, 10]}\n"
    "distortion: [{focal_length_mm: 5, k1: -0.05, k2: 0.01, p1: 0.001, p2: -0.002, k3: 0.0}]\n"
)
START_NS = 1_525_435_200_000_000_000


@pytest.fixture
def data() -> FlightData:
    """Four frames: one read, one with a needle missing, one without panel, one with an edge."""
    return fly(
        [
            {"speed_kt": reading(270.0)},
            {"speed_kt": reading(271.0, Status.MISSING, 0.41)},
            "knob not found",
            {"speed_kt": reading(345.0, Status.EDGE, 0.9)},
        ]
    )


def frame(sequence: int, focal_length_mm: float | None = None) -> Frame:
    """A frame whose picture is not decoded."""
    clock = ClockReading(0, 0)
    return Frame(
        sequence=sequence,
        captured_ns=START_NS + sequence * 500_000_000,
        encoded=b"jpeg %d" % sequence,
        sha256="",
        times=HostTimes(clock, clock, clock),
        exif=Exif(focal_length_mm=focal_length_mm),
    )


def written(
    data: FlightData, panel: PanelPictures, frames: list[Frame] | None = None, camera: Camera | None = None
) -> bytes:
    """The file's bytes, with frames' pictures if there are any."""
    stream = io.BytesIO()
    decoded = Decoded(panel, camera, data, PROVENANCE, lambda: iter(frames or []), list, Session("demo"))
    write_mcap(replace(decoded, with_images=frames is not None), stream)
    return stream.getvalue()


def messages(content: bytes, topic: str) -> Iterator[tuple[Any, Any, Any]]:
    """Schema, message and decoded message of a topic, in the order of log times."""
    reader = make_reader(io.BytesIO(content), validate_crcs=True, decoder_factories=[DecoderFactory()])
    if topic.startswith("/camera/"):
        for schema, _, message, decoded in reader.iter_decoded_messages(topics=[topic]):
            yield schema, message, decoded
    else:
        for schema, _, message in reader.iter_messages(topics=[topic]):
            yield schema, message, json.loads(message.data)


def test_each_needle_is_a_topic_of_flat_json(data: FlightData, panel: PanelPictures) -> None:
    """Every message fits the schema in the file, which has only plain types, and no number is a text."""
    jsonschema = pytest.importorskip("jsonschema")
    content = written(data, panel)

    for name in ("speed_kt", "al_lb", "fr_lb"):
        found = list(messages(content, f"/{name}"))
        assert len(found) == 4
        for schema, _, document in found:
            assert schema.encoding == "jsonschema"
            own = json.loads(schema.data)
            assert {one["type"] for one in own["properties"].values()} == {"number", "integer", "string"}
            jsonschema.Draft202012Validator.check_schema(own)
            jsonschema.validate(document, own)
            assert not any(isinstance(value, dict | list) for value in document.values())
            assert {key for key, value in document.items() if isinstance(value, str)} == {"unit", "status"}


def test_values_are_those_of_the_flight_data(data: FlightData, panel: PanelPictures) -> None:
    """Value, bounds and score are there where the flight data has them; no null, no NaN, no zero elsewhere."""
    documents = [document for _, _, document in messages(written(data, panel), "/speed_kt")]

    assert documents[0] | {"sigma": 0, "low_95": 0, "high_95": 0} == {
        "value": 400.0, "unit": "kt", "status": "read", "quality": 4, "score": 0.99,
        "sigma": 0, "low_95": 0, "high_95": 0, "frame": 0,
    }  # fmt: skip
    assert documents[3]["value"] == pytest.approx(700.0)
    sigma = documents[3]["sigma"]
    assert sigma == pytest.approx(0.02 * 4, rel=1e-3)
    assert (documents[3]["low_95"], documents[3]["high_95"]) == pytest.approx(
        (700 - 1.96 * sigma, 700 + 1.96 * sigma), abs=0.006
    )
    assert documents[1] == {"unit": "kt", "status": "missing", "quality": 0, "score": 0.41, "frame": 1}
    assert documents[2] == {"unit": "kt", "status": "missing", "quality": 0, "frame": 2}


def test_annotations_draw_needles_and_values(data: FlightData, panel: PanelPictures) -> None:
    """Needle, pivot and value lie half a pixel on, because Foxglove counts from the picture's corner."""
    found = [decoded for _, _, decoded in messages(written(data, panel), "/camera/annotations")]
    first, second, lost, _ = found

    line = first.points[0]
    assert [(round(point.x, 3), round(point.y, 3)) for point in line.points] == [
        (85.9, round(110.7 - 20 + 0.5, 3)),
        (85.9, round(110.7 - 52 + 0.5, 3)),
    ]
    assert (first.circles[0].position.x, first.circles[0].position.y) == pytest.approx((85.9, 111.2))
    assert [text.text for text in first.texts] == ["speed_kt 400.0 kt", "al_lb 800.0 lb", "fr_lb 800.0 lb"]
    assert (len(first.points), len(second.points), len(lost.points)) == (3, 2, 0)
    assert second.texts[0].text == "speed_kt missing"
    assert {annotation.timestamp.seconds for annotation in first.points} == {START_NS // 10**9}
    for index, status in ((0, Status.READ), (1, Status.MISSING), (3, Status.EDGE)):
        colour = found[index].texts[0].text_color
        assert (colour.r * 255, colour.g * 255, colour.b * 255) == pytest.approx(STATUS_COLOURS[status])


def test_pictures_go_in_as_they_were_recorded(data: FlightData, panel: PanelPictures) -> None:
    """With images each frame's JPEG is at its capture time, byte for byte."""
    content = written(data, panel, [frame(number) for number in range(4)])
    found = list(messages(content, "/camera/image"))

    assert [decoded.data for _, _, decoded in found] == [b"jpeg %d" % number for number in range(4)]
    assert {(schema.name, decoded.format, decoded.frame_id) for schema, _, decoded in found} == {
        ("foxglove.CompressedImage", "jpeg", "camera")
    }
    assert [message.log_time for _, message, _ in found] == data.time_ns.tolist()


def test_frames_that_changed_meanwhile_are_an_error(data: FlightData, panel: PanelPictures) -> None:
    """Pictures are never put beside another frame's values."""
    for frames in (
        [frame(0), frame(2)],
        [frame(number) for number in range(3)],
        [frame(number) for number in range(5)],
    ):
        with pytest.raises(OutputError, match="than before"):
            written(data, panel, frames)


def test_lens_is_told_when_it_changes(data: FlightData, panel: PanelPictures) -> None:
    """One calibration for each zoom in a row, with OpenCV's matrix and coefficients; none for a zoom not calibrated."""
    frames = [frame(0, 5.0), frame(1, 5.0), frame(2, 8.0), frame(3, 40.0)]
    found = list(messages(written(data, panel, frames, CAMERA), "/camera/calibration"))

    assert [message.log_time for _, message, _ in found] == [START_NS, START_NS + 10**9]
    first, second = (decoded for _, _, decoded in found)
    assert first.distortion_model == "plumb_bob"
    assert list(first.D) == [-0.05, 0.01, 0.001, -0.002, 0.0]
    assert list(first.K) == [500, 0, 179.5, 0, 500, 109.5, 0, 0, 1]
    assert list(first.P) == [500, 0, 179.5, 0, 0, 500, 109.5, 0, 0, 0, 1, 0]
    assert second.K[0] == 800
    assert (first.width, first.height, first.frame_id) == (360, 220, "camera")


def test_file_says_where_it_comes_from(data: FlightData, panel: PanelPictures) -> None:
    """The profile, the hashes as metadata, and the whole description as an attachment."""
    reader = make_reader(io.BytesIO(written(data, panel)))

    assert reader.get_header().profile == "flight_data"
    (record,) = reader.iter_metadata()
    assert (record.name, record.metadata["recording"]) == ("provenance", "demo")
    assert json.loads(record.metadata["flight_files"])[0]["sha256"] == "0" * 64
    (attachment,) = reader.iter_attachments()
    assert attachment.name == "demo.json"
    assert json.loads(attachment.data)["needles"]["speed_kt"]["unit"] == "kt"


def test_committed_layout_is_that_of_the_demo() -> None:
    """docs/foxglove-layout.json is what `decode --format layout` gives for the demo flight."""
    panel = panel_from_file(ROOT / "fixtures" / "panel.yaml").panel
    made = layout([(quantity.name, quantity.unit) for quantity in panel.quantities])

    assert json.loads((ROOT / "docs" / "foxglove-layout.json").read_text(encoding="utf-8")) == made
