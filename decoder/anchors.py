"""Anchors: fixed features of the panel, found in a frame by normalized cross-correlation (thesis 3.2.1).

An anchor is searched first around the place where this flight usually has it, then, if it is not there, in the whole
frame. Nothing is carried from one frame to the next, so a lost frame cannot spoil the one that follows.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from decoder.errors import PanelError
from decoder.panel import Anchor
from decoder.pictures import GreyPicture

SEARCH_MARGIN_PX = 16
# A rolled or slightly blurred anchor still scores this much before the roll is known; what the
# alignment rests on in the end is held to the same 0.8 as the needles.
MIN_FIRST_SCORE = 0.5
MIN_CONTRAST_LEVELS = 4.0


@dataclass(frozen=True, slots=True)
class AnchorHit:
    """Where an anchor's centre was found in a frame, to the pixel, and how well it matched."""

    centre_px: tuple[float, float]
    score: float


class AnchorFinder:
    """Finds one anchor of the panel picture in frames."""

    def __init__(self, anchor: Anchor, picture: GreyPicture, *, path: str) -> None:
        left, top, width, height = (round(edge) for edge in anchor.box)
        if left < 0 or top < 0 or left + width > picture.shape[1] or top + height > picture.shape[0]:
            raise PanelError(f"{path}.box", f"lies outside the {picture.shape[1]} x {picture.shape[0]} panel picture")
        self.name = anchor.name
        self.corner_px = (left, top)
        self._template = np.ascontiguousarray(picture[top : top + height, left : left + width])
        if float(self._template.std()) < MIN_CONTRAST_LEVELS:
            raise PanelError(f"{path}.box", "holds nothing that could be found again; box a feature with contrast")

    @property
    def centre_px(self) -> tuple[float, float]:
        """The centre of the anchor in the panel picture."""
        height, width = self._template.shape
        return self.corner_px[0] + (width - 1) / 2, self.corner_px[1] + (height - 1) / 2

    def find(self, frame: GreyPicture, usual_offset_px: tuple[float, float]) -> AnchorHit:
        """The best match around the usual place, or in the whole frame if there is nothing like it there."""
        near = self._search_near(frame, usual_offset_px)
        return near if near.score >= MIN_FIRST_SCORE else self.find_anywhere(frame)

    def find_anywhere(self, frame: GreyPicture) -> AnchorHit:
        """The best match in the whole frame."""
        return self._search(frame, 0, 0)

    def _search_near(self, frame: GreyPicture, usual_offset_px: tuple[float, float]) -> AnchorHit:
        height, width = self._template.shape
        left = round(self.corner_px[0] + usual_offset_px[0]) - SEARCH_MARGIN_PX
        top = round(self.corner_px[1] + usual_offset_px[1]) - SEARCH_MARGIN_PX
        right, bottom = left + width + 2 * SEARCH_MARGIN_PX, top + height + 2 * SEARCH_MARGIN_PX
        left, top = max(left, 0), max(top, 0)
        return self._search(frame[top : max(bottom, 0), left : max(right, 0)], left, top)

    def _search(self, region: GreyPicture, left: int, top: int) -> AnchorHit:
        height, width = self._template.shape
        if region.shape[0] < height or region.shape[1] < width:
            return AnchorHit((0.0, 0.0), 0.0)
        scores = cv2.matchTemplate(region, self._template, cv2.TM_CCOEFF_NORMED)
        _, best, _, (x, y) = cv2.minMaxLoc(scores)
        return AnchorHit((left + x + (width - 1) / 2, top + y + (height - 1) / 2), float(best))
