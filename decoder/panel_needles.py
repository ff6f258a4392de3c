"""The panel's needles: where the panel picture shows them, and how surely a flight's needles are found there.

The panel picture is one more frame in which all needles' angles are known: it tells where a needle's zero is, and by
how much the needle's line was turned there, from where the pivot follows even if the needle hardly moves in flight.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from decoder.fitting import Fitter
from decoder.gauge_grid import row_of_angle
from decoder.panel_reader import PanelReader
from decoder.pointers import Needle
from decoder.reading import Reading, Status
from decoder.unwrapping import PolarGrid, UnwrappedGauge, rows_at


@dataclass(frozen=True, slots=True)
class DrawnGauge:
    """One gauge of the panel picture: unwrapped, and its needles as the panel has them.

    A needle that was cut elsewhere is missing. The readings' sigma is that of the zeros: how surely the needle, as the
    reader has it, is found where the panel says that it lies.
    """

    strip: UnwrappedGauge
    readings: Mapping[str, Reading]


def drawn_gauges(reader: PanelReader) -> list[DrawnGauge]:
    """The panel picture's, in the panel's order."""
    source = reader.source
    parts = zip(source.panel.gauges, reader.grids, reader.tuning.faces, reader.own_gauges, strict=True)
    return [
        DrawnGauge(strip, {needle.name: _reading(reader, needle, grid, face, strip) for needle in gauge.needles})
        for gauge, grid, face, strip in parts
    ]


def _reading(
    reader: PanelReader, needle: Needle, grid: PolarGrid, face: UnwrappedGauge, strip: UnwrappedGauge
) -> Reading:
    if needle.template.at is None or needle.template.picture is not None:
        return Reading(Status.MISSING, math.nan, math.inf, 0.0)
    template = reader.tuning.templates[needle.name]
    row = row_of_angle(grid, needle.template.at)
    rows = row + np.arange(template.rows) - (template.rows - 1) / 2
    behind = rows_at(face, rows)
    fit = Fitter(template, grid.pixels_per_sample).fit(rows_at(strip, rows), lambda _: behind)
    return Reading(Status.READ, grid.angle_deg(row), fit.sigma_rows * grid.step_deg, fit.correlation)
