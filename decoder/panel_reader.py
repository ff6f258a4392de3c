"""The panel reader: one frame in, the readings of all needles out."""

from __future__ import annotations

import math
from collections.abc import Mapping
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
from decoder.unwrapping import PolarGrid, Unwrapper

PANEL_PRECISION_PX = 0.1

Templates = Mapping[str, NeedleTemplate]


@dataclass(frozen=True, slots=True)
class FrameReadings:
    """One frame's alignment, and its readings by needle."""

    alignment: Alignment
    readings: Mapping[str, Reading]


class PanelReader:
    """Reads frames with one panel, one set of templates and one method; keeps nothing from frame to frame."""

    def __init__(
        self, source: PanelPictures, grids: list[PolarGrid], templates: Templates, usual: Alignment, method: Method
    ) -> None:
        panel = source.panel
        self.source = source
        self.grids = grids
        self.templates = templates
        self.method = method
        self.aligner = Aligner(panel, source.picture, usual)
        self._unwrapper = Unwrapper(grids)
        self._gauges = [
            GaugeReader(gauge, grid, {needle.name: templates[needle.name] for needle in gauge.needles}, method)
            for gauge, grid in zip(panel.gauges, grids, strict=True)
        ]

    @classmethod
    def from_panel(cls, source: PanelPictures, method: Method) -> Self:
        """A reader with the templates as the panel gives them.

        Raises
        ------
        PanelError
            If a template, an anchor or the level edge does not fit the panel picture.
        """
        grids = [gauge_grid(gauge) for gauge in source.panel.gauges]
        templates = {
            needle.name: _template(source, gauge, needle, grid, f"gauges[{g}].needles[{n}].template")
            for g, (gauge, grid) in enumerate(zip(source.panel.gauges, grids, strict=True))
            for n, needle in enumerate(gauge.needles)
        }
        return cls(source, grids, templates, IDENTITY, method)

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

    def tuned(self, templates: Templates, usual: Alignment) -> PanelReader:
        """The same reader with other templates, and searches starting at another alignment."""
        return PanelReader(self.source, self.grids, templates, usual, self.method)

    def read(self, frame: GreyPicture) -> FrameReadings:
        """The readings of one frame.

        Raises
        ------
        PictureError
            If the frame is of another size than the panel picture, or the panel is not found in it.
        """
        if frame.shape != self.source.picture.shape:
            (height, width), (panel_height, panel_width) = frame.shape, self.source.picture.shape
            raise PictureError(f"the picture is {width} x {height}, the panel's {panel_width} x {panel_height}")
        alignment = self.aligner.align(frame)
        unwrapped = self._unwrapper.unwrap(frame, alignment)
        readings: dict[str, Reading] = {}
        for gauge, image in zip(self._gauges, unwrapped, strict=True):
            readings.update(gauge.read(image))
        return FrameReadings(alignment, readings)


def _template(source: PanelPictures, gauge: Gauge, needle: Needle, grid: PolarGrid, path: str) -> NeedleTemplate:
    name = needle.template.picture
    picture = source.picture if name is None else source.pictures[name]
    if needle.template.at is None:
        return given_template(needle, grid, picture, path=path)
    if picture.shape != source.picture.shape:
        raise PanelError(f"{path}.picture", "is not of the panel picture's size, so `at` has no meaning in it")
    return cut_template(gauge, needle, grid, picture, path=path)
