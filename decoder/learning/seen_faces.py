"""The dial behind a needle of the panel picture, learned from frames.

A needle cut from one picture includes the marks behind it. If these are brighter than a dim needle, they match
themselves in every frame, and the needle seems to stay where it is in the panel picture. If most frames show something
else in that place, it is the dial. Without this correction, some flights have no frame in which a thin needle, or one
over a numeral, is found.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from decoder.imaging.sorting import MAD_TO_SIGMA, median_of
from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import (
    PolarGrid,
    UnwrappedGauge,
    needle_places,
    opposite_rows,
    row_of_angle,
    same_rows,
    turn_rows,
)
from decoder.instruments.appearance import Appearance
from decoder.instruments.missing import finds_more, is_lost
from decoder.instruments.panel_reader import PanelReader
from decoder.instruments.reading import Reading, Status
from decoder.instruments.thresholds import APART_DEG, CLEAR_PART, CLEARLY_WORSE, FRAMES_TO_LEARN, NEEDLE_PART
from decoder.learning.thresholds import NOISE_SPREADS, SEEN_PART
from decoder.matching.faces import LitViews, face_behind
from decoder.matching.needle_layer import layer_over
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.thresholds import MIN_VIEWS, MIN_VISIBLE, MOSTLY
from decoder.panel.arrays import Floats, Mask
from decoder.panel.gauge import Gauge
from decoder.panel.kind import Pointer
from decoder.panel.scale import FULL_CIRCLE_DEG, shortest
from decoder.registration.thresholds import NOISE_LEVELS

# The dial behind a needle is taken from the third of the frames that differ most there from the panel picture.
ELSEWHERE = 3

Found = Sequence[Mapping[str, Reading]]
Read = Callable[[PanelReader], Found]
"""Reads the sample's frames."""


def with_seen_faces(reader: PanelReader, views: LitViews, found: Found, read: Read) -> tuple[PanelReader, Found]:
    """Correct the reader's faces behind the panel picture's needles, where frames show them; return its readings too.

    A needle that moves in `found`, the readings by frame, needs no correction: what matches is not the marks behind it.
    A geared hand may move so little that it is still there in the median of the frames. Correcting its face would lose
    it, and with it the value in some frames; such a hand keeps its face.
    """
    bared = _with_usual_faces(reader, views, found, frozenset())
    if bared is not reader:
        again = read(bared)
        kept = frozenset(_going_where_less_is_told(reader.source.panel.gauges, found, again))
        if kept:
            bared = _with_usual_faces(reader, views, found, kept)
            again = read(bared)
        reader, found = bared, again
    return _with_other_faces(reader, views, found, read)


def _going_where_less_is_told(gauges: Sequence[Gauge], before: Found, after: Found) -> Iterator[str]:
    """List hands that followed their value `before`, on gauges whose value is missing in more frames `after`."""
    for gauge in gauges:
        if gauge.combination is not None:
            name = gauge.combination.quantity.name
            old, new = (sum(own[name].status is Status.MISSING for own in found) for found in (before, after))
            if new > old:
                yield from (needle.name for needle in _cut_needles(gauge) if _goes_along(needle, gauge, before))


def _with_usual_faces(reader: PanelReader, views: LitViews, found: Found, kept: frozenset[str]) -> PanelReader:
    """Take the face behind needles, but `kept` ones, from the frames' median if most frames show them elsewhere."""
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
        bared = _bared(dial, seen, {name: rows[in_sight] for name, rows in others.items()})
        bared = [needle for needle in bared if needle.name not in kept]
        covered = _covered_by_others(dial, bared, found)
        for needle in bared:
            place = _wherever_shown(_window(needle, grid, templates[needle.name]), dial) & ~covered
            faces[index] = np.where(place, usual, faces[index]).astype(np.float32)
            templates[needle.name] = _over(dial, faces[index], needle)
    if all(face is same for face, same in zip(faces, before.faces, strict=True)):
        return reader
    return reader.with_appearance(replace(before, faces=tuple(faces), templates=templates))


def with_usual_dials(reader: PanelReader, views: LitViews, found: Found, read: Read) -> tuple[PanelReader, Found]:
    """Take lost gauges' dials from the frames' median, where that finds more; return the reader's readings too.

    The panel picture shows its own shadows and reflections as if they were print. Over these, needles are found in too
    few frames to learn the dial without them. Geared hands are left out: the slow ones stay in the median themselves.
    """
    gauges, before = reader.source.panel.gauges, reader.appearance
    own, wanted = reader.own_gauges, set[int]()
    faces, templates = list(before.faces), dict(before.templates)
    for index, (gauge, grid) in enumerate(zip(gauges, reader.grids, strict=True)):
        seen = [view for view in views[index] if view is not None]
        needles = _cut_needles(gauge) if gauge.combination is None else []
        if isinstance(grid, PolarGrid) and needles and len(seen) >= FRAMES_TO_LEARN and is_lost(gauge, found):
            wanted.add(index)
            faces[index] = median_of(np.stack(seen)).astype(np.float32)
            dial = _Dial(gauge, grid, templates, own[index], faces[index], faces[index])
            templates |= {needle.name: _over(dial, faces[index], needle) for needle in needles}
    while wanted:
        again = reader.with_appearance(of_gauges(wanted, gauges, before, tuple(faces), templates))
        found_again = read(again)
        better = {index for index in wanted if finds_more(gauges[index], found, found_again)}
        if better == wanted:
            return again, found_again
        wanted = better
    return reader, found


def of_gauges(
    which: Collection[int],
    gauges: Sequence[Gauge],
    before: Appearance,
    faces: Sequence[UnwrappedGauge],
    templates: Mapping[str, NeedleTemplate],
) -> Appearance:
    """Return what was known `before`, with the faces and templates of some gauges replaced."""
    names = {needle.name for index in which for needle in _cut_needles(gauges[index])}
    return replace(
        before,
        faces=tuple(
            face if index in which else known
            for index, (face, known) in enumerate(zip(faces, before.faces, strict=True))
        ),
        templates={name: templates[name] if name in names else known for name, known in before.templates.items()},
    )


@dataclass(frozen=True, slots=True)
class _Apart:
    """A needle that may have left its place in some frames.

    `unlike` and `like` are the frames that differ most and least from the panel picture there; `face` and `template`
    follow from the unlike ones.
    """

    needle: Pointer
    unlike: Sequence[int]
    like: Sequence[int]
    place: Mask
    face: UnwrappedGauge
    template: NeedleTemplate

    def is_confirmed(self, before: Found, found: Found) -> bool:
        """Tell whether the readings with this face, `found`, confirm it.

        They do if most unlike frames show the needle elsewhere; or if in most unlike frames its best match is no longer
        where it was cut, while most like ones still show it there. For a needle that was missing in most frames
        `before`, it is enough if unlike frames do not show it where it was cut.
        """
        was_found = 2 * sum(own[self.needle.name].status is not Status.MISSING for own in before) >= len(before)
        unlike, like = ([found[at] for at in part] for part in (self.unlike, self.like))
        is_elsewhere = [own[self.needle.name].is_seen and _off_home_deg(self.needle, own) > APART_DEG for own in unlike]
        is_gone = [
            _off_home_deg(self.needle, own) > APART_DEG if was_found else not _is_at_home(self.needle, own)
            for own in unlike
        ]
        is_there = [_is_at_home(self.needle, own) for own in like]
        return float(max(np.mean(is_elsewhere), min(np.mean(is_gone), np.mean(is_there)))) > MOSTLY


def _with_other_faces(reader: PanelReader, views: LitViews, found: Found, read: Read) -> tuple[PanelReader, Found]:
    """Correct the faces behind needles that seem to stand still, from the frames that differ most there.

    These frames may show a reflection, so a correction is kept only if the needles are then no longer found there.
    """
    source, before, own = reader.source, reader.appearance, reader.own_gauges
    apart: dict[int, list[_Apart]] = {}
    for index, (gauge, grid) in enumerate(zip(source.panel.gauges, reader.grids, strict=True)):
        if isinstance(grid, PolarGrid):
            dial = _Dial(gauge, grid, before.templates, own[index], own[index], before.faces[index])
            still = [needle for needle in _cut_needles(gauge) if _seems_still(needle, found)]
            own_apart = [each for needle in still if (each := _apart(dial, needle, views[index], found)) is not None]
            apart |= {index: own_apart} if own_apart else {}
    while apart:
        faces, templates = list(before.faces), dict(before.templates)
        for index, own_apart in apart.items():
            for each in own_apart:
                faces[index] = np.where(each.place, each.face, faces[index]).astype(np.float32)
                templates[each.needle.name] = each.template
        again = reader.with_appearance(replace(before, faces=tuple(faces), templates=templates))
        found_again = read(again)
        kept = {
            index: all_ for index, all_ in apart.items() if all(each.is_confirmed(found, found_again) for each in all_)
        }
        if len(kept) == len(apart):
            return again, found_again
        apart = kept
    return reader, found


def _apart(dial: _Dial, needle: Pointer, views: Sequence[UnwrappedGauge | None], found: Found) -> _Apart | None:
    """Learn a face from the frames that differ most from the panel picture where a needle was cut.

    Frames with another needle there are left out. So are those in which the needle is slightly off its place: it has
    really moved, since print behind it would match exactly where it was cut. None if the frames are no more like each
    other than like the picture, or do not show that the needle is gone.
    """
    rows = _own_window(dial, needle)
    taken = _rows_of_others(dial, needle, found)[:, rows].any(axis=1)
    off_rows = np.array([_off_home_deg(needle, readings) for readings in found]) / dial.grid.step_deg
    is_found = np.array([readings[needle.name].status is not Status.MISSING for readings in found])
    near_rows = np.where(is_found, rows.sum(), APART_DEG / dial.grid.step_deg)
    taken |= (off_rows > 1.0) & (off_rows < near_rows)
    free = [at for at, view in enumerate(views) if view is not None and not taken[at]]
    if len(free) < FRAMES_TO_LEARN:
        return None
    seen = np.stack([view[rows] for at in free if (view := views[at]) is not None])
    off = np.square(seen - dial.drawn[rows]).mean(axis=(1, 2))
    order, count = np.argsort(off, kind="stable"), math.ceil(len(free) / ELSEWHERE)
    other = median_of(seen[order[-count:]]).astype(np.float32)
    off_other = np.square(seen[order[-count:]] - other).mean(axis=(1, 2))
    is_alike = float((CLEARLY_WORSE * off_other < off[order[-count:]]).mean()) > MOSTLY
    if not is_alike or not _is_bared(dial, needle, rows, other):
        return None
    unlike, like = ([free[at] for at in part] for part in (order[-count:], order[:count]))
    place = _wherever_shown(rows, dial)
    all_around = median_of(np.stack([view for at in unlike if (view := views[at]) is not None]))
    face = np.where(place, all_around, dial.face).astype(np.float32)
    return _Apart(needle, unlike, like, place, face, _over(dial, face, needle))


def _is_bared(dial: _Dial, needle: Pointer, rows: Mask, other: Floats) -> bool:
    """Whether `other` frames show a dial's rows without the needle, and different from the face so far."""
    is_gone = np.abs(dial.drawn[rows] - _in_light_of(dial.drawn[rows], other)) > 3 * NOISE_LEVELS
    is_other = np.abs(dial.face[rows] - other) > 3 * NOISE_LEVELS
    return _may_be_gone(dial, needle, rows, is_gone) and float(is_other.mean()) > NEEDLE_PART


def _is_at_home(needle: Pointer, readings: Mapping[str, Reading]) -> bool:
    """Whether a needle is found where it is in the panel picture."""
    return readings[needle.name].status is not Status.MISSING and _off_home_deg(needle, readings) <= APART_DEG


def _off_home_deg(needle: Pointer, readings: Mapping[str, Reading]) -> float:
    """Return how far a needle's best match is from its place in the panel picture."""
    at = 0.0 if needle.at_deg is None else needle.at_deg
    return abs(float(shortest(np.array(readings[needle.name].angle_deg - at), FULL_CIRCLE_DEG)))


def _over(dial: _Dial, face: UnwrappedGauge, needle: Pointer) -> NeedleTemplate:
    """Make a panel picture's needle template over a face."""
    cut = dial.templates[needle.name]
    return layer_over(cut.pixels, face_behind(face, dial.grid, needle.at_deg, cut.rows), cut.step_deg)


@dataclass(frozen=True, slots=True)
class _Dial:
    """One unwrapped gauge: in the panel picture, in the median of the frames, and its bare face so far."""

    gauge: Gauge
    grid: PolarGrid
    templates: Mapping[str, NeedleTemplate]
    drawn: UnwrappedGauge
    usual: UnwrappedGauge
    face: UnwrappedGauge


def may_be_lost(gauge: Gauge, found: Found) -> bool:
    """Whether a value of the gauge is missing in some frame, or a needle seems to stay as in the panel picture."""
    return any(_seems_still(needle, found) for needle in gauge.over_face) or any(
        readings[quantity.name].status is Status.MISSING for readings in found for quantity in gauge.quantities
    )


def least_at_home(gauge: Gauge, found: Found) -> dict[str, float]:
    """For needles that seem to stand still, return the lowest score to be trusted where they were cut.

    The dial behind such a needle is unknown. If the needle is gone, the print behind it may still match there, but less
    well. Geared hands are left out: they may stand still for long, but have to agree.
    """
    agreeing = () if gauge.combination is None else gauge.combination.parts
    least = {}
    for needle in _cut_needles(gauge):
        readings = [each[needle.name] for each in found]
        left = [1.0 - own.score**2 for own in readings if own.status is Status.READ and own.is_at(needle.at_deg)]
        if needle.name not in agreeing and _seems_still(needle, found) and len(left) >= MIN_VIEWS:
            least[needle.name] = math.sqrt(max(1.0 - CLEARLY_WORSE * float(np.median(left)), 0.0))
    return least


def _seems_still(needle: Pointer, found: Found) -> bool:
    """Whether a needle is mostly missing or read where it is in the panel picture."""
    still = [not readings[needle.name].is_seen or _is_at_home(needle, readings) for readings in found]
    return 2 * sum(still) > len(still)


def _goes_along(needle: Pointer, gauge: Gauge, found: Found) -> bool:
    """Whether a geared hand's motion is better explained by the value that all hands show than by standing still.

    A ten thousand feet pointer turns by 4 degrees in 1,000 feet: it seems still, but print would not move at all.
    """
    gearing = gauge.gearing
    if gearing is None or needle.name not in gearing.names[1:]:
        return False
    both = [(own[needle.name], own[gearing.name]) for own in found if own[needle.name].status is Status.READ]
    told = [(hand.angle_deg, value.angle_deg) for hand, value in both if value.status is not Status.MISSING]
    if len(told) < FRAMES_TO_LEARN:
        return False
    hand_deg, value_deg = np.array(told).T
    moved, strayed = gearing.variances(gearing.names.index(needle.name), hand_deg, gearing.value_at(value_deg))
    return moved > CLEARLY_WORSE * strayed


def _may_be_bared(
    gauge: Gauge, grid: PolarGrid, templates: Mapping[str, NeedleTemplate], face: UnwrappedGauge, seen: Sequence[Floats]
) -> bool:
    """Whether the frames' median in a needle's window differs from the face so far."""
    windows = [_window(needle, grid, templates[needle.name]) for needle in _cut_needles(gauge)]
    off = (np.abs(face[rows] - median_of(np.stack([view[rows] for view in seen]))) for rows in windows)
    return any(float((each > 3 * NOISE_LEVELS).mean()) > NEEDLE_PART for each in off)


def _cut_needles(gauge: Gauge) -> list[Pointer]:
    """List the needles that are cut from the panel picture."""
    return [each for each in gauge.over_face if each.hides_deg is not None]


def _bared(dial: _Dial, seen: Sequence[UnwrappedGauge], others: Mapping[str, Mask]) -> list[Pointer]:
    """List the needles that are elsewhere in most frames, with a dial behind them that differs from the face so far.

    A needle that moved by less than its width is gone only at its edges: its axis is still covered, whatever else moves
    there. `others`, (frames, R) by needle, marks rows that show other needles.
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
    for needle in needles:
        rows = _own_window(dial, needle)
        gone = dial.drawn[rows] - _in_light_of(dial.drawn[rows], dial.usual[rows])
        low, high = np.quantile(dial.drawn[rows], (0.02, 0.98))
        is_gone = np.abs(gone) > max(least, CLEAR_PART * float(high - low))
        elsewhere = np.where(others[needle.name], 0, differs).sum(axis=1)
        if (
            _may_be_gone(dial, needle, rows, is_gone)
            and (elsewhere > SEEN_PART * is_gone.sum()).mean() > MOSTLY
            and float((np.abs(dial.face[rows] - dial.usual[rows]) > least).mean()) > NEEDLE_PART
        ):
            bared.append(needle)
    return bared


def _may_be_gone(dial: _Dial, needle: Pointer, rows: Mask, is_gone: Mask) -> bool:
    """Whether a needle may be gone from some rows (R,) of the dial, where its pixels (rows, C) are.

    A needle that moved by less than its width is gone from a small part of its outline, and hardly from its axis. If a
    small part of the outline differs, the axis has to differ clearly. If most of it does, less is enough on the axis,
    where print as bright as the needle may show.
    """
    outline = dial.templates[needle.name].outline
    shown = outline[len(outline) // 2]
    if not shown.any() or is_gone.mean() <= NEEDLE_PART:
        return False
    on_axis = int(np.argmin(np.abs(np.flatnonzero(rows) - _axis_row(needle, dial.grid))))
    least = MIN_VISIBLE if is_gone.mean() > HALF * outline.mean() else HALF
    return float(is_gone[on_axis, shown].mean()) > least


def _covered_by_others(dial: _Dial, bared: Sequence[Pointer], found: Found) -> Mask:
    """(R, C): where needles other than the `bared` ones lie in the panel picture or in frames, and so hide the dial."""
    covered, turn = np.zeros(dial.face.shape, bool), turn_rows(dial.gauge, dial.grid)
    for needle in _cut_needles(dial.gauge):
        if needle not in bared:
            seen = (own[needle.name] for own in found)
            angles_deg = [each.angle_deg for each in seen if each.status is not Status.MISSING]
            for row in {_axis_row(needle, dial.grid), *(round(row_of_angle(dial.grid, each)) for each in angles_deg)}:
                covered |= needle_places(dial.grid, dial.templates[needle.name].touched, row, turn)
    return covered


def _rows_of_others(dial: _Dial, needle: Pointer, found: Found) -> Mask:
    """(frames, R): rows that show another needle of the dial, or its tail.

    A needle that seems to stand still may be print, and is ignored where the panel picture has it, but not elsewhere.
    """
    rows = np.zeros((len(found), dial.grid.rows), bool)
    angles_deg = dial.grid.start_deg + dial.grid.step_deg * np.arange(dial.grid.rows)
    for other in dial.gauge.over_face:
        if other.name == needle.name:
            continue
        may_be_print = other.at_deg is not None and _seems_still(other, found)
        half_deg = dial.templates[other.name].rows * dial.templates[other.name].step_deg / 2
        for frame, readings in enumerate(found):
            is_seen = readings[other.name].status is not Status.MISSING
            if is_seen and not (may_be_print and _is_at_home(other, readings)):
                off_deg = shortest(angles_deg - readings[other.name].angle_deg, FULL_CIRCLE_DEG / 2)
                rows[frame] |= np.abs(off_deg) <= half_deg
    return rows


def _in_light_of(wanted: Floats, seen: Floats) -> Floats:
    """Bring a part of a dial into another picture's light, so that a change of light is not taken for another dial."""
    spread = seen - seen.mean()
    gain = float((spread * (wanted - wanted.mean())).sum()) / max(float((spread * spread).sum()), 1.0)
    lit: Floats = wanted.mean() + gain * spread
    return lit


def _window(needle: Pointer, grid: PolarGrid, template: NeedleTemplate) -> Mask:
    """(R,): the rows of the gauge from which a needle of the panel picture was cut."""
    rows: Mask = np.abs(np.arange(grid.rows) - _axis_row(needle, grid)) <= (template.rows - 1) / 2
    return rows


def _own_window(dial: _Dial, needle: Pointer) -> Mask:
    """(R,): the rows of a needle's `_window` that are nearer to its axis than to another needle's."""
    rows, turn = np.arange(dial.grid.rows), turn_rows(dial.gauge, dial.grid)
    off = [np.abs(shortest(rows - _axis_row(each, dial.grid), turn)) for each in _cut_needles(dial.gauge)]
    is_nearest = np.abs(rows - _axis_row(needle, dial.grid)) <= np.min(off, axis=0)
    own: Mask = is_nearest & _window(needle, dial.grid, dial.templates[needle.name])
    return own


def _wherever_shown(rows: Mask, dial: _Dial) -> Mask:
    """(R, 1): the given rows of the gauge, and all others that show the same part of the dial."""
    shifts = (*same_rows(0.0, turn_rows(dial.gauge, dial.grid)), *opposite_rows(0.0, dial.grid))
    shown = np.concatenate([np.flatnonzero(rows) + round(shift) for shift in shifts])
    every: Mask = np.isin(np.arange(len(rows)), shown)[:, None]
    return every


def _axis_row(needle: Pointer, grid: PolarGrid) -> float:
    """Return the row of the axis of a panel picture's needle."""
    return row_of_angle(grid, 0.0 if needle.at_deg is None else needle.at_deg)
