"""Groups of pictures: from a key frame up to the next, in the order of time.

A picture of a video depends on others: a key frame on none, the rest on those since the last key frame. Pictures that
follow a key frame in the file and precede it in time (an open group's leading pictures) depend on both groups; they
belong to the earlier group, which includes the key frame for them.

A coded picture is an access unit in Annex B: NAL units, each after 00 00 01. A key frame has its parameter sets before
it. Sources: ITU-T H.264 table 7-1, H.265 table 7-1; foxglove.CompressedVideo.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

from flight_file.frame import VIDEO_FORMATS, Frame, Group
from flight_file.thresholds import MAX_CHUNK_BYTES

_START = b"\0\0\1"
_SPS = {"h264": 7, "h265": 33}
_CODED = {"h264": range(1, 6), "h265": range(32)}
_MAX_GROUP_BYTES = 4 * MAX_CHUNK_BYTES
_LOST = "a picture of the video that it depends on is lost"
_ENDLESS = "the video has no key frame for too long; encode it again with ffmpeg -g 60"


def begins_group(frame: Frame) -> bool:
    """Whether parameter sets precede a video's coded picture, as they do for each key frame."""
    return has_parameter_sets(frame.encoded, frame.format)


def has_parameter_sets(data: bytes, kind_of_video: str) -> bool:
    """Whether they precede the coded picture of an access unit of `h264` or `h265`."""
    at = data.find(_START)
    while 0 <= at < len(data) - len(_START):
        first = data[at + len(_START)]
        kind = first & 31 if kind_of_video == "h264" else first >> 1 & 63
        if kind == _SPS[kind_of_video]:
            return True
        if kind in _CODED[kind_of_video]:
            return False
        at = data.find(_START, at + len(_START))
    return False


def in_groups(frames: Iterable[Frame]) -> Iterator[list[Frame]]:
    """Divide frames into groups, each in order of time; a frame that is not video is a group of its own.

    Frames are numbered in that order: those of a video exchange their stored numbers.

    Memory holds one group and the beginning of the next. If a group is too large for that, the rest of it comes without
    the packets needed to decode it.
    """
    own: list[Frame] = []
    given: list[Frame] = []  # leading pictures of this group's key frame, already in the group before
    key: Frame | None = None
    leading: list[Frame] = []
    size_bytes = 0
    for frame in frames:
        if frame.format not in VIDEO_FORMATS:
            yield [frame]
            continue
        is_key = begins_group(frame)
        if key is not None:
            if not is_key and frame.captured_ns < key.captured_ns:
                leading.append(frame)
                continue
            yield from _closed(own, given, key, leading)
            size_bytes = len(key.encoded)
            own, given, key, leading = [key], leading, None, []
        if is_key:
            key = frame
        elif size_bytes > _MAX_GROUP_BYTES:
            yield from _closed(own, given, None, [])
            own = []
            yield [_broken(frame, _ENDLESS)]
        else:
            own.append(frame)
            size_bytes += len(frame.encoded)
    yield from _closed(own, given, key, leading)
    if key is not None:
        yield from _closed([key], leading, None, [])


def _closed(
    own: Sequence[Frame], given: Sequence[Frame], key: Frame | None, leading: Sequence[Frame]
) -> Iterator[list[Frame]]:
    """Yield a group, unless it is empty: its own pictures, and those of the next that precede its key frame in time."""
    row = [*own, key, *leading] if key is not None and leading else list(own)
    stored = [*own[:1], *given, *row[1:]]
    sound = stored[: _unbroken(stored)] if own and begins_group(own[0]) else []
    sound = [*sound[:1], *sound[1 + len(given) :]]
    shown = sorted((frame for frame in sound if frame is not key), key=lambda each: (each.captured_ns, each.sequence))
    places = {frame.sequence: place for place, frame in enumerate(shown)}
    if own or leading:
        some = (own or leading)[0]
        packets = tuple((places.get(frame.sequence), frame.encoded) for frame in sound)
        group = Group(some.format, packets, some.rotation_deg)
        whole = [replace(frame, group=group, place=places[frame.sequence]) for frame in shown]
        broken = [_broken(frame, _LOST) for frame in row[len(sound) :] if frame is not key]
        in_time = sorted([*whole, *broken], key=lambda each: (each.captured_ns, each.sequence))
        numbers = sorted(frame.sequence for frame in [*given[-1:], *row[bool(given) :]])
        yield [replace(frame, sequence=number) for frame, number in zip(in_time, numbers, strict=False)]


def _unbroken(row: Sequence[Frame]) -> int:
    """Count the frames before the first gap."""
    gaps = (place for place, (one, two) in enumerate(pairwise(row), start=1) if two.sequence != one.sequence + 1)
    return next(gaps, len(row))


def _broken(frame: Frame, trouble: str) -> Frame:
    return replace(frame, group=Group(frame.format, (), frame.rotation_deg, trouble))
