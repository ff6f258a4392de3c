"""The first tuning: what the panel picture alone tells of needles and dials.

A needle's template is cut from the panel picture, or given as a cropped unwrapped picture (thesis 3.2.1). The face of
a dial is the panel picture without its needles; what they hide there is filled with what the dial mostly shows at
that radius.
"""

from __future__ import annotations

import cv2
import numpy as np

from decoder.alignment import IDENTITY, Alignment
from decoder.arrays import Floats
from decoder.card_tuning import first_card
from decoder.correlation import normxcorr
from decoder.errors import PanelError
from decoder.faces import bare_face
from decoder.gauge import Gauge
from decoder.gauge_grid import PICTURE_SPAN_DEG, needle_places, row_of_angle, rows_in_sweep, turn_rows
from decoder.needle_layer import cut_over, first_layer
from decoder.needle_template import NeedleTemplate, odd_rows
from decoder.panel_pictures import PanelPictures
from decoder.pictures import GreyPicture
from decoder.pointers import Needle
from decoder.resampling import inside
from decoder.sorting import median_of
from decoder.tuning import Tuning
from decoder.unwrapped_panel import UnwrappedPanel
from decoder.unwrapping import PolarGrid, UnwrappedGauge, Unwrapper, rows_at

MIN_CONTRAST_LEVELS = 4.0
# A needle cut from one picture need not match others better than this, whatever the light.
FOUND_SCORE = 0.8


def tuning_from_panel(drawn: UnwrappedPanel) -> Tuning:
    """The tuning that the panel's own pictures give.

    Raises
    ------
    PanelError
        If a gauge or a template does not fit its picture.
    """
    templates: dict[str, NeedleTemplate] = {}
    faces, cards = [], {}
    source = drawn.source
    parts = zip(source.panel.gauges, drawn.grids, drawn.rims, drawn.gauges, strict=True)
    for index, (gauge, grid, rim, strip) in enumerate(parts):
        _check_inside(rim, source.picture, source.optics.own, f"gauges[{index}]")
        own, face = _gauge_tuning(source, gauge, grid, strip, f"gauges[{index}]")
        templates |= own
        faces.append(face)
        if gauge.card is not None:
            cards[gauge.card.name] = first_card(face, grid)
    return Tuning(templates, tuple(faces), IDENTITY, evenly_lit_score=FOUND_SCORE, cards=cards)


def _gauge_tuning(
    source: PanelPictures, gauge: Gauge, grid: PolarGrid, strip: UnwrappedGauge, path: str
) -> tuple[dict[str, NeedleTemplate], Floats]:
    plain = median_of(strip)
    layers = {}
    for index, needle in enumerate(gauge.needles):
        pixels = _template_picture(source, gauge, needle, grid, f"{path}.needles[{index}].template")
        layers[needle.name] = first_layer(pixels, plain, grid.step_deg)
    place = np.zeros(strip.shape, bool)
    for needle in gauge.needles:
        layer = layers[needle.name]
        row = _row_in_panel_picture(gauge, needle, grid, strip, layer.pixels)
        if row is not None:
            place |= needle_places(grid, layer.touched, row, turn_rows(gauge, grid))
    face = bare_face(strip, place)
    templates = {
        needle.name: cut_over(layers[needle.name], face_behind(face, grid, needle, layers[needle.name].rows))
        for needle in gauge.needles
    }
    return templates, face


def face_behind(face: Floats, grid: PolarGrid, needle: Needle, rows: int) -> Floats:
    """(rows, C): the face where a needle's template was cut; for a cropped picture, what the dial mostly shows."""
    if needle.template.at is None:
        return np.broadcast_to(median_of(face), (rows, face.shape[1])).astype(np.float32)
    return rows_at(face, row_of_angle(grid, needle.template.at) + np.arange(rows) - (rows - 1) / 2)


def _row_in_panel_picture(gauge: Gauge, needle: Needle, grid: PolarGrid, strip: Floats, pixels: Floats) -> float | None:
    """Where a needle lies in the panel picture, by the panel's word or by looking; None if it cannot be told."""
    if needle.template.at is not None and needle.template.picture is None:
        return row_of_angle(grid, needle.template.at)
    axis = (len(pixels) - 1) // 2
    scores = np.zeros(len(strip), np.float32)
    inner = normxcorr(strip, pixels, np.ones_like(pixels))
    scores[axis : axis + len(inner)] = inner
    scores[~rows_in_sweep(gauge, grid)] = 0.0
    return float(scores.argmax()) if scores.max() >= FOUND_SCORE else None


def _template_picture(source: PanelPictures, gauge: Gauge, needle: Needle, grid: PolarGrid, path: str) -> Floats:
    """The needle's picture, (H, C) float32, H odd, its axis in the middle row."""
    template = needle.template
    rows = odd_rows(template.span or PICTURE_SPAN_DEG, grid.step_deg)
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
        own = source.optics.own
        _check_inside(window.rim(), picture, own, path)
        pixels = Unwrapper([window]).unwrap(picture, own)[0]
    if float(pixels.std()) < MIN_CONTRAST_LEVELS:
        raise PanelError(
            path, "shows no needle there: the picture is flat; check `at`, and the gauge's centre and radius"
        )
    return pixels


def _check_inside(rim: Floats, picture: GreyPicture, own: Alignment, path: str) -> None:
    height, width = picture.shape
    if not inside(rim, own, width, height):
        raise PanelError(path, f"lies outside the {width} x {height} picture; check the gauge's centre and radius")
