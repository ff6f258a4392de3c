"""Dials on which something like a needle moves that no needle accounts for, and needles learned from something else.

Print may be taken for a needle and match perfectly in every frame, while the needle itself moves unseen. No score shows
that; the rest of the dial does. Where the sample's frames differ from their median by a bar along a radius, and differ
as much from the dial drawn with its needles where these were read, the readings do not explain what moves. And a needle
as the flight taught it, whether from print, from a tail or from another hand, must be found where somebody drew it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Self

import numpy as np
from numpy.typing import NDArray

from decoder.imaging.sorting import median_of
from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import (
    PolarGrid,
    UnwrappedGauge,
    opposite_rows,
    row_of_angle,
    rows_in_sweep,
    same_rows,
    turn_rows,
)
from decoder.instruments.appearance import Instrument
from decoder.instruments.found import Needle, all_above
from decoder.instruments.missing import mostly_missing
from decoder.instruments.needle_learner import Readings
from decoder.instruments.needle_lines import places_of
from decoder.instruments.panel_reader import PanelReader
from decoder.instruments.reading import Status
from decoder.instruments.thresholds import APART_DEG, BEYOND_CHANCE_SPREADS, FRAMES_TO_LEARN, MIN_PLACES
from decoder.matching.correlation import partial_normxcorr
from decoder.matching.faces import LitViews
from decoder.matching.layered_dial import DialComparison
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.strips import rows_at
from decoder.matching.thresholds import MIN_VIEWS, MOSTLY
from decoder.panel.arrays import Floats
from decoder.panel.scale import FULL_CIRCLE_DEG, shortest
from decoder.registration.thresholds import LIKELY_SCORE, NOISE_LEVELS


def unexplained_gauges(reader: PanelReader, views: LitViews, found: Sequence[Readings]) -> Mapping[str, frozenset[str]]:
    """Find the gauges on which something moves, in most frames that show their needles, that these do not explain.

    Parameters
    ----------
    views
        By gauge and frame, from `lit_views`.
    found
        For each frame, the readings in it.

    Returns
    -------
    By gauge, those of its needles that stand still meanwhile: they are likely print. Hands that show one value are left
    out, since they check each other.
    """
    return dict(_unexplained(reader, views, found))


def without_print(reader: PanelReader, views: LitViews, found: Sequence[Readings]) -> Sequence[Readings]:
    """Return readings, given as for `unexplained_gauges`, in which needles that are likely print are missing."""
    likely_print = frozenset[str]().union(*unexplained_gauges(reader, views, found).values())
    if not likely_print:
        return found
    return [
        {name: replace(own, status=Status.MISSING) if name in likely_print else own for name, own in readings.items()}
        for readings in found
    ]


@dataclass(frozen=True, slots=True)
class Moving:
    """A needle that was found by its motion: its angle by frame, degrees."""

    name: str
    angles_deg: Mapping[int, float]


def needles_by_motion(
    reader: PanelReader, cut: Mapping[str, NeedleTemplate], views: LitViews, found: Sequence[Readings]
) -> Mapping[int, Moving]:
    """Find needles that alone are lost on their dials where frames differ from their median by a bar along a radius.

    This needs no picture of a needle, only its width. If it mostly rests at one place, the median shows it there, and
    every other frame differs there, too, but always at that place. Bars at the dial's other needles are theirs. Hands
    that show one value are left out.

    Parameters
    ----------
    cut
        Needles from the panel picture, by name.
    views
        By gauge and frame, from `lit_views`.
    found
        For each frame, the readings in it.

    Returns
    -------
    By the gauge's index, for gauges of which enough frames show a bar that stands out, and it moves far enough.
    """
    if len(found) < FRAMES_TO_LEARN:
        return {}
    missing, moving = mostly_missing(found), dict[int, Moving]()
    for dial, needles in _dials(reader):
        lost = [needle for needle in needles if needle.name in missing]
        if len(lost) == 1:
            others = [needle for needle in needles if needle not in lost]
            known = {
                at: (view, readings)
                for at, (view, readings) in enumerate(zip(views[dial.index], found, strict=True))
                if view is not None and all(readings[other.name].is_seen for other in others)
            }
            angles_deg = _found_by_motion(dial, cut[lost[0].name], others, known)
            if angles_deg:
                moving[dial.index] = Moving(lost[0].name, angles_deg)
    return moving


def with_moved(found: Sequence[Readings], moving: Iterable[Moving]) -> Sequence[Readings]:
    """Return readings in which needles found by their motion are read where they were found, and missing elsewhere."""
    told = list(found)
    for name, angles_deg in ((own.name, own.angles_deg) for own in moving):
        for at, readings in enumerate(told):
            own = readings[name]
            there = (
                replace(own, status=Status.READ, angle_deg=angles_deg[at])
                if at in angles_deg
                else replace(own, status=Status.MISSING)
            )
            told[at] = {**readings, name: there}
    return told


def _found_by_motion(
    dial: Instrument,
    needle: NeedleTemplate,
    others: Sequence[Needle],
    known: Mapping[int, tuple[UnwrappedGauge, Readings]],
) -> Mapping[int, float]:
    """Return the angles of a needle by frame, from frames in which all others on its dial are known."""
    if len(known) < FRAMES_TO_LEARN:
        return {}
    seen = np.stack([view for view, _ in known.values()])
    is_apart = np.array([_is_apart(dial, others, readings) for _, readings in known.values()])
    moving = np.where(is_apart[..., None], seen - median_of(seen), 0.0)[..., dial.grid.tail_columns :]
    bars = _bars(moving, 2 * needle.half_width_deg / needle.step_deg)
    usual = np.maximum(2 * BEYOND_CHANCE_SPREADS * np.quantile(np.abs(bars), 1.0 - HALF**2, axis=2), NOISE_LEVELS)
    bars *= rows_in_sweep(dial.gauge, dial.grid) & is_apart
    either = []
    for own in (bars, -bars):
        # The width that fits a bar best shows it most strongly. What is beside a bar seems half as much of one.
        levels = np.where(own > usual[..., None], own, 0.0).max(axis=0)
        angles_deg = {
            at: dial.grid.angle_deg(float(each.argmax())) for at, each in zip(known, levels, strict=True) if each.any()
        }
        if len(angles_deg) >= FRAMES_TO_LEARN and places_of(angles_deg.values()) > MIN_PLACES:
            either.append((float(levels.max(axis=1).sum()), angles_deg))
    return max(either, key=itemgetter(0), default=(0.0, {}))[1]


def mistaken_needles(reader: PanelReader) -> Mapping[str, float]:
    """Find the needles that, as they were learned, match the panel picture better elsewhere than where they were drawn.

    Then a flight taught something else, such as a tail that is as long and not described. Hands that share a dial are
    left out: one may hide another.

    Returns
    -------
    By name, how far away the panel picture shows what was learned, degrees.
    """
    return dict(_mistaken(reader))


def _mistaken(reader: PanelReader) -> Iterator[tuple[str, float]]:
    gauges = reader.source.panel.gauges
    for index, (gauge, grid, face) in enumerate(zip(gauges, reader.grids, reader.appearance.faces, strict=True)):
        if not isinstance(grid, PolarGrid) or len(gauge.over_face) != 1:
            continue
        (pointer,) = gauge.over_face
        if pointer.at_deg is None:
            continue
        needle = Needle(pointer.name, index, gauge, grid, face, reader.appearance.templates[pointer.name])
        matches, _ = partial_normxcorr(reader.own_gauges[index], face, needle.template)
        rows = np.arange(len(matches)) + needle.axis
        off_deg = (rows - row_of_angle(grid, pointer.at_deg)) * grid.step_deg
        away_deg, reach_deg = np.abs(shortest(off_deg, FULL_CIRCLE_DEG)), HALF * needle.template.rows * grid.step_deg
        is_home, is_elsewhere = away_deg <= reach_deg, needle.allowed[rows] & (away_deg > reach_deg)
        home, elsewhere = (float(matches[own].max(initial=0.0)) for own in (is_home, is_elsewhere))
        if elsewhere > max(home, LIKELY_SCORE):
            yield pointer.name, float(away_deg[is_elsewhere][matches[is_elsewhere].argmax()])


def _unexplained(
    reader: PanelReader, views: LitViews, found: Sequence[Readings]
) -> Iterator[tuple[str, frozenset[str]]]:
    for dial, needles in _dials(reader):
        # One that is hidden is drawn, too: if it stands elsewhere, something is left there.
        shown = [
            (view, readings)
            for view, readings in zip(views[dial.index], found, strict=True)
            if view is not None and all(readings[needle.name].status is not Status.MISSING for needle in needles)
        ]
        if len(shown) >= FRAMES_TO_LEARN:
            bars = _Bars.of(dial, needles, shown)
            if bars.are_unexplained:
                yield dial.gauge.name, frozenset(each.name for each in needles if not bars.show(each, shown))


def _dials(reader: PanelReader) -> Iterator[tuple[Instrument, Sequence[Needle]]]:
    """Iterate over the dials with needles over their faces that each show a value of their own."""
    known = reader.appearance
    for index, (gauge, grid, face) in enumerate(
        zip(reader.source.panel.gauges, reader.grids, known.faces, strict=True)
    ):
        if isinstance(grid, PolarGrid) and gauge.over_face and gauge.combination is None:
            dial = Instrument(index, gauge, grid, face)
            yield (
                dial,
                [Needle(own.name, index, gauge, grid, face, known.templates[own.name]) for own in gauge.over_face],
            )


@dataclass(frozen=True, slots=True)
class _Bars:
    """By how much most columns of a dial differ along each row from those beside it, (W, F, R), grey levels.

    Bars of W widths are looked for. `moving` is what differs from the median of the frames, `left` from the dial drawn
    with its needles. `is_apart` (F, R) says which rows lie apart from all needles, where a needle that is only drawn a
    little wrong leaves nothing.
    """

    moving: Floats
    left: Floats
    is_apart: NDArray[np.bool_]

    @classmethod
    def of(cls, dial: Instrument, needles: Sequence[Needle], shown: Sequence[tuple[UnwrappedGauge, Readings]]) -> Self:
        """Compare frames with their median, and with the dial drawn for each."""
        seen = np.stack([view for view, _ in shown])
        drawn = np.stack([_drawn(dial, needles, readings) for _, readings in shown])
        usual = np.broadcast_to(median_of(seen), seen.shape)
        width, tail = 2 * min(needle.half_width_rows for needle in needles), dial.grid.tail_columns
        # A dial without print does not show its light before its needles are known.
        light = DialComparison(dial.face, dial.grid.radii_px, [needle.template for needle in needles])
        lit = (light.lit(seen, each[:, None])[:, 0] for each in (usual, drawn))
        moving, left = (np.abs(_bars((seen - each)[..., tail:], width)) for each in lit)
        return cls(moving, left, np.array([_is_apart(dial, needles, readings) for _, readings in shown]))

    @property
    def are_unexplained(self) -> bool:
        """Whether in most frames a bar apart from the needles stands out, and stays when these are drawn.

        However dim a needle is, it stands out from what light, noise and JPEG change along most other rows.
        """
        stays = self.is_apart & (self.left > HALF * self.moving)
        most = np.where(stays, np.minimum(self.moving, self.left), 0.0).max(axis=2)
        usual = np.quantile(self.moving, 1.0 - HALF**2, axis=2)
        stands_out = (most > np.maximum(2 * BEYOND_CHANCE_SPREADS * usual, NOISE_LEVELS)).any(axis=0)
        return bool(stands_out.mean() > MOSTLY)

    def show(self, needle: Needle, shown: Sequence[tuple[UnwrappedGauge, Readings]]) -> bool:
        """Whether a needle is mostly seen, and moves, or some frames, and more than not, show that it has moved."""
        own = [readings[needle.name] for _, readings in shown]
        if sum(reading.is_seen for reading in own) <= HALF * len(own):
            return False
        rows = np.array([row_of_angle(needle.grid, reading.angle_deg) for reading in own])
        if (np.abs(rows - np.median(rows)) * needle.template.step_deg > APART_DEG).any():
            return True
        reach = math.ceil(needle.half_width_rows)
        there = np.rint(rows).astype(np.intp)[:, None] + np.arange(-reach, reach + 1)
        moving, left = (
            np.take_along_axis(each, there.clip(0, each.shape[1] - 1), axis=1).max(axis=1)
            for each in (self.moving.max(axis=0), self.left.max(axis=0))
        )
        shows = (moving >= 3 * NOISE_LEVELS) & (left <= HALF * moving)
        return int(shows.sum()) >= MIN_VIEWS and shows.sum() > (left >= 3 * NOISE_LEVELS).sum()


def _is_apart(dial: Instrument, needles: Sequence[Needle], readings: Readings) -> NDArray[np.bool_]:
    """(R,): the rows further from every needle than it is wide."""
    rows, turn = np.arange(len(dial.face)), turn_rows(dial.gauge, dial.grid)
    is_apart = np.ones(len(rows), np.bool_)
    for needle in needles:
        off_rows = shortest(rows - row_of_angle(dial.grid, readings[needle.name].angle_deg), turn)
        is_apart &= np.abs(off_rows) > 2 * needle.half_width_rows
    return is_apart


def _bars(levels: Floats, most_rows: float) -> Floats:
    """(W, F, R): by how much most columns of levels (F, R, C) are above those beside them, along each row.

    Light that changes slowly with the angle gives little, and so does print that fills less than half of the columns.
    What was drawn as a needle may be far wider than the needle, so narrower bars are tried, too.
    """
    along = np.median(levels, axis=2)
    parts = (1.0, HALF, HALF**2)
    bars = np.zeros((len(parts), *along.shape))
    for own, part in zip(bars, parts, strict=True):
        width = 2 * math.ceil(part * most_rows / 2) + 1
        kernel = np.repeat([-HALF, 1.0, -HALF], width) / width
        inner = slice(len(kernel) // 2, along.shape[1] - len(kernel) // 2)
        if inner.start >= inner.stop:
            continue
        own[:, inner] = [np.convolve(each, kernel, mode="valid") for each in along]
    return bars


def _drawn(dial: Instrument, needles: Sequence[Needle], readings: Readings) -> UnwrappedGauge:
    """Draw a dial with its needles where they were read, the lowest first."""
    picture, turn = dial.face.astype(np.float32), turn_rows(dial.gauge, dial.grid)
    names = [needle.name for needle in needles]
    for index in sorted(range(len(needles)), key=lambda own: -len(all_above(needles, names, own))):
        template, row = needles[index].template, row_of_angle(dial.grid, readings[names[index]].angle_deg)
        for there in same_rows(row, turn):
            _draw(picture, template.light, template.transparency, there)
        for there in opposite_rows(row, dial.grid):
            _draw(picture, template.light[:, ::-1], template.transparency[:, ::-1], there)
    return picture


def _draw(picture: UnwrappedGauge, light: Floats, transparency: Floats, axis_row: float) -> None:
    """Draw a needle (H, C) around a row on a picture (R, C), as far as it reaches there."""
    top = axis_row - (len(light) - 1) / 2
    rows = np.arange(max(math.ceil(top), 0), min(math.floor(top) + len(light), len(picture)))
    if rows.size:
        picture[rows] = rows_at(light, rows - top) + rows_at(transparency, rows - top) * picture[rows]
