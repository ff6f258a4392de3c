"""The driver of IP cameras, before a real RTSP server on loopback."""

from __future__ import annotations

import math
import socket
import socketserver
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from functools import partial
from itertools import count, islice, pairwise, takewhile
from pathlib import Path
from typing import Any

import av
import pytest
from hypothesis import given
from hypothesis import strategies as st

from camera_drivers.errors import CameraError, CameraUnusableError
from camera_drivers.live.camera import LiveCamera
from camera_drivers.rtsp import stream
from camera_drivers.rtsp.options import RtspSettings, checked_address
from camera_drivers.rtsp.stream import NO_KEY_FRAME, rtsp_camera
from camera_drivers.rtsp.times import Stamps, StreamTimes
from camera_drivers.settings import WithheldError
from camera_drivers.waiting import Notes
from flight_file.frame import NS_PER_S, ClockReading, Frame
from flight_file.video.groups import begins_group
from recorder.host import SystemClock
from tests.camera_drivers.listening import Listener
from tests.camera_drivers.rtsp.server import RTP_HZ, Server, Show, nal_units
from tests.videos import film, packets

Options = partial(RtspSettings, driver="rtsp")
STEP_S = 0.04
LATENCY_S = 0.5
BY_ARRIVAL_NS = round(LATENCY_S * NS_PER_S / math.sqrt(12))
TICK_NS = NS_PER_S // RTP_HZ + 1000  # RTP's own step, and a microsecond
PASSWORD = "p@ss:w/rd%41 x"  # noqa: S105 - an example with all that has a meaning in URLs

Serve = Callable[[Show], Server]


@pytest.fixture(scope="module")
def units(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[bytes]]:
    """Forty pictures of noise, in groups of ten, by codec; key frames need many RTP packets each."""
    folder = tmp_path_factory.mktemp("films")
    codecs = {"h264": "libx264", "h265": "libx265"}
    return {name: packets(film(folder / f"film.{name}", codec=codec, noise=120)) for name, codec in codecs.items()}


@pytest.fixture
def serve() -> Iterator[Serve]:
    """Starts servers, which end with the test."""
    with ExitStack() as stack:
        yield lambda show: stack.enter_context(Server(show))


@pytest.fixture
def listener() -> Iterator[Listener]:
    """Who hears the driver; no thread of it may be left in the end."""
    yield Listener()
    limit = time.monotonic() + 10
    while (left := [each.name for each in threading.enumerate() if each.name == "camera rtsp"]) and (
        time.monotonic() < limit
    ):
        time.sleep(0.02)
    assert left == []


def driver(server: Server, listener: Listener, **options: object) -> LiveCamera:
    """A driver for it."""
    wanted = {"url": server.url, "latency_s": LATENCY_S, "stall_s": 1.5, **options}
    return rtsp_camera(Options(**wanted), SystemClock(), listener)


def taken(camera: LiveCamera, number: int = 10**6) -> list[Frame]:
    """So many frames of one connection, or all until it fails."""
    frames: list[Frame] = []
    with camera:
        while len(frames) < number:
            try:
                frame = camera.next_frame(threading.Event())
            except CameraError:
                return frames
            assert frame is not None
            frames.append(frame)
    return frames


def steady_clock() -> Callable[[], int]:
    """A camera's clock that agrees with the box's and makes even steps."""
    numbers, start_ns = count(), time.time_ns()
    return lambda: start_ns + round(next(numbers) * STEP_S * NS_PER_S)


@pytest.mark.parametrize("sets", ["in the stream", "in the description"])
@pytest.mark.parametrize("codec", ["h264", "h265"])
def test_access_units_come_as_they_are_at_the_cameras_time(
    units: dict[str, list[bytes]], serve: Serve, listener: Listener, codec: str, sets: str
) -> None:
    """The same NAL units, parameter sets before each key frame, all decodable; each at its moment of the reports."""
    show = Show(units[codec], codec, STEP_S, clock_ns=steady_clock(), after="close", sets_in_sdp="description" in sets)
    frames = taken(driver(serve(show), listener))
    decoder = av.CodecContext.create("hevc" if codec == "h265" else codec, "r")
    shown = [picture for frame in frames for picture in decoder.decode(av.Packet(frame.encoded))]
    walls_ns = [wall_ns for wall_ns, _ in show.sent]

    assert [nal_units(frame.encoded) for frame in frames] == [nal_units(unit) for unit in units[codec]]
    assert [frame.sequence for frame in frames if begins_group(frame)] == [0, 10, 20, 30]
    assert {(frame.format, frame.width_px, frame.height_px) for frame in frames} == {(codec, 160, 120)}
    assert len([*shown, *decoder.decode(None)]) == len(units[codec])
    assert all(abs(each.captured_ns - wall_ns) < TICK_NS for each, wall_ns in zip(frames, walls_ns, strict=True))
    assert all(0 <= (each.captured_sigma_ns or 0) < BY_ARRIVAL_NS for each in frames)
    assert listener.reasons("clock") == ["the pictures' times are by the camera's clock, which fits to the box's"]
    assert listener.losses == []


@pytest.mark.parametrize(
    ("clock_ns", "offset_s", "sentence"),
    [
        (None, None, "sends no reports"),
        (lambda: time.time_ns() - 3600 * NS_PER_S, -3600, "does not fit"),
        (lambda: time.time_ns() + 86_400 * NS_PER_S, 86_400, "does not fit"),
    ],
    ids=["no reports", "an hour behind", "a day ahead"],
)
def test_clock_that_cannot_be_right_is_not_believed(
    units: dict[str, list[bytes]],
    serve: Serve,
    listener: Listener,
    clock_ns: Callable[[], int] | None,
    offset_s: int | None,
    sentence: str,
) -> None:
    """Times are by arrival, with the larger sigma, evenly as the camera's stamps are; its offset is reported."""
    began_ns = time.time_ns()
    frames = taken(driver(serve(Show(units["h264"], step_s=STEP_S, clock_ns=clock_ns)), listener), 20)
    steps_ns = [after.captured_ns - before.captured_ns for before, after in pairwise(frames[:10])]
    (said,) = [each for each in listener.reports if each.state == "clock"]

    assert {frame.captured_sigma_ns for frame in frames} == {BY_ARRIVAL_NS}
    assert all(abs(step_ns - STEP_S * NS_PER_S) < TICK_NS for step_ns in steps_ns)
    assert all(
        began_ns - LATENCY_S * NS_PER_S < each.captured_ns < each.times.downloaded.realtime_ns for each in frames
    )
    assert sentence in said.reason
    offset_ns = said.camera_clock_offset_ns
    assert (offset_ns is None) == (offset_s is None)
    assert offset_s is None or abs((offset_ns or 0) - offset_s * NS_PER_S) < 60 * NS_PER_S


def test_camera_is_left_and_connected_again(units: dict[str, list[bytes]], serve: Serve, listener: Listener) -> None:
    """A stream that ends and one that stalls are errors; frames are counted on; sound is never asked for."""
    show = Show(units["h264"][:15], step_s=STEP_S, after="close")
    camera = driver(serve(show), listener)
    first = taken(camera)
    show.after = "wait"
    second = taken(camera)

    assert (len(first), len(second)) == (15, 15)
    assert [frame.sequence for frame in [*first, *second]] == list(range(30))
    assert show.requests.count("PLAY") == 2
    assert show.requests.count("SETUP") == 2


def test_stream_for_which_no_memory_is_left_is_an_error_at_once(
    units: dict[str, list[bytes]], serve: Serve, listener: Listener, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It need not stand still first; what came before it is there."""
    read = stream._units

    def short_of_memory(*arguments: Any) -> Iterator[Any]:  # noqa: ANN401 - as they are
        yield from islice(read(*arguments), 3)
        raise MemoryError

    monkeypatch.setattr(stream, "_units", short_of_memory)
    with driver(serve(Show(units["h264"], step_s=STEP_S)), listener, stall_s=60) as camera:
        first = [camera.next_frame(threading.Event()) for _ in range(3)]
        with pytest.raises(CameraError, match="no memory is left"):
            camera.next_frame(threading.Event())

    assert None not in first


def test_pictures_before_the_first_key_frame_are_counted(
    units: dict[str, list[bytes]], serve: Serve, listener: Listener
) -> None:
    """Nobody could decode them; but they show that the camera works, however long it takes until the key frame."""
    early = [*units["h264"][1:10]] * 8
    show = Show([*early, *units["h264"][10:20]], step_s=STEP_S, after="close", sets_of=units["h264"][0])
    frames = taken(driver(serve(show), listener, stall_s=1.2))

    assert len(early) * STEP_S > 2 * 1.2
    assert [frame.sequence for frame in frames] == list(range(len(early), len(early) + 10))
    assert listener.losses == [NO_KEY_FRAME] * len(early)


@pytest.mark.parametrize("way", ["Basic", "Digest"])
def test_credentials_are_given_and_never_shown(
    tmp_path: Path, units: dict[str, list[bytes]], serve: Serve, listener: Listener, way: str
) -> None:
    """With all that has a meaning in URLs; what is wrong with them is said without them."""
    server = serve(Show(units["h264"], user=f"crew:{PASSWORD}", way=way))
    right, wrong = tmp_path / "right", tmp_path / "wrong"
    right.write_text(f"crew:{PASSWORD}\n")
    wrong.write_text("crew:s3cret\n")
    camera = driver(server, listener, credentials=right)
    frames = taken(camera, 3)
    said = []
    for credentials in (wrong, None):
        with pytest.raises(CameraUnusableError) as refused:
            driver(server, listener, credentials=credentials).__enter__()
        said.append(str(refused.value))

    assert len(frames) == 3
    assert ["does not take user and password" in said[0], "asks for user and password" in said[1]] == [True, True]
    told = [*said, camera.identity.note, *(each.reason for each in listener.reports), *listener.waits]
    assert [each for each in told if "s3cret" in each or "p@ss" in each or "crew" in each] == []


def test_camera_that_is_not_there_or_no_camera_is_an_error(listener: Listener) -> None:
    """In one sentence with its place."""
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        with pytest.raises(CameraError, match=rf"127.0.0.1:{port}: .*\(it does not answer"):
            rtsp_camera(Options(url=f"rtsp://127.0.0.1:{port}/", open_s=0.3), SystemClock(), listener).__enter__()
    with pytest.raises(CameraError, match=rf"127.0.0.1:{port}: .*\(Connection refused\)"):
        rtsp_camera(Options(url=f"rtsp://127.0.0.1:{port}/"), SystemClock(), listener).__enter__()


def test_description_of_gigabytes_fills_no_memory(listener: Listener) -> None:
    """FFmpeg makes room for as much as is announced: now it takes no part of it, and the connection fails."""
    sent, piece = 0, b"a=x:y\r\n" * 10_000

    class Flood(socketserver.StreamRequestHandler):
        """Answers without end."""

        def handle(self) -> None:
            nonlocal sent
            request = b"OPTIONS"
            while request.startswith(b"OPTIONS"):
                request, *lines = takewhile(bytes.strip, self.rfile)
                (number,) = (line for line in lines if line.lower().startswith(b"cseq"))
                self.wfile.write(b"RTSP/1.0 200 OK\r\n" + number)
                if request.startswith(b"OPTIONS"):
                    self.wfile.write(b"Public: DESCRIBE\r\n\r\n")
            self.wfile.write(b"Content-Type: application/sdp\r\nContent-Length: 2147483000\r\n\r\n")
            with suppress(OSError):
                while sent < 200 * 2**20:
                    self.wfile.write(piece)
                    sent += len(piece)

    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Flood) as server:
        threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True).start()
        options = Options(url=f"rtsp://127.0.0.1:{server.server_address[1]}/x", open_s=60.0)
        with pytest.raises(CameraError), rtsp_camera(options, SystemClock(), listener):
            pass
        server.shutdown()

    assert sent < 50 * 2**20


def test_stream_of_another_codec_needs_a_person(serve: Serve, listener: Listener) -> None:
    """Who sets the camera to another one."""
    server = serve(Show([], codec="jpeg"))
    with pytest.raises(CameraUnusableError, match=r"sends mjpeg; set the camera to H\.264 or H\.265"):
        driver(server, listener, open_s=2.0).__enter__()


@pytest.mark.parametrize(
    "url",
    [
        "",
        "http://10.0.0.1/",
        "rtsp://",
        "rtsp://10.0.0.1:99999/",
        "rtsp://crew:secret@10.0.0.1/",
        "rtsp://h/a b",
        "rtsp://[::1",
    ],
)
def test_address_that_is_none_is_refused_without_repeating_it(url: str) -> None:
    """A password in it would stand in the configuration that every flight carries."""
    with pytest.raises(WithheldError) as refused:
        checked_address(url)
    assert "secret" not in str(refused.value)
    assert checked_address("rtsp://camera.local:554/stream1?channel=1") == "rtsp://camera.local:554/stream1?channel=1"


@given(
    st.lists(
        st.tuples(st.booleans(), st.none() | st.integers(-(10**12), 10**12), st.integers(0, 10**9)),
        min_size=1,
        max_size=40,
    )
)
def test_order_within_a_group_is_the_streams(pictures: list[tuple[bool, int | None, int]]) -> None:
    """Whatever the camera's clock says and however late pictures come; no time is after the arrival by reports."""
    times = StreamTimes(LATENCY_S, Notes(Listener()))
    last_ns = None
    for number, (is_key, report_ns, late_ns) in enumerate(pictures):
        stream_ns, start_ns = number * 40_000_000, 10**18
        at_ns = start_ns + stream_ns + late_ns
        reported_ns = None if report_ns is None else start_ns + stream_ns + report_ns
        stamps = Stamps(reported_ns, stream_ns, ClockReading(at_ns, at_ns - start_ns))
        times.hear(stamps)
        taken_ns, sigma_ns = times.taken(stamps, is_key=is_key)
        assert 0 <= sigma_ns <= BY_ARRIVAL_NS
        assert last_ns is None or is_key or taken_ns - last_ns == 40_000_000
        last_ns = taken_ns
