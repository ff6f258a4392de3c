"""Tuning: learns from a sample of a flight's own frames what its needles and dials look like.

A template cut from one picture carries that picture's noise, and whatever lies behind the needle there, into every
reading. Many frames tell needle and dial apart: the dial's face is what each pixel shows when no needle is there, and
the needle is what it adds to the faces it passes over. A reading then compares the gauge with the needle drawn over
the face behind it, so marks and numerals no longer pull at it. Searches start where the camera mostly was.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from decoder.alignment import Alignment, Matrix, is_rigid
from decoder.arrays import Floats
from decoder.card_tuning import learn_card
from decoder.errors import PictureError
from decoder.faces import LitViews, in_light_of, learn_face
from decoder.fitting import Fitter
from decoder.frame_batch import batch_frames
from decoder.frame_placer import UnwrappedFrame
from decoder.gauge import Gauge
from decoder.gauge_grid import touched_pixels, turn_rows
from decoder.needle_layer import in_local_light, layered
from decoder.needle_template import NeedleTemplate
from decoder.panel_reader import PanelReader
from decoder.panel_tuning import face_behind
from decoder.picture_block import TopOfFrame
from decoder.pictures import FramePicture, GreyPicture
from decoder.reading import Reading, Status
from decoder.scale import shortest
from decoder.scale_marks import FULL_CIRCLE_DEG
from decoder.sorting import median_of, middle_of
from decoder.unwrapping import PolarGrid, UnwrappedGauge, rows_of_each

SAMPLE_FRAMES = 16
MIN_CUTS = 5
# Learned needles over learned faces score 0.99 as a rule.
EVENLY_LIT_SCORE = 0.97

Readings = Mapping[str, Reading]
Templates = Mapping[str, NeedleTemplate]


def tune(reader: PanelReader, frames: Iterable[GreyPicture | FramePicture]) -> PanelReader:
    """The reader fitted to the flight that the frames are a sample of; with too few usable frames, as it was."""
    samples = unwrapped(reader, frames)
    return tune_on(reader, samples, lit_views(reader, samples))


def lit_views(reader: PanelReader, samples: Sequence[UnwrappedFrame]) -> LitViews:
    """All gauges of the samples as in the panel picture's light."""
    return [
        in_light_of(picture, (sample.gauges[index] for sample in samples))
        for index, picture in enumerate(reader.own_gauges)
    ]


def tune_on(
    reader: PanelReader,
    samples: Sequence[UnwrappedFrame],
    views: LitViews,
    found: Sequence[Readings] | None = None,
) -> PanelReader:
    """The same for frames that the reader has unwrapped, and `found` what it reads in them, if that is known."""
    if len(samples) < MIN_CUTS:
        return reader
    matrices = _at_panels_zoom(reader, samples)
    usual = _usual(samples, matrices)
    tuners = [
        _GaugeTuner(gauge, grid, seen, first, reader.tuning.templates)
        for gauge, grid, seen, first in zip(
            reader.source.panel.gauges, reader.grids, views, reader.tuning.faces, strict=True
        )
    ]
    cards = {
        gauge.card.name: learn_card(
            gauge,
            gauge.card,
            grid,
            [like for like in seen if like is not None],
            reader.tuning.cards[gauge.card.name],
        )
        for gauge, grid, seen in zip(reader.source.panel.gauges, reader.grids, views, strict=True)
        if gauge.card is not None
    }
    found = found or reader.found_in(samples)
    templates = dict(reader.tuning.templates)
    faces = [tuner.face(found, templates) for tuner in tuners]
    for tuner, face in zip(tuners, faces, strict=True):
        templates |= tuner.templates(found, templates, face)
    tuning = replace(
        reader.tuning,
        templates=templates,
        faces=tuple(faces),
        usual=usual,
        motions=_motions(samples, matrices, usual),
        evenly_lit_score=EVENLY_LIT_SCORE,
        cards=cards,
        rows=reader.placer.rows_wanted([sample.alignment for sample in samples]),
    )
    return reader.tuned(tuning)


class _GaugeTuner:
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
        self._needles = {needle.name: needle for needle in gauge.needles}
        self._grid = grid
        self._turn_rows = turn_rows(gauge, grid)
        self._strips = strips
        self._first = first
        self._given = given

    def face(self, found: Sequence[Readings], templates: Templates) -> UnwrappedGauge:
        """The dial without needles; the panel picture's where too few frames show it."""
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
        return learn_face(views, places, self._first) if len(views) >= MIN_CUTS else self._first

    def templates(
        self, found: Sequence[Readings], before: Templates, face: UnwrappedGauge
    ) -> dict[str, NeedleTemplate]:
        """The gauge's needles, those that enough frames show free of the others."""
        learned = {}
        for name in self._needles:
            clear = [
                (strip, self._row(readings[name]))
                for strip, readings in zip(self._strips, found, strict=True)
                if strip is not None and self._is_clear(name, readings, before)
            ]
            if len(clear) >= MIN_CUTS:
                learned[name] = self._learned(name, clear, before[name], face)
        return learned

    def _learned(
        self,
        name: str,
        clear: Sequence[tuple[UnwrappedGauge, float]],
        before: NeedleTemplate,
        face: UnwrappedGauge,
    ) -> NeedleTemplate:
        """The needle from its cuts, its zero where the panel's own template has it.

        The frames tell the needle's form, but not where its axis is: all cuts share the error of the template that
        found them. The given template, read with the learned needle over the face behind it, shows that error; the
        cuts are moved by it.
        """
        behind = face_behind(face, self._grid, self._needles[name], before.rows)
        both = face, behind
        learned = layered(*self._cuts(name, clear, before, both, 0.0), before.pixels, before.step_deg)
        off_rows = (
            Fitter(learned, self._grid.pixels_per_sample).fit(self._given[name].pixels, lambda _: behind).fraction
        )
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
        """The needle in the frames and, where it was cut from a picture, there; and the face behind each."""
        face, behind = whole_and_given
        axis_rows = np.array([row for _, row in clear]) + shift_rows
        windows = axis_rows[:, None] + np.arange(before.rows) - (before.rows - 1) / 2
        faces = rows_of_each([face] * len(clear), windows)
        seen = rows_of_each([strip for strip, _ in clear], windows)
        cuts = in_local_light(seen, before, faces)
        if self._needles[name].template.at is not None:  # one more view, over another part of the face
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


def taken(frames: Iterable[GreyPicture | FramePicture | TopOfFrame]) -> Iterator[FramePicture | TopOfFrame]:
    """The frames of a sample, those without a focal length too."""
    return (FramePicture(frame) if isinstance(frame, np.ndarray) else frame for frame in frames)


def unwrapped(reader: PanelReader, frames: Iterable[GreyPicture | FramePicture | TopOfFrame]) -> list[UnwrappedFrame]:
    """Those of the frames that can be aligned, unwrapped."""
    sampled = taken(frames)
    height, width = reader.source.picture.shape
    samples: list[UnwrappedFrame] = []
    while batch := tuple(islice(sampled, batch_frames((width, height)))):
        # what is not found is reported when the flight is read
        samples += [one for one in reader.placer.unwrap_many(batch) if not isinstance(one, PictureError)]
    return samples


def _usual(samples: Sequence[UnwrappedFrame], matrices: Sequence[Matrix]) -> Alignment:
    """The median alignment, each at the panel picture's zoom; where all are mere shifts and rolls, it is one too."""
    usual = median_of(np.array(matrices))
    if all(is_rigid(matrix) for matrix in matrices):
        usual[:2, :2] /= np.hypot(usual[0, 0], usual[1, 0])
    return Alignment.of(usual, float(middle_of(np.array([sample.alignment.score for sample in samples]))))


def _motions(samples: Sequence[UnwrappedFrame], matrices: Sequence[Matrix], usual: Alignment) -> tuple[Matrix, ...]:
    """How those samples moved that show most of the panel."""
    models = [0 if each.alignment.covariance is None else each.alignment.covariance.model for each in samples]
    there = np.linalg.inv(usual.matrix)
    most = max(models)
    return tuple(matrix @ there for matrix, model in zip(matrices, models, strict=True) if model == most)


def _at_panels_zoom(reader: PanelReader, samples: Sequence[UnwrappedFrame]) -> list[Matrix]:
    """(3, 3) each: frames' alignments, had they been taken at the panel picture's zoom and size."""
    optics = reader.aligner.optics
    kinds = [(sample.focal_length_mm, sample.size_px or optics.size_px) for sample in samples]
    back = {kind: np.linalg.inv(optics.zoom(*kind)) for kind in dict.fromkeys(kinds)}
    matrices = [back[kind] @ sample.alignment.matrix for kind, sample in zip(kinds, samples, strict=True)]
    return [matrix / matrix[2, 2] for matrix in matrices]
