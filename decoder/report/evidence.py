"""The evidence of a frame: small crops of its gauges as they are in the picture, and where the readings lie on them.

Crops are cut where the frame's alignment has each gauge. Needles are not drawn into the pixels: the page draws them
over the crop, so that they can be taken away. A frame without alignment is shown whole.
"""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from PIL import Image

from decoder.drawn_readings import DrawnGauge, Point
from decoder.pictures import ColourPicture

REACH = 1.22
"""How much of a gauge's surroundings is seen, in its radii."""
LARGEST_PX, SMALLEST_PX, EASY_GAUGES = 208, 112, 8
WHOLE_PX = 560
JPEG_QUALITY = 80
BYTES_OF_PIXEL = 0.25  # what such a crop takes as JPEG, about
RIM_STEP = 3

Evidence = dict[str, Any]


def crop_px(gauges: int) -> int:
    """How wide a crop is; smaller ones for a panel of many gauges, so that there is room for more frames."""
    return max(SMALLEST_PX, round(LARGEST_PX * min(1.0, math.sqrt(EASY_GAUGES / max(gauges, 1)))))


def likely_bytes(gauges: int) -> int:
    """What the evidence of a frame takes in the page, about."""
    return round(gauges * crop_px(gauges) ** 2 * BYTES_OF_PIXEL * 4 / 3)


def evidence(picture: ColourPicture, gauges: Sequence[DrawnGauge], places: dict[str, int]) -> Evidence:
    """A frame's pictures for the page.

    Parameters
    ----------
    picture : (H, W, 3) uint8
    gauges : as they lie in it; none where the panel was not found
    places : of each needle's name, its place among the page's needles
    """
    if not gauges:
        height, width = picture.shape[:2]
        return {"whole": _crop(picture, (0, 0, width, height), WHOLE_PX)}
    size_px = crop_px(len(gauges))
    return {"gauges": [found for gauge in gauges if (found := _gauge(picture, gauge, places, size_px)) is not None]}


def _gauge(picture: ColourPicture, gauge: DrawnGauge, places: dict[str, int], size_px: int) -> Evidence | None:
    height, width = picture.shape[:2]
    left, top, right, bottom = gauge.box_px
    x, y, reach = (left + right) / 2, (top + bottom) / 2, REACH * max(right - left, bottom - top) / 2
    box = (max(0, x - reach), max(0, y - reach), min(width, x + reach), min(height, y + reach))
    left, top, right, bottom = (math.floor(side) for side in box)
    if right - left < 2 or bottom - top < 2:  # noqa: PLR2004 - it lies outside the frame
        return None
    return {
        "name": gauge.name,
        **_crop(picture, (left, top, right, bottom), size_px),
        "pivot": _rounded([gauge.pivot_px]),
        "rim": _rounded(gauge.rim_px[::RIM_STEP]),
        "needles": [
            {"at": places[reading.name], "line": None if reading.line_px is None else _rounded(reading.line_px)}
            for reading in gauge.readings
        ],
    }


def _crop(picture: ColourPicture, box: tuple[int, int, int, int], size_px: int) -> Evidence:
    """A part of a picture, no wider or higher than so many pixels; `box` is left, top, right, bottom in its pixels."""
    left, top, right, bottom = box
    part = picture[top:bottom, left:right]
    smaller = min(1.0, size_px / max(right - left, bottom - top))
    if smaller < 1.0:
        size = (max(1, round((right - left) * smaller)), max(1, round((bottom - top) * smaller)))
        part = np.asarray(cv2.resize(part, size, interpolation=cv2.INTER_AREA), np.uint8)
    return {"box": [left, top, right - left, bottom - top], "jpeg": jpeg_text(part)}


def jpeg_text(pixels: ColourPicture, quality: int = JPEG_QUALITY) -> str:
    """A picture, (H, W) or (H, W, 3) uint8, as JPEG in base64."""
    stream = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(stream, "JPEG", quality=quality, optimize=True)
    return base64.b64encode(stream.getvalue()).decode()


def _rounded(points: Sequence[Point]) -> list[float]:
    """X and y by turns, where the pixel's corner is the origin as a drawing has it."""
    return [round(coordinate + 0.5, 2) for point in points for coordinate in point]
