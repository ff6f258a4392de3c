"""The aligner: from a frame to its alignment with the panel picture, or the reason why there is none.

It knows how the panel looks at each zoom and size of frames; one frame's search is in `decoder.frame_search`.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable
from copy import copy
from dataclasses import dataclass

import numpy as np

from decoder.alignment import IDENTITY, Alignment
from decoder.alignment_noise import BlockPulls, noise_beside_claim
from decoder.anchors import check_anchor
from decoder.arrays import Floats
from decoder.errors import PanelError
from decoder.features import level_feature
from decoder.frame_search import UNMISTAKABLE_SCORE, FrameSearch
from decoder.motion import Model
from decoder.optics import Optics
from decoder.panel import Panel
from decoder.pictures import GreyPicture
from decoder.seen_panel import SeenPanel
from decoder.settling import MIN_FEATURE_SCORE
from decoder.usual_place import UsualPlace

KEPT_ZOOMS = 6
# Where more of the anchors than this do not match, they lie at other depths.
FEW_FAILED = 1 / 4


@dataclass(frozen=True, slots=True, eq=False)
class AlignedFrame:
    """A frame of so many pixels, all of its rows or the first in `pixels`, and where the panel lies in it."""

    pixels: GreyPicture
    size_px: tuple[int, int]
    focal_length_mm: float | None
    alignment: Alignment


class Aligner:
    """Aligns frames with one panel picture.

    `usual` is where the camera mostly was during the flight, at the panel picture's zoom (`IDENTITY` if nothing is
    known): searches start there, and what the features found cannot tell stays as it is there.
    """

    def __init__(
        self, panel: Panel, picture: GreyPicture, usual: Alignment = IDENTITY, optics: Optics | None = None
    ) -> None:
        height, width = picture.shape
        for index, anchor in enumerate(panel.anchors):
            check_anchor(anchor, picture, path=f"anchors[{index}]")
        if panel.level is not None:
            _check_level(panel.level, picture)
        self.usual = usual
        self._panel = panel
        self._picture = picture
        self.optics = optics or Optics((width, height), panel.focal_length_mm)
        self._seen: OrderedDict[tuple[float | None, int, int], SeenPanel] = OrderedDict()

    def at(self, usual: Alignment) -> Aligner:
        """The same for a camera that mostly was there."""
        other = copy(self)
        vars(other).update(usual=usual, _seen=OrderedDict())
        return other

    @property
    def shortcoming(self) -> str | None:
        """What the panel's anchors leave wanting, as a sentence; None if nothing."""
        return self._own.shortcoming

    def outline(self) -> Floats:
        """(2, M) float32: points of the panel picture around all that frames are aligned by."""
        boxes = [anchor.box for anchor in self._panel.anchors]
        corners = [
            (x, y) for left, top, width, height in boxes for x in (left, left + width) for y in (top, top + height)
        ]
        return np.array([*corners, *(self._panel.level or ())], np.float32).T

    @property
    def _own(self) -> SeenPanel:
        """The panel at the panel picture's own zoom and size."""
        return self._seen_at(self.optics.focal_length_mm, self.optics.size_px)

    def align(self, frame: GreyPicture, focal_length_mm: float | None = None) -> Alignment:
        """Where the panel picture's points lie in the frame.

        Raises
        ------
        AlignmentLost
            Naming what was not found and its score.
        PictureError
            If the frame is of another shape than the panel picture, or its zoom outside the camera's calibration.
        """
        height, width = frame.shape
        return FrameSearch(self._seen_at(focal_length_mm, (width, height)), frame).alignment()

    def usual_place(self, size_px: tuple[int, int], focal_length_mm: float | None = None) -> UsualPlace:
        """Tells what `align` says of frames of one size and zoom in which the panel lies where it usually does.

        Of a frame the first rows may be all that it is shown.

        Raises
        ------
        PictureError
            As `align`.
        """
        return self._seen_at(focal_length_mm, size_px).usual_place(UNMISTAKABLE_SCORE)

    def align_roughly(self, frame: GreyPicture, focal_length_mm: float | None = None) -> Alignment:
        """The same for a panel that is no plane: where its features disagree, what most anchors agree on roughly.

        Raises
        ------
        AlignmentLost, PictureError
            As `align`.
        """
        height, width = frame.shape
        search = FrameSearch(self._seen_at(focal_length_mm, (width, height)), frame)
        rough = search.rough_alignment()
        return search.alignment() if rough is None else rough

    def agrees(self, alignment: Alignment) -> bool:
        """Whether most anchors match where an alignment has them all: then they lie in a plane."""
        anchors = self._panel.anchors
        return sum(anchor.name in alignment.failed for anchor in anchors) <= FEW_FAILED * len(anchors)

    def noise_beside_claim(self, aligned: Iterable[AlignedFrame]) -> float:
        """How many times as uncertain as they claim alignments are, by frames in which all matches; 1 without such."""
        pairs = []
        known: dict[tuple[SeenPanel, Model], BlockPulls] = {}
        for frame in aligned:
            alignment = frame.alignment
            seen = self._seen_at(frame.focal_length_mm, frame.size_px)
            if alignment.covariance is None or alignment.failed:
                continue
            key = (seen, alignment.covariance.model)
            if key not in known:
                known[key] = BlockPulls(seen.features, alignment.covariance)
            pulls = known[key]
            if pulls.tell:
                own = alignment.after(np.linalg.inv(seen.usual))
                pairs.append((alignment.covariance, pulls.found(frame.pixels, own)))
        return noise_beside_claim(pairs, self._own.gauges)

    def _seen_at(self, focal_length_mm: float | None, size_px: tuple[int, int]) -> SeenPanel:
        key = (focal_length_mm, *size_px)
        if key not in self._seen:
            zoom = self.optics.zoom(focal_length_mm, size_px)
            lens = self.optics.frame_lens(focal_length_mm, size_px)
            usual = self.usual.matrix if (zoom == np.eye(3)).all() else zoom @ self.usual.matrix
            self._seen[key] = SeenPanel(self._panel, self._picture, usual, self.optics, lens)
            if len(self._seen) > KEPT_ZOOMS:
                self._seen.popitem(last=False)
        return self._seen[key]


def _check_level(level: tuple[tuple[float, float], tuple[float, float]], picture: GreyPicture) -> None:
    height, width = picture.shape
    if not all(0 <= x < width and 0 <= y < height for x, y in level):
        raise PanelError("level", f"lies outside the {width} x {height} panel picture")
    if float(level_feature(picture, level).pixels.std()) < MIN_FEATURE_SCORE:
        raise PanelError("level", "lies on no visible edge of the panel picture")
