"""Learning needles, and what they turn over, from frames in which they were found.

The face is what each pixel shows when no needle is there, and a needle is what it adds to the faces it passes over.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from decoder.imaging.unwrapping import PolarGrid, UnwrappedGauge, touched_pixels
from decoder.instruments.reading import Reading, Status
from decoder.instruments.thresholds import FRAMES_TO_LEARN
from decoder.matching.faces import face_behind, learn_face
from decoder.matching.needle_fit import WindowFitter
from decoder.matching.needle_layer import in_local_light, layered
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.strips import rows_of_each
from decoder.panel.arrays import Floats
from decoder.panel.kind import Pointer
from decoder.panel.scale import FULL_CIRCLE_DEG, shortest
from decoder.registration.thresholds import LIKELY_SCORE

Readings = Mapping[str, Reading]
Templates = Mapping[str, NeedleTemplate]


@dataclass(frozen=True)
class NeedleLearner:
    """Learns the needles of one gauge, and the face that they turn over, from a sample.

    Attributes
    ----------
    pointers
        The needles.
    turn
        How many rows of the grid are a turn, if the dial is read all the way round.
    strips
        The gauge in the sample's frames, in the panel picture's light; None where that failed.
    first, given
        Face and templates from the panel picture.
    """

    pointers: Sequence[Pointer]
    grid: PolarGrid
    turn: float | None
    strips: Sequence[UnwrappedGauge | None]
    first: UnwrappedGauge
    given: Templates

    @cached_property
    def _needles(self) -> dict[str, Pointer]:
        return {pointer.name: pointer for pointer in self.pointers}

    def face(self, found: Sequence[Readings], templates: Templates) -> UnwrappedGauge:
        """Learn the dial without needles; return the panel picture's if too few frames show all needles."""
        touched = {name: templates[name].touched for name in self._needles}
        views, places = [], []
        for strip, readings in zip(self.strips, found, strict=True):
            if strip is None or not all(readings[name].is_seen for name in self._needles):
                continue
            covered = [
                touched_pixels(self.grid, own, self._row(readings[name]), self.turn) for name, own in touched.items()
            ]
            views.append(strip)
            places.append(np.concatenate(covered) if covered else np.empty(0, np.intp))
        return learn_face(views, places, self.first) if len(views) >= FRAMES_TO_LEARN else self.first

    def templates(
        self, found: Sequence[Readings], before: Templates, face: UnwrappedGauge
    ) -> dict[str, NeedleTemplate]:
        """Learn those of the gauge's needles that enough frames show clear of the others."""
        learned = {}
        for name in self._needles:
            clear = [
                (strip, self._row(readings[name]))
                for strip, readings in zip(self.strips, found, strict=True)
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
        """Learn a needle from its cuts, keeping the zero of the panel's own template.

        The frames show the needle's shape, but not its axis, since all cuts share the error of the template that found
        them. Fitting the learned needle to the given template, over the face behind it, shows that error, and the cuts
        are moved by it; but not where the given template shows something else, such as print that hides the needle.
        """
        behind = face_behind(face, self.grid, self._needles[name].at_deg, before.rows)
        both = face, behind
        learned = layered(*self._cuts(name, clear, before, both, 0.0), before.pixels, before.step_deg)
        fitter = WindowFitter([learned], [self.grid.pixels_per_sample])
        given, face_there = self.given[name].pixels.reshape(1, -1), behind.reshape(1, -1)
        fit = fitter.fit(given, face_there, np.zeros(1))
        off_rows = float(fit.fraction[0])
        if not (fit.correlation[0] >= LIKELY_SCORE and abs(off_rows) < before.rows / 8):
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
        """Cut the needle from the frames and, if it was cut from a picture, from that; also return the faces behind."""
        face, behind = whole_and_given
        axis_rows = np.array([row for _, row in clear]) + shift_rows
        windows = axis_rows[:, None] + np.arange(before.rows) - (before.rows - 1) / 2
        faces = rows_of_each([face] * len(clear), windows)
        seen = rows_of_each([strip for strip, _ in clear], windows)
        cuts = in_local_light(seen, before, faces)
        if self._needles[name].at_deg is not None:  # one more view, over another part of the face
            return np.concatenate([cuts, self.given[name].pixels[None]]), np.concatenate([faces, behind[None]])
        return cuts, faces

    def _row(self, reading: Reading) -> float:
        return (reading.angle_deg - self.grid.start_deg) / self.grid.step_deg

    def _apart_deg(self, one: Reading, other: Reading) -> float:
        difference_deg = np.array(one.angle_deg - other.angle_deg)
        return float(abs(shortest(difference_deg, None if self.turn is None else FULL_CIRCLE_DEG)))

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
