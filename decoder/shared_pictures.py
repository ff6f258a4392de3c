"""Pictures handed to another process through memory that both see: a connection would copy each four times.

The memory has no name, and is gone when both have ended, however they end.
"""

from __future__ import annotations

import mmap
import os
from collections.abc import Sequence

from decoder.frame_batch import Batch, RawFrame

SharedFrame = tuple[int, int, float | None, int, int]
"""A frame's sequence, when it was taken, its focal length, and from where to where its picture lies in the memory."""


class PicturesGiven:
    """The giving side; what was put there before must have been taken when the next is put."""

    def __init__(self) -> None:
        self.descriptor = os.memfd_create("pictures", os.MFD_CLOEXEC)
        self._memory: mmap.mmap | None = None

    def put(self, batch: Batch) -> list[SharedFrame]:
        """Where the batch's pictures lie now."""
        shared: list[SharedFrame] = []
        stop = 0
        for frame in batch:
            start, stop = stop, stop + len(frame.jpeg)
            shared.append((frame.sequence, frame.captured_ns, frame.focal_length_mm, start, stop))
        memory = self._of(stop)
        for frame, (*_, start, stop) in zip(batch, shared, strict=True):
            memory[start:stop] = frame.jpeg
        return shared

    def close(self) -> None:
        """Lets the memory go."""
        if self._memory is not None:
            self._memory.close()
        os.close(self.descriptor)

    def _of(self, size: int) -> mmap.mmap:
        if self._memory is None or len(self._memory) < size:
            if self._memory is not None:
                self._memory.close()
            os.ftruncate(self.descriptor, max(size, 1))
            self._memory = mmap.mmap(self.descriptor, max(size, 1))
        return self._memory


class PicturesTaken:
    """The taking side of the memory behind a descriptor."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._memory: mmap.mmap | None = None

    def take(self, shared: Sequence[SharedFrame]) -> Batch:
        """The frames with their pictures, which are copies."""
        end = max(stop for *_, stop in shared)
        if self._memory is None or len(self._memory) < end:
            self._memory = mmap.mmap(self._descriptor, 0, prot=mmap.PROT_READ)
        memory = self._memory
        return tuple(
            RawFrame(sequence, captured_ns, memory[start:stop], focal_length_mm)
            for sequence, captured_ns, focal_length_mm, start, stop in shared
        )
