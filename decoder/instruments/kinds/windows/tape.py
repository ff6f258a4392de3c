"""Tapes: a scale that slides or turns behind a fixed index, such as a compass card seen edge-on or an altitude tape.

The tape is one picture, longer than the window, and a frame shows a part of it. A reading is the whole tape's best
match with the window, searched at every position and then refined by least squares. Where another position matches
nearly as well, or the tape was never seen, nothing is read.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import UnwrappedGauge, WindowGrid
from decoder.instruments.appearance import Appearance, DrawnInstrument, Grower, Instrument, LearnedPicture, Look
from decoder.instruments.kinds.windows.tape_finder import TapeFinder
from decoder.instruments.kinds.windows.tape_learning import TapeMosaic, first_tape, learn_tape
from decoder.instruments.kinds.windows.tape_picture import TapePicture
from decoder.instruments.kinds.windows.tape_shape import ROW_PX, DrawnMarks, TapeShape, rows_in_sight
from decoder.instruments.kinds.windows.window import WindowKind
from decoder.instruments.reading import Reading, Status
from decoder.instruments.thresholds import SURE_SCORE
from decoder.panel.arrays import Floats
from decoder.panel.errors import PanelError
from decoder.panel.gauge import Gauge
from decoder.panel.kinds.straight import ACROSS
from decoder.panel.scale import FULL_CIRCLE_DEG
from decoder.registration.thresholds import SCORE_THRESHOLD


class TapeReader:
    """Reads one tape."""

    def __init__(self, gauge: Gauge, grid: WindowGrid, picture: TapePicture) -> None:
        self._drawn, self._picture = DrawnTape.of(gauge, grid), picture
        self._finder = TapeFinder(picture)
        self._least = SCORE_THRESHOLD if picture.is_whole else SURE_SCORE

    def read(self, strips: Floats, place_sigmas_px: Floats) -> list[dict[str, Reading]]:
        """Read F frames of its window, (F, R, C) as they are sampled.

        While part of a tape is unknown, that part may look like a known one, so a match must be better; and if two
        known parts look alike, an unknown one may look like them too, unless they are told apart. On a flat tape, whose
        numerals often differ in one digit, they always have to be. A place of which less than most is known is not
        read: one or two numerals would decide. A tape to which no frame of the flight could
        be added is not read.
        """
        picture, drawn = self._picture, self._drawn
        windows = np.stack([picture.unroll(window) for window in drawn.along(strips)])
        matches = self._finder.laid(windows)
        found = matches.found
        base = picture.shape.value_at(drawn.index_px)
        own_sigma, per_unit = picture.shape.sigmas(drawn.marks, drawn.index_px)
        a_pixel = picture.step / ROW_PX
        is_read = picture.is_learned & found.is_there & (found.score >= self._least)
        is_read &= picture.is_whole | (self._finder.part_known(found.rows) >= 1.0 - HALF**2)
        is_sure = picture.shape.is_round & matches.is_clear & (picture.is_whole | (matches.rivals < SURE_SCORE))
        doubt = np.flatnonzero(is_read & ~is_sure)
        is_read[doubt] = self._finder.told_apart(windows, matches, doubt)
        if not (picture.shape.is_round or picture.is_whole):
            is_read[is_read] = self._finder.explained(windows, found, np.flatnonzero(is_read))
        readings = []
        all_moved = picture.moved(found.rows).tolist()
        for number, (moved, place_sigma_px) in enumerate(zip(all_moved, place_sigmas_px.tolist(), strict=True)):
            away = moved if drawn.turn is None else (moved + drawn.turn / 2) % drawn.turn - drawn.turn / 2
            parts = found.sigma_rows[number] * picture.step, own_sigma, per_unit * away, place_sigma_px * a_pixel
            status = Status.READ if is_read[number] else Status.MISSING
            value = base + moved
            scale = 1.0 if drawn.turn is None else FULL_CIRCLE_DEG / drawn.turn
            angle = value if drawn.turn is None else value % drawn.turn * scale
            sigma = math.hypot(*(float(part) for part in parts)) * scale
            readings.append({drawn.name: Reading(status, float(angle), sigma, float(found.score[number]))})
        return readings


@dataclass(frozen=True, slots=True)
class DrawnTape:
    """One tape as it is described, in cells of its window along and across it."""

    name: str
    goes_across: bool
    marks: DrawnMarks
    index_px: float
    turn: float | None
    is_round: bool

    @classmethod
    def of(cls, gauge: Gauge, grid: WindowGrid) -> DrawnTape:
        """Return the tape of a gauge that has one."""
        own = gauge.tape
        if own is None:
            raise AssertionError(f"{gauge.name} is no tape")
        goes_across = own.moves == ACROSS
        width_px, height_px = grid.cell_px
        along_px, across_px = (width_px, height_px) if goes_across else (height_px, width_px)
        marks = [(x / along_px - 0.5, y / across_px - 0.5, value) for x, y, value in own.drawn(grid.corners)]
        index = own.index_px(grid.corners) / along_px - 0.5
        return cls(own.name, goes_across, marks, index, own.turn, own.drum)

    def along(self, strips: Floats) -> Floats:
        """(..., along, across): turn windows as they are sampled."""
        return np.ascontiguousarray(np.swapaxes(strips, -1, -2)) if self.goes_across else strips


class TapeKind(WindowKind):
    """A scale that slides or turns behind an index."""

    def owns(self, gauge: Gauge) -> bool:
        return gauge.tape is not None

    def first(self, gauge: Gauge, grid: WindowGrid, drawn: UnwrappedGauge) -> TapePicture:
        own = DrawnTape.of(gauge, grid)
        return first_tape(own.marks, own.turn, own.along(drawn), is_round=own.is_round)

    def first_look(self, drawn: DrawnInstrument) -> Look:
        own = DrawnTape.of(drawn.gauge, drawn.window)
        along, across = own.along(drawn.strip).shape
        if not len(rows_in_sight(TapeShape.of_marks(own.marks, (along, across), own.turn, is_round=own.is_round))):
            raise PanelError(f"gauges[{drawn.index}].tape.marks", "tell of a tape that its window shows nothing of")
        return super().first_look(drawn)

    def learned(
        self, gauge: Gauge, grid: WindowGrid, strips: Sequence[UnwrappedGauge], known: TapePicture
    ) -> TapePicture:
        own = DrawnTape.of(gauge, grid)
        return known if known.is_learned else learn_tape([own.along(strip) for strip in strips], known, own.marks)

    def window_reader(self, gauge: Gauge, grid: WindowGrid, picture: TapePicture) -> TapeReader:
        return TapeReader(gauge, grid, picture)

    def grower(self, instrument: Instrument, appearance: Appearance) -> Grower | None:
        own = DrawnTape.of(instrument.gauge, instrument.window)
        picture = appearance.pictures[own.name]
        return None if picture.is_whole else _Grower(own, TapeMosaic(picture, own.marks))


@dataclass(frozen=True, slots=True)
class _Grower:
    """Learns more of one tape."""

    drawn: DrawnTape
    tape: TapeMosaic

    @property
    def pictures(self) -> Mapping[str, LearnedPicture]:
        return {self.drawn.name: replace(self.tape.picture, views=(), rows_of_views=())}

    def add(self, strips: Sequence[UnwrappedGauge]) -> Sequence[bool]:
        return self.tape.complete([self.drawn.along(strip) for strip in strips])
