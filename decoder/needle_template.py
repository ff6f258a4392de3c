"""Needle templates: what an unwrapped needle looks like, and which of its pixels to trust.

A template is cut once per gauge from the panel picture, or given as a cropped unwrapped picture (thesis 3.2.1). Its
rows are angle around the needle's axis, an odd number of them, the axis in the middle row.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.alignment import IDENTITY
from decoder.errors import PanelError
from decoder.panel import Gauge, Needle
from decoder.pictures import GreyPicture
from decoder.unwrapping import PolarGrid, Unwrapper, inside

Floats = NDArray[np.float32]

MIN_CONTRAST_LEVELS = 4.0
# Parts of a needle's full contrast: at its outline, and where its blurred edge has faded out.
OUTLINE_LEVEL = 0.35
TOUCH_LEVEL = 0.1
PICTURE_SPAN_DEG = 16.0


@dataclass(frozen=True, slots=True)
class NeedleTemplate:
    """An unwrapped needle; all arrays (H, C) float32, H odd: rows of angle, the axis in the middle one, by columns of radius.

    Attributes
    ----------
    pixels
        The needle on a plain dial: what is searched for.
    weights
        In [0, 1]: how far each pixel can be trusted to look like that, whatever lies behind the needle.
    light, transparency
        The needle over any background: it shows as `light + transparency * background`. Where nothing is known of the background,
        `light` is all there is.
    trust
        In [0, 1]: how far each pixel follows `light` and `transparency`.
    step_deg
        Degrees from one row to the next.
    """

    pixels: Floats
    weights: Floats
    light: Floats
    transparency: Floats
    trust: Floats
    step_deg: float

    @classmethod
    def plain(cls, pixels: Floats, step_deg: float) -> Self:
        """A template of which nothing but one picture is known."""
        ones = np.ones_like(pixels)
        return cls(pixels, ones, pixels, np.zeros_like(pixels), ones, step_deg)

    @property
    def rows(self) -> int:
        """H, an odd number."""
        return int(self.pixels.shape[0])

    def place(self, level: float) -> NDArray[np.bool_]:
        """(H, C): where the needle differs from its surroundings by more than this part of its full contrast."""
        edge = max(1, self.rows // 10)
        surroundings = np.median(np.concatenate([self.pixels[:edge], self.pixels[-edge:]]), axis=0)
        difference = np.abs(self.pixels - surroundings)
        middle = slice(self.rows // 4, self.rows - self.rows // 4)
        contrast = difference[middle].max(axis=0)
        place: NDArray[np.bool_] = (difference > level * contrast) & (contrast > contrast.max() / 4)
        return place

    @property
    def outline(self) -> NDArray[np.bool_]:
        """(H, C): where the needle itself is, without its surroundings."""
        return self.place(OUTLINE_LEVEL)

    @property
    def half_width_deg(self) -> float:
        """Half of the outline's extent in angle, at its widest."""
        rows = np.flatnonzero(self.outline.any(axis=1))
        return float(np.abs(rows - (self.rows - 1) / 2).max()) * self.step_deg if rows.size else 0.0


def odd_rows(span_deg: float, step_deg: float) -> int:
    """The odd number of rows that covers a span."""
    return 2 * round(span_deg / step_deg / 2) + 1


def cut_template(gauge: Gauge, needle: Needle, grid: PolarGrid, picture: GreyPicture, *, path: str) -> NeedleTemplate:
    """The template around `needle.template.at` in a picture of the panel's size.

    Raises
    ------
    PanelError
        If it lies outside the picture, or nothing is to be seen there.
    """
    template = needle.template
    assert template.at is not None  # noqa: S101 - the caller chose by it
    assert template.span is not None  # noqa: S101 - the panel's own check
    window = grid.at(template.at, odd_rows(template.span, grid.step_deg))
    height, width = picture.shape
    if not inside(window, IDENTITY, width, height):
        raise PanelError(path, f"lies outside the {width} x {height} picture; check the gauge's centre and radius")
    start_deg, end_deg = gauge.sweep
    if not any(start_deg - template.span <= template.at + turn <= end_deg + template.span for turn in (-360, 0, 360)):
        raise PanelError(f"{path}.at", f"{template.at:g} degrees lies outside the gauge's sweep")
    return _checked(Unwrapper([window]).unwrap(picture, IDENTITY)[0], grid.step_deg, path)


def given_template(needle: Needle, grid: PolarGrid, picture: GreyPicture, *, path: str) -> NeedleTemplate:
    """The template from a cropped unwrapped picture, brought to the grid's density.

    Raises
    ------
    PanelError
        If nothing is to be seen in it.
    """
    rows = odd_rows(needle.template.span or PICTURE_SPAN_DEG, grid.step_deg)
    resized = cv2.resize(picture, (grid.columns, rows), interpolation=cv2.INTER_AREA)
    return _checked(resized.astype(np.float32), grid.step_deg, path)


def _checked(pixels: Floats, step_deg: float, path: str) -> NeedleTemplate:
    if float(pixels.std()) < MIN_CONTRAST_LEVELS:
        raise PanelError(
            path, "shows no needle there: the picture is flat; check `at`, and the gauge's centre and radius"
        )
    return NeedleTemplate.plain(pixels, step_deg)
