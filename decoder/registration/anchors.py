"""Anchors: fixed features of the panel, found in a frame by normalized cross-correlation (thesis 3.2.1).

An anchor is searched for around its usual place in this flight, and if that leads nowhere, in the whole frame. Nothing
is carried over from one frame to the next, so a lost frame cannot spoil the one that follows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from decoder.imaging.alignment import Alignment, Point
from decoder.imaging.pictures import GreyPicture
from decoder.panel.arrays import Floats
from decoder.panel.errors import PanelError
from decoder.panel.lens import Lens
from decoder.panel.panel import Anchor
from decoder.registration.thresholds import MAX_REDUCTION, MIN_REDUCED_PX, NOISE_LEVELS

SEARCH_MARGIN_PX = 16
# A panel may have several features that look alike; this many places are kept for each anchor.
MAX_PLACES = 4
NOTHING_THERE = "holds nothing that could be found again; box a feature with contrast"

Render = Callable[[], GreyPicture]
"""Draws an anchor as the camera usually sees it."""
Shrunk = Callable[[int], GreyPicture]
"""Gives a frame as `reduced` by a factor, however often it is asked for."""


@dataclass(frozen=True, slots=True)
class AnchorHit:
    """Where an anchor's centre was found in a frame, to the pixel and without distortion, and how well it matched."""

    centre_px: Point
    score: float


class AnchorFinder:
    """Finds one anchor in frames; `centre_px` is where its centre usually lies, without distortion."""

    def __init__(self, name: str, centre_px: Point, render: Render, lens: Lens | None = None) -> None:
        self.name = name
        self.centre_px = centre_px
        self._render = render
        self._lens = lens if lens is not None and lens.distorts else None

    def near(self, frame: GreyPicture, place_px: Point, margin_px: int) -> AnchorHit:
        """Find the best match with its centre within a margin of a place; score 0 where there is no room for it."""
        template = self._template
        height, width = template.shape
        x, y = self._bent(place_px)
        left, top = round(x - (width - 1) / 2) - margin_px, round(y - (height - 1) / 2) - margin_px
        right, bottom = left + width + 2 * margin_px, top + height + 2 * margin_px
        left, top = max(left, 0), max(top, 0)
        region = frame[top : max(bottom, 0), left : max(right, 0)]
        if region.shape[0] < height or region.shape[1] < width:
            return AnchorHit(place_px, 0.0)
        scores = cv2.matchTemplate(region, template, cv2.TM_CCOEFF_NORMED)
        _, best, _, (x, y) = cv2.minMaxLoc(scores)
        return AnchorHit(self._straight((left + x + (width - 1) / 2, top + y + (height - 1) / 2)), float(best))

    def seen_through(self, frame: GreyPicture, alignment: Alignment, margin_px: int) -> AnchorHit:
        """Find the best match near where an alignment puts the anchor, with the shape that the alignment gives it.

        Alignment and margin are relative to the usual place.
        """
        template = self._template
        height, width = template.shape
        x, y = self.centre_px
        across = np.arange(width + 2 * margin_px) + (x - (width - 1) / 2 - margin_px)
        down = np.arange(height + 2 * margin_px) + (y - (height - 1) / 2 - margin_px)
        places = alignment.places(np.stack(np.meshgrid(across, down), axis=-1).astype(np.float32))
        region = cv2.remap(frame, places[..., 0], places[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        scores = cv2.matchTemplate(region, template, cv2.TM_CCOEFF_NORMED)
        _, best, _, (right, below) = cv2.minMaxLoc(scores)
        x, y, depth = alignment.matrix @ (x + right - margin_px, y + below - margin_px, 1.0)
        return AnchorHit((float(x / depth), float(y / depth)), float(best))

    def anywhere(self, frame: GreyPicture, shrunk: Shrunk) -> Sequence[AnchorHit]:
        """Find the best matches in the whole frame, which is also given `shrunk`; best first, without overlaps."""
        template = self._template
        factor = int(np.clip(min(template.shape) // MIN_REDUCED_PX, 1, MAX_REDUCTION))
        small, small_template = shrunk(factor), reduced(template, factor)
        height, width = small_template.shape
        if small.shape[0] < height or small.shape[1] < width:
            return []
        scores = cv2.matchTemplate(small, small_template, cv2.TM_CCOEFF_NORMED)
        hits = []
        for _ in range(MAX_PLACES):
            _, best, _, (x, y) = cv2.minMaxLoc(scores)
            if best <= 0.0:
                break
            rough = tuple((at + size / 2) * factor - 0.5 for at, size in ((x, width), (y, height)))
            hits.append(self.near(frame, self._straight((rough[0], rough[1])), 2 * factor))
            scores[max(y - height // 2, 0) : y + height // 2 + 1, max(x - width // 2, 0) : x + width // 2 + 1] = -1.0
        return sorted(hits, key=lambda hit: -hit.score)

    @cached_property
    def _template(self) -> GreyPicture:
        return self._render()

    def _bent(self, place_px: Point) -> Point:
        if self._lens is None:
            return place_px
        x, y = self._lens.distorted(np.array(place_px)[:, None])[:, 0]
        return float(x), float(y)

    def _straight(self, place_px: Point) -> Point:
        if self._lens is None:
            return place_px
        x, y = self._lens.undistorted(np.array(place_px, np.float64)[:, None])[:, 0]
        return float(x), float(y)


def findable(anchors: Sequence[Anchor], picture: GreyPicture) -> tuple[Anchor, ...]:
    """Return those of a panel's anchors that can be found by their pictures; flat ones are harmless and left out.

    Raises
    ------
    PanelError
        If a box leaves the panel picture, or none has contrast.
    """
    found = []
    for index, anchor in enumerate(anchors):
        left, top, width, height = whole_box(anchor)
        if left < 0 or top < 0 or left + width > picture.shape[1] or top + height > picture.shape[0]:
            outside = f"lies outside the {picture.shape[1]} x {picture.shape[0]} panel picture"
            raise PanelError(f"anchors[{index}].box", outside)
        if float(picture[top : top + height, left : left + width].std()) >= NOISE_LEVELS:
            found.append(anchor)
    if not found:
        raise PanelError("anchors[0].box", NOTHING_THERE)
    return tuple(found)


def whole_box(anchor: Anchor) -> tuple[int, int, int, int]:
    """Return left, top, width and height of an anchor in whole pixels."""
    left, top, width, height = (round(edge) for edge in anchor.box)
    return left, top, width, height


def middle_of(anchor: Anchor) -> Floats:
    """(2, 1): the centre of an anchor in the panel picture."""
    left, top, width, height = whole_box(anchor)
    return np.array([[left + (width - 1) / 2], [top + (height - 1) / 2]])


def reduced(picture: GreyPicture, factor: int) -> GreyPicture:
    """Shrink a picture by a whole factor."""
    if factor == 1:
        return picture
    height, width = (max(side // factor, 1) for side in picture.shape)
    whole = picture[: height * factor, : width * factor]
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
