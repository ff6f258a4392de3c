"""What needles and dials look like, learned from a sample of a flight's own frames.

A template cut from one picture carries that picture's noise, and whatever lies behind the needle there, into every
reading. Many frames tell needle and dial apart: the dial's face is what each pixel shows when no needle is there, and
the needle is what it adds to the faces it passes over. A reading then compares the gauge with the needle drawn over
the face behind it, so marks and numerals no longer pull at it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from decoder.imaging.unwrapping import PolarGrid, UnwrappedGauge, touched_pixels, turn_rows
from decoder.instruments.appearance import Instrument, LearnedPicture, face_behind
from decoder.instruments.panel_reader import PanelReader
from decoder.instruments.readers import kind_of
from decoder.instruments.reading import Reading, Status
from decoder.instruments.thresholds import FRAMES_TO_LEARN
from decoder.matching.faces import LitViews, in_light_of, learn_face
from decoder.matching.fitting import WindowFitter
from decoder.matching.needle_layer import in_local_light, layered
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.strips import rows_of_each
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.panel.scale import FULL_CIRCLE_DEG, shortest
from decoder.registration.frame_placer import UnwrappedFrame

# Learned needles over learned faces score 0.99 as a rule.
EVENLY_LIT_SCORE = 0.97

Readings = Mapping[str, Reading]
Templates = Mapping[str, NeedleTemplate]


def lit_views(reader: PanelReader, samples: Sequence[UnwrappedFrame]) -> LitViews:
    """Bring all dials of the samples into the panel picture's light; windows, which may shine, are as they are."""
    dials = [isinstance(grid, PolarGrid) for grid in reader.grids]
    return [
        in_light_of(picture, (sample.gauges[index] for sample in samples))
        if is_dial
        else [sample.gauges[index] for sample in samples]
        for index, (picture, is_dial) in enumerate(zip(reader.own_gauges, dials, strict=True))
    ]


def learn_appearance(reader: PanelReader, views: LitViews, found: Sequence[Readings]) -> PanelReader:
    """Learn what instruments look like; with too few frames the reader stays as it was.

    Parameters
    ----------
    views
        By gauge and frame, as `lit_views` brings them.
    found
        By frame what the reader finds in it.
    """
    if len(found) < FRAMES_TO_LEARN:
        return reader
    gauges, before = reader.source.panel.gauges, reader.appearance
    learners = {
        index: _GaugeLearner(gauge, grid, seen, first, before.templates)
        for index, (gauge, grid, seen, first) in enumerate(zip(gauges, reader.grids, views, before.faces, strict=True))
        if isinstance(grid, PolarGrid)
    }
    pictures: dict[str, LearnedPicture] = {}
    for index, (gauge, grid, face, seen) in enumerate(zip(gauges, reader.grids, before.faces, views, strict=True)):
        strips = [like for like in seen if like is not None]
        pictures |= kind_of(gauge).learned_pictures(Instrument(index, gauge, grid, face), strips, before.pictures)
    templates = dict(before.templates)
    faces = list(before.faces)
    for index, learner in learners.items():
        faces[index] = learner.face(found, before.templates)
        templates |= learner.templates(found, templates, faces[index])
    return reader.with_appearance(
        replace(before, templates=templates, faces=tuple(faces), evenly_lit_score=EVENLY_LIT_SCORE, pictures=pictures)
    )


class _GaugeLearner:
    """What the sample tells about one gauge.

    `strips` are the gauge in the sample's frames, in the panel picture's light, None where that cannot be had;
    `first` and `given` are face and templates as the panel picture has them.
    """

    def __init__(
        self,
        gauge: Gauge,
        grid: PolarGrid,
        strips: Sequence[UnwrappedGauge | None],
        first: UnwrappedGauge,
        given: Templates,
    ) -> None:
        self._needles = {pointer.name: pointer for pointer in gauge.turning}
        self._grid = grid
        self._turn_rows = turn_rows(gauge, grid)
        self._strips = strips
        self._first = first
        self._given = given

    def face(self, found: Sequence[Readings], templates: Templates) -> UnwrappedGauge:
        """Learn the dial without needles; the panel picture's where too few frames show it."""
        touched = {name: templates[name].touched for name in self._needles}
        views, places = [], []
        for strip, readings in zip(self._strips, found, strict=True):
            if strip is None or any(readings[name].status is Status.MISSING for name in self._needles):
                continue
            covered = [
                touched_pixels(self._grid, own, self._row(readings[name]), self._turn_rows)
                for name, own in touched.items()
            ]
            views.append(strip)
            places.append(np.concatenate(covered) if covered else np.empty(0, np.intp))
        return learn_face(views, places, self._first) if len(views) >= FRAMES_TO_LEARN else self._first

    def templates(
        self, found: Sequence[Readings], before: Templates, face: UnwrappedGauge
    ) -> dict[str, NeedleTemplate]:
        """Learn the gauge's needles, those that enough frames show free of the others."""
        learned = {}
        for name in self._needles:
            clear = [
                (strip, self._row(readings[name]))
                for strip, readings in zip(self._strips, found, strict=True)
                if strip is not None and self._is_clear(name, readings, before)
            ]
            if len(clear) >= FRAMES_TO_LEARN:
                learned[name] = self._learned(name, clear, before[name], face)
        return learned

    def _learned(
        self,
        name: str,
        clear: Sequence[tuple[UnwrappedGauge, float]],
        before: NeedleTemplate,
        face: UnwrappedGauge,
    ) -> NeedleTemplate:
        """Learn a needle from its cuts, its zero where the panel's own template has it.

        The frames tell the needle's form, but not where its axis is: all cuts share the error of the template that
        found them. The given template, read with the learned needle over the face behind it, shows that error; the
        cuts are moved by it.
        """
        behind = face_behind(face, self._grid, self._needles[name].at_deg, before.rows)
        both = face, behind
        learned = layered(*self._cuts(name, clear, before, both, 0.0), before.pixels, before.step_deg)
        fitter = WindowFitter([learned], [self._grid.pixels_per_sample])
        given, face_there = self._given[name].pixels.reshape(1, -1), behind.reshape(1, -1)
        off_rows = float(fitter.fit(given, face_there, np.zeros(1)).fraction[0])
        if not abs(off_rows) < before.rows / 8:
            return learned
        return layered(*self._cuts(name, clear, learned, both, -off_rows), before.pixels, learned.step_deg)

    def _cuts(
        self,
        name: str,
        clear: Sequence[tuple[UnwrappedGauge, float]],
        before: NeedleTemplate,
        whole_and_given: tuple[UnwrappedGauge, Floats],
        shift_rows: float,
    ) -> tuple[Floats, Floats]:
        """Cut the needle from the frames and, where it was cut from a picture, there; and the face behind each."""
        face, behind = whole_and_given
        axis_rows = np.array([row for _, row in clear]) + shift_rows
        windows = axis_rows[:, None] + np.arange(before.rows) - (before.rows - 1) / 2
        faces = rows_of_each([face] * len(clear), windows)
        seen = rows_of_each([strip for strip, _ in clear], windows)
        cuts = in_local_light(seen, before, faces)
        if self._needles[name].at_deg is not None:  # one more view, over another part of the face
            return np.concatenate([cuts, self._given[name].pixels[None]]), np.concatenate([faces, behind[None]])
        return cuts, faces

    def _row(self, reading: Reading) -> float:
        return (reading.angle_deg - self._grid.start_deg) / self._grid.step_deg

    def _apart_deg(self, one: Reading, other: Reading) -> float:
        difference_deg = np.array(one.angle_deg - other.angle_deg)
        return float(abs(shortest(difference_deg, None if self._turn_rows is None else FULL_CIRCLE_DEG)))

    def _is_clear(self, name: str, readings: Readings, templates: Templates) -> bool:
        """Whether a needle was read whole, with no other near enough to reach into its template."""
        own = readings[name]
        reach_deg = templates[name].rows * templates[name].step_deg / 2
        return own.status is Status.READ and all(
            readings[other].status is not Status.MISSING
            and self._apart_deg(readings[other], own) > reach_deg + templates[other].half_width_deg
            for other in self._needles
            if other != name
        )
