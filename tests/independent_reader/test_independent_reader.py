"""Our flight files, read with other people's code: @mcap/core and protobufjs, against Foxglove's own schemas."""

from __future__ import annotations

import io
import json
import subprocess
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from flight_file.reader import open_flight

HERE = Path(__file__).parent
FLIGHT = HERE.parents[1] / "fixtures" / "thesis_a1.mcap"

pytestmark = pytest.mark.xdist_group("npm")  # one worker installs, and reads


@pytest.fixture(scope="session")
def seen(reader_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the other reader finds in a committed flight, and the first picture as it decodes it."""
    picture = tmp_path_factory.mktemp("picture") / "first.jpg"
    command = ["node", "read.mjs", str(FLIGHT), str(picture)]
    done = subprocess.run(command, cwd=reader_folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found | {"picture": picture.read_bytes()}


def test_topics_and_schemas_are_the_contract(seen: dict[str, Any]) -> None:
    """The profile, the topics, their schemas by Foxglove's names, and their encodings."""
    assert seen["profile"] == "flight"
    assert {topic: (found["schema"], found["encoding"]) for topic, found in seen["topics"].items()} == {
        "/camera/image": ("foxglove.CompressedImage", "protobuf"),
        "/camera/frame": (seen["topics"]["/camera/frame"]["schema"], "json"),
        "/camera/status": (seen["topics"]["/camera/status"]["schema"], "json"),
        "/recorder/health": (seen["topics"]["/recorder/health"]["schema"], "json"),
        "/recorder/log": ("foxglove.Log", "protobuf"),
    }
    assert {found["schemaEncoding"] for found in seen["topics"].values()} == {"protobuf", "jsonschema"}


def test_every_frame_is_there_in_order(seen: dict[str, Any]) -> None:
    """Twenty pictures and twenty descriptions, in log-time order, counted from 0."""
    assert seen["topics"]["/camera/image"]["messages"] == seen["topics"]["/camera/frame"]["messages"] == 20
    assert seen["ordered"] is True
    assert [frame["sequence"] for frame in seen["frames"]] == list(range(20))
    assert {frame["exif"]["focal_length_mm"] for frame in seen["frames"]} == {4.45}


def test_picture_decodes_and_is_ours(seen: dict[str, Any]) -> None:
    """The first image message holds the JPEG that our reader gives, and it decodes."""
    first = next(iter(open_flight([FLIGHT]).frames()))

    assert seen["picture"] == first.jpeg
    with Image.open(io.BytesIO(seen["picture"])) as picture:
        picture.load()
        assert picture.size == (1024, 768)
    assert seen["firstImage"]["format"] == "jpeg"


def test_schema_is_foxgloves(seen: dict[str, Any]) -> None:
    """The image schema in the file has the fields that Foxglove publishes."""
    published = {name.replace("_", "").lower() for name in seen["expectedImageFields"]}

    assert {name.replace("_", "").lower() for name in seen["firstImage"]["fields"]} == published


def test_panel_travels_along(seen: dict[str, Any]) -> None:
    """The panel and its picture are attachments."""
    assert {"panel.yaml", "panel.jpg"} <= set(seen["attachments"])
