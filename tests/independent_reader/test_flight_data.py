"""Flight data as MCAP, read with other people's code: @mcap/core and protobufjs, against Foxglove's own schemas."""

from __future__ import annotations

import base64
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from flight_file.reader import open_flight
from tests.programs import A1, ran, rows_of

Read = Callable[..., dict[str, Any]]

pytestmark = pytest.mark.xdist_group("npm")  # one worker installs, and reads


@pytest.fixture(scope="session")
def decoded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the CSV and the MCAP of a committed flight."""
    folder = tmp_path_factory.mktemp("decoded")
    done = ran("decode", A1, "-o", folder, "--format", "csv,mcap", "--with-images")
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="session")
def seen(read: Read, decoded: Path) -> dict[str, Any]:
    """What the other reader finds."""
    return read("read_flight_data.mjs", decoded / "thesis_a1.mcap")


def test_values_are_those_of_the_csv(seen: dict[str, Any], decoded: Path) -> None:
    """Every number of the CSV is in its needle's topic, at the frame's capture time."""
    rows = rows_of(decoded / "thesis_a1.csv")
    times = [str(frame.captured_ns) for frame in open_flight([A1]).frames()]
    names = [name.removesuffix("_status") for name in rows[0] if name.endswith("_status")]

    assert len(names) == 7
    for name in names:
        found = seen["topics"][f"/{name}"]["messages"]
        assert [message["content"]["value"] for message in found] == [float(row[name]) for row in rows]
        assert [message["content"]["status"] for message in found] == [row[f"{name}_status"] for row in rows]
        assert [message["logTime"] for message in found] == [message["publishTime"] for message in found] == times


def test_messages_for_pictures_are_foxgloves(seen: dict[str, Any]) -> None:
    """Names and fields of the schemas in the file are those that Foxglove publishes."""
    for topic, name in (("/camera/annotations", "ImageAnnotations"), ("/camera/image", "CompressedImage")):
        found = seen["topics"][topic]
        assert (found["schema"], found["schemaEncoding"]) == (f"foxglove.{name}", "protobuf")
        assert set(seen["published"][name]) <= set(found["fields"])


def test_every_picture_has_its_annotations(seen: dict[str, Any]) -> None:
    """A needle, a value and a pivot for each, stamped like the picture they belong to."""
    images = [message["content"] for message in seen["topics"]["/camera/image"]["messages"]]
    annotations = [message["content"] for message in seen["topics"]["/camera/annotations"]["messages"]]

    assert len(images) == len(annotations) == 20
    for image, annotation in zip(images, annotations, strict=True):
        assert annotation["timestamp"] == image["timestamp"]
        assert (len(annotation["points"]), len(annotation["texts"]), len(annotation["circles"])) == (7, 7, 6)
        assert {line["type"] for line in annotation["points"]} == {"LINE_STRIP"}
    jpegs = [frame.encoded for frame in open_flight([A1]).frames()]
    assert [base64.b64decode(image["data"]) for image in images] == jpegs
