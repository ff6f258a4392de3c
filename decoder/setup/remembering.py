"""Alignments remembered: while gauges are drawn the anchors stay, so the same frames are not aligned again and again.

On an oblique panel with ten anchors aligning twenty frames takes nine tenths of a trial.
"""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable
from dataclasses import dataclass, field

from decoder.aligner import Aligner
from decoder.alignment import IDENTITY, Alignment
from decoder.errors import PictureError
from decoder.optics import Optics
from decoder.panel import Panel
from decoder.panel_pictures import PanelPictures
from decoder.pictures import GreyPicture

Found = Alignment | PictureError
Name = tuple[str, int, float | None, tuple[float, ...]]


class AlignmentMemory:
    """What aligners of the same anchors on the same picture found in frames; safe to use from several threads."""

    def __init__(self) -> None:
        self._found: dict[Name, tuple[weakref.ref[GreyPicture], Found]] = {}
        self._lock = threading.Lock()

    def recall(self, name: Name, frame: GreyPicture, find: Callable[[], Alignment]) -> Alignment:
        """What was found in a frame before, or else is found now; a failure is remembered as well."""
        with self._lock:
            seen, found = self._found.get(name, (None, None))
        if seen is None or found is None or seen() is not frame:  # another picture may have got its place in memory
            try:
                found = find()
            except PictureError as error:
                found = error
            with self._lock:
                self._found[name] = (weakref.ref(frame), found)
        if isinstance(found, PictureError):
            raise found.with_traceback(None)  # else it would keep the frames of each asking
        return found


class RememberingAligner(Aligner):
    """An aligner that looks at no frame twice."""

    def __init__(
        self, panel: Panel, picture: GreyPicture, usual: Alignment, optics: Optics, memory: AlignmentMemory
    ) -> None:
        super().__init__(panel, picture, usual, optics)
        self._memory = memory

    def align(self, frame: GreyPicture, focal_length_mm: float | None = None) -> Alignment:
        """As any aligner."""
        name = ("align", id(frame), focal_length_mm, self.usual.elements)
        return self._memory.recall(name, frame, lambda: super(RememberingAligner, self).align(frame, focal_length_mm))

    def align_roughly(self, frame: GreyPicture, focal_length_mm: float | None = None) -> Alignment:
        """As any aligner."""
        name = ("roughly", id(frame), focal_length_mm, self.usual.elements)
        return self._memory.recall(
            name, frame, lambda: super(RememberingAligner, self).align_roughly(frame, focal_length_mm)
        )


@dataclass(frozen=True, slots=True)
class RememberedPanel(PanelPictures):
    """A panel whose readers share what their aligners have found."""

    memory: AlignmentMemory = field(default_factory=AlignmentMemory)

    def aligner(self, usual: Alignment = IDENTITY) -> Aligner:
        """What finds the panel in frames."""
        return RememberingAligner(self.panel, self.picture, usual, self.optics, self.memory)
