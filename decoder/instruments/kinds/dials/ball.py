"""Balls in curved tubes: whatever moves along the tube, dark or bright, learned from the flight.

Unwrapped along its tube, a ball shifts up and down as a needle does, and is found the same way. The panel does not
describe its look: in each frame the ball is where, among the pixels that change over the flight, the tube differs most
from its usual look.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from decoder.imaging.sorting import MAD_TO_SIGMA, median_of
from decoder.imaging.unwrapping import PolarGrid, UnwrappedGauge, Unwrapper, rows_in_sweep
from decoder.instruments.appearance import Appearance, DrawnInstrument, Instrument, LearnedPicture, Look, Still
from decoder.instruments.kind import Kind
from decoder.instruments.needle_learner import NeedleLearner
from decoder.instruments.reading import Reading, Readings, Status
from decoder.instruments.sampling import GaugeSampler, Reader, Samples
from decoder.instruments.thresholds import FRAMES_TO_LEARN
from decoder.matching.needle_layer import layer_over
from decoder.matching.needle_template import NeedleTemplate, odd_rows
from decoder.matching.strips import rows_of_each
from decoder.matching.thresholds import OUTLIER_SPREADS
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.panel.kind import Pointer
from decoder.panel.kinds.needles import Needle, Template
from decoder.panel.vocabulary import Method
from decoder.registration.thresholds import NOISE_LEVELS, SCORE_THRESHOLD

ROUNDS = 2
PASSES = 4
# Length of a ball's picture, in widths of the tube.
PICTURE_WIDTHS = 1.5
# How precisely a click marks a ball's middle, and how precisely its outline is found, as a glint lies to one side.
MIDDLE_PX = 1.0


@dataclass(frozen=True, slots=True)
class BallPicture:
    """A ball, and the tube without it, (R, C) float32."""

    face: UnwrappedGauge
    template: NeedleTemplate


@dataclass(frozen=True)
class _Tube:
    """One tube on its grid, and the kind that reads needles over a still face."""

    gauge: Gauge
    grid: PolarGrid
    needle_kind: Kind

    @property
    def name(self) -> str:
        """The name of its column."""
        return self.gauge.quantities[0].name

    @property
    def ball_rows(self) -> float:
        """How many rows are as long as the tube is wide."""
        middle_px = float(self.grid.radii_px.mean())
        width_px = float(self.grid.radii_px[-1] - self.grid.radii_px[0])
        return math.degrees(width_px / middle_px) / self.grid.step_deg

    @property
    def bare_gauge(self) -> Gauge:
        """The gauge as which it is read: a dial with a needle."""
        span_deg = PICTURE_WIDTHS * self.ball_rows * self.grid.step_deg
        needle = Needle(name=self.name, template=Template(at=sum(self.gauge.sweep) / 2, span=max(span_deg, 2.0)))
        return self.gauge.model_copy(update={"ball": None, "needles": (needle,)})

    @property
    def rows(self) -> int:
        """How many rows a ball's picture has."""
        return odd_rows(PICTURE_WIDTHS * self.ball_rows * self.grid.step_deg, self.grid.step_deg)


class BallReader:
    """Reads the ball of one gauge."""

    def __init__(self, tube: _Tube, picture: BallPicture, method: Method, evenly_lit_score: float) -> None:
        self._tube = tube
        self._sampler = GaugeSampler(Unwrapper([tube.grid]), [0])
        self._reader: Reader = tube.needle_kind.reader(
            [Instrument(0, tube.bare_gauge, tube.grid, picture.face)],
            Appearance({tube.name: picture.template}, (picture.face,), evenly_lit_score),
            self._sampler,
            method,
        )

    def read(self, strips: Sequence[UnwrappedGauge], place_sigmas_deg: Floats) -> Readings:
        """Read F gauges (R, C); `place_sigmas_deg` (F, 1) is as in `Reader`."""
        return self._reader.read([self._sampler.of_unwrapped([strip]) for strip in strips], place_sigmas_deg)


def learn_ball(tube: _Tube, strips: Sequence[UnwrappedGauge]) -> BallPicture | None:
    """Learn ball and tube from frames (R, C) in one light; None if nothing moves or there are too few frames."""
    if len(strips) < FRAMES_TO_LEARN:
        return None
    places = _places(tube, np.stack(strips))
    if places is None:
        return None
    grid = tube.grid
    windows = places[:, None] + np.arange(tube.rows) - (tube.rows - 1) / 2
    cuts = rows_of_each(list(strips), windows)
    shown = (windows >= 0) & (windows <= grid.rows - 1)
    plain = np.broadcast_to(median_of(np.concatenate(strips)), cuts.shape[1:]).astype(np.float32)
    whole = cuts[shown.all(axis=1)]
    if len(whole) < FRAMES_TO_LEARN:
        return None
    template = layer_over(np.median(whole, axis=0).astype(np.float32), plain, grid.step_deg)
    found = [{tube.name: Reading(Status.READ, grid.angle_deg(row), grid.step_deg, 1.0)} for row in places.tolist()]
    usual = np.median(strips, axis=0).astype(np.float32)
    known = BallPicture(usual, template)
    pointers = [Pointer(tube.name, None, is_fixed=False)]
    for _ in range(ROUNDS):
        learner = NeedleLearner(pointers, grid, None, strips, known.face, {tube.name: template})
        face = learner.face(found, {tube.name: known.template})
        templates = learner.templates(found, {tube.name: known.template}, face)
        known = BallPicture(face, templates.get(tube.name, known.template))
        found = BallReader(tube, known, Method.NORMXCORR, SCORE_THRESHOLD).read(strips, np.zeros((len(strips), 1)))
    return known


def _places(tube: _Tube, strips: Floats) -> Floats | None:
    """(F,): the rows of the ball's middle in frames (F, R, C); None where nothing moves.

    A tube looks mostly the same along its length, so where a pixel changes over the flight, the ball makes it differ
    from that. In changing light everything changes, but its ends and lines differ from it in every frame.
    """
    middle = np.median(strips, axis=0)
    changes = MAD_TO_SIGMA * np.quantile(np.abs(strips - middle), 0.9, axis=0) > OUTLIER_SPREADS * NOISE_LEVELS
    allowed = rows_in_sweep(tube.gauge, tube.grid)
    if not changes[allowed].any():
        return None
    plain = np.median(strips[:, allowed], axis=(0, 1))
    differs = np.square(strips - plain) * allowed[:, None]
    differs /= np.maximum(differs.mean(axis=(1, 2), keepdims=True), 1.0)
    energy = ((differs - differs.min(axis=0)) * changes).sum(axis=2)
    half = max(round(tube.ball_rows / 2), 1)
    box = np.ones(2 * half + 1)
    sums = np.stack([np.convolve(own, box, mode="same") for own in energy])
    places: Floats = np.where(allowed, sums, -1.0).argmax(axis=1).astype(np.float64)
    rows = np.arange(tube.grid.rows)
    for _ in range(PASSES):
        near = energy * (np.abs(rows - places[:, None]) <= tube.rows / 2)
        total = near.sum(axis=1)
        places[:] = np.where(total > 0, (near * rows).sum(axis=1) / np.maximum(total, 1.0), places)
    return places


class _Balls:
    def __init__(self, readers: Sequence[tuple[int, _Tube, BallReader | None]], sampler: GaugeSampler) -> None:
        self._readers, self._sampler = readers, sampler

    def read(self, frames: Sequence[Samples], place_sigmas_deg: Floats) -> Readings:
        readings: Readings = [{} for _ in frames]
        for index, tube, reader in self._readers:
            if reader is None:
                unread = Reading(Status.MISSING, math.nan, math.inf, 0.0)
                found = [{tube.name: unread} for _ in frames]
            else:
                found = reader.read(list(self._sampler.strips(frames, index)), place_sigmas_deg[:, [index]])
            sigma_deg = math.degrees(MIDDLE_PX / float(tube.grid.radii_px.mean()))
            for frame, own in zip(readings, found, strict=True):
                frame.update({name: reading.in_place_within(sigma_deg) for name, reading in own.items()})
        return readings


class BallKind(Still):
    """A ball in a curved tube; `needle_kind` reads needles that turn over a face."""

    is_searched = False

    def __init__(self, needle_kind: Kind) -> None:
        self._needle_kind = needle_kind

    def owns(self, gauge: Gauge) -> bool:
        return gauge.ball is not None

    def reader(
        self, instruments: Sequence[Instrument], appearance: Appearance, sampler: GaugeSampler, method: Method
    ) -> _Balls:
        readers: list[tuple[int, _Tube, BallReader | None]] = []
        for own in instruments:
            tube = self._tube(own.gauge, own.grid)
            picture: BallPicture | None = appearance.pictures[tube.name]
            reader = None if picture is None else BallReader(tube, picture, method, appearance.evenly_lit_score)
            readers.append((own.index, tube, reader))
        return _Balls(readers, sampler)

    def _tube(self, gauge: Gauge, grid: PolarGrid) -> _Tube:
        return _Tube(gauge, grid, self._needle_kind)

    def first_look(self, drawn: DrawnInstrument) -> Look:
        return Look(drawn.strip, pictures={self._tube(drawn.gauge, drawn.grid).name: None})

    def learned_pictures(
        self, instrument: Instrument, strips: Sequence[UnwrappedGauge], _: Mapping[str, LearnedPicture]
    ) -> Mapping[str, LearnedPicture]:
        tube = self._tube(instrument.gauge, instrument.grid)
        return {tube.name: learn_ball(tube, strips)}
