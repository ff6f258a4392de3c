"""Resampling: a frame's grey levels at any points of the panel, in one pass over its original pixels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.imaging.alignment import Alignment, carried_by, upright
from decoder.imaging.pictures import ColourPicture, GreyPicture, Mixed
from decoder.panel.arrays import Floats

_NO_SECOND_MAP: Any = None  # the first contains x and y; OpenCV's type hints require both, its code does not
_WIDTH = 256  # OpenCV limits a map's sides to 32767; a folded map stays far below


@dataclass(frozen=True, slots=True)
class Patch:
    """A part of a frame in float32, and the position of its first pixel in the frame."""

    pixels: Floats
    left: int
    top: int


@dataclass(frozen=True, slots=True)
class PointMap:
    """Points of the panel picture, in several parts, in the layout that OpenCV transforms and samples fastest.

    Attributes
    ----------
    slices
        Where each part lies in the flattened samples.
    folded
        (rows, columns, 2) float32: the points, padded at the end by repetition.
    """

    slices: tuple[slice, ...]
    folded: Floats
    _corners: Floats

    @classmethod
    def of(cls, parts: Sequence[Floats]) -> PointMap:
        """Lay out parts that are (2, N) each: x and y in the panel picture."""
        flat = np.concatenate(parts, axis=1).astype(np.float32, order="C")  # by rows, whatever the layout of the parts
        size = flat.shape[1]
        folded = np.empty((math.ceil(size / _WIDTH), _WIDTH, 2), np.float32)
        pairs = folded.reshape(-1, 2)
        for axis, values in enumerate(flat):  # NumPy takes six times as long for both at once
            pairs[:size, axis] = values
        pairs[size:] = flat[:, -1]
        (left, top), (right, bottom) = flat.min(axis=1), flat.max(axis=1)
        corners = np.array([[[left, top], [right, top], [left, bottom], [right, bottom]]], np.float32)
        return cls(_consecutive([part.shape[1] for part in parts]), folded, corners)

    def sample(self, frame: GreyPicture, alignment: Alignment) -> Floats:
        """(N,) float32: sample all parts one after the other, bilinear; outside the frame its border is repeated."""
        return self.levels(frame, alignment).astype(np.float32)

    def levels(self, frame: GreyPicture, alignment: Alignment) -> GreyPicture:
        """Do `sample` in whole grey levels, (N,) uint8."""
        return levels_at(frame, alignment.places(self.folded))[: self.slices[-1].stop]

    def colours(self, frame: ColourPicture, alignment: Alignment) -> Floats:
        """(N, 3) float32: do `sample` in red, green and blue."""
        levels = levels_at(frame, alignment.places(self.folded)).reshape(-1, 3)
        return levels[: self.slices[-1].stop].astype(np.float32)

    def places(self, alignment: Alignment, origin: tuple[float, float] = (0.0, 0.0)) -> Floats:
        """(rows, columns, 2) float32: where the points lie in a frame, for `levels_at`; some are repeated.

        `origin` is the frame's pixel that counts as (0, 0).
        """
        places: Floats = alignment.places(self.folded, origin)
        return places

    def patch(self, frame: GreyPicture, alignment: Alignment, margin_px: int) -> Patch | None:
        """Cut out the part of the frame with all points and a margin around them; None if that leaves the frame."""
        x, y = alignment.places(self._corners)[0].T
        left, top = math.floor(x.min()) - margin_px, math.floor(y.min()) - margin_px
        right, bottom = math.ceil(x.max()) + margin_px + 1, math.ceil(y.max()) + margin_px + 1
        if left < 0 or top < 0 or right > frame.shape[1] or bottom > frame.shape[0]:
            return None
        return Patch(frame[top:bottom, left:right].astype(np.float32), left, top)


@dataclass(frozen=True, slots=True)
class MixedPart:
    """The part of a frame around some points in a mixture of colours, and the position of its first pixel."""

    pixels: GreyPicture
    origin: tuple[float, float]

    @classmethod
    def of(cls, colour: ColourPicture, mixture: Mixed, places: Floats) -> MixedPart:
        """Mix the colours (H, W, 3) around places (rows, columns, 2), as far as the frame goes."""
        height, width = colour.shape[:2]
        x, y = places[..., 0], places[..., 1]
        left, right = (_limited(math.floor(at), width - 1) for at in (x.min(), x.max()))
        top, bottom = (_limited(math.floor(at), height - 1) for at in (y.min(), y.max()))
        return cls(mixture.of(colour[top : bottom + 2, left : right + 2]), (float(left), float(top)))


def _limited(at: int, last: int) -> int:
    return min(max(at, 0), last)


def inside(points: Floats, alignment: Alignment, width_px: int, height_px: int) -> bool:
    """Whether all points (2, M) of the panel picture lie within the frame."""
    (is_inside,) = each_inside(as_places(points), [alignment], width_px, height_px)
    return is_inside


def part_inside(points: Floats, alignment: Alignment, width_px: int, height_px: int) -> float:
    """Return which part of the points (2, M) of the panel picture lies within the frame."""
    x, y = alignment.places(as_places(points))[0].T
    return float(((x >= 0) & (y >= 0) & (x <= width_px - 1) & (y <= height_px - 1)).mean())


def as_places(points: Floats) -> Floats:
    """(1, M, 2) float32: points (2, M) in the layout to be carried into frames."""
    return np.ascontiguousarray(points.T[None], np.float32)


def each_inside(places: Floats, alignments: Sequence[Alignment], width_px: int, height_px: int) -> list[bool]:
    """Do `inside` for points from `as_places` and the alignments of frames of one size and lens."""
    if not alignments:
        return []
    matrices = np.array([alignment.elements for alignment in alignments]).reshape(-1, 3, 3)
    there = np.ascontiguousarray(carried_by(matrices, upright(places[0]), alignments[0].lens).transpose(0, 2, 1))
    (left, top), (right, bottom) = there.min(axis=2).T, there.max(axis=2).T
    within: list[bool] = ((left >= 0) & (top >= 0) & (right <= width_px - 1) & (bottom <= height_px - 1)).tolist()
    return within


def levels_at(pixels: NDArray[Any], places: NDArray[Any]) -> NDArray[Any]:
    """Return grey levels at places (rows, columns, 2), flattened, in the pixels' own type: integers stay integers."""
    return cv2.remap(pixels, places, _NO_SECOND_MAP, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).reshape(-1)


def put_levels(levels: Floats, pixels: Floats, places: Floats) -> None:
    """Do `levels_at` into given memory, not flattened: (rows, columns) float32, rows contiguous."""
    cv2.remap(pixels, places, _NO_SECOND_MAP, cv2.INTER_LINEAR, dst=levels, borderMode=cv2.BORDER_REPLICATE)


def _consecutive(lengths: Sequence[int]) -> tuple[slice, ...]:
    ends = np.cumsum(lengths).tolist()
    return tuple(slice(end - length, end) for end, length in zip(ends, lengths, strict=True))
