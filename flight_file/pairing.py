"""Put the two messages of a frame together again: its record and its image.

They belong together if they name the same capture time, and are delivered only if the image has the digest that the
record states. Our writer puts both into one chunk; another writer may part them, so each waits for its partner until
the next chunk has been read. One without the other is a loss: a picture without its record cannot be checked, a record
without its picture is no frame.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

from flight_file.codec import Image
from flight_file.frame import Frame


@dataclass(frozen=True, slots=True)
class Unpaired:
    """A frame that cannot be delivered: why, the chunk it came in (offset and length, bytes), its record if known."""

    reason: str
    offset: int
    length: int
    frame: Frame | None = None


@dataclass(frozen=True, slots=True)
class _Waiting:
    item: Frame | Image
    offset: int
    length: int
    round: int


class Pairing:
    """Feed it the messages of one file; it gives back frames."""

    def __init__(self) -> None:
        self._waiting: list[_Waiting] = []
        self._round = 0

    def feed(self, item: Frame | Image, *, offset: int, length: int) -> Frame | Unpaired | None:
        """Take one message of the chunk at `offset`; gives the frame if this completes one."""
        for index, other in enumerate(self._waiting):
            if other.item.captured_ns == item.captured_ns and type(other.item) is not type(item):
                del self._waiting[index]
                return _paired(item, other.item, offset, length)
        self._waiting.append(_Waiting(item, offset, length, self._round))
        return None

    def end_chunk(self) -> list[Unpaired]:
        """A chunk is done; gives what has waited a whole chunk in vain."""
        late = [waiting for waiting in self._waiting if waiting.round < self._round]
        self._waiting = [waiting for waiting in self._waiting if waiting.round == self._round]
        self._round += 1
        return [
            Unpaired(_why(item), waiting.offset, waiting.length, item if isinstance(item, Frame) else None)
            for waiting in late
            for item in (waiting.item,)
        ]

    def end_file(self) -> list[Unpaired]:
        """The file is done; gives all that still waits."""
        return self.end_chunk()


def joined(frame: Frame, image: Image) -> Frame | None:
    """The frame with its JPEG; None if the JPEG does not fit the digest that the frame's record states."""
    if hashlib.sha256(image.jpeg).hexdigest() != frame.sha256:
        return None
    return frame.with_jpeg(image.jpeg)


def paired(records: Sequence[Frame], image: Image) -> Frame | str:
    """The first of some records of the same time that fits the image, with its JPEG; or why there is none."""
    if not records:
        return _why(image)
    whole = (joined(record, image) for record in records)
    return next((frame for frame in whole if frame is not None), _misfit(records[0]))


def _misfit(record: Frame) -> str:
    return f"the picture of frame {record.sequence} does not fit its SHA-256"


def _paired(one: Frame | Image, two: Frame | Image, offset: int, length: int) -> Frame | Unpaired:
    if isinstance(one, Image) or isinstance(two, Frame):
        return _paired(two, one, offset, length)
    return joined(one, two) or Unpaired(_misfit(one), offset, length, one)


def _why(item: Frame | Image) -> str:
    if isinstance(item, Frame):
        return f"the picture of frame {item.sequence} is lost, its record is there"
    return f"the record of the picture taken at {item.captured_ns} ns is lost, so it cannot be checked"
