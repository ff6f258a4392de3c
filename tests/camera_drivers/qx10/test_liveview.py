"""The liveview: packets in, pictures out, whatever lies between; and the times of a simulated camera's pictures."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camera_drivers.errors import CameraError
from camera_drivers.qx10.link import Link
from camera_drivers.qx10.liveview import HEADER_BYTES, LivePicture, Liveview, LiveviewParser
from camera_drivers.qx10.remote_api import RemoteApi
from camera_drivers.qx10.simulator.pictures import drawn_picture
from camera_drivers.qx10.simulator.services import information_packet, packet
from camera_drivers.waiting import Notes, Waiter
from recorder.host import SystemClock
from tests.camera_drivers.listening import Listener
from tests.camera_drivers.qx10.conftest import LIMITS
from tests.camera_drivers.qx10.strangers import OK, Strangers, send

# A JPEG as short as one can be that its markers make sense: a table, a scan with stuffing and a restart, an end.
SCANS = st.binary(max_size=400).map(lambda data: data.replace(b"\xff", b"\xff\x00"))
JPEGS = SCANS.map(lambda scan: b"\xff\xd8\xff\xdb\x00\x04ab\xff\xda\x00\x03c" + scan + b"\xff\xd0" + b"x\xff\xd9")
PICTURES = st.builds(LivePicture, st.integers(0, 65535), st.integers(0, 2**32 - 1), JPEGS)
START = b"\x24\x35\x68\x79"
LOOKALIKES = st.builds(
    lambda size, tail: b"\xff\x01" + bytes(6) + START + size.to_bytes(3, "big") + b"\x00" + bytes(120) + tail,
    st.integers(0, 2**24 - 1),
    st.sampled_from((b"", b"\xff\xd8", b"\xff\xd8\xff\xda\x00\x02ab")),
)
JPEG = b"\xff\xd8\xff\xda\x00\x02a\xff\xd9"
PIECES = st.lists(st.integers(7, 700), min_size=1, max_size=5)
MS = 1_000_000
MakeBench = Callable[..., Any]


JUNK = st.one_of(
    st.binary(max_size=300),
    st.sampled_from((b"", b"\xff", b"\xff\x01", START, b"\xff\x01" + bytes(6) + START, information_packet(7))),
    LOOKALIKES,
    # A packet that breaks off, in its header or in its picture.
    PICTURES.flatmap(
        lambda each: st.integers(0, HEADER_BYTES + len(each.jpeg) - 1).map(lambda cut: as_packet(each)[:cut])
    ),
)


def as_packet(picture: LivePicture) -> bytes:
    """A picture as the camera sends it, with junk after its end."""
    return packet(picture.number, picture.timestamp_ms, picture.jpeg)


def parsed(stream: bytes, sizes: list[int]) -> list[LivePicture]:
    """The pictures of a stream that comes in pieces of these sizes, over and over."""
    parser, found, position, turn = LiveviewParser(), [], 0, 0
    while position < len(stream):
        size = sizes[turn % len(sizes)]
        found += parser.feed(stream[position : position + size])
        position += size
        turn += 1
    return found


@settings(max_examples=100)
@given(parts=st.lists(st.tuples(JUNK, PICTURES), max_size=5), last=JUNK, pieces=PIECES)
def test_junk_between_packets_costs_no_picture_and_adds_no_byte(
    parts: list[tuple[bytes, LivePicture]], last: bytes, pieces: list[int]
) -> None:
    """Nothing or junk, headers that announce too much, packets that break off: each whole packet gives its picture."""
    stream = b"".join(junk + as_packet(picture) for junk, picture in parts) + last
    found = parsed(stream, pieces)

    assert found == [picture for _, picture in parts]


@given(stream=st.binary(max_size=2000), pieces=PIECES)
def test_any_bytes_may_come(stream: bytes, pieces: list[int]) -> None:
    """Nothing is raised, and nothing is made up."""
    assert parsed(stream, pieces) == []


def test_buffer_does_not_grow_on_junk() -> None:
    """Megabytes without a packet leave nothing behind but what may be the beginning of one."""
    parser = LiveviewParser()
    for _ in range(64):
        parser.feed(bytes(65536))

    assert len(parser._buffer) < 2 * HEADER_BYTES


def test_frames_are_the_pictures_of_the_stream(make_bench: MakeBench) -> None:
    """Each in order, without the junk after its end, with times that never run back."""
    frames = make_bench(mode="liveview").take(5)

    assert [frame.encoded for frame in frames] == [drawn_picture(number) for number in range(5)]
    assert [frame.sequence for frame in frames] == list(range(5))
    captured = [frame.captured_ns for frame in frames]
    assert captured == sorted(captured)
    assert all(frame.captured_sigma_ns for frame in frames)


@pytest.mark.parametrize(
    ("fault", "reports"), [("liveview_junk@3", 0), ("liveview_stall@3", 1), ("liveview_restart@3", 1)]
)
def test_stream_goes_on_after_a_fault(make_bench: MakeBench, fault: str, reports: int) -> None:
    """Junk costs nothing; a stream that ends or stalls begins again on the same connection."""
    bench = make_bench(fault, mode="liveview")
    frames = bench.take(6)

    assert len({frame.sha256 for frame in frames}) == 6
    assert len(bench.listener.reasons("liveview")) == reports
    assert bench.failures == []


def test_all_pictures_that_arrive_together_are_frames(strangers: Strangers, listener: Listener) -> None:
    """Two hundred small ones in one piece: none is left out, as none would be counted."""
    pictures = [LivePicture(number, number * 70, JPEG) for number in range(200)]
    stream = strangers.url(send(OK + b"\r\n" + b"".join(map(as_packet, pictures))), "liveview")
    answer = json.dumps({"id": 1, "result": [stream]}).encode()
    services = {"camera": strangers.url(send(OK + b"\r\n" + answer), "camera")}
    clock = SystemClock()
    api = RemoteApi(Link("127.0.0.1", LIMITS, Waiter(clock, listener)), services)
    liveview = Liveview(api, clock, Notes(listener))

    assert [liveview.next_picture().jpeg for _ in pictures] == [JPEG] * 200


def test_stop_ends_the_stream(make_bench: MakeBench) -> None:
    """None soon after stopping was asked for, though no picture comes."""
    bench = make_bench("liveview_stall@2", mode="liveview")
    stop = threading.Event()
    with bench.camera as camera:
        assert camera.next_frame(stop) is not None
        threading.Timer(0.1, stop.set).start()
        assert camera.next_frame(stop) is None

    assert bench.simulated.model.liveview is False


def test_camera_without_liveview_is_told_of(make_bench: MakeBench) -> None:
    """It is connected again rather than left without pictures."""
    bench = make_bench(mode="liveview", behaviour={"forbidden": frozenset({"startLiveview"})})
    with bench.camera as camera, pytest.raises(CameraError, match="refuses a liveview"):
        camera.next_frame(threading.Event())
