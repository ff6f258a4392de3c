"""Learning a geared hand that the panel picture hides, from where the gearing puts it in a flight's frames.

A hand that lies below another one in the panel picture is cut out together with that one, and so is found in no other
frame. But the other hands can be read without it, and the gearing then says where it is. For the coarsest hand there
are a few possible places, a turn of the next finer hand apart; the hand is drawn near one of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import UnwrappedGauge, needle_places, row_of_angle, turn_rows
from decoder.instruments.appearance import Appearance, Instrument, Look
from decoder.instruments.found import Needle, readings_of
from decoder.instruments.kinds.dials.geared import GearedReader, Guesses, Placed, gearing_of
from decoder.instruments.needle_learner import NeedleLearner, Readings
from decoder.instruments.reading import Reading, Status
from decoder.instruments.thresholds import CLEARLY_WORSE, FRAMES_TO_LEARN
from decoder.matching.needle_layer import layer_over
from decoder.matching.needle_search import COARSE_STEP
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.strips import rows_of_each
from decoder.panel.arrays import Floats, Indices, Mask
from decoder.panel.gauge import Gauge
from decoder.panel.scale import FULL_CIRCLE_DEG, shortest
from decoder.registration.thresholds import LIKELY_SCORE, SCORE_THRESHOLD


class _SomeHands(GearedReader):
    """Reads all hands of a gauge but one.

    Without that hand they cannot explain the dial, so residuals and rival explanations are ignored.
    """

    def _likely(self, seen: Floats, guesses: Guesses) -> Guesses:
        del seen
        return guesses

    def _settled(self, dials: Floats, rows: Floats) -> Placed:
        placed = super()._settled(dials, rows)
        # a hand that was cut out together with the hidden one matches worse without it
        is_likely = placed.score >= LIKELY_SCORE
        return replace(placed, score=np.where(is_likely, np.maximum(placed.score, SCORE_THRESHOLD), placed.score))

    def _rivals(self, seen: Floats, rows: Floats, others: Floats) -> Mask:
        del seen, rows
        return np.zeros(others.shape[:2], bool)

    def _adds_up(self, seen: Floats, rows: Floats) -> Mask:
        del rows
        return np.ones(len(seen), bool)


def learn_hidden_hand(instrument: Instrument, appearance: Appearance, strips: Sequence[UnwrappedGauge]) -> Look | None:
    """Learn the hidden hand because of which most frames have no value, if there is one.

    Parameters
    ----------
    strips
        The gauge in a sample's frames, in the light of the panel picture: (R, C) each.

    Returns
    -------
    The face and the hand's template, if with them more frames have a value than before, and the hand moves with that
    value (print that is taken for a hand does not move). Else None.
    """
    told, best = _Told.by(instrument, appearance, strips).count, None
    drawn_deg = {needle.name: needle.at_deg for needle in instrument.gauge.turning if needle.at_deg is not None}
    for name in gearing_of(instrument.gauge).names[1:]:
        if name not in drawn_deg:  # its own picture shows it
            continue
        for look in _HiddenHand(instrument, appearance, name, drawn_deg[name]).learned(strips):
            after = replace(appearance, templates={**appearance.templates, **look.templates})
            frames = _Told.by(replace(instrument, face=look.face), after, strips)
            if frames.count > max(told, FRAMES_TO_LEARN, HALF * len(strips)) and frames.goes_along(name):
                told, best = frames.count, look
    return best


@dataclass(frozen=True, slots=True)
class _Told:
    """The value and the angles of all hands of a gauge in F frames."""

    gauge: Gauge
    values: Floats
    angles_deg: Floats
    is_read: Mask

    @classmethod
    def by(cls, instrument: Instrument, appearance: Appearance, strips: Sequence[UnwrappedGauge]) -> Self:
        """Read frames."""
        gearing, needles = gearing_of(instrument.gauge), instrument.needles(appearance)
        values, hands = _read(GearedReader(needles), needles, strips)
        is_told = np.array([value.status is not Status.MISSING for value in values])
        told = gearing.value_at(np.array([value.angle_deg for value in values]))
        by_hand = [[readings[name] for name in gearing.names] for readings in hands]
        angles_deg = np.array([[hand.angle_deg for hand in own] for own in by_hand])
        is_read = np.array([[hand.status is Status.READ for hand in own] for own in by_hand]) & is_told[:, None]
        return cls(instrument.gauge, np.where(is_told, told, np.nan), angles_deg, is_read)

    @property
    def count(self) -> int:
        """The number of frames with a value."""
        return int(np.isfinite(self.values).sum())

    def goes_along(self, name: str) -> bool:
        """Whether a hand's motion is better explained by the value than by standing still."""
        gearing = gearing_of(self.gauge)
        hand = gearing.names.index(name)
        frames = self.is_read[:, hand]
        if frames.sum() < FRAMES_TO_LEARN:
            return False
        moved, strayed = gearing.variances(hand, self.angles_deg[frames, hand], self.values[frames])
        return moved > CLEARLY_WORSE * strayed


def _read(
    reader: GearedReader, needles: list[Needle], strips: Sequence[UnwrappedGauge]
) -> tuple[list[Reading], list[dict[str, Reading]]]:
    """Read some of the hands; return their common value, and the hands themselves, by frame."""
    together = reader.read(np.stack(strips))
    return together.values, readings_of(together.hands, needles, np.zeros(together.hands.row.shape))


@dataclass(frozen=True, slots=True)
class _Views:
    """A hand that is not known yet, in N frames in which the others were read.

    Attributes
    ----------
    strips
        The gauge in these frames.
    found
        The others.
    at_deg
        (N, P): where the hand may be, degrees.
    bare
        (N, R, C): where no other hand is.
    face
        The dial without the others.
    """

    strips: Sequence[UnwrappedGauge]
    found: Sequence[Readings]
    at_deg: Floats
    bare: Mask
    face: UnwrappedGauge


class _HiddenHand:
    """One hand of a gauge, to be learned where the others put it."""

    def __init__(self, instrument: Instrument, appearance: Appearance, name: str, drawn_deg: float) -> None:
        self._instrument, self._appearance, self._name = instrument, appearance, name
        self._drawn_deg = drawn_deg
        self._others = replace(instrument, gauge=without(instrument.gauge, name))
        self._gearing = gearing_of(instrument.gauge).without(name)

    def learned(self, strips: Sequence[UnwrappedGauge]) -> Iterator[Look]:
        """Learn it from frames in which all others are read; alone, and with these, as one may be cut out with it."""
        views = self._views(strips)
        if views is None:
            return
        for chosen in self._choices(views):
            yield from self._looks(views, chosen)

    def _looks(self, views: _Views, chosen: Floats) -> Iterator[Look]:
        """Learn it at some places, (N,)."""
        name = self._name
        found = [
            {**own, name: Reading(Status.READ, at_deg, self._instrument.grid.step_deg, 1.0)}
            for own, at_deg in zip(views.found, chosen.tolist(), strict=True)
        ]
        before = self._appearance.templates
        face = self._learner(self._instrument.gauge, views.strips, before).face(found, before)
        templates = {**before, name: self._first(views, chosen, face)}
        learner = self._learner(self._instrument.gauge, views.strips, templates)
        face = learner.face(found, templates)
        every = {**templates, **learner.templates(found, templates, face)}
        yield Look(face, {name: every[name]})
        yield Look(face, every)

    def _views(self, strips: Sequence[UnwrappedGauge]) -> _Views | None:
        """Read the other hands; None if that succeeds in too few frames."""
        gauge, grid, templates = self._others.gauge, self._others.grid, self._appearance.templates
        needles = self._others.needles(self._appearance)
        values, hands = _read(_SomeHands(needles, self._gearing), needles, strips)
        frames = [
            frame
            for frame, (value, readings) in enumerate(zip(values, hands, strict=True))
            if all(each.status is not Status.MISSING for each in (value, *readings.values()))
        ]
        if len(frames) < FRAMES_TO_LEARN:
            return None
        found, own = [hands[frame] for frame in frames], [strips[frame] for frame in frames]
        bare = np.ones((len(frames), *own[0].shape), bool)
        for index, readings in enumerate(found):
            for needle in gauge.turning:
                row = row_of_angle(grid, readings[needle.name].angle_deg)
                bare[index] &= ~needle_places(grid, templates[needle.name].touched, row, turn_rows(gauge, grid))
        told_deg = np.array([values[frame].angle_deg for frame in frames])
        face = self._learner(gauge, own, templates).face(found, templates)
        return _Views(own, found, self._at_deg(told_deg), bare, face)

    def _at_deg(self, told_deg: Floats) -> Floats:
        """(N, P): where the hand may be, a turn of the next finer one apart; first where the others put it, (N,)."""
        gearing = gearing_of(self._instrument.gauge)
        hand = gearing.names.index(self._name)
        finer = gearing.turns[hand - 1]
        values = self._gearing.value_at(told_deg)[:, None] + finer * np.arange(round(gearing.turns[hand] / finer))
        first_deg = self._instrument.gauge.sweep[0]
        at_deg: Floats = first_deg + (gearing.angles_deg(hand, values) - first_deg) % FULL_CIRCLE_DEG
        return at_deg

    def _choices(self, views: _Views) -> Iterator[Floats]:
        """Choose one of each frame's possible places, (N,), in up to two ways.

        First, the place where the other hands put it or, for the coarsest hand, the one nearest to where it is drawn.
        That fails if a coarser hand is drawn carelessly, or the coarsest moves far. So the second choice is the places
        at which all frames show the same over the face; a slow hand would not show there, as part of that face.
        """
        frames = len(views.at_deg)
        told = np.zeros(frames, np.intp)
        if self._name == gearing_of(self._instrument.gauge).names[-1]:
            told = np.abs(shortest(views.at_deg - self._drawn_deg, FULL_CIRCLE_DEG)).argmin(axis=1)
        alike = self._alike(views)
        for choice in (told, alike) if (told != alike).any() else (told,):
            yield views.at_deg[np.arange(frames), choice]

    def _alike(self, views: _Views) -> Indices:
        """(N,): the places at which frames show the most alike over the face."""
        faces = np.repeat(views.face[None], len(views.strips), axis=0)
        seen, behind, bare = (
            self._windows(each[..., ::COARSE_STEP], views.at_deg)
            for each in (np.stack(views.strips), faces, views.bare)
        )
        frames, places = views.at_deg.shape
        over = np.where(bare >= HALF, seen - behind, 0.0).reshape(frames * places, -1)
        size = np.linalg.norm(over, axis=1)
        over /= np.maximum(size, np.finfo(over.dtype).tiny)[:, None]
        like = (over @ over.T).reshape(frames, places, frames, places)
        # a window beside the hand also shows part of it in all frames, but a smaller part
        shown = size.reshape(frames, places) * like.max(axis=3).sum(axis=2)
        seed = np.unravel_index(shown.argmax(), shown.shape)
        like_seed = like[seed].argmax(axis=1)
        alike: Indices = like[:, :, np.arange(frames), like_seed].sum(axis=2).argmax(axis=1)
        return alike

    def _windows(self, strips: Floats | Mask, at_deg: Floats) -> Floats:
        """(N, P, H, C): windows of the hand's size around angles (N, P)."""
        size, grid = self._appearance.templates[self._name].rows, self._instrument.grid
        offsets = np.arange(size) - (size - 1) / 2
        windows = (at_deg - grid.start_deg)[..., None] / grid.step_deg + offsets
        every = [rows_of_each(list(strips.astype(np.float32)), rows) for rows in windows.swapaxes(0, 1)]
        return np.stack(every, axis=1)

    def _first(self, views: _Views, chosen_deg: Floats, face: UnwrappedGauge) -> NeedleTemplate:
        """Return the hand as the median of the frames shows it at these angles, (N,), beside the other hands."""
        strips, faces = np.stack(views.strips), np.repeat(face[None], len(chosen_deg), axis=0)
        seen, behind, bare = (self._windows(each, chosen_deg[:, None])[:, 0] for each in (strips, faces, views.bare))
        behind = np.median(behind, axis=0)
        shown = np.nanmedian(np.where(bare >= HALF, seen, np.nan), axis=0)
        pixels = np.where(np.isfinite(shown), shown, behind).astype(np.float32)
        return layer_over(pixels, behind.astype(np.float32), self._instrument.grid.step_deg)

    def _learner(
        self, gauge: Gauge, strips: Sequence[UnwrappedGauge], templates: Mapping[str, NeedleTemplate]
    ) -> NeedleLearner:
        grid, face = self._instrument.grid, self._instrument.face
        return NeedleLearner(gauge.turning, grid, turn_rows(gauge, grid), strips, face, templates)


def without(gauge: Gauge, name: str) -> Gauge:
    """Return a gauge without one of its hands; whatever covers that one then covers what lay below it."""
    assert gauge.combined is not None  # noqa: S101 - only called for gauges with a combination
    above = next(needle.covered_by for needle in gauge.needles if needle.name == name)
    others = tuple(
        needle.model_copy(update={"covered_by": above}) if needle.covered_by == name else needle
        for needle in gauge.needles
        if needle.name != name
    )
    parts = tuple(each for each in gauge.combined.needles if each != name)
    combined = gauge.combined.model_copy(update={"needles": parts})
    return gauge.model_copy(update={"needles": others, "combined": combined})
