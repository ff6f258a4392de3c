"""Registration: brings a first guess of the alignment to sub-pixel by least squares on the features' own pixels.

Inverse compositional least-squares matching (Baker and Matthews 2004): each feature has its own gain and offset, so
light may change; shift and roll are common. All that depends on the panel picture alone is solved once, a frame costs
two small products.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from decoder.alignment import Alignment
from decoder.arrays import Floats
from decoder.features import Feature
from decoder.pictures import GreyPicture

ITERATIONS = 10
FULL_STEPS = 3
SETTLED_PX = 0.02
NEARLY_SETTLED_PX = 0.1
MAX_STEP_PX = 6.0


class Registration:
    """Least-squares alignment on a set of features; with `rolls` the roll is solved for, otherwise kept."""

    def __init__(self, features: Sequence[Feature], *, rolls: bool) -> None:
        self._features = tuple(features)
        points = np.concatenate([feature.points for feature in features], axis=1).astype(np.float64)
        self._middle = points.mean(axis=1)
        self._lever_px = float(np.hypot(*(points - self._middle[:, None])).max())
        self._rolls = rolls
        self._solvers = [self._columns(feature) for feature in features]

    def refine(self, frame: GreyPicture, alignment: Alignment) -> Alignment | None:
        """The alignment at which the features match best in least squares, starting within some pixels of it.

        None where it does not settle.
        """
        for iteration in range(ITERATIONS):
            samples = [self._samples(feature, frame, alignment) for feature in self._features]
            # OpenCV samples at 32nds of a pixel: full steps may go to and fro between two of them for ever.
            part = 1.0 if iteration < FULL_STEPS else 0.5
            shift_x, shift_y, roll = (part * step for step in self._step(samples))
            reach_px = math.hypot(shift_x, shift_y) + abs(roll) * self._lever_px
            if reach_px > MAX_STEP_PX:
                return None
            alignment = self._moved(alignment, shift_x, shift_y, roll)
            if reach_px < SETTLED_PX:
                return alignment
        return alignment if reach_px < NEARLY_SETTLED_PX else None

    @staticmethod
    def _samples(feature: Feature, frame: GreyPicture, alignment: Alignment) -> Floats:
        """The feature's pixels in the frame; where they are not in it, as the others make one expect them."""
        samples, within = feature.sample(frame, alignment), feature.within(frame, alignment)
        if within.all() or not within.any() or float(feature.pixels[within].std()) < 1.0:
            return samples
        gain, offset = np.polyfit(feature.pixels[within], samples[within], 1)
        return np.where(within, samples, gain * feature.pixels + offset)

    def _columns(self, feature: Feature) -> tuple[Floats, Floats]:
        """The feature's motion columns with gain and offset projected out, and the normal matrix they make."""
        gradient_x, gradient_y = feature.gradient.astype(np.float64)
        x, y = feature.points.astype(np.float64) - self._middle[:, None]
        motion = [gradient_x, gradient_y]
        if self._rolls:
            motion.append(gradient_y * x - gradient_x * y)
        light = np.stack([feature.pixels.astype(np.float64), np.ones(feature.pixels.size)], axis=1)
        basis, _ = np.linalg.qr(light)
        columns = np.stack(motion, axis=1)
        columns -= basis @ (basis.T @ columns)
        return columns, columns.T @ columns

    def _step(self, samples: Sequence[Floats]) -> tuple[float, float, float]:
        size = 3 if self._rolls else 2
        normal, right = np.zeros((size, size)), np.zeros(size)
        for feature, values, (columns, own) in zip(self._features, samples, self._solvers, strict=True):
            centred = feature.pixels - feature.pixels.mean()
            gain = float(centred @ values) / max(float(centred @ centred), 1e-9)
            if gain <= 0:
                continue
            normal += own
            right += columns.T @ values.astype(np.float64) / gain
        step = np.linalg.solve(normal + np.eye(size) * (1e-9 * normal.trace() + 1e-9), right)
        return float(step[0]), float(step[1]), float(step[2]) if self._rolls else 0.0

    def _moved(self, alignment: Alignment, shift_x: float, shift_y: float, roll: float) -> Alignment:
        """Where the alignment expected panel point p the frame shows p + step: shift back, in the panel's axes."""
        x, y = float(self._middle[0]), float(self._middle[1])
        target = alignment.to_frame((x - shift_x, y - shift_y))
        return Alignment.pinned((x, y), target, alignment.roll_deg - math.degrees(roll), alignment.score)
