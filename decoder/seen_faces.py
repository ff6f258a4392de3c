"""Seen faces: what lies behind the panel picture's needles, as the flight's frames show it.

A needle cut from one picture is cut with the marks behind it. Where these outshine a dim needle, they match themselves
in every frame, and the needle seems to stand still where the panel picture has it. If the frames mostly show something
else there, that is the dial.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from decoder.arrays import Floats, Mask
from decoder.faces import LitViews
from decoder.gauge import Gauge
from decoder.gauge_grid import row_of_angle
from decoder.needle_layer import layer_over
from decoder.needle_template import NeedleTemplate
from decoder.panel_reader import PanelReader
from decoder.panel_tuning import face_behind
from decoder.pointers import Needle
from decoder.reading import Reading, Status
from decoder.scale import shortest
from decoder.scale_marks import FULL_CIRCLE_DEG
from decoder.sorting import median_of
from decoder.unwrapping import PolarGrid, UnwrappedGauge

MIN_VIEWS = 5
# What differs between two pictures of the same is noise up to so many times its spread, and so many levels.
NOISE_SPREADS = 6.0
LEAST_LEVELS = 12.0
MAD_TO_SIGMA = 1.4826
# A needle fills more of its window than this.
LEAST_PART = 0.015
# Glints change a needle by less than this part of the contrast around it.
CLEAR_PART = 0.2
# A needle that is read no further than this from where the panel picture has it may be the marks behind it.
STILL_DEG = 3.0
# It must be seen elsewhere, for the most part, in most frames.
SEEN_PART, MOSTLY = 0.4, 0.6


def with_seen_faces(reader: PanelReader, views: LitViews, found: Sequence[Mapping[str, Reading]]) -> PanelReader:
    """The reader with the dials behind the panel picture's needles, where these mostly stand elsewhere.

    A needle that is `found` to move, by frame, is not in doubt: the marks behind it are not what is matched.
    """
    source, tuning = reader.source, reader.tuning
    own = reader.own_gauges
    faces, templates = list(tuning.faces), dict(tuning.templates)
    for index, (gauge, grid) in enumerate(zip(source.panel.gauges, reader.grids, strict=True)):
        seen = [view for view in views[index] if view is not None]
        doubted = any(_seems_still(needle, found) for needle in _cut_needles(gauge))
        if len(seen) < MIN_VIEWS or not doubted or not _may_be_bared(gauge, grid, templates, faces[index], seen):
            continue
        usual = median_of(np.stack(seen)).astype(np.float32)
        for needle in _bared(gauge, grid, templates, _Dial(own[index], usual, faces[index]), seen):
            rows = _window(needle, grid, templates[needle.name])
            faces[index] = np.where(rows[:, None], usual, faces[index]).astype(np.float32)
            cut = templates[needle.name]
            behind = face_behind(faces[index], grid, needle, cut.rows)
            templates[needle.name] = layer_over(cut.pixels, behind, cut.step_deg)
    if all(face is before for face, before in zip(faces, tuning.faces, strict=True)):
        return reader
    return reader.tuned(replace(tuning, faces=tuple(faces), templates=templates))


@dataclass(frozen=True, slots=True)
class _Dial:
    """One unwrapped gauge: in the panel picture, as frames mostly show it, and as it was thought to be bare."""

    drawn: UnwrappedGauge
    usual: UnwrappedGauge
    face: UnwrappedGauge


def _seems_still(needle: Needle, found: Sequence[Mapping[str, Reading]]) -> bool:
    """Whether a needle is mostly read where the panel picture has it, or not at all."""
    at = 0.0 if needle.template.at is None else needle.template.at
    readings = [readings[needle.name] for readings in found]
    still = [
        each.status is Status.MISSING
        or abs(float(shortest(np.array(each.angle_deg - at), FULL_CIRCLE_DEG))) <= STILL_DEG
        for each in readings
    ]
    return 2 * sum(still) > len(still)


def _may_be_bared(
    gauge: Gauge, grid: PolarGrid, templates: Mapping[str, NeedleTemplate], face: UnwrappedGauge, seen: Sequence[Floats]
) -> bool:
    """Whether frames mostly show another dial behind some needle than was thought: only its window is looked at."""
    windows = [_window(needle, grid, templates[needle.name]) for needle in _cut_needles(gauge)]
    off = (np.abs(face[rows] - median_of(np.stack([view[rows] for view in seen]))) for rows in windows)
    return any(float((each > LEAST_LEVELS).mean()) > LEAST_PART for each in off)


def _cut_needles(gauge: Gauge) -> list[Needle]:
    """Those that are cut from the panel picture."""
    return [each for each in gauge.needles if each.template.at is not None and each.template.picture is None]


def _bared(
    gauge: Gauge,
    grid: PolarGrid,
    templates: Mapping[str, NeedleTemplate],
    dial: _Dial,
    seen: Sequence[UnwrappedGauge],
) -> list[Needle]:
    """The needles that mostly stand elsewhere, and behind which there is another dial than was thought."""
    needles = _cut_needles(gauge)
    windows = [_window(needle, grid, templates[needle.name]) for needle in needles]
    beside = ~np.any(windows, axis=0) if windows else np.zeros(0, bool)
    if not beside.any():
        return []
    noise = MAD_TO_SIGMA * float(np.median(np.abs(dial.drawn - dial.usual)[beside]))
    least = max(NOISE_SPREADS * noise, LEAST_LEVELS)
    elsewhere = [int((np.abs(view - dial.usual)[beside] > least).sum()) for view in seen]
    bared = []
    for needle, rows in zip(needles, windows, strict=True):
        gone = dial.drawn[rows] - _in_light_of(dial.drawn[rows], dial.usual[rows])
        low, high = np.quantile(dial.drawn[rows], (0.02, 0.98))
        clear = max(least, CLEAR_PART * float(high - low))
        area = int((np.abs(gone) > clear).sum())
        if (
            area > LEAST_PART * gone.size
            and float(np.mean([count > SEEN_PART * area for count in elsewhere])) > MOSTLY
            and float((np.abs(dial.face[rows] - dial.usual[rows]) > least).mean()) > LEAST_PART
        ):
            bared.append(needle)
    return bared


def _in_light_of(wanted: Floats, seen: Floats) -> Floats:
    """A part of a dial in the light of another picture of it: one that only lies in other light is no other dial."""
    spread = seen - seen.mean()
    gain = float((spread * (wanted - wanted.mean())).sum()) / max(float((spread * spread).sum()), 1.0)
    lit: Floats = wanted.mean() + gain * spread
    return lit


def _window(needle: Needle, grid: PolarGrid, template: NeedleTemplate) -> Mask:
    """(R,): which rows of the gauge a needle of the panel picture was cut from."""
    at = needle.template.at
    middle = row_of_angle(grid, 0.0 if at is None else at)
    rows: Mask = np.abs(np.arange(grid.rows) - middle) <= (template.rows - 1) / 2
    return rows
