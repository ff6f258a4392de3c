"""Features of the panel that hold a frame in place: the pixels around an anchor, and those along the level edge.

A feature has its pixels in the panel picture and their gradients. `registration` turns these into a sub-pixel
alignment, starting from a first guess by `anchors` and the level edge.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.imaging.alignment import Alignment, bent
from decoder.imaging.pictures import GreyPicture
from decoder.imaging.thresholds import HALF
from decoder.panel.arrays import Floats, Mask
from decoder.panel.lens import Lens
from decoder.registration.thresholds import MAX_ROLL_DEG, MIN_SPREAD_LEVELS, POINTS_ACROSS

Carry = Callable[[Floats], Floats]
"""Takes (2, N) points from one picture to another."""

LEVEL_HALF_WIDTH_PX = 6


@dataclass(frozen=True, slots=True)
class Feature:
    """Pixels of the panel picture that are located in every frame.

    Attributes
    ----------
    name
        Of the anchor, or `level`.
    points
        (2, N) float32: x and y in the panel picture.
    pixels
        (N,) float32: the panel picture there.
    gradient
        (2, N) float32: its gradient along x and y, grey levels per pixel.
    """

    name: str
    points: Floats
    pixels: Floats
    gradient: Floats

    def sample(self, frame: GreyPicture, alignment: Alignment) -> Floats:
        """(N,) float32: the frame where the alignment puts the points; outside the frame, its border."""
        x, y = self._places(alignment)
        return sample(frame, x, y)

    def within(self, frame: GreyPicture, alignment: Alignment) -> Mask:
        """(N,): which of the points lie in the frame."""
        x, y = self._places(alignment)
        height, width = frame.shape
        if x.min() >= 0 and y.min() >= 0 and x.max() <= width - 1 and y.max() <= height - 1:
            return np.ones(x.shape, bool)
        within: Mask = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
        return within

    def _places(self, alignment: Alignment) -> Floats:
        places: Floats = alignment.places(np.ascontiguousarray(self.points.T[None], np.float32))[0].T
        return places

    def score(self, frame: GreyPicture, alignment: Alignment) -> float:
        """Return the NCC of frame and panel picture at the points; 0 if either is flat or half of them are outside."""
        within = self.within(frame, alignment)
        if within.mean() < HALF:
            return 0.0
        samples = self.sample(frame, alignment)
        return float(correlation_of_rows(samples[None, within], self.pixels[within])[0])


def sample(frame: GreyPicture, x: Floats, y: Floats) -> Floats:
    """Sample a frame bilinearly at points of any shape; outside it, its border."""
    shape = x.shape
    map_x, map_y = np.atleast_2d(x), np.atleast_2d(y)
    samples = cv2.remap(frame, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return samples.astype(np.float32).reshape(shape)


def correlation_of_rows(rows: Floats, pixels: Floats) -> Floats:
    """Return the NCC of each row of (M, N) with pixels (N,): (M,) float32 in [-1, 1]; 0 if either is flat."""
    rows = rows - rows.mean(axis=1, keepdims=True)
    pixels = pixels - pixels.mean()
    norms = np.sqrt((rows * rows).sum(axis=1) * float((pixels * pixels).sum()))
    scores = np.divide(rows @ pixels, norms, out=np.zeros_like(norms), where=norms > len(pixels) * MIN_SPREAD_LEVELS**2)
    clipped: Floats = np.clip(scores, -1.0, 1.0)
    return clipped


def seen_through(feature: Feature, carry: Carry) -> Feature:
    """Move a feature's points and gradients to where `carry` takes (2, N) points of the panel picture."""
    half = np.float64(0.5)
    points = feature.points.astype(np.float64)
    right, down = np.array([[half], [0.0]]), np.array([[0.0], [half]])
    along_x, along_y = carry(points + right) - carry(points - right), carry(points + down) - carry(points - down)
    area = along_x[0] * along_y[1] - along_x[1] * along_y[0]
    gradient_x, gradient_y = feature.gradient.astype(np.float64)
    x = (gradient_x * along_y[1] - gradient_y * along_x[1]) / area
    y = (gradient_y * along_x[0] - gradient_x * along_y[0]) / area
    return replace(feature, points=carry(points).astype(np.float32), gradient=np.stack([x, y]).astype(np.float32))


def anchor_feature(name: str, picture: GreyPicture, box: tuple[float, float, float, float]) -> Feature:
    """Take the pixels of an anchor's box (left, top, width, height), at most about forty across."""
    left, top, width, height = (round(edge) for edge in box)
    stride = max(1, round(math.sqrt(width * height)) // POINTS_ACROSS)
    x, y = np.meshgrid(np.arange(left, left + width, stride), np.arange(top, top + height, stride))
    return _feature(name, picture, x.ravel(), y.ravel(), float(stride))


def level_feature(picture: GreyPicture, edge: tuple[tuple[float, float], tuple[float, float]]) -> Feature:
    """Take the pixels in a narrow band along the level edge."""
    (x0, y0), (x1, y1) = edge
    length = math.hypot(x1 - x0, y1 - y0)
    along = np.linspace(0.0, 1.0, min(POINTS_ACROSS, round(length)))[:, None]
    across = np.arange(-LEVEL_HALF_WIDTH_PX, LEVEL_HALF_WIDTH_PX + 1)[None, :]
    x = x0 + along * (x1 - x0) - across * (y1 - y0) / length
    y = y0 + along * (y1 - y0) + across * (x1 - x0) / length
    return _feature("level", picture, x.ravel(), y.ravel(), max(1.0, length / (16 * POINTS_ACROSS)))


def _feature(name: str, picture: GreyPicture, x: NDArray[Any], y: NDArray[Any], apart_px: float) -> Feature:
    """Build a feature from points; gradients span `apart_px`, as noise in them would make each step fall short."""
    points = np.stack([x, y]).astype(np.float32)
    half = np.float32(apart_px / 2)
    across = sample(picture, points[0] + half, points[1]) - sample(picture, points[0] - half, points[1])
    down = sample(picture, points[0], points[1] + half) - sample(picture, points[0], points[1] - half)
    gradient = np.stack([across, down]) / np.float32(apart_px)
    return Feature(name, points, sample(picture, points[0], points[1]), gradient)


class LevelFinder:
    """Finds the roll of the level edge in a frame, by trying rolls about a known point."""

    def __init__(self, feature: Feature, pivot_px: tuple[float, float], lens: Lens | None = None) -> None:
        self._feature = feature
        self._lens = lens if lens is not None and lens.distorts else None
        self._x, self._y = feature.points - np.array(pivot_px, np.float32)[:, None]
        lever_px = float(np.hypot(self._x, self._y).max())
        self._step_deg = math.degrees(1.0 / lever_px)  # one pixel at the edge's far end

    def find(self, frame: GreyPicture, pivot_px: tuple[float, float], usual_roll_deg: float) -> float:
        """Find the roll in degrees, to a pixel at the edge's far end; `pivot_px` is the known point in the frame."""
        _, roll_deg = self._best(frame, pivot_px, usual_roll_deg, MAX_ROLL_DEG)
        return roll_deg

    def _best(
        self, frame: GreyPicture, pivot_px: tuple[float, float], middle_deg: float, reach_deg: float
    ) -> tuple[float, float]:
        count = math.ceil(reach_deg / self._step_deg)
        rolls_deg = middle_deg + self._step_deg * np.arange(-count, count + 1)
        cos, sin = (f(np.radians(rolls_deg)).astype(np.float32)[:, None] for f in (np.cos, np.sin))
        x = cos * self._x - sin * self._y + np.float32(pivot_px[0])
        y = sin * self._x + cos * self._y + np.float32(pivot_px[1])
        if self._lens is not None:
            x, y = np.moveaxis(bent(np.stack([x, y], axis=-1), self._lens), -1, 0)
        scores = correlation_of_rows(sample(frame, x, y), self._feature.pixels)
        best = int(scores.argmax())
        return float(scores[best]), float(rolls_deg[best])
