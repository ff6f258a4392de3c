"""The panel reader: one frame in, the readings of all needles out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

from decoder.aligner import Aligner
from decoder.alignment import IDENTITY, Alignment
from decoder.errors import PanelError, PictureError
from decoder.gauge_reader import GaugeReader, Method, gauge_grid
from decoder.needle_template import NeedleTemplate, cut_template, given_template
from decoder.panel import Gauge, Needle
from decoder.panel_pictures import PanelPictures
from decoder.pictures import GreyPicture
from decoder.reading import Reading
from decoder.unwrapping import UnwrappedGauge, Unwrapper

PANEL_PRECISION_PX = 0.1


@dataclass(frozen=True, slots=True)
class Tuning:
    """What is known beyond the panel's description.

    Attributes
    ----------
    templates
        By needle.
    faces
        For each gauge in the panel's order, the unwrapped dial without needles, (rows, columns) float32, if it is known.
    usual
        Where the camera mostly was.
    """

    templates: Mapping[str, NeedleTemplate]
    faces: tuple[UnwrappedGauge | None, ...]
    usual: Alignment


@dataclass(frozen=True, slots=True)
class UnwrappedFrame:
    """One frame's alignment, and its unwrapped gauges in the panel's order."""

    alignment: Alignment
    gauges: Sequence[UnwrappedGauge]


@dataclass(frozen=True, slots=True)
class FrameReadings:
    """One frame's alignment, and its readings by needle."""

    alignment: Alignment
    readings: Mapping[str, Reading]


class PanelReader:
    """Reads frames with one panel, one tuning and one method; keeps nothing from frame to frame."""

    def __init__(self, source: PanelPictures, method: Method, tuning: Tuning) -> None:
        self.source = source
        self.method = method
        self.tuning = tuning
        self.grids = [gauge_grid(gauge) for gauge in source.panel.gauges]
        self.aligner = Aligner(source.panel, source.picture, tuning.usual)
        self._unwrapper = Unwrapper(self.grids)
        self._gauges = [
            GaugeReader(
                gauge,
                grid,
                {needle.name: tuning.templates[needle.name] for needle in gauge.needles},
                face,
                method,
            )
            for gauge, grid, face in zip(source.panel.gauges, self.grids, tuning.faces, strict=True)
        ]

    @classmethod
    def from_panel(cls, source: PanelPictures, method: Method) -> Self:
        """A reader with the templates as the panel gives them.

        Raises
        ------
        PanelError
            If a template, an anchor or the level edge does not fit the panel picture.
        """
        templates = {
            needle.name: _template(source, gauge, needle, f"gauges[{g}].needles[{n}].template")
            for g, gauge in enumerate(source.panel.gauges)
            for n, needle in enumerate(gauge.needles)
        }
        return cls(source, method, Tuning(templates, (None,) * len(source.panel.gauges), IDENTITY))

    @property
    def systematic_deg(self) -> Mapping[str, float]:
        """By needle: what all its readings may be off by together, as a standard uncertainty in degrees.

        A panel drawn on a picture is good to about a tenth of a pixel, at the needle's mean radius.
        """
        return {
            needle.name: math.degrees(PANEL_PRECISION_PX / (sum(gauge.radius) / 2))
            for gauge in self.source.panel.gauges
            for needle in gauge.needles
        }

    def tuned(self, tuning: Tuning) -> PanelReader:
        """The same reader with another tuning."""
        return PanelReader(self.source, self.method, tuning)

    def unwrap(self, frame: GreyPicture) -> UnwrappedFrame:
        """A frame aligned and unwrapped.

        Raises
        ------
        PictureError
            If the frame is of another size than the panel picture, or the panel is not found in it.
        """
        if frame.shape != self.source.picture.shape:
            (height, width), (panel_height, panel_width) = frame.shape, self.source.picture.shape
            raise PictureError(f"the picture is {width} x {height}, the panel's {panel_width} x {panel_height}")
        alignment = self.aligner.align(frame)
        return UnwrappedFrame(alignment, self._unwrapper.unwrap(frame, alignment))

    def read(self, frame: GreyPicture) -> FrameReadings:
        """The readings of one frame.

        Raises
        ------
        PictureError
            As `unwrap`.
        """
        return self.read_unwrapped(self.unwrap(frame))

    def read_unwrapped(self, unwrapped: UnwrappedFrame) -> FrameReadings:
        """The readings of a frame that is unwrapped already."""
        readings: dict[str, Reading] = {}
        for gauge, image in zip(self._gauges, unwrapped.gauges, strict=True):
            readings.update(gauge.read(image))
        return FrameReadings(unwrapped.alignment, readings)


def _template(source: PanelPictures, gauge: Gauge, needle: Needle, path: str) -> NeedleTemplate:
    grid = gauge_grid(gauge)
    name = needle.template.picture
    picture = source.picture if name is None else source.pictures[name]
    if needle.template.at is None:
        return given_template(needle, grid, picture, path=path)
    if picture.shape != source.picture.shape:
        raise PanelError(f"{path}.picture", "is not of the panel picture's size, so `at` has no meaning in it")
    return cut_template(gauge, needle, grid, picture, path=path)
