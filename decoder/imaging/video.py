"""Pictures of a video, decoded a group at a time; the one place where FFmpeg decodes.

Grey is the decoder's own luma plane, scaled to full range if the video has limited-range levels (16 to 235), so that a
frame and a panel picture taken from it have the same greys. A rotation stated in the video is applied, since it is the
same in all its pictures, and players show it so.

One thread decodes, so that the same packets give the same bytes however many processes share a flight.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import simplejpeg
from numpy.typing import NDArray

from decoder.panel.errors import PictureError
from flight_file.frame import Frame, Group
from flight_file.thresholds import MAX_PIXELS, MAX_SIDE_PX

if TYPE_CHECKING:
    from av import VideoFrame

JPEG_QUALITY = 97  # of a frame that becomes a panel picture
_CODECS = {"h264": "h264", "h265": "hevc"}
_PLANAR = frozenset({"yuv420p", "yuvj420p", "yuv422p", "yuvj422p", "yuv444p", "yuvj444p", "gray"})
_EIGHT_BITS = "yuv420p"
_INSTALL = "reading a video needs PyAV; install it: pip install 'image-flight-recorder[video]'"
_QUARTER_DEG = 90
_BLACK, _LUMA = 16.0, 255 / 219  # limited-range black, and the scale to full range. Source: ITU-R BT.709


class _Range(IntEnum):
    """FFmpeg's codes of the range of levels."""

    TELEVISION = 1
    FULL = 2


@dataclass(frozen=True, slots=True)
class GroupPicture:
    """One picture of a video: the group that it is decoded with, and its index there in order of time."""

    group: Group
    place: int


Encoded = bytes | GroupPicture
"""A picture as it was recorded: a whole file, or one of a group."""


def encoded_of(frame: Frame) -> Encoded:
    """Return a frame's picture, to be decompressed."""
    return frame.encoded if frame.group is None else GroupPicture(frame.group, frame.place)


class GroupDecoder:
    """Decodes pictures of one group after the other; if they are requested in order, each is decoded once."""

    def __init__(self) -> None:
        self._group: Group | None = None
        self._coming: Iterator[VideoFrame] = iter(())
        self._last: VideoFrame | None = None

    def picture(self, wanted: GroupPicture) -> VideoFrame:
        """Decode a picture.

        Raises
        ------
        PictureError
            It is damaged, larger than a picture may be, or PyAV is not installed.
        """
        group = wanted.group
        if group.trouble:
            raise PictureError(group.trouble)
        if self._last is not None and group == self._group and self._last.pts == wanted.place:
            return self._last
        if group != self._group or self._last is None or _place(self._last) > wanted.place:
            self._group, self._coming, self._last = group, _decoded(group), None
        for frame in self._coming:
            self._last = frame
            if frame.pts == wanted.place:
                _refuse_damaged(frame)
                return frame
        self._group = None
        raise PictureError("the picture is damaged: it cannot be decoded")

    def grey(self, wanted: GroupPicture, into: NDArray[np.uint8] | None = None) -> NDArray[np.uint8]:
        """(H, W) uint8: return a picture's luma, in memory of at least as many bytes if given.

        Raises
        ------
        PictureError
            As `picture`.
        """
        frame = _eight_bits(self.picture(wanted))
        plane = _plane(frame, 0)
        height, width = plane.shape
        target = np.empty(plane.shape, np.uint8) if into is None else into[: height * width].reshape(height, width)
        if _is_full_range(frame):
            np.copyto(target, plane)
        else:
            # Both together take a third of the time of a lookup table.
            cv2.subtract(plane, _BLACK, target)  # type: ignore[call-overload]  # its stubs know no scalar
            cv2.convertScaleAbs(target, target, _LUMA)
        return _turned(target, wanted.group.rotation_deg)

    def size_px(self, wanted: GroupPicture) -> int:
        """Count the pixels of a picture."""
        frame = self.picture(wanted)
        return frame.height * frame.width

    def colour(self, wanted: GroupPicture) -> NDArray[np.uint8]:
        """(H, W, 3) uint8, red, green, blue.

        Raises
        ------
        PictureError
            As `picture`.
        """
        return self.coloured(wanted)()

    def coloured(self, wanted: GroupPicture) -> Callable[[], NDArray[np.uint8]]:
        """Keep a picture so that it can be seen in colour after others have been decoded.

        Raises
        ------
        PictureError
            As `picture`.
        """
        return partial(_in_colour, self.picture(wanted), wanted.group.rotation_deg)

    def jpeg(self, wanted: GroupPicture) -> bytes:
        """Encode a picture as a JPEG whose luma is that of `grey`, up to compression.

        Raises
        ------
        PictureError
            As `picture`.
        """
        frame = self.picture(wanted)
        if frame.format.name not in ("yuv420p", "yuvj420p"):
            frame = frame.reformat(format=_EIGHT_BITS)
        luma, chroma = _levels(frame)
        planes = []
        for number, levels in enumerate((luma, chroma, chroma)):
            plane = _plane(frame, number)
            planes.append(_turned(_carried(plane, levels, np.empty(plane.shape, np.uint8)), wanted.group.rotation_deg))
        return bytes(simplejpeg.encode_jpeg_yuv_planes(*planes, JPEG_QUALITY))


def _in_colour(frame: VideoFrame, rotation_deg: int) -> NDArray[np.uint8]:
    """(H, W, 3) uint8, red, green, blue."""
    return _turned(np.asarray(frame.to_ndarray(format="rgb24"), np.uint8), rotation_deg)


def _decoded(group: Group) -> Iterator[VideoFrame]:
    """Decode a group's pictures in order of time; each has its index in the group as its time."""
    av: Any = _av()
    context = av.CodecContext.create(_CODECS[group.format], "r")
    context.thread_type, context.thread_count = "NONE", 1
    context.options = {"max_pixels": str(MAX_PIXELS)}
    try:
        for place, data in group.packets:
            packet = av.Packet(data)
            packet.pts = place
            yield from _own(context.decode(packet))
        yield from _own(context.decode(None))
    except av.FFmpegError as error:
        raise PictureError(f"the picture cannot be decoded: {error.strerror}") from error


def _own(frames: list[VideoFrame]) -> Iterator[VideoFrame]:
    return (frame for frame in frames if frame.pts is not None)


def _av() -> Any:  # noqa: ANN401 - a module
    try:
        import av  # noqa: PLC0415 - an extra, which JPEGs do without
    except ImportError as error:
        raise PictureError(_INSTALL) from error
    return av


def _place(frame: VideoFrame) -> int:
    return -1 if frame.pts is None else frame.pts


def _refuse_damaged(frame: VideoFrame) -> None:
    if frame.is_corrupt:
        raise PictureError("the picture is damaged: parts of it cannot be decoded")
    if frame.width * frame.height > MAX_PIXELS or max(frame.width, frame.height) > MAX_SIDE_PX:
        raise PictureError(f"the picture is {frame.width} x {frame.height}, which is more than can be read")


def _eight_bits(frame: VideoFrame) -> VideoFrame:
    """Return a frame whose first plane is luma of eight bits."""
    return frame if frame.format.name in _PLANAR or frame.format.name == "nv12" else frame.reformat(format=_EIGHT_BITS)


def _plane(frame: VideoFrame, number: int) -> NDArray[np.uint8]:
    plane = frame.planes[number]
    rows = np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)  # type: ignore[call-overload]  # it is a buffer
    shown: NDArray[np.uint8] = rows[: plane.height, : plane.width]
    return shown


def _carried(
    plane: NDArray[np.uint8], levels: NDArray[np.uint8] | None, target: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """Copy a plane, through a table of levels if there is one."""
    if levels is None:
        np.copyto(target, plane)
    else:
        cv2.LUT(plane, levels, target)
    return target


def _is_full_range(frame: VideoFrame) -> bool:
    return frame.format.name.startswith("yuvj") or frame.color_range == _Range.FULL


def _levels(frame: VideoFrame) -> tuple[NDArray[np.uint8] | None, NDArray[np.uint8] | None]:
    """Return tables for luma and chroma; None for those that are full range."""
    return (None, None) if _is_full_range(frame) else _tables()


@cache
def _tables() -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return tables from limited range, 16 to 235 and 16 to 240, to 0 to 255. Source: ITU-R BT.601, BT.709; JFIF."""
    levels = np.arange(256.0)
    luma = np.rint((levels - _BLACK) * _LUMA)
    chroma = np.rint((levels - 128) * 255 / 224 + 128)
    return luma.clip(0, 255).astype(np.uint8), chroma.clip(0, 255).astype(np.uint8)


def _turned(pixels: NDArray[np.uint8], rotation_deg: int) -> NDArray[np.uint8]:
    if not rotation_deg:
        return pixels
    return np.ascontiguousarray(np.rot90(pixels, -rotation_deg // _QUARTER_DEG))
