"""The shape of a tape in its window: flat, or the rim of a drum or card, whose marks crowd together towards the sides.

A place on a tape is identified by its value. Unrolled, a tape moves by rows, and a drum's rim becomes flat. The shape
starts from marks drawn by hand. The rest is learned from how the picture of the tape moves across the window, such as
that a drum leans, is narrower at one end, or is seen from above.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.panel.arrays import Floats

# Size of a row of the unrolled tape where it faces the window, in pixels.
ROW_PX = 0.5
# Parts turned further away than this are too narrow to be read.
LIMB = math.radians(62.0)
# How precisely a mark is drawn.
MARK_PX = 0.5
# Blur that removes fine print, noise and differences in sharpness, which locate a tape less well than its numerals do.
BLUR_PX = 0.8
MARK_STEPS = 30
# Priors, before a flight is seen: a drum's taper, and how far its edge bends.
PRIOR_TAPER, PRIOR_SAG_PX = 0.3, 4.0
# The longest step of a refinement.
STEPS = {"middle_px": 1.5, "radius_px": 1.5, "taper": 0.05, "sag_px": 1.0}
# The differences from which derivatives are taken.
TRIALS = {"middle_px": 0.3, "radius_px": 0.3, "taper": 0.02, "sag_px": 0.3}

DrawnMarks = Sequence[tuple[float, float, float]]
"""Pixels along the window, and across it, and the value there."""


@dataclass(frozen=True)
class TapeShape:
    """Where the values of a tape lie in its window in the panel picture.

    Attributes
    ----------
    size
        Of the window: pixels along the tape, and across.
    middle_px
        Along the window, where a drum faces it; on a flat tape, where `value` is.
    radius_px
        Of a drum, on its middle; on a flat tape, pixels per `unit`. Negative where values fall along the window.
    value
        The value there.
    unit
        The value of a radian of a drum.
    turn
        The value of a whole turn, if values repeat after it.
    across_px
        How far across the window the marks were drawn.
    taper, sag_px
        How much the radius grows per pixel across the window, and how far a drum's limb is displaced across it.
    """

    size: tuple[int, int]
    middle_px: float
    radius_px: float
    value: float
    unit: float
    turn: float | None
    across_px: float
    is_round: bool
    taper: float = 0.0
    sag_px: float = 0.0

    @classmethod
    def of_marks(cls, marks: DrawnMarks, size: tuple[int, int], turn: float | None, *, is_round: bool) -> TapeShape:
        """Fit a shape to drawn marks."""
        along, across, values = np.array(marks, np.float64).T
        unit = turn / math.tau if is_round and turn is not None else 1.0
        slope, _ = np.polyfit(values, along, 1)
        drawn = cls(
            size, along.mean(), slope * unit, values.mean(), unit, turn, float(across.mean()), is_round=is_round
        )
        for _ in range(MARK_STEPS if is_round else 1):
            off_px, slopes = drawn._at_marks(marks)
            step = -np.linalg.lstsq(slopes[:3].T, off_px, rcond=None)[0]
            # values that lie close together hardly determine a radius, so steps are kept small
            step *= min(1.0, abs(drawn.radius_px) / 4 / max(abs(float(step[1])), 1e-9))
            drawn = replace(
                drawn,
                middle_px=drawn.middle_px + float(step[0]),
                radius_px=drawn.radius_px + float(step[1]),
                value=drawn.value + float(step[2]),
            )
            if not is_round:
                break
        return drawn

    def _at_marks(self, marks: DrawnMarks) -> tuple[Floats, Floats]:
        """Return how far (M,) marks lie from where they were drawn, with the derivatives.

        Those are (5, M): by position, radius, value, taper and sag.
        """
        along, _, values = np.array(marks, np.float64).T
        angles = (values - self.value) / self.unit
        if not self.is_round:
            ones, none = np.ones_like(along), np.zeros_like(along)
            off_px: Floats = self.middle_px + self.radius_px * angles - along
            return off_px, np.stack([ones, angles, none, none, none])
        back_px = -self.sag_px * (1.0 - np.cos(angles))
        radius_px = self.radius_px + self.taper * back_px
        off_px = self.middle_px + radius_px * np.sin(angles) - along
        slopes = [np.ones_like(along), np.sin(angles), -radius_px * np.cos(angles) / self.unit]
        slopes += [back_px * np.sin(angles), -self.taper * (1.0 - np.cos(angles)) * np.sin(angles)]
        return off_px, np.stack(slopes)

    @cached_property
    def step(self) -> float:
        """The value of a row of the unrolled tape."""
        step = ROW_PX * self.unit / abs(self.radius_px)
        return step if self.turn is None else self.turn / max(round(self.turn / step), 1)

    def value_at(self, along_px: float) -> float:
        """Return the value at a place along the window, at the height across it where the marks were drawn."""
        part = (along_px - self.middle_px) / self.radius_px
        return self.value + self.unit * (math.asin(min(max(part, -1.0), 1.0)) if self.is_round else part)

    def sigmas(self, marks: DrawnMarks, along_px: float) -> tuple[float, float]:
        """Return the uncertainty of a value there due to marks and index drawn by hand, and of differences from it.

        The second is per unit of distance from that value.
        """
        _, slopes = self._at_marks(marks)
        known = (slopes[:3] if self.is_round else slopes[:2]) / MARK_PX
        covariance = np.linalg.pinv(known @ known.T)
        part = (along_px - self.middle_px) / self.radius_px
        a_pixel = self.value_at(along_px + 0.5) - self.value_at(along_px - 0.5)
        change = np.array([-a_pixel, -part * a_pixel, 1.0][: len(known)])
        own = float(change @ covariance @ change)
        return math.hypot(MARK_PX * a_pixel, math.sqrt(own)), math.sqrt(covariance[1, 1]) / abs(self.radius_px)

    def refined(self, marks: DrawnMarks, normal: Floats, pull: Floats) -> TapeShape:
        """Return the shape after one least-squares step from a flight's normal equations (4, 4), (4,) and the marks."""
        off_px, slopes = self._at_marks(marks)
        order = [0, 1, 3, 4, 2]
        own = slopes[order] / MARK_PX
        information, sides = own @ own.T, own @ (off_px / MARK_PX)
        information[:4, :4] += normal
        sides[:4] += pull
        information[[2, 3], [2, 3]] += 1.0 / np.square([PRIOR_TAPER, PRIOR_SAG_PX])
        sides[[2, 3]] += np.array([self.taper, self.sag_px]) / np.square([PRIOR_TAPER, PRIOR_SAG_PX])
        steps = -np.linalg.solve(information, sides)
        part = 1.0 / max(1.0, *(abs(float(step)) / STEPS[name] for step, name in zip(steps, STEPS, strict=False)))
        moved = {name: getattr(self, name) + part * float(step) for step, name in zip(steps, STEPS, strict=False)}
        return replace(self, **moved, value=self.value + part * float(steps[4]))

    def trials(self) -> list[tuple[TapeShape, float]]:
        """Return shapes that each differ a little in one parameter that a flight can show, with the difference."""
        return [(replace(self, **{name: getattr(self, name) + trial}), trial) for name, trial in TRIALS.items()]


class Unrolling:
    """Unrolls tapes of one shape; `rows` is as in `rows_in_sight`, and a row is worth `step`."""

    def __init__(self, shape: TapeShape, rows: NDArray[np.intp], step: float) -> None:
        self._rows, self._step = rows, step
        along_px, across_px = shape.size
        angles = (rows * (step / shape.unit))[:, None]
        across = (np.arange(across_px) - shape.across_px)[None]
        if shape.is_round:
            x = shape.middle_px + (shape.radius_px + shape.taper * across) * np.sin(angles)
            y = shape.across_px + across + shape.sag_px * (1.0 - np.cos(angles))
        else:
            x, y = np.broadcast_arrays(shape.middle_px + shape.radius_px * angles, shape.across_px + across)
        self._x, self._y = x.astype(np.float32), y.astype(np.float32)
        inside = (x >= 0) & (x <= along_px - 1) & (y >= 0) & (y <= across_px - 1)
        facing = np.cos(angles) if shape.is_round else np.ones_like(angles)
        self.worth: Floats = (facing * inside).astype(np.float32)
        """(R, C): how many of the window's rows one of the tape's stands for, against where it faces the window."""

    def shifts(self, shapes: Sequence[tuple[TapeShape, float]]) -> Floats:
        """(K, 2, R, C): how many rows and columns the unrolled tape moves per unit of difference to other shapes.

        `shapes` are those shapes with their differences.
        """
        (x_down, x_across), (y_down, y_across) = (np.gradient(each) for each in (self._x, self._y))
        area = x_down * y_across - x_across * y_down
        moved = []
        for shape, trial in shapes:
            other = Unrolling(shape, self._rows, self._step)
            right, below = (other._x - self._x) / trial, (other._y - self._y) / trial
            moved.append([(right * y_across - below * x_across) / area, (below * x_down - right * y_down) / area])
        return np.array(moved, np.float32)

    def __call__(self, strip: Floats) -> Floats:
        """Unroll the tape of one window: (along, across) to (R, C) float32."""
        return self.of_soft(softened(strip))

    def of_soft(self, window: Floats) -> Floats:
        """Unroll the tape of one window (along, across) that is already softened: (R, C) float32."""
        levels = cv2.remap(window, self._y, self._x, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(levels, np.float32)


def softened(window: Floats) -> Floats:
    """Blur a window to remove what is finer than a tape's numerals."""
    return np.asarray(cv2.GaussianBlur(window.astype(np.float32, copy=False), (0, 0), BLUR_PX), np.float32)


def rows_in_sight(shape: TapeShape) -> NDArray[np.intp]:
    """(R,): the tape's visible rows, counted from where `value` is."""
    most = LIMB * shape.unit / shape.step if shape.is_round else math.inf
    ends = []
    for end_px in (0.0, shape.size[0] - 1.0):
        part = (end_px - shape.middle_px) / shape.radius_px
        angle = math.asin(min(max(part, -1.0), 1.0)) if shape.is_round else part
        ends.append(min(max(angle * shape.unit / shape.step, -most), most))
    return np.arange(math.ceil(min(ends)), math.floor(max(ends)) + 1)
