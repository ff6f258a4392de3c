"""Reading frames in batches: the one place where many frames are read at once.

A flight's frames are cut into batches by their position alone. What is read of a frame depends neither on who reads its
batch nor on when, nor on the frames beside it: a batch may be read in parts. No frame's failure touches another's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from decoder.imaging.picture_block import TopOfFrame, batch_frames, top_of
from decoder.imaging.pictures import FramePicture
from decoder.imaging.thresholds import MAX_BATCH_FRAMES
from decoder.imaging.video import Encoded, GroupPicture, encoded_of
from decoder.instruments.panel_reader import PanelReader
from decoder.instruments.reading import FrameReadings
from decoder.panel.errors import AlignmentLost, PictureError
from flight_file.frame import Frame


@dataclass(frozen=True, slots=True)
class RawFrame:
    """Of a frame what reading it takes; `focal_length_mm` is None if it does not tell.

    `picture` is decompressed, or its first rows, if that has been done; another process is not told.
    """

    sequence: int
    captured_ns: int
    encoded: Encoded
    focal_length_mm: float | None = None
    picture: FramePicture | TopOfFrame | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Unread:
    """Why a frame could not be read at all; `failed` are the features of the panel that did not match."""

    reason: str
    failed: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LeftOut(Unread):
    """Of a frame that was not read because whoever read it was killed: at another time it may be."""


Batch = tuple[RawFrame, ...]
Outcome = FrameReadings | Unread
ReadBatches = Callable[[PanelReader, Iterable[Batch]], Iterator[tuple[Batch, list[Outcome]]]]
"""Reads batches, here or elsewhere: gives each, in order, with what was read of its frames."""


def batches(
    frames: Iterable[Frame], size: int, picture: Callable[[Frame], FramePicture | TopOfFrame | None] | None = None
) -> Iterator[Batch]:
    """Return the frames in their order, so many at a time; the last batch may be smaller.

    Of a video, whole groups of pictures are together, so that each is decoded once; only those are cut that are longer
    than the 250 pictures which encoders put into a group unless they are told otherwise. `picture` gives those that are
    decompressed already.
    """
    raw = (
        RawFrame(
            frame.sequence,
            frame.captured_ns,
            encoded_of(frame),
            frame.exif.lens_mm,
            None if picture is None else picture(frame),
        )
        for frame in frames
    )
    batch: list[RawFrame] = []
    for frame in raw:
        together = bool(batch) and _are_together(batch[-1], frame)
        if len(batch) >= (max(size, 7 * MAX_BATCH_FRAMES) if together else size):
            yield tuple(batch)
            batch = []
        batch.append(frame)
    if batch:
        yield tuple(batch)


def _are_together(one: RawFrame, two: RawFrame) -> bool:
    """Whether both are pictures of the same group."""
    return (
        isinstance(one.encoded, GroupPicture)
        and isinstance(two.encoded, GroupPicture)
        and one.encoded.group is two.encoded.group
    )


def read_batch(reader: PanelReader, frames: Sequence[RawFrame]) -> list[Outcome]:
    """Return what is read of each frame, in their order; keeps nothing from batch to batch."""
    height, width = reader.source.picture.shape
    at_once = batch_frames((width, height))
    outcomes: list[Outcome] = []
    for first in range(0, len(frames), at_once):
        some = frames[first : first + at_once]
        reader.block.reserve(len(some))
        pictures = (_picture(reader, frame, slot) for slot, frame in enumerate(some))
        outcomes += [_unread(one) if isinstance(one, PictureError) else one for one in reader.read(pictures)]
    return outcomes


def read_here(reader: PanelReader, cut: Iterable[Batch]) -> Iterator[tuple[Batch, list[Outcome]]]:
    """Read the batches one after the other in this process."""
    for batch in cut:
        yield batch, read_batch(reader, batch)


def _picture(reader: PanelReader, frame: RawFrame, slot: int) -> FramePicture | TopOfFrame | PictureError:
    try:
        if frame.picture is not None:
            return top_of(frame.picture, reader.placement.rows)
        rows, has_colour = reader.placement.rows, reader.source.has_colour
        return reader.block.frame(frame.encoded, slot, frame.focal_length_mm, rows, has_colour=has_colour)
    except PictureError as error:
        return error


def _unread(error: PictureError) -> Unread:
    return Unread(str(error), error.failed if isinstance(error, AlignmentLost) else ())
