"""Reading frames in batches: the one place where many frames are read at once.

A flight's frames are cut into batches by their position alone. A frame's result depends neither on who reads its batch
or when, nor on the other frames in it: a batch may be read in parts. A frame that fails does not affect the others.
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
    """What is needed to read a frame; `focal_length_mm` is None if unknown.

    `picture` holds the frame, or its first rows, if already decompressed; it is not sent to other processes.
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
    """A frame that was not read because its reader was killed; it may be readable at another time."""


Batch = tuple[RawFrame, ...]
Outcome = FrameReadings | Unread
ReadBatches = Callable[[PanelReader, Iterable[Batch]], Iterator[tuple[Batch, list[Outcome]]]]
"""Reads batches, here or elsewhere: gives each, in order, with what was read of its frames."""


def batches(
    frames: Iterable[Frame], size: int, picture: Callable[[Frame], FramePicture | TopOfFrame | None] | None = None
) -> Iterator[Batch]:
    """Yield the frames in their order in batches of `size`; the last one may be smaller.

    For video, whole groups of pictures stay together, so that each is decoded once. Only groups longer than the 250
    pictures that encoders put into a group by default are cut. `picture` provides frames that are already decompressed.
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
    """Read each frame, in order; nothing is kept from batch to batch."""
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
