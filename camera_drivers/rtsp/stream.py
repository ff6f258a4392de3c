"""The stream of one IP camera: opened, read by a thread of its own, and abandoned if it hangs.

    open ──▶ DESCRIBE, SETUP over TCP, PLAY ──▶ thread: access units ──▶ queue ──▶ picture
                                                  └── the end, or nothing for stall_s: its failure ──▶ CameraError

FFmpeg speaks RTSP, assembles RTP packets into access units in Annex B, and keeps sessions alive. It returns an access
unit when the next one begins, so a picture began to arrive when the one before was returned. It also gives each unit's
wall-clock time (`prft`) by the latest sender report: this follows the camera's clock, which `start_time_realtime` does
not, since it uses only the first report.

Only video is requested: no voices are wanted on the box. Parameter sets are put before a key frame that lacks them.
"""

from __future__ import annotations

import ctypes
import queue
import struct
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from urllib.parse import urlsplit

import av
from av import _core
from av.container import InputContainer
from av.error import FFmpegError, HTTPNotFoundError, HTTPUnauthorizedError, InvalidDataError
from av.video.stream import VideoStream

from camera_drivers.camera import CameraIdentity
from camera_drivers.clock import Clock
from camera_drivers.errors import CameraError, CameraUnusableError
from camera_drivers.live.camera import LiveCamera
from camera_drivers.live.source import Missed, Picture
from camera_drivers.reporter import Reporter
from camera_drivers.rtsp.options import RtspSettings, with_credentials
from camera_drivers.rtsp.times import Stamps, StreamTimes
from camera_drivers.thresholds import CLOSE_S, LOOK_S, MAX_WAITING_PICTURES, SAY_S
from camera_drivers.waiting import NO_MEMORY, Notes, Waiter, begin
from flight_file.frame import NS_PER_S, ClockReading
from flight_file.thresholds import MAX_CHUNK_BYTES
from flight_file.video.groups import has_parameter_sets

DRIVER = "rtsp"
DAMAGED = "a part of the picture was lost on its way"
NO_KEY_FRAME = "it came before the stream's first key frame"
ENDED = "the stream ended"
_MAX_UNIT_BYTES = MAX_CHUNK_BYTES // 2
_FORMATS = {"h264": "h264", "hevc": "h265"}
_PRFT = struct.Struct("=qi")  # AVProducerReferenceTime: us since 1970, flags
_NS_PER_US = 1000
_MEANING: Mapping[type[FFmpegError], str] = {
    HTTPNotFoundError: "there is no such stream; correct camera.url",
    InvalidDataError: "it does not answer, or not as an RTSP server",
}
_OPTIONS = {
    "rtsp_transport": "tcp",
    "allowed_media_types": "video",
    "protocol_whitelist": "rtp,tcp,udp",  # no file, and no other server
    "fpsprobesize": "0",  # else FFmpeg examines a second of pictures before it gives the first
}


def rtsp_camera(options: RtspSettings, clock: Clock, reporter: Reporter) -> LiveCamera:
    """Make the camera that the options describe; nothing is opened yet."""
    _limit_blocks()

    def connect(waiter: Waiter, notes: Notes, missed: Missed) -> RtspSource:
        url, place = with_credentials(options), _place(options.url)
        work = partial(_opened, url, options)
        # FFmpeg's own limit ends it; ours is for what that does not cover, such as looking up a name.
        container = waiter.until_done(f"connecting to {place}", work, lambda: None, limit_s=2 * options.open_s)
        return RtspSource(container, options, clock, notes, missed)

    return LiveCamera(DRIVER, connect, options, clock, reporter)


def _limit_blocks() -> None:
    """Let FFmpeg allocate no block larger than any picture: the other side says how long its answers are."""
    with suppress(AttributeError, OSError):  # an FFmpeg that has no such limit
        ctypes.CDLL(_core.__file__).av_max_alloc(ctypes.c_size_t(_MAX_UNIT_BYTES))


@dataclass(frozen=True, slots=True)
class _Unit:
    """An access unit from FFmpeg, with its times."""

    encoded: bytes
    is_key: bool
    is_damaged: bool
    stamps: Stamps
    given: ClockReading


class RtspSource:
    """An open stream; see `camera_drivers.live.source.Source`.

    Units are held back during the first second: only then the delay of pictures is known, since FFmpeg has examined
    some before it gives the first.

    Raises
    ------
    CameraUnusableError
        It is not a stream of H.264 or H.265.
    """

    def __init__(
        self, container: InputContainer, options: RtspSettings, clock: Clock, notes: Notes, missed: Missed
    ) -> None:
        try:
            stream = _video(container, options)
        except BaseException:
            container.close()
            raise
        self._clock = clock
        self._format = _FORMATS[stream.codec_context.name]
        self._sets = bytes(stream.codec_context.extradata or b"")
        self._size_px = (stream.width, stream.height) if stream.width and stream.height else None
        self._times = StreamTimes(options.latency_s, notes)
        self._held: deque[_Unit] = deque()
        self._is_settled = False
        self._failure: CameraError | None = None
        self._missed = missed
        self._has_key = False
        self._reader = _Reader(lambda: _units(container, stream, clock), container.close)
        try:
            begin(self._reader, "stream")
        except CameraError:
            container.close()
            raise
        size = " {} x {}".format(*self._size_px) if self._size_px else ""
        self.identity = CameraIdentity(DRIVER, note=f"{_place(options.url)}, {self._format}{size}")

    def next_picture(self, wait_s: float) -> Picture | None:
        """Wait for the next access unit; see `Source`."""
        if not self._is_settled:
            self._settle(wait_s)
            return None
        if not self._held:
            if self._failure is not None:
                raise self._failure
            self._receive(wait_s)
        return self._picture(self._held.popleft()) if self._held else None

    def close(self) -> None:
        """Leave the stream; a thread that hangs in it ends by itself, after stall_s at most."""
        self._reader.stop()

    def _settle(self, wait_s: float) -> None:
        self._receive(wait_s)
        if self._failure is None and self._held:
            passed_ns = self._clock.read().monotonic_ns - self._held[0].given.monotonic_ns
            self._is_settled = passed_ns >= SAY_S * NS_PER_S
        else:
            self._is_settled = self._failure is not None
        if self._is_settled and len(self._held) > 2:  # noqa: PLR2004 - two that have times
            self._held[0] = _with_time(*(self._held[place] for place in range(3)))

    def _receive(self, wait_s: float) -> None:
        try:
            unit = self._reader.take(wait_s)
        except CameraError as failure:
            self._failure = failure
            return
        if unit is not None:
            self._times.hear(unit.stamps)
            self._held.append(unit)

    def _picture(self, unit: _Unit) -> Picture | None:
        self._has_key = self._has_key or unit.is_key
        if unit.is_damaged:
            self._missed.add(DAMAGED)
            return None
        if not self._has_key:
            self._missed.add(NO_KEY_FRAME, alive=True)  # there may be a minute between key frames
            return None
        taken_ns, sigma_ns = self._times.taken(unit.stamps, is_key=unit.is_key)
        return Picture(
            encoded=self._with_sets(unit),
            received=unit.given,
            taken_ns=taken_ns,
            sigma_ns=sigma_ns,
            number=unit.given.monotonic_ns if unit.stamps.stream_ns is None else unit.stamps.stream_ns,
            format=self._format,
            size_px=self._size_px,
        )

    def _with_sets(self, unit: _Unit) -> bytes:
        lacks = unit.is_key and not has_parameter_sets(unit.encoded, self._format)
        return self._sets + unit.encoded if lacks else unit.encoded


class _Reader(threading.Thread):
    """Reads a stream until it ends, fails or is stopped, and closes it then.

    It waits while its units are not taken: TCP then makes the camera wait.
    """

    def __init__(self, read: Callable[[], Iterator[_Unit]], close: Callable[[], None]) -> None:
        super().__init__(name="camera rtsp", daemon=True)
        self._read = read
        self._close = close
        self._queue: queue.Queue[_Unit | CameraError] = queue.Queue(MAX_WAITING_PICTURES)
        self._over = threading.Event()

    def run(self) -> None:
        """Read."""
        failure = CameraError(_sentence(ENDED))
        try:
            for unit in self._read():
                if not self._put(unit):
                    return
        except FFmpegError as error:
            failure = CameraError(_sentence(error.strerror))
        except CameraError as error:
            failure = error
        except MemoryError:
            failure = CameraError(_sentence(NO_MEMORY))
        finally:
            self._close()
        self._put(failure)

    def take(self, wait_s: float) -> _Unit | None:
        """Take the oldest unit; None if there is none in time. Raises the CameraError that the stream ended with."""
        try:
            item = self._queue.get(timeout=wait_s)
        except queue.Empty:
            return None
        if isinstance(item, CameraError):
            raise item
        return item

    def stop(self) -> None:
        """Ask it to end, and wait for that briefly."""
        self._over.set()
        self.join(CLOSE_S)

    def _put(self, item: _Unit | CameraError) -> bool:
        while not self._over.is_set():
            try:
                self._queue.put(item, timeout=LOOK_S)
            except queue.Full:
                continue
            return True
        return False


def _opened(url: str, options: RtspSettings) -> InputContainer:
    """Open the stream; FFmpeg's messages are not passed on, since they name the URL with its password."""
    timeout_s = (options.open_s, options.stall_s)
    try:
        return av.open(url, "r", metadata_errors="replace", options=_OPTIONS, timeout=timeout_s)
    except HTTPUnauthorizedError:
        what = "asks for user and password" if options.credentials is None else "does not take user and password"
        problem = f"{_place(options.url)}: the camera {what}; see camera.credentials in docs/cameras.md."
    except (FFmpegError, OSError) as error:
        why = next((meaning for kind, meaning in _MEANING.items() if isinstance(error, kind)), error.strerror)
        raise CameraError(f"{_place(options.url)}: {_sentence(why)}") from None
    raise CameraUnusableError(problem)


def _video(container: InputContainer, options: RtspSettings) -> VideoStream:
    streams = [
        stream
        for stream in container.streams.video
        if stream.codec_context is not None  # type: ignore[redundant-expr]  # it is where FFmpeg knows no such codec
    ]
    names = [stream.codec_context.name for stream in streams]
    found = next((stream for stream, name in zip(streams, names, strict=True) if name in _FORMATS), None)
    if found is None:
        raise CameraUnusableError(
            f"{_place(options.url)}: sends {', '.join(names) or 'no video'}; set the camera to H.264 or H.265."
        )
    return found


def _units(container: InputContainer, stream: VideoStream, clock: Clock) -> Iterator[_Unit]:
    began = None
    for packet in container.demux(stream):
        if packet.size > _MAX_UNIT_BYTES:
            raise CameraError(f"A picture has {packet.size >> 20} MiB, which no camera makes.")
        if not packet.size:  # the end
            return
        given = clock.read()
        base = packet.time_base or stream.time_base
        stream_ns = None if packet.pts is None or base is None else round(packet.pts * base * NS_PER_S)
        # A unit is returned when the next one begins to arrive; so it began to arrive when the one before was returned.
        stamps = Stamps(_reported_ns(packet), stream_ns, began or given)
        yield _Unit(bytes(packet), packet.is_keyframe, packet.is_corrupt, stamps, given)
        began = given


def _with_time(first: _Unit, second: _Unit, third: _Unit) -> _Unit:
    """Give a stream's first unit the time that FFmpeg leaves out: as far before the second as the third is after it."""
    ours, one, two = first.stamps.stream_ns, second.stamps.stream_ns, third.stamps.stream_ns
    if ours is not None or one is None or two is None:
        return first
    return replace(first, stamps=replace(first.stamps, stream_ns=2 * one - two))


def _reported_ns(packet: av.Packet[VideoStream]) -> int | None:
    data = bytes(packet.get_sidedata("prft")) if packet.has_sidedata("prft") else b""
    if len(data) < _PRFT.size:
        return None
    wall_us, _ = _PRFT.unpack_from(data)
    return int(wall_us) * _NS_PER_US


def _place(url: str) -> str:
    """Return host and port, for people."""
    return urlsplit(url).netloc.rpartition("@")[2]


def _sentence(problem: str | None) -> str:
    return f"The camera's stream failed ({problem}); check that the camera is on and in reach."
