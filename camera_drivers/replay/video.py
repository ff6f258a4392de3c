"""Video files as a camera: packets as they are, each with its own presentation time, never encoded again.

H.264 and H.265 become access units in Annex B, with the parameter sets before each key frame; an MP4 file has lengths
in place of start codes, and the parameter sets once. MJPEG is JPEGs as they are. Packets come in the order of the file,
which is decoding order: with B-frames it differs from the order of time.

The strongest tones of its sound are kept (see `camera_drivers.replay.sound`); the packets only on request.

Edit lists are followed as players do. Pictures before the first shown one that it depends on are stored with times
before the start. Source: FFmpeg's mov demuxer.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from fractions import Fraction
from itertools import accumulate, islice, pairwise
from pathlib import Path

import av
from av.container import InputContainer
from av.error import FFmpegError
from av.stream import Disposition
from av.video.stream import VideoStream

from camera_drivers.camera import CameraIdentity
from camera_drivers.clock import Clock
from camera_drivers.errors import ReplayError
from camera_drivers.replay.chapters import in_order
from camera_drivers.replay.telemetry import Fixes, Telemetry, TimedPayload, payloads, summarized
from camera_drivers.replay.upcoming import Alongside, Upcoming
from camera_drivers.replay.video_clocks import (
    CREATION,
    FILE_DATE,
    GPS,
    TIMECODE,
    Believed,
    GpsClock,
    Start,
    disagreements,
    gps_of_chapters,
    shift_of_chapter,
    started,
)
from flight_file.frame import JPEG, MAX_TIME_NS, NS_PER_S, Frame, GpsFix, HostTimes, Origin, Sound
from flight_file.segment import digest_of, opened
from flight_file.session import NO_SOUND, Original
from flight_file.thresholds import BLOCK_BYTES, MAX_CHUNK_BYTES, MAX_PIXELS, MAX_SIDE_PX
from flight_file.untrusted import open_regular, printable

_FORMATS = {"h264": "h264", "hevc": "h265", "mjpeg": JPEG}
_TO_ANNEX_B = {
    "h264": "h264_mp4toannexb,dump_extra=freq=keyframe",
    "h265": "hevc_mp4toannexb,dump_extra=freq=keyframe",
}
_OPTIONS = {"format_whitelist": "mov,matroska,avi,mpegts", "protocol_whitelist": "file"}  # none that names other files
_QUARTER_DEG = 90
_FIRST_PACKETS = 600  # more than a group of pictures, to find their order
_CONVERT = "convert it: ffmpeg -i {name} -c:v libx264 -crf 17 -an converted.mp4"


@dataclass(frozen=True, slots=True)
class Chapter:
    """One video file's properties.

    Attributes
    ----------
    size_px
        Width and height of its pictures, before they are turned.
    pictures
        Number in its index; 0 if it has none.
    first_ns
        The earliest time of its first pictures, by its own time base.
    length_ns
        Its stated length.
    telemetry
        Its telemetry.
    facts
        Its statements about itself, for the session.
    """

    path: Path
    track: int
    format: str
    size_px: tuple[int, int]
    rotation_deg: int
    pictures: int
    rate_hz: float
    first_ns: int
    length_ns: int
    telemetry: Telemetry
    facts: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class _Packet:
    """A packet of a chapter: its time and length there, ns, its bytes as they came and as they are stored."""

    time_ns: int
    length_ns: int
    sha256: str
    stored: bytes


class VideoSource:
    """The chapters of one recording, in their order.

    Parameters
    ----------
    paths
        In any order.
    believed
        Its stated time.
    keep_sound
        Whether the packets of its sound are stored too, beside its strongest tones.

    Raises
    ------
    ReplayError
        One of them cannot be read, holds no video that can be stored, or is of another kind than the others.
    """

    def __init__(self, paths: Sequence[Path], believed: Believed, *, keep_sound: bool = False) -> None:
        self._keep_sound = keep_sound
        self._chapters = [look_at(path) for path in in_order(paths)]
        first = self._chapters[0]
        for chapter in self._chapters[1:]:
            _refuse_other_kind(first, chapter)
        begins_ns = [0, *accumulate(chapter.length_ns for chapter in self._chapters[:-1])]
        gps = gps_of_chapters([chapter.telemetry.clock for chapter in self._chapters], begins_ns)
        start = started(believed, first.facts, first.rate_hz, first.path.name, gps)
        self._sigma_ns = start.sigma_ns
        # If the time of day is unknown, the earliest picture is at 0: no time may be less.
        self._zero_ns = max(start.time_ns, -first.first_ns)
        self.start_ns = self._zero_ns + first.first_ns
        self.attachments: Mapping[str, bytes] = {}
        self.identity = CameraIdentity(
            driver="replay",
            model=printable(first.telemetry.device),
            note=f"video, {len(self._chapters)} {'file' if len(self._chapters) == 1 else 'files'}",
            time_of_day=start.time_of_day,
            originals=tuple(
                _original(chapter, gps, begin_ns, start)
                for chapter, begin_ns in zip(self._chapters, begins_ns, strict=True)
            ),
        )

    def pictures(self) -> Iterator[Upcoming]:
        """Iterate over the pictures of all chapters in decoding order."""
        sequence, offset_ns = 0, self._zero_ns
        for number, chapter in enumerate(self._chapters):
            end_ns = 0
            fixes = Fixes(_payloads(chapter), number, offset_ns)
            sounds = Alongside(self._heard(chapter, offset_ns))
            for packet in _packets(chapter):
                end_ns = max(end_ns, packet.time_ns + packet.length_ns)
                captured_ns = max(offset_ns + packet.time_ns, 0)
                if captured_ns > MAX_TIME_NS:
                    raise ReplayError(f"{chapter.path}: picture {sequence} has a time that no flight is at.")
                origin = Origin(number, packet.time_ns, packet.sha256)
                came, heard = fixes.up_to(packet.time_ns), sounds.with_picture(captured_ns)
                taking = _Taking(chapter, packet, sequence, captured_ns, self._sigma_ns, origin, came, heard)
                yield Upcoming(captured_ns, taking)
                sequence += 1
            offset_ns += end_ns

    def _heard(self, chapter: Chapter, zero_ns: int) -> Iterator[Sound]:
        if chapter.facts["sound"] != NO_SOUND:
            try:
                from camera_drivers.replay.sound import listened  # noqa: PLC0415 - NumPy, which a box does without
            except ImportError as error:
                raise ReplayError(
                    f"{chapter.path}: listening to its sound needs NumPy; install it: pip install numpy"
                ) from error
            with _opened(chapter.path) as container:
                yield from listened(container, zero_ns, keep_packets=self._keep_sound)


def _payloads(chapter: Chapter) -> Iterator[TimedPayload]:
    if chapter.telemetry.payloads:
        with _opened(chapter.path) as container:
            yield from payloads(container)


@dataclass(frozen=True, slots=True)
class _Taking:
    """Makes the frame of a packet when its time has come."""

    chapter: Chapter
    packet: _Packet
    sequence: int
    captured_ns: int
    sigma_ns: int | None
    origin: Origin
    fixes: tuple[GpsFix, ...] = ()
    sound: tuple[Sound, ...] = ()

    def __call__(self, clock: Clock) -> Frame:
        now = clock.read()
        chapter, stored = self.chapter, self.packet.stored
        return Frame(
            sequence=self.sequence,
            captured_ns=self.captured_ns,
            encoded=stored,
            sha256=hashlib.sha256(stored).hexdigest(),
            times=HostTimes(now, now, now),
            width_px=chapter.size_px[0],
            height_px=chapter.size_px[1],
            captured_sigma_ns=self.sigma_ns,
            format=chapter.format,
            rotation_deg=chapter.rotation_deg,
            origin=self.origin,
            readout_s=chapter.telemetry.readout_s,
            fixes=self.fixes,
            sound=self.sound,
        )


def look_at(path: Path) -> Chapter:
    """Open a video file, choose its track and read what it says of itself.

    Raises
    ------
    ReplayError
        It holds no video that can be stored, or was cut off.
    """
    with _opened(path) as container:
        stream = _track(path, container)
        codec, size_px = stream.codec_context.name, (stream.width, stream.height)
        if codec not in _FORMATS:
            raise ReplayError(
                f"{path}: its video is {codec}; only H.264, H.265 and MJPEG are stored as they are, so"
                f" {_CONVERT.format(name=path.name)}"
            )
        if not 0 < size_px[0] * size_px[1] <= MAX_PIXELS or max(size_px) > MAX_SIDE_PX:
            raise ReplayError(
                f"{path}: its pictures are {size_px[0]} x {size_px[1]}, which is more than can be read;"
                " make them smaller with ffmpeg -vf scale."
            )
        times = [_time_ns(path, packet, stream) for packet in islice(_demuxed(path, container, stream), _FIRST_PACKETS)]
        if not times:
            raise ReplayError(f"{path}: there is no picture in it; was the recording cut off?")
        rate_hz = float(stream.average_rate or 0)
        facts = _facts(path, container, stream) | _oddities(stream, times)
        chapter = Chapter(
            path=path,
            track=stream.index,
            format=_FORMATS[codec],
            size_px=size_px,
            rotation_deg=0,
            pictures=len(stream.index_entries),
            rate_hz=rate_hz,
            first_ns=min(times),
            length_ns=round((stream.duration or 0) * (stream.time_base or Fraction(0)) * NS_PER_S),
            telemetry=Telemetry(),
            facts=facts,
        )
    with _opened(path) as container:
        chapter = replace(chapter, telemetry=summarized(path, container))
    return _turned(replace(chapter, facts={**chapter.facts, **chapter.telemetry.facts()}))


def _turned(chapter: Chapter) -> Chapter:
    """Find its pictures' rotation, which only a decoded one gives."""
    with _opened(chapter.path) as container:
        stream = _same_track(chapter, container)
        try:
            frame = next(iter(container.decode(stream)), None)
        except FFmpegError as error:
            raise ReplayError(f"{chapter.path}: its first picture cannot be decoded ({error.strerror}).") from error
        # FFmpeg counts anticlockwise.
        rotation_deg = 0 if not isinstance(frame, av.VideoFrame) else -round(frame.rotation) % 360
    if rotation_deg % _QUARTER_DEG:
        raise ReplayError(f"{chapter.path}: its pictures are to be turned by {rotation_deg} degrees, which nobody can.")
    if not rotation_deg:
        return chapter
    return replace(chapter, rotation_deg=rotation_deg, facts={**chapter.facts, "rotation": f"{rotation_deg} degrees"})


@contextmanager
def _opened(path: Path) -> Iterator[InputContainer]:
    try:
        with (
            os.fdopen(open_regular(path), "rb") as file,
            av.open(file, "r", metadata_errors="replace", options=_OPTIONS, buffer_size=BLOCK_BYTES) as container,
        ):
            yield container
    except OSError as error:
        if isinstance(error, FFmpegError):
            raise ReplayError(f"{path}: {_why(path, error)}") from error
        raise ReplayError(f"{path}: cannot be read ({error.strerror}); check its name and permissions.") from error
    except FFmpegError as error:
        raise ReplayError(f"{path}: {_why(path, error)}") from error


def _why(path: Path, error: FFmpegError) -> str:
    """Say why a file cannot be opened as a video."""
    with opened(path) as source:
        head = source.read_at(0, 12)
    if head[4:8] in (b"ftyp", b"mdat", b"wide", b"free"):
        return (
            "its index (moov) is missing, as in a file that a camera had no time to finish; let the camera repair it,"
            " or untrunc with another video of the same camera, and run this again."
        )
    return f"is no video that can be read ({error.strerror}); give an MP4, MOV or MKV, or flight files."


def _track(path: Path, container: InputContainer) -> VideoStream:
    """Choose among several: the one that players show first, and of those the largest; never a cover picture."""
    tracks = [
        each
        for each in container.streams.video
        if each.codec_context is not None  # type: ignore[redundant-expr]  # it is where FFmpeg knows no such codec
        and not each.disposition & Disposition.attached_pic
    ]
    if not tracks:
        raise ReplayError(f"{path}: there is no video in it that is known; give a file with pictures.")
    return max(
        tracks,
        key=lambda each: (bool(each.disposition & Disposition.default), each.width * each.height, -each.index),
    )


def _same_track(chapter: Chapter, container: InputContainer) -> VideoStream:
    """Find the track that was chosen when the file was first opened."""
    for stream in container.streams.video:
        if stream.index == chapter.track and stream.codec_context is not None:
            return stream
    raise ReplayError(f"{chapter.path}: its tracks are not what they were a moment ago; is somebody writing it?")


def _facts(path: Path, container: InputContainer, stream: VideoStream) -> dict[str, str]:
    """Collect a file's statements about itself, its clocks first."""
    metadata = {**container.metadata, **stream.metadata}
    timecodes = [each.metadata.get("timecode") for each in container.streams]
    facts = {
        CREATION: metadata.get("creation_time"),
        TIMECODE: next(filter(None, [metadata.get("timecode"), *timecodes]), None),
        FILE_DATE: f"{datetime.fromtimestamp(int(path.stat().st_mtime), UTC):%Y-%m-%dT%H:%M:%SZ}",
        "video": f"{stream.codec_context.name} {stream.width}x{stream.height}",
        "pictures": str(len(stream.index_entries) or stream.frames or "not stated"),
        "sound": _sound(container),
    }
    tracks = len(container.streams.video)
    if tracks > 1:
        facts["track"] = f"{stream.index}, one of {tracks} with video"
    return {name: text for name, text in facts.items() if text}


def _sound(container: InputContainer) -> str:
    """Describe the sound that is used; other tracks are not."""
    track = next((each for each in container.streams.audio if each.codec_context is not None), None)  # type: ignore[redundant-expr]  # as in _track
    return NO_SOUND if track is None else f"{track.codec_context.name} {track.rate} Hz {track.layout.name}"


def _oddities(stream: VideoStream, times: Sequence[int]) -> dict[str, str]:
    """Say in words what a reader of the flight should know."""
    found = {}
    if any(after < before for before, after in pairwise(times)):
        found["order"] = "B-frames: stored in decoding order, which Foxglove does not play"
    cut = stream.frames - len(stream.index_entries) if stream.index_entries else 0
    if cut > 0:
        found["edit list"] = f"{cut} pictures that it cuts away are not in the flight"
    return found


def _demuxed(path: Path, container: InputContainer, stream: VideoStream) -> Iterator[av.Packet[VideoStream]]:
    """Iterate over a track's packets up to the first that is not whole."""
    for packet in container.demux(stream):
        if packet.is_corrupt:
            return
        if packet.size > MAX_CHUNK_BYTES // 2:
            raise ReplayError(f"{path}: a picture in it has {packet.size >> 20} MiB, which no camera makes.")
        if packet.size:
            yield packet


def _time_ns(path: Path, packet: av.Packet[VideoStream], stream: VideoStream) -> int:
    time = packet.pts if packet.pts is not None else packet.dts
    if time is None:
        raise ReplayError(
            f"{path}: its pictures have no times; put them into an MP4 with the rate that they were taken at:"
            f" ffmpeg -r 30 -i {path.name} -c copy timed.mp4"
        )
    return round(time * (packet.time_base or stream.time_base or Fraction(1)) * NS_PER_S)


def _packets(chapter: Chapter) -> Iterator[_Packet]:
    """Read a chapter's packets, as they came and as they are stored."""
    with _opened(chapter.path) as container:
        stream = _same_track(chapter, container)
        name = _TO_ANNEX_B.get(chapter.format)
        convert = None if name is None else av.BitStreamFilterContext(name, stream)
        for packet in _demuxed(chapter.path, container, stream):
            came = bytes(packet)  # a filter empties the packet that it is given
            time_ns = _time_ns(chapter.path, packet, stream)
            length_ns = round((packet.duration or 0) * (packet.time_base or Fraction(0)) * NS_PER_S)
            stored = came if convert is None else b"".join(map(bytes, convert.filter(packet)))
            yield _Packet(time_ns, length_ns, hashlib.sha256(came).hexdigest(), stored)


def _original(chapter: Chapter, gps: GpsClock | None, begin_ns: int, start: Start) -> Original:
    """Gather a chapter's statements about itself.

    Parameters
    ----------
    gps
        The recording's GPS time.
    begin_ns
        When the chapter begins, by the recording's own clock.
    start
        The recording's time that is used.
    """
    own = chapter.telemetry.clock
    with opened(chapter.path) as source:
        facts = dict(chapter.facts)
        if own is not None and gps is not None:
            facts[GPS] = own.fact + shift_of_chapter(own, gps, begin_ns)
        apart = disagreements(facts, own, start.time_ns + begin_ns if start.time_of_day == "start" else None)
        if apart:
            facts["clocks"] = apart
        return Original(chapter.path.name, source.size, digest_of(source), facts)


def _refuse_other_kind(first: Chapter, other: Chapter) -> None:
    one, two = ((each.format, each.size_px, each.rotation_deg) for each in (first, other))
    if one != two:
        raise ReplayError(
            f"{first.path} and {other.path} are no chapters of one recording: their pictures differ in codec, size or"
            " rotation; make a flight file of each."
        )
