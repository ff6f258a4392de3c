"""Needles as the panel's pictures show them, and the dial without them.

A needle's template is cut from the panel picture, or given as a cropped unwrapped picture (thesis 3.2.1). The face of
a dial is the panel picture without its needles; what they hide there is filled with what the dial mostly shows at
that radius.
"""

from __future__ import annotations

import cv2
import numpy as np

from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.sorting import median_of
from decoder.imaging.unwrapping import (
    PolarGrid,
    Unwrapper,
    needle_places,
    row_of_angle,
    rows_in_sweep,
    turn_rows,
)
from decoder.instruments.appearance import DrawnInstrument, Look
from decoder.matching.correlation import normxcorr
from decoder.matching.faces import bare_face
from decoder.matching.needle_layer import cut_over, first_layer
from decoder.matching.needle_template import odd_rows
from decoder.matching.strips import rows_at
from decoder.matching.thresholds import SCORE_THRESHOLD
from decoder.panel.arrays import Floats
from decoder.panel.errors import PanelError
from decoder.panel.gauge import Gauge
from decoder.panel.needles import Needle
from decoder.registration.thresholds import MIN_CONTRAST_LEVELS


def needles_in_picture(drawn: DrawnInstrument) -> Look:
    """Cut an instrument's needles, if it has any, and bare the dial below them.

    Raises
    ------
    PanelError
        If a template does not fit its picture.
    """
    gauge, grid, strip = drawn.gauge, drawn.grid, drawn.strip
    plain = median_of(strip)
    layers = {}
    for place, needle in enumerate(gauge.needles):
        path = f"gauges[{drawn.index}].needles[{place}].template"
        layers[needle.name] = first_layer(
            _template_picture(drawn.source, gauge, needle, grid, path), plain, grid.step_deg
        )
    covered = np.zeros(strip.shape, bool)
    for needle in gauge.needles:
        layer = layers[needle.name]
        row = _row_in_panel_picture(gauge, needle, grid, strip, layer.pixels)
        if row is not None:
            covered |= needle_places(grid, layer.touched, row, turn_rows(gauge, grid))
    face = bare_face(strip, covered)
    templates = {
        needle.name: cut_over(layer, face_behind(face, grid, needle.template.at, layer.rows))
        for needle, layer in zip(gauge.needles, layers.values(), strict=True)
    }
    return Look(face, templates)


def face_behind(face: Floats, grid: PolarGrid, at_deg: float | None, rows: int) -> Floats:
    """(rows, C): the face where a needle's template was cut; for a cropped picture, what the dial mostly shows."""
    if at_deg is None:
        return np.broadcast_to(median_of(face), (rows, face.shape[1])).astype(np.float32)
    return rows_at(face, row_of_angle(grid, at_deg) + np.arange(rows) - (rows - 1) / 2)


def _row_in_panel_picture(gauge: Gauge, needle: Needle, grid: PolarGrid, strip: Floats, pixels: Floats) -> float | None:
    """Where a needle lies in the panel picture, by the panel's word or by looking; None if it cannot be told."""
    if needle.template.at is not None and needle.template.picture is None:
        return row_of_angle(grid, needle.template.at)
    axis = (len(pixels) - 1) // 2
    scores = np.zeros(len(strip), np.float32)
    inner = normxcorr(strip, pixels, np.ones_like(pixels))
    scores[axis : axis + len(inner)] = inner
    scores[~rows_in_sweep(gauge, grid)] = 0.0
    return float(scores.argmax()) if scores.max() >= SCORE_THRESHOLD else None


def _template_picture(source: PanelPictures, gauge: Gauge, needle: Needle, grid: PolarGrid, path: str) -> Floats:
    """Cut out the needle's picture, (H, C) float32, H odd, its axis in the middle row."""
    template = needle.template
    rows = odd_rows(template.span_deg, grid.step_deg)
    picture = source.picture if template.picture is None else source.pictures[template.picture]
    if template.at is None:
        pixels = cv2.resize(picture, (grid.columns, rows), interpolation=cv2.INTER_AREA).astype(np.float32)
    else:
        if picture.shape != source.picture.shape:
            raise PanelError(f"{path}.picture", "is not of the panel picture's size, so `at` has no meaning in it")
        start_deg, end_deg = gauge.sweep
        if not any(start_deg - 45.0 <= template.at + turn <= end_deg + 45.0 for turn in (-360.0, 0.0, 360.0)):
            raise PanelError(f"{path}.at", f"{template.at:g} degrees lies outside the gauge's sweep")
        window = grid.at(template.at, rows)
        source.check_shows(window.rim(), path)
        pixels = Unwrapper([window]).unwrap(picture, source.optics.own)[0]
    if float(pixels.std()) < MIN_CONTRAST_LEVELS:
        raise PanelError(
            path, "shows no needle there: the picture is flat; check `at`, and the gauge's centre and radius"
        )
    return pixels
