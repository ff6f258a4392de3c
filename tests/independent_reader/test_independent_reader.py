"""Our flight files, read with other people's code: @mcap/core and protobufjs, against Foxglove's own schemas."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from flight_file.flight_writer import FlightWriter, Plan
from flight_file.frame import CameraStatus, ClockReading
from flight_file.reader import open_flight
from flight_file.session import Session
from flight_file.signature import load_signer, make_key_files
from tests.programs import A1

Read = Callable[..., dict[str, Any]]

pytestmark = pytest.mark.xdist_group("npm")  # one worker installs, and reads


@pytest.fixture(scope="session")
def seen(read: Read, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the other reader finds in a committed flight, and the first picture as it decodes it."""
    picture = tmp_path_factory.mktemp("picture") / "first.jpg"
    return read("read.mjs", A1, picture) | {"picture": picture.read_bytes()}


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


def test_every_frame_is_there_in_order_and_the_panel_with_them(seen: dict[str, Any]) -> None:
    """Twenty pictures and twenty descriptions, in log-time order, counted from 0."""
    assert seen["topics"]["/camera/image"]["messages"] == seen["topics"]["/camera/frame"]["messages"] == 20
    assert seen["ordered"] is True
    assert [frame["sequence"] for frame in seen["frames"]] == list(range(20))
    assert {frame["exif"]["focal_length_mm"] for frame in seen["frames"]} == {4.45}
    assert {"panel.yaml", "panel.jpg"} <= set(seen["attachments"])


def test_picture_is_ours_in_the_fields_that_foxglove_publishes(seen: dict[str, Any]) -> None:
    """The first image message holds the JPEG that our reader gives."""
    published, fields = (
        {name.replace("_", "").lower() for name in names}
        for names in (seen["expectedImageFields"], seen["firstImage"]["fields"])
    )

    assert seen["picture"] == next(iter(open_flight([A1]).frames())).encoded
    assert seen["firstImage"]["format"] == "jpeg"
    assert fields == published


def test_signed_segment_is_read_like_any_other(read: Read, tmp_path: Path) -> None:
    """The checkpoints between its chunks are in nobody's way."""
    make_key_files(tmp_path / "key")
    start = ClockReading(10**18, 0)
    plan = Plan(
        tmp_path, Session("R", started=start), {"panel.yaml": b"name: F-16\n"}, signer=load_signer(tmp_path / "key")
    )
    writer = FlightWriter(plan, status=CameraStatus("connected"), at=start)
    for number, frame in enumerate(open_flight([A1]).frames()):
        writer.write_frame(frame, ClockReading(10**18 + number, number))
    (path,) = writer.finish("stopped", ClockReading(10**18 + 20, 20))
    found = read("read.mjs", path, tmp_path / "first.jpg")

    assert path.read_bytes().count(b"flight checkpoint 1\n") > 1
    assert [frame["sequence"] for frame in found["frames"]] == list(range(20))
    assert found["attachments"] == ["panel.yaml"]
