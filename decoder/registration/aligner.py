"""The aligner: from a frame to its alignment with the panel picture, or the reason why there is none.

It knows how the panel looks at each zoom and frame size; the search of one frame is in `frame_search`. A frame that is
rolled, or nearer or further than that search covers, is first located by SIFT features before it is given up.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Mapping
from contextlib import suppress
from copy import copy
from dataclasses import replace

import numpy as np

from decoder.imaging.alignment import IDENTITY, Alignment, Matrix
from decoder.imaging.motion import Model, carried
from decoder.imaging.optics import Optics
from decoder.imaging.pictures import GreyPicture
from decoder.panel.arrays import Floats
from decoder.panel.errors import AlignmentLost, PanelError, PictureError
from decoder.panel.gauge import Gauge
from decoder.panel.panel import Panel
from decoder.registration.anchors import NOTHING_THERE, SEARCH_MARGIN_PX, findable
from decoder.registration.features import level_feature
from decoder.registration.frame_search import AlignmentRefiner, FrameSearch, failing
from decoder.registration.seen_panel import SeenPanel
from decoder.registration.sift_localizer import SiftLocalizer
from decoder.registration.thresholds import (
    CLEAR_SCORE,
    CONSISTENT_PX,
    FEW_FAILED,
    KEPT,
    MOST_ANCHORED,
    NOISE_LEVELS,
    SCORE_THRESHOLD,
    SIGNIFICANT_SIGMAS,
)


class Aligner:
    """Aligns frames with one panel picture.

    `usual` is where the camera mostly was during the flight, at the panel picture's zoom (`IDENTITY` if unknown):
    searches start there, and what the features found cannot determine stays as it is there. `left_out` are the indices
    of anchors that the panel picture does not show clearly enough to be found by.
    """

    def __init__(
        self, panel: Panel, picture: GreyPicture, usual: Alignment = IDENTITY, optics: Optics | None = None
    ) -> None:
        height, width = picture.shape
        found = findable(panel.anchors, picture)
        if sum(anchor.box[2] * anchor.box[3] for anchor in panel.anchors) > MOST_ANCHORED * height * width:
            raise PanelError("anchors", f"cover the panel picture more than {MOST_ANCHORED} times; box small features")
        if panel.level is not None:
            _check_level(panel.level, picture)
        self.usual = usual
        self.left_out = tuple(index for index, anchor in enumerate(panel.anchors) if anchor not in found)
        self._panel = panel.model_copy(update={"anchors": found})
        self._picture = picture
        self.localizer = SiftLocalizer(picture)
        self.optics = optics or Optics((width, height), panel.focal_length_mm)
        self._is_upright = True
        self._seen: OrderedDict[tuple[float | None, int, int], SeenPanel] = OrderedDict()

    def at(self, usual: Alignment, *, is_upright: bool = True) -> Aligner:
        """Return an aligner for a camera that was mostly there, and perhaps rolls."""
        other = copy(self)
        vars(other).update(usual=usual, _is_upright=is_upright, _seen=OrderedDict())
        return other

    def around(self, gauges: tuple[Gauge, ...]) -> Aligner:
        """Return an aligner by the same anchors for other gauges; frames that SIFT was tried on are still known."""
        other = copy(self)
        vars(other).update(_panel=self._panel.model_copy(update={"gauges": gauges}), _seen=OrderedDict())
        return other

    @property
    def shortcomings(self) -> tuple[str, ...]:
        """The shortcomings of the panel's anchors, a sentence each."""
        left_out = [f"anchors[{index}].box: {NOTHING_THERE}; frames are aligned without it" for index in self.left_out]
        return (*left_out, *filter(None, [self._own.shortcoming]))

    def outline(self) -> Floats:
        """(2, M) float32: points of the panel picture around everything that frames are aligned by."""
        boxes = [anchor.box for anchor in self._panel.anchors]
        corners = [
            (x, y) for left, top, width, height in boxes for x in (left, left + width) for y in (top, top + height)
        ]
        return np.array([*corners, *(self._panel.level or ())], np.float32).T

    @property
    def _own(self) -> SeenPanel:
        """The panel at the panel picture's own zoom and size."""
        return self.seen_at(self.optics.focal_length_mm, self.optics.size_px)

    def align(self, frame: GreyPicture, focal_length_mm: float | None = None) -> Alignment:
        """Find where the panel picture's points lie in the frame.

        Raises
        ------
        AlignmentLost
            Naming what was not found and its score.
        PictureError
            If the frame differs in shape from the panel picture, or its zoom is outside the camera's calibration.
        """
        seen = self._seen_in(frame, focal_length_mm)
        (as_usual,) = seen.as_usual([seen.look_at(frame)])
        return self._searched(seen, frame) if as_usual is None else as_usual

    def search(self, frame: GreyPicture, focal_length_mm: float | None = None) -> Alignment:
        """Align a frame in which the panel is known not to lie at its usual place.

        Raises
        ------
        AlignmentLost, PictureError
            As `align`.
        """
        return self._searched(self._seen_in(frame, focal_length_mm), frame)

    def _searched(self, seen: SeenPanel, frame: GreyPicture) -> Alignment:
        """Search around the panel's usual place, and if it is not there, around where SIFT puts it.

        If its anchors leave in doubt where it is, as under shadows, it is where SIFT puts it, if that is surer.
        """
        try:
            found = FrameSearch(seen, frame).alignment()
        except AlignmentLost as lost:
            motion = self.localizer.find(frame)
            if motion is None:
                raise
            try:
                found = FrameSearch(seen.at(motion), frame).alignment()
            except AlignmentLost:
                raise lost from None
        is_sure = SIGNIFICANT_SIGMAS * _doubt_px(seen, found) <= CONSISTENT_PX
        is_clear = found.score >= CLEAR_SCORE or self.agrees(found)  # a hand over some leaves the others as they are
        if (is_sure and is_clear) or _lie_elsewhere(seen, frame, found):
            return found
        return self._held_against_sight(seen, frame, found)

    def _held_against_sight(self, seen: SeenPanel, frame: GreyPicture, found: Alignment) -> Alignment:
        """Return where SIFT puts a panel, if that is surer than what was found; if it contradicts that, doubt it.

        SIFT's features are matched as they appear, so with a lens that distorts they tell nothing.
        """
        sighted = None if seen.start.lens is not None and seen.start.lens.distorts else self.localizer.alignment(frame)
        known = found.covariance
        if sighted is None or known is None:
            return found
        there, points = np.linalg.inv(seen.usual), seen.gauges.astype(np.float64)
        apart = carried(found.matrix @ there, points) - carried(sighted.matrix @ there, points)
        off_px, doubt_px, other_px = float(np.hypot(*apart).max()), _doubt_px(seen, found), _doubt_px(seen, sighted)
        if off_px > SIGNIFICANT_SIGMAS * math.hypot(doubt_px, other_px):
            return found.with_covariance(replace(known, covariance=known.covariance * (off_px / doubt_px) ** 2))
        scores = AlignmentRefiner(seen, frame).scores(sighted.after(there))
        matching = [score for score in scores.values() if score >= SCORE_THRESHOLD]
        if not matching or 2.0 * other_px > doubt_px:
            return found
        return replace(sighted, score=min(matching), failed=failing(scores), lens=found.lens)

    @property
    def tells_perspective(self) -> bool:
        """Whether there are enough well-placed anchors to determine a perspective."""
        return self._own.model(self._own.features) >= Model.AFFINE

    def sight(self, frame: GreyPicture, focal_length_mm: float | None = None) -> Matrix | None:
        """(3, 3): where SIFT puts the panel, if its features show more perspective than the alignment can express.

        With few anchors, the alignment has no perspective. If the pixels of the features show one all the same, the
        camera has at least moved. None if they do not, or SIFT fails or agrees with the alignment.

        Raises
        ------
        AlignmentLost, PictureError
            As `align`.
        """
        seen = self._seen_in(frame, focal_length_mm)
        settled = self.align(frame, focal_length_mm)
        if not AlignmentRefiner(seen, frame).leans(settled):
            return None
        motion = self.localizer.find(frame)
        if motion is None:
            return None
        there, points = np.linalg.inv(seen.usual), seen.gauges.astype(np.float64)
        off_px = carried(motion @ there, points) - carried(settled.matrix @ there, points)
        return motion if float(np.hypot(*off_px).max()) > CONSISTENT_PX else None

    def seen_at(self, focal_length_mm: float | None, size_px: tuple[int, int]) -> SeenPanel:
        """Return the panel as frames of one size and zoom usually show it.

        Raises
        ------
        PictureError
            As `align`.
        """
        key = (focal_length_mm, *size_px)
        if key not in self._seen:
            zoom = self.optics.zoom(focal_length_mm, size_px)
            lens = self.optics.frame_lens(focal_length_mm, size_px)
            usual = self.usual.matrix if (zoom == np.eye(3)).all() else zoom @ self.usual.matrix
            self._seen[key] = SeenPanel(
                self._panel, self._picture, usual, self.optics, lens, is_upright=self._is_upright
            )
            if len(self._seen) > KEPT:
                self._seen.popitem(last=False)
        return self._seen[key]

    def _seen_in(self, frame: GreyPicture, focal_length_mm: float | None) -> SeenPanel:
        height, width = frame.shape
        return self.seen_at(focal_length_mm, (width, height))

    def found_in(self, pictures: Mapping[str, GreyPicture]) -> dict[str, Alignment]:
        """Align other pictures, by name, leaving out those that do not show the panel as frames do."""
        places = {}
        for name, picture in pictures.items():
            with suppress(PictureError):
                places[name] = self.align(picture)
        return places

    def align_roughly(self, frame: GreyPicture, focal_length_mm: float | None = None) -> Alignment:
        """Align a panel that is not a plane, roughly, by what most anchors agree on; as `align` if too few are found.

        Raises
        ------
        AlignmentLost, PictureError
            As `align`.
        """
        search = FrameSearch(self._seen_in(frame, focal_length_mm), frame)
        rough = search.rough_alignment()
        return self.align(frame, focal_length_mm) if rough is None else rough

    def agrees(self, alignment: Alignment) -> bool:
        """Whether most anchors match where an alignment puts them, which means that they lie in a plane."""
        anchors = self._panel.anchors
        return sum(anchor.name in alignment.failed for anchor in anchors) <= FEW_FAILED * len(anchors)


def _check_level(level: tuple[tuple[float, float], tuple[float, float]], picture: GreyPicture) -> None:
    height, width = picture.shape
    if not all(0 <= x < width and 0 <= y < height for x, y in level):
        raise PanelError("level", f"lies outside the {width} x {height} panel picture")
    if float(level_feature(picture, level).pixels.std()) < NOISE_LEVELS / 4:
        raise PanelError("level", "lies on no visible edge of the panel picture")


def _doubt_px(seen: SeenPanel, found: Alignment) -> float:
    """Return how uncertain the worst gauge's place is, in frames' pixels."""
    return math.inf if found.covariance is None else float(found.covariance.sigma_px(seen.gauges).max())


def _lie_elsewhere(seen: SeenPanel, frame: GreyPicture, found: Alignment) -> bool:
    """Whether half of the anchors that do not match are found near by: they lie at other depths, and not in shadow."""
    there = found.after(np.linalg.inv(seen.usual))
    scores = [
        finder.seen_through(frame, there, SEARCH_MARGIN_PX).score
        for finder in seen.finders
        if finder.name in found.failed
    ]
    return 2 * sum(score >= SCORE_THRESHOLD for score in scores) >= len(scores) > 0
