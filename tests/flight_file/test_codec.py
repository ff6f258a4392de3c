"""What a report looks like as JSON."""

from __future__ import annotations

import json

from flight_file.codec import encode_status
from flight_file.frame import ClockReading
from flight_file.reports import CameraStatus
from flight_file.topics import STATUS_TOPIC, TOPICS

AT = ClockReading(5, 6)
SCHEMA = json.loads(next(topic.schema for topic in TOPICS if topic.name == STATUS_TOPIC))


def test_offset_of_the_cameras_clock_is_in_the_status() -> None:
    """An offset that is negative keeps a positive rest; the schema names every field."""
    status = CameraStatus("clock", "set", camera_clock_offset_ns=-1, camera_clock_sigma_ns=3_000_000_001)
    document = json.loads(encode_status(status, AT))

    assert document["camera_clock_offset"] == {"sec": -1, "nsec": 999_999_999}
    assert document["camera_clock_sigma"] == {"sec": 3, "nsec": 1}
    assert set(document) <= set(SCHEMA["properties"])


def test_status_without_an_offset_does_not_mention_it() -> None:
    """What is not known is absent."""
    assert set(json.loads(encode_status(CameraStatus("connected"), AT))) == {"clocks", "state", "reason", "dropped"}
