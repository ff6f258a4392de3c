"""The stack reader: three needles or more that turn above each other on one dial, as an altimeter's.

Each needle is searched for with what is known of the others: those below it are drawn over the face that lies behind
it, and the pixels of those above it are left out. As better places of one make better places of the others, this is
done a few times over, from the uppermost needle down.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from decoder.arrays import Floats, Mask
from decoder.fitting import MAX_FRACTION_ROWS, Fit, Fitter
from decoder.gauge import Gauge
from decoder.gauge_grid import needle_places, opposite_rows, rows_in_sweep, same_rows, turn_rows
from decoder.needle_template import NeedleTemplate
from decoder.over_face import face_moments, partial_normxcorr
from decoder.reading import Reading, Status
from decoder.scale import shortest
from decoder.scale_marks import FULL_CIRCLE_DEG
from decoder.searching import COARSE_STEP, thinned
from decoder.unwrapping import PolarGrid, UnwrappedGauge, rows_at

ROUNDS = 3
# Around each needle all of them must explain what is seen to this correlation, or one is taken for another.
MIN_CORRELATION = 0.9
FIT_STEPS = 4
# Below this a needle is not taken into account when the others are read.
LIKELY_SCORE = 0.6
# A needle covers so much of its axis from where it begins to its tip.
COVERED = 0.5
SCORE_THRESHOLD = 0.8
# What shows of a needle must match the better the less it is.
SLIVER_THRESHOLD = 0.95
HALF_VISIBLE = 0.5
MIN_VISIBLE = 0.2
WHOLE_VISIBLE = 0.97
CLEARLY_WORSE = 2.0
# A needle is hidden only if what covers it is seen clearly; under a glare it may be anywhere.
CLEAR_SCORE = 0.9


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a needle seems to be, how surely, and how much of its contrast shows.

    `rival` is its next best score, `under` the place of the needle below which nothing would show of it, if there is
    just one, and `under_reach_rows` how far from that it would still not show.
    """

    row: float
    sigma_rows: float
    score: float
    visible: float
    rival: float
    under: _Place | None
    under_reach_rows: float

    @property
    def is_sure(self) -> bool:
        """Whether what shows of the needle matches well enough, and nowhere else."""
        needed = SCORE_THRESHOLD if self.visible >= HALF_VISIBLE else SLIVER_THRESHOLD
        alone = 1.0 - max(self.rival, 0.0) ** 2 > CLEARLY_WORSE * (1.0 - min(self.score, 1.0) ** 2)
        return self.visible >= MIN_VISIBLE and self.score >= needed and alone


@dataclass(frozen=True, slots=True)
class _Layer:
    """One needle of the stack."""

    template: NeedleTemplate
    coarse: NeedleTemplate
    fitter: Fitter
    touched: Mask
    axis: int
    half_width_rows: float


class StackReader:
    """Reads the needles of one gauge; the parameters are those of `GaugeReader`, the covers as `covers_of` has them."""

    def __init__(
        self, gauge: Gauge, grid: PolarGrid, templates: Mapping[str, NeedleTemplate], face: UnwrappedGauge
    ) -> None:
        self._grid = grid
        self._face = face
        self._turn_rows = turn_rows(gauge, grid)
        self._first_deg = gauge.sweep[0]
        self._allowed = rows_in_sweep(gauge, grid)
        self._names = [needle.name for needle in gauge.needles]
        self._above = {name: _all_above(gauge, name) for name in self._names}
        self._order = sorted(self._names, key=lambda name: len(self._above[name]))
        self._layers = {name: _layer(_without_dial(templates[name], grid), grid) for name in self._names}

    def read(self, unwrapped: UnwrappedGauge) -> dict[str, Reading]:
        """The readings by needle of (R, C) float32, the gauge's grid."""
        places: dict[str, _Place] = {}
        for _ in range(ROUNDS):
            before = {name: place.row for name, place in places.items()}
            for name in self._order:
                places[name] = self._place(unwrapped, name, places)
            if before and all(abs(places[name].row - row) < MAX_FRACTION_ROWS for name, row in before.items()):
                break
        explained = self._explained(unwrapped, places)
        return {name: self._reading(places[name], is_explained=explained[name]) for name in self._names}

    def _explained(self, unwrapped: UnwrappedGauge, places: Mapping[str, _Place]) -> dict[str, bool]:
        """Whether all needles where they seem to be explain what is seen around each of them."""
        likely = {name: place for name, place in places.items() if place.score >= LIKELY_SCORE}
        drawn = self._drawn([name for name in reversed(self._order) if name in likely], likely)
        explained = {}
        for name, place in places.items():
            axis = self._layers[name].axis
            row = place.row if place.is_sure or place.under is None else place.under.row
            rows = slice(max(round(row) - axis, 0), round(row) + axis + 1)
            correlation = float(np.corrcoef(drawn[rows].ravel(), unwrapped[rows].ravel())[0, 1])
            explained[name] = correlation >= MIN_CORRELATION
        return explained

    def _place(self, unwrapped: UnwrappedGauge, name: str, places: Mapping[str, _Place]) -> _Place:
        """The best place for one needle, the others where they seem to be."""
        layer = self._layers[name]
        likely = {other: place for other, place in places.items() if other != name and place.score >= LIKELY_SCORE}
        below = [other for other in reversed(self._order) if other in likely and other not in self._above[name]]
        behind = self._face if not below else self._drawn(below, likely)
        mask = np.ones(unwrapped.shape, np.float32)
        for other in self._above[name]:
            if other in likely:
                mask[needle_places(self._grid, self._layers[other].touched, likely[other].row, self._turn_rows)] = 0.0
        scores, visible = _scores(unwrapped, behind, mask, layer)
        under, reach = self._hiding_place([likely[o] for o in self._above[name] if o in likely], visible)
        scores = np.where(self._allowed & (visible >= MIN_VISIBLE), scores, 0.0)
        best = int(scores.argmax())
        fit, row = _fitted(layer, unwrapped, behind, mask, best)
        rival = _elsewhere(scores, best, layer.half_width_rows + 3.0, self._turn_rows)
        if fit is None:
            score = float(min(scores[best], LIKELY_SCORE))
            return _Place(float(best), math.inf, score, float(visible[best]), rival, under, reach)
        return _Place(row, fit.sigma_rows, fit.score, float(visible[best]), rival, under, reach)

    def _hiding_place(self, above: Sequence[_Place], visible: Floats) -> tuple[_Place | None, float]:
        """The needle above that can hide this one wholly, and how far from its axis this one's can then be.

        None where needles at different places can: it may be under either.
        """
        places = [place for place in above if visible[round(place.row)] < MIN_VISIBLE]
        if not places:
            return None, 0.0
        shows = np.flatnonzero(visible[self._allowed] >= MIN_VISIBLE) + int(self._allowed.argmax())
        reaches = [float(np.abs(shows - place.row).min(initial=len(visible))) for place in places]
        apart = [abs(float(shortest(np.array(place.row - places[0].row), self._turn_rows))) for place in places]
        return (places[0], max(reaches)) if max(apart) <= max(reaches) else (None, 0.0)

    def _drawn(self, names: Sequence[str], places: Mapping[str, _Place]) -> Floats:
        """The face with needles drawn on it, the lowest first."""
        picture = self._face.copy()
        for name in names:
            row, template = places[name].row, self._layers[name].template
            for same in same_rows(row, self._turn_rows):
                _draw(picture, template.light, template.transparency, same)
            for opposite in opposite_rows(row, self._grid):
                _draw(picture, template.light[:, ::-1], template.transparency[:, ::-1], opposite)
        return picture

    def _reading(self, place: _Place, *, is_explained: bool) -> Reading:
        if place.is_sure and is_explained:
            status = Status.READ if place.visible >= WHOLE_VISIBLE else Status.EDGE
            return self._at(status, place.row, place.sigma_rows, place.score)
        hidden = not place.is_sure and is_explained and place.under is not None
        if hidden and place.under is not None and place.under.is_sure and place.under.score >= CLEAR_SCORE:
            sigma_rows = math.hypot(place.under.sigma_rows, place.under_reach_rows / math.sqrt(3.0))
            return self._at(Status.HIDDEN, place.under.row, sigma_rows, place.under.score)
        return self._at(Status.MISSING, place.row, place.sigma_rows, place.score)

    def _at(self, status: Status, row: float, sigma_rows: float, score: float) -> Reading:
        angle_deg = self._grid.angle_deg(row)
        if self._turn_rows is not None:
            angle_deg = self._first_deg + (angle_deg - self._first_deg) % FULL_CIRCLE_DEG
        return Reading(status, angle_deg, sigma_rows * self._grid.step_deg, score)


def _without_dial(template: NeedleTemplate, grid: PolarGrid) -> NeedleTemplate:
    """A template with nothing but the dial beyond the needle's tip, where a first picture takes numerals for needle."""
    axis = (template.rows - 1) // 2
    covered = 1.0 - template.transparency[axis - 1 : axis + 2].mean(axis=0) > COVERED
    beyond = np.zeros(grid.columns, bool)
    tail = grid.tail_columns
    beyond[tail:] = _beyond_tip(covered[tail:])
    beyond[:tail] = _beyond_tip(covered[:tail][::-1])[::-1]
    light = np.where(beyond, 0.0, template.light).astype(np.float32)
    return replace(template, light=light, transparency=np.where(beyond, 1.0, template.transparency).astype(np.float32))


def _beyond_tip(covered: Mask) -> Mask:
    """(C,): which columns, from the centre outwards, lie beyond a needle that covers its axis in some of them."""
    bare = ~covered
    ends = np.flatnonzero(bare[:-2] & bare[1:-1] & bare[2:] & (np.cumsum(covered)[:-2] > 0))
    first = int(ends[0]) + 1 if ends.size else len(covered)  # the tip's own blurred edge is the needle's
    return np.arange(len(covered)) >= first


def _layer(template: NeedleTemplate, grid: PolarGrid) -> _Layer:
    return _Layer(
        template=template,
        coarse=thinned(template),
        fitter=Fitter(template, grid.pixels_per_sample),
        touched=template.touched,
        axis=(template.rows - 1) // 2,
        half_width_rows=template.half_width_deg / template.step_deg,
    )


def _all_above(gauge: Gauge, name: str) -> tuple[str, ...]:
    """All needles that turn above one, the next first."""
    covers = {needle.name: needle.covered_by for needle in gauge.needles}
    above: list[str] = []
    cover = covers[name]
    while cover is not None:
        above.append(cover)
        cover = covers[cover]
    return tuple(above)


def _scores(gauge: Floats, behind: Floats, mask: Floats, layer: _Layer) -> tuple[Floats, Floats]:
    """NCC of what shows of a needle by the row of its axis, and how much of its contrast that is: (R,) each."""
    template = layer.coarse
    gauge_seen, behind_seen, mask_seen = (
        np.ascontiguousarray(each[::COARSE_STEP, ::COARSE_STEP]) for each in (gauge, behind, mask)
    )
    moments = face_moments(behind_seen, template, mask_seen)
    scores = partial_normxcorr(gauge_seen, behind_seen, moments, mask_seen)
    whole = moments if mask_seen.all() else face_moments(behind_seen, template)
    visible = moments.needle_contrast / np.maximum(whole.needle_contrast, 1e-6)
    rows = COARSE_STEP * ((template.rows - 1) // 2 + np.arange(len(scores)))
    every = np.arange(len(gauge))
    return np.interp(every, rows, scores, 0.0, 0.0), np.interp(every, rows, visible, 0.0, 0.0)


def _fitted(layer: _Layer, gauge: Floats, behind: Floats, mask: Floats, start: int) -> tuple[Fit | None, float]:
    """Least squares at a row: what it finds there, and the fractional row; None where it gets lost."""
    row = start
    for _ in range(FIT_STEPS):
        if not layer.axis <= row < len(gauge) - layer.axis:
            return None, float(start)
        window = slice(row - layer.axis, row + layer.axis + 1)
        fit = layer.fitter.fit(gauge[window], partial(_as_it_is, behind[window]), mask[window])
        if not abs(row + fit.fraction - start) <= layer.half_width_rows:
            return None, float(start)
        if abs(fit.fraction) <= MAX_FRACTION_ROWS:
            return fit, row + fit.fraction
        row += round(fit.fraction)
    return None, float(start)


def _as_it_is(behind: Floats, _: Floats) -> Floats:
    return behind


def _elsewhere(scores: Floats, best: int, reach_rows: float, turn: float | None) -> float:
    """The highest peak of the scores (R,) that is not this one's."""
    peaks = np.zeros(len(scores), bool)
    peaks[1:-1] = (scores[1:-1] >= scores[:-2]) & (scores[1:-1] >= scores[2:])
    for row in same_rows(best, turn):
        peaks[max(math.floor(row - reach_rows), 0) : max(math.ceil(row + reach_rows) + 1, 0)] = False
    return float(scores.max(where=peaks, initial=0.0))


def _draw(picture: Floats, light: Floats, transparency: Floats, row: float) -> None:
    """Draws a needle (H, C) with its axis on a row of a picture (R, C)."""
    rows = len(light)
    first = math.floor(row) - (rows - 1) // 2
    start, end = max(first, 0), min(first + rows, len(picture))
    if start < end:
        own = np.arange(start, end) - first - (row - math.floor(row))
        picture[start:end] = rows_at(transparency, own) * picture[start:end] + rows_at(light, own)
