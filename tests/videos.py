"""Small films with known pictures and known times, encoded by PyAV in whatever way a camera might."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.audio.stream import AudioStream
from av.container import OutputContainer
from av.video.stream import VideoStream
from numpy.typing import NDArray

from camera_drivers.replay.camera import ReplayCamera, open_source
from camera_drivers.replay.video_clocks import Believed
from flight_file.frame import Frame
from recorder.host import SimulatedClock

SIZE_PX = (160, 120)
TICKS_PER_S = 12_000
STEADY = tuple(range(0, 40 * 400, 400))  # 30 Hz
UNSTEADY = tuple(int(tick) for tick in np.cumsum(np.random.default_rng(7).integers(300, 900, 40)))
X264 = {"x264-params": "scenecut=0:threads=1"}
X265 = {"x265-params": "log-level=none:scenecut=0:pools=none:frame-threads=1"}


def drawn(number: int, size_px: tuple[int, int] = SIZE_PX) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 RGB: a picture that shows its number, as a bar that moves and a grey level."""
    width, height = size_px
    picture = np.full((height, width, 3), 40, np.uint8)
    picture[: height // 2] = 40 + 3 * number
    picture[height // 2 :, (3 * number) % (width - 8) : (3 * number) % (width - 8) + 8] = (230, 200, 60)
    return picture


def number_of(grey: NDArray[np.uint8]) -> int:
    """Which picture it is, by the middle of its upper half; full range."""
    height, width = grey.shape
    return round((float(np.median(grey[8 : height // 2 - 8, 8 : width - 8])) - 40) / 3)


def film(
    path: Path,
    *,
    ticks: Sequence[int] = STEADY,
    codec: str = "libx264",
    pixels: str = "yuv420p",
    group: int = 10,
    b_frames: int = 0,
    options: Mapping[str, str] | None = None,
    metadata: Mapping[str, str] | None = None,
    size_px: tuple[int, int] = SIZE_PX,
    first_number: int = 0,
    muxing: Mapping[str, str] | None = None,
    noise: int = 0,
    sound: NDArray[np.floating[Any]] | None = None,
    sound_rate_hz: int = 16_000,
    sound_codec: str = "aac",
) -> Path:
    """Encode numbered pictures at these times, in ticks of 1/12000 s, with so many grey levels of noise.

    `sound` is mono, full scale 1.
    """
    rng = np.random.default_rng(5)
    known = {"libx264": X264, "libx265": X265}.get(codec, {})
    with av.open(str(path), "w", options=dict(muxing or {})) as container:
        container.metadata.update(metadata or {})
        stream = container.add_stream(codec, rate=30, options={**known, **(options or {})})
        assert isinstance(stream, VideoStream)
        stream.width, stream.height = size_px
        stream.pix_fmt = pixels
        stream.time_base = stream.codec_context.time_base = Fraction(1, TICKS_PER_S)
        stream.codec_context.gop_size = group
        stream.codec_context.max_b_frames = b_frames
        track = container.add_stream(sound_codec, rate=sound_rate_hz) if sound is not None else None
        if isinstance(track, AudioStream) and sound is not None:
            track.layout, track.bit_rate = "mono", 64_000
            add_sound(container, track, sound)
        for number, tick in enumerate(ticks, start=first_number):
            picture = drawn(number, size_px)
            if noise:
                picture = picture // 2 + rng.integers(0, noise, picture.shape, np.uint8)
            frame = av.VideoFrame.from_ndarray(picture, "rgb24")
            frame.pts, frame.time_base = tick, Fraction(1, TICKS_PER_S)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def add_sound(container: OutputContainer, track: AudioStream, sound: NDArray[np.floating[Any]]) -> None:
    """Encode mono sound, full scale 1, into a track that is ready for it."""
    kind = "fltp" if track.codec_context.name == "aac" else "s16"
    samples = sound.astype(np.float32) if kind == "fltp" else np.round(sound * 32767).astype(np.int16)
    for start in range(0, len(samples), 4096):
        frame = av.AudioFrame.from_ndarray(samples[None, start : start + 4096], format=kind, layout="mono")
        frame.rate, frame.pts = track.rate, start
        container.mux(track.encode(frame))
    container.mux(track.encode(None))


def times_ns(ticks: Sequence[int]) -> list[int]:
    """When pictures with these times are shown."""
    return [round(Fraction(tick, TICKS_PER_S) * 10**9) for tick in ticks]


def packets(path: Path) -> list[bytes]:
    """Read a film's packets as they stand in it, by PyAV alone."""
    with av.open(str(path)) as container:
        return [bytes(packet) for packet in container.demux(container.streams.video[0]) if packet.size]


def decoded(path: Path) -> list[NDArray[np.uint8]]:
    """(H, W) uint8 each: a film's luma planes in the order of time, by PyAV alone."""
    with av.open(str(path)) as container:
        return [luma(frame) for frame in container.decode(video=0)]


def luma(frame: av.VideoFrame) -> NDArray[np.uint8]:
    """(H, W) uint8: the first plane."""
    plane = frame.planes[0]
    rows = np.frombuffer(bytes(plane), np.uint8).reshape(-1, plane.line_size)
    return rows[: frame.height, : frame.width]


def steps(numbers: Sequence[int]) -> set[int]:
    """How far apart neighbours are."""
    return {after - before for before, after in pairwise(numbers)}


def remuxed(source: Path, target: Path, *, shift_s: float = 0.0) -> Path:
    """Copy a film's packets, all so much earlier: what would be before 0 goes behind an edit list."""
    with av.open(str(source)) as given, av.open(str(target), "w") as made:
        stream = given.streams.video[0]
        copy = made.add_stream_from_template(stream)
        for packet in given.demux(stream):
            if packet.size and packet.pts is not None and packet.dts is not None and stream.time_base is not None:
                ticks = round(shift_s / stream.time_base)
                packet.pts, packet.dts, packet.stream = packet.pts - ticks, packet.dts - ticks, copy
                made.mux(packet)
    return target


def turned(path: Path, turns: int) -> Path:
    """Write into an MP4 by how many quarters players are to turn its pictures clockwise: the matrix of its tkhd box."""
    data = bytearray(path.read_bytes())
    one = 1 << 16
    cosine, sine = {0: (one, 0), 1: (0, one), 2: (-one, 0), 3: (0, -one)}[turns]
    matrix = (cosine, sine, 0, -sine, cosine, 0, 0, 0, 1 << 30)
    at = data.index(b"tkhd") + 4 + 40
    data[at : at + 36] = b"".join(value.to_bytes(4, "big", signed=True) for value in matrix)
    path.write_bytes(data)
    return path


def played(
    *paths: Path,
    believed: Believed | None = None,
    keep_sound: bool = False,
    rate_hz: float | None = None,
    clock: SimulatedClock | None = None,
) -> list[Frame]:
    """All frames of a replay."""
    clock = clock or SimulatedClock(0)
    source = open_source(paths, rate_hz=rate_hz, clock=clock, believed=believed, keep_sound=keep_sound)
    camera = ReplayCamera(source, clock)
    stop, frames = threading.Event(), []
    with camera:
        while (frame := camera.next_frame(stop)) is not None:
            frames.append(frame)
    return frames
