"""The thesis's steps as one writes them down with a library's own functions, one frame and one needle after the other.

Find the knob anywhere in the frame, unwrap each gauge, find each needle in it by normalized cross-correlation, and look
up its row in the scale. What correlates is a parameter: OpenCV's `matchTemplate`, or scikit-image's `match_template`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.feature import match_template

from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.pictures import GreyPicture
from decoder.panel.gauge import Gauge

ROWS_PER_DEG = 2
FULL_CIRCLE_DEG = 360
MIN_SCORE = 0.8  # thesis 3.2.3

Correlate = Callable[[GreyPicture, GreyPicture], NDArray[np.float32]]
"""The score of a template at each place of a picture."""


def with_opencv(picture: GreyPicture, template: GreyPicture) -> NDArray[np.float32]:
    """`cv2.matchTemplate`."""
    return np.asarray(cv2.matchTemplate(picture, template, cv2.TM_CCOEFF_NORMED), np.float32)


def with_skimage(picture: GreyPicture, template: GreyPicture) -> NDArray[np.float32]:
    """`skimage.feature.match_template`."""
    return np.asarray(match_template(picture, template), np.float32)  # type: ignore[no-untyped-call]


@dataclass(frozen=True, slots=True)
class _Needle:
    name: str
    template: GreyPicture
    covered_by: str | None


class PlainWay:
    """Reads frames with one panel."""

    def __init__(self, source: PanelPictures, correlate: Correlate) -> None:
        self._panel = source.panel
        self._correlate = correlate
        left, top, width, height = map(round, source.panel.anchors[0].box)
        self._knob = source.picture[top : top + height, left : left + width]
        self._knob_at = (left, top)
        self._needles = [_needles(gauge, source.picture) for gauge in source.panel.gauges]

    def read(self, jpeg: bytes) -> dict[str, float]:
        """The values by needle."""
        frame = np.asarray(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE), np.uint8)
        scores = self._correlate(frame, self._knob)
        top, left = np.unravel_index(int(scores.argmax()), scores.shape)
        shift_px = (int(left) - self._knob_at[0], int(top) - self._knob_at[1])
        values: dict[str, float] = {}
        for gauge, needles in zip(self._panel.gauges, self._needles, strict=True):
            unwrapped = _unwrapped(frame, gauge, shift_px)
            angles: dict[str, float] = {}
            for needle in sorted(needles, key=lambda each: each.covered_by is not None):
                angles[needle.name] = self._angle_deg(unwrapped, needle, angles, gauge)
            marks = np.array(gauge.scale)
            values |= {name: float(np.interp(angle, marks[:, 0], marks[:, 1])) for name, angle in angles.items()}
        return values

    def _angle_deg(self, unwrapped: GreyPicture, needle: _Needle, found: dict[str, float], gauge: Gauge) -> float:
        """The whole needle; of a covered one else its top, its bottom, or the place of what covers it."""
        rows = len(needle.template)
        parts = [(0, rows), (0, rows // 2), (rows // 2, rows)] if needle.covered_by else [(0, rows)]
        for first, stop in parts:
            scores = self._correlate(unwrapped, needle.template[first:stop])[:, 0]
            best = int(scores.argmax())
            if scores[best] >= MIN_SCORE or needle.covered_by is None:
                return float(gauge.sweep[0] + (best - first + (rows - 1) / 2) / ROWS_PER_DEG)
        return found[needle.covered_by or ""]


def _needles(gauge: Gauge, picture: GreyPicture) -> list[_Needle]:
    unwrapped = _unwrapped(picture, gauge, (0, 0))
    needles = []
    for needle in gauge.needles:
        half = round((needle.template.span or 0) / 2 * ROWS_PER_DEG)
        middle = round(((needle.template.at or 0.0) - gauge.sweep[0]) * ROWS_PER_DEG)
        cut = np.ascontiguousarray(unwrapped[max(middle - half, 0) : middle + half + 1])
        needles.append(_Needle(needle.name, cut, needle.covered_by))
    return needles


def _unwrapped(picture: GreyPicture, gauge: Gauge, shift_px: tuple[int, int]) -> GreyPicture:
    """Rows are angles of the sweep, columns radii from the needle's bottom to the outer perimeter."""
    inner, outer = (round(radius) for radius in gauge.radius)
    centre = (gauge.centre[0] + shift_px[0], gauge.centre[1] + shift_px[1])
    turn = cv2.warpPolar(
        picture, (outer, FULL_CIRCLE_DEG * ROWS_PER_DEG), centre, outer, cv2.INTER_LINEAR | cv2.WARP_POLAR_LINEAR
    )
    first, stop = (round(angle * ROWS_PER_DEG) for angle in gauge.sweep)
    return np.ascontiguousarray(np.vstack([turn, turn])[first : stop + 1, inner:])
