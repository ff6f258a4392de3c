"""The dial behind a needle of the panel picture, as frames show it.

A needle cut from one picture is cut with the marks behind it. Where these outshine a dim needle, they match themselves
in every frame, and the needle seems to stand still where the panel picture has it. If the frames mostly show something
else there, that is the dial. Without this a thin needle, or one before a numeral, is found in no frame of some flights.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from decoder.imaging.sorting import MAD_TO_SIGMA, median_of
from decoder.imaging.unwrapping import PolarGrid, UnwrappedGauge, row_of_angle
from decoder.instruments.appearance import face_behind
from decoder.instruments.panel_reader import PanelReader
from decoder.instruments.reading import Reading, Status
from decoder.instruments.thresholds import APART_DEG, CLEAR_PART, FRAMES_TO_LEARN, NEEDLE_PART
from decoder.learning.thresholds import MOSTLY, NOISE_SPREADS, SEEN_PART
from decoder.matching.faces import LitViews
from decoder.matching.needle_layer import layer_over
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.thresholds import MIN_VISIBLE
from decoder.panel.arrays import Floats, Mask
from decoder.panel.gauge import Gauge
from decoder.panel.kind import Pointer
from decoder.panel.scale import FULL_CIRCLE_DEG, shortest
from decoder.registration.thresholds import NOISE_LEVELS


def with_seen_faces(reader: PanelReader, views: LitViews, found: Sequence[Mapping[str, Reading]]) -> PanelReader:
    """Show the reader the dials behind the panel picture's needles, where these mostly stand elsewhere.

    A needle that is `found` to move, by frame, is not in doubt: the marks behind it are not what is matched.
    """
    source, before = reader.source, reader.appearance
    own = reader.own_gauges
    faces, templates = list(before.faces), dict(before.templates)
    for index, (gauge, grid) in enumerate(zip(source.panel.gauges, reader.grids, strict=True)):
        if not isinstance(grid, PolarGrid):
            continue
        seen = [view for view in views[index] if view is not None]
        doubted = any(_seems_still(needle, found) for needle in _cut_needles(gauge))
        if len(seen) < FRAMES_TO_LEARN or not doubted or not _may_be_bared(gauge, grid, templates, faces[index], seen):
            continue
        usual = median_of(np.stack(seen)).astype(np.float32)
        dial = _Dial(gauge, grid, templates, own[index], usual, faces[index])
        others = {needle.name: _rows_of_others(dial, needle, found) for needle in _cut_needles(gauge)}
        in_sight = [at for at, view in enumerate(views[index]) if view is not None]
        for needle in _bared(dial, seen, {name: rows[in_sight] for name, rows in others.items()}):
            rows = _window(needle, grid, templates[needle.name])
            faces[index] = np.where(rows[:, None], usual, faces[index]).astype(np.float32)
            cut = templates[needle.name]
            behind = face_behind(faces[index], grid, needle.at_deg, cut.rows)
            templates[needle.name] = layer_over(cut.pixels, behind, cut.step_deg)
    if all(face is same for face, same in zip(faces, before.faces, strict=True)):
        return reader
    return reader.with_appearance(replace(before, faces=tuple(faces), templates=templates))


@dataclass(frozen=True, slots=True)
class _Dial:
    """One unwrapped gauge: in the panel picture, as frames mostly show it, and as it was thought to be bare."""

    gauge: Gauge
    grid: PolarGrid
    templates: Mapping[str, NeedleTemplate]
    drawn: UnwrappedGauge
    usual: UnwrappedGauge
    face: UnwrappedGauge


def may_be_lost(gauge: Gauge, found: Sequence[Mapping[str, Reading]]) -> bool:
    """Whether one of its needles is not read in some frame, or mostly where the panel picture has it."""
    return any(
        _seems_still(needle, found) or any(readings[needle.name].status is Status.MISSING for readings in found)
        for needle in gauge.over_face
    )


def _seems_still(needle: Pointer, found: Sequence[Mapping[str, Reading]]) -> bool:
    """Tell whether a needle is mostly read where the panel picture has it, or not at all."""
    at = 0.0 if needle.at_deg is None else needle.at_deg
    readings = [readings[needle.name] for readings in found]
    still = [
        each.status is Status.MISSING
        or abs(float(shortest(np.array(each.angle_deg - at), FULL_CIRCLE_DEG))) <= APART_DEG
        for each in readings
    ]
    return 2 * sum(still) > len(still)


def _may_be_bared(
    gauge: Gauge, grid: PolarGrid, templates: Mapping[str, NeedleTemplate], face: UnwrappedGauge, seen: Sequence[Floats]
) -> bool:
    """Tell whether frames mostly show another dial in a needle's window than was thought."""
    windows = [_window(needle, grid, templates[needle.name]) for needle in _cut_needles(gauge)]
    off = (np.abs(face[rows] - median_of(np.stack([view[rows] for view in seen]))) for rows in windows)
    return any(float((each > 3 * NOISE_LEVELS).mean()) > NEEDLE_PART for each in off)


def _cut_needles(gauge: Gauge) -> list[Pointer]:
    """Name those that are cut from the panel picture."""
    return [each for each in gauge.over_face if each.hides_deg is not None]


def _bared(dial: _Dial, seen: Sequence[UnwrappedGauge], others: Mapping[str, Mask]) -> list[Pointer]:
    """Name the needles that mostly stand elsewhere, and behind which there is another dial than was thought.

    A needle that moved by less than its width has gone from its edges alone: along its axis the dial still shows the
    needle, however much moves beside it. What `others` show, by needle, (frames, R), is not the needle itself.
    """
    needles = _cut_needles(dial.gauge)
    windows = [_window(needle, dial.grid, dial.templates[needle.name]) for needle in needles]
    beside = ~np.any(windows, axis=0) if windows else np.zeros(0, bool)
    if not beside.any():
        return []
    noise = MAD_TO_SIGMA * float(np.median(np.abs(dial.drawn - dial.usual)[beside]))
    least = max(NOISE_SPREADS * noise, 3 * NOISE_LEVELS)
    differs = np.stack([(np.abs(view - dial.usual) > least).sum(axis=1) * beside for view in seen])
    bared = []
    for needle, rows in zip(needles, windows, strict=True):
        gone = dial.drawn[rows] - _in_light_of(dial.drawn[rows], dial.usual[rows])
        low, high = np.quantile(dial.drawn[rows], (0.02, 0.98))
        is_gone = np.abs(gone) > max(least, CLEAR_PART * float(high - low))
        elsewhere = np.where(others[needle.name], 0, differs).sum(axis=1)
        if (
            is_gone.mean() > NEEDLE_PART
            and _axis_part(dial, needle, is_gone) > MIN_VISIBLE
            and (elsewhere > SEEN_PART * is_gone.sum()).mean() > MOSTLY
            and float((np.abs(dial.face[rows] - dial.usual[rows]) > least).mean()) > NEEDLE_PART
        ):
            bared.append(needle)
    return bared


def _axis_part(dial: _Dial, needle: Pointer, is_gone: Mask) -> float:
    """Return the part of a needle's axis, in [0, 1], that is gone from its window, (rows, C)."""
    template = dial.templates[needle.name]
    shown = template.outline[template.rows // 2]
    rows = np.flatnonzero(_window(needle, dial.grid, template))
    on_axis = int(np.argmin(np.abs(rows - _axis_row(needle, dial.grid))))
    return float(is_gone[on_axis, shown].mean()) if shown.any() else 0.0


def _rows_of_others(dial: _Dial, needle: Pointer, found: Sequence[Mapping[str, Reading]]) -> Mask:
    """(frames, R): the rows that show another needle of the dial, one that is found to move, or its tail."""
    rows = np.zeros((len(found), dial.grid.rows), bool)
    angles_deg = dial.grid.start_deg + dial.grid.step_deg * np.arange(dial.grid.rows)
    for other in dial.gauge.over_face:
        if other.name == needle.name or _seems_still(other, found):
            continue
        half_deg = dial.templates[other.name].rows * dial.templates[other.name].step_deg / 2
        for frame, readings in enumerate(found):
            if readings[other.name].status is Status.READ:
                off_deg = shortest(angles_deg - readings[other.name].angle_deg, FULL_CIRCLE_DEG / 2)
                rows[frame] |= np.abs(off_deg) <= half_deg
    return rows


def _in_light_of(wanted: Floats, seen: Floats) -> Floats:
    """Bring a part of a dial into the light of another picture of it, so that other light makes no other dial."""
    spread = seen - seen.mean()
    gain = float((spread * (wanted - wanted.mean())).sum()) / max(float((spread * spread).sum()), 1.0)
    lit: Floats = wanted.mean() + gain * spread
    return lit


def _window(needle: Pointer, grid: PolarGrid, template: NeedleTemplate) -> Mask:
    """(R,): which rows of the gauge a needle of the panel picture was cut from."""
    rows: Mask = np.abs(np.arange(grid.rows) - _axis_row(needle, grid)) <= (template.rows - 1) / 2
    return rows


def _axis_row(needle: Pointer, grid: PolarGrid) -> float:
    """Return the row on which the axis of a needle of the panel picture lies."""
    return row_of_angle(grid, 0.0 if needle.at_deg is None else needle.at_deg)
