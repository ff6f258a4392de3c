"""What the page shows: scaled pictures, parts of them, unwrapped gauges and strips of dials, encoded."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.imaging.alignment import Alignment
from decoder.imaging.pictures import GreyPicture
from decoder.outputs.thresholds import PICTURE_PX
from decoder.panel.arrays import Floats
from decoder.setup.sources import PictureStore

SHRINKS = (8, 4, 2, 1)
JPEG_QUALITY = 88
DIAL_PX = 112
# The size of a dial's crop in the filmstrip, relative to the dial.
DIAL_MARGIN = 1.12


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a picture: its box in pixels and the requested width."""

    left: int
    top: int
    width: int
    height: int
    wanted_px: int


def jpeg(picture: NDArray[np.uint8]) -> bytes:
    """Encode a picture as JPEG."""
    _, encoded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return encoded.tobytes()


def _address(picture: NDArray[np.uint8]) -> str:
    """Encode a picture as a data URL."""
    return f"data:image/jpeg;base64,{base64.b64encode(jpeg(picture)).decode('ascii')}"


def whole_view(store: PictureStore, key: str) -> bytes:
    """Shrink the whole picture by a whole number to about `PICTURE_PX`, as JPEG."""
    width_px = store.grey(key).shape[1]
    store.forget_colours(but=key)
    shrink = next(each for each in SHRINKS if each == 1 or width_px / each >= PICTURE_PX)
    return jpeg(store.colour(key, shrink))


def part_view(store: PictureStore, key: str, part: Part) -> bytes:
    """Cut out a part of a picture at the requested width, but not enlarged, as JPEG."""
    picture = store.colour(key)
    height, width = picture.shape[:2]
    left, top = min(max(part.left, 0), width - 1), min(max(part.top, 0), height - 1)
    right, bottom = min(max(part.left + part.width, left + 1), width), min(max(part.top + part.height, top + 1), height)
    piece = picture[top:bottom, left:right]
    scale = min(part.wanted_px / piece.shape[1], PICTURE_PX / max(piece.shape[:2]), 1.0)
    if scale < 1.0:
        piece = np.asarray(cv2.resize(piece, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
    return jpeg(piece)


def unwrapped_view(strip: Floats) -> str:
    """Turn an unwrapped gauge on its side, angle to the right and radius upwards, as a data URL."""
    lying = np.ascontiguousarray(np.clip(strip.T[::-1], 0, 255).astype(np.uint8))
    return _address(lying)


def film_view(
    frames: Sequence[tuple[GreyPicture, Alignment | None]], centre: tuple[float, float], outer_px: float
) -> str:
    """Show one dial in all frames, side by side, each aligned with the panel picture; dark if no panel is found."""
    half = outer_px * DIAL_MARGIN
    x, y = centre
    corners = [(x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half)]
    wanted = np.array([(0, 0), (DIAL_PX, 0), (DIAL_PX, DIAL_PX), (0, DIAL_PX)], np.float32) - 0.5
    strip = np.zeros((DIAL_PX, DIAL_PX * max(len(frames), 1)), np.uint8)
    for number, (frame, alignment) in enumerate(frames):
        if alignment is None:
            continue
        seen = np.array([alignment.to_frame(corner) for corner in corners], np.float32)
        matrix = cv2.getPerspectiveTransform(seen, wanted)
        dial = cv2.warpPerspective(frame, matrix, (DIAL_PX, DIAL_PX), flags=cv2.INTER_LINEAR)
        strip[:, number * DIAL_PX : (number + 1) * DIAL_PX] = dial
    return _address(strip)
