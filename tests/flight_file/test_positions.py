"""Positions beside the frames: what is written is what is read, and what cannot be read is a loss."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from camera_drivers.replay.camera import open_source
from flight_file.errors import LossKind
from flight_file.frame import MAX_TIME_NS, GpsFix
from flight_file.messages import FIX_TOPIC, TOPICS, MalformedMessageError
from flight_file.reader import open_flight
from flight_file.video.positions import decode_fix, encode_fix
from flight_file.walk import walk
from recorder.host import SimulatedClock
from tests.flight_file.flights import flipped, make_frame, write_flight

SCHEMA = Draft202012Validator(json.loads(next(topic.schema for topic in TOPICS if topic.name == FIX_TOPIC)))
SPEEDS = st.none() | st.floats(0, 10_000)
TIMES = st.integers(0, MAX_TIME_NS - 2 * 10**9)
LOST = st.builds(GpsFix, TIMES, st.integers(0, 9), st.integers(-(2**60), 2**60))
FOUND = st.builds(
    GpsFix,
    captured_ns=TIMES,
    fix=st.sampled_from((2, 3)),
    latitude_deg=st.floats(-90, 90),
    longitude_deg=st.floats(-180, 180),
    altitude_m=st.none() | st.floats(-100_000, 100_000),
    speed_mps=SPEEDS,
    speed_3d_mps=SPEEDS,
    dop=st.none() | st.floats(0.01, 100),
    gps_ns=st.none() | TIMES,
)


@given(fix=LOST | FOUND)
def test_what_is_written_of_a_position_is_read(fix: GpsFix) -> None:
    """Every field, as the schema in the file has it."""
    message = encode_fix(fix)

    SCHEMA.validate(json.loads(message))
    assert decode_fix(memoryview(message)) == fix


@pytest.mark.parametrize(
    "changed",
    [
        {"fix": 3, "latitude": None},
        {"fix": 0},
        {"latitude": 91},
        {"speed_mps": -1},
        {"dop": 1e300},
        {"timestamp": {"sec": -1, "nsec": 0}},
        {"time": 5},
    ],
    ids=str,
)
def test_what_is_no_position_is_refused(changed: dict[str, object]) -> None:
    """A place without a fix, a fix without a place, and numbers that none can have."""
    fix = GpsFix(10**18, fix=3, latitude_deg=47.5, longitude_deg=8.25)
    document = {**json.loads(encode_fix(fix)), **changed}
    with pytest.raises(MalformedMessageError):
        decode_fix(
            memoryview(json.dumps({key: value for key, value in document.items() if value is not None}).encode())
        )


def test_a_replay_gives_all_positions(tmp_path: Path) -> None:
    """Each with a frame that is not much older; those behind the last picture go with it."""
    frames = [make_frame(number) for number in range(3)]
    fixes = [GpsFix(frames[0].captured_ns + number * 5 * 10**8) for number in range(20)]
    (path,) = write_flight(tmp_path, [replace(frames[0], fixes=tuple(fixes)), *frames[1:]])
    clock = SimulatedClock(0)
    came = [upcoming.take(clock).fixes for upcoming in open_source([path], rate_hz=None, clock=clock).pictures()]

    assert [len(each) for each in came] == [3, 2, 15]
    assert [fix for each in came for fix in each] == fixes


def test_positions_of_a_damaged_chunk_are_a_loss(tmp_path: Path) -> None:
    """The others are there, in their order; without the pictures' kind their channel has the number it always has."""
    fixes = [GpsFix(10**18 + number, origin_ns=number) for number in range(6)]
    frames = [replace(make_frame(number), fixes=(fix,)) for number, fix in enumerate(fixes)]
    (path,) = write_flight(tmp_path, frames)
    assert list(open_flight([path]).fixes()) == fixes

    data = path.read_bytes()
    first, fourth = (data.index(encode_fix(fixes[number])) * 8 for number in (0, 3))
    path.write_bytes(flipped(data, fourth))
    flight = open_flight([path])

    assert list(flight.fixes()) == [*fixes[:3], *fixes[4:]]
    assert [loss.kind for loss in flight.losses] == [LossKind.DAMAGED]
    assert sum(not hasattr(found, "reason") for found in walk(flight.segments[0])) == 5
    path.write_bytes(flipped(data, first))
    assert list(open_flight([path]).fixes()) == fixes[1:]  # the chunk that names the channels is lost
