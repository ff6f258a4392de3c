"""Dials with needles: read one by one or in pairs, as geared hands that show one value, or as a stack."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from decoder.imaging.planes import Squeeze
from decoder.imaging.sorting import median_of
from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import Grid, UnwrappedGauge, row_of_angle
from decoder.instruments.appearance import (
    Appearance,
    DrawnInstrument,
    Grower,
    Instrument,
    LearnedPicture,
    Look,
    Placed,
    needles_in_picture,
    rows_to_others,
)
from decoder.instruments.found import Found, Needle, readings_of
from decoder.instruments.kinds.dials.geared import GearedReader
from decoder.instruments.kinds.dials.geared_learning import learn_hidden_hand
from decoder.instruments.kinds.dials.needles import NeedleReader, is_simple
from decoder.instruments.kinds.dials.stack import StackReader, covers_axis, needle_columns
from decoder.instruments.needle_lines import pivot_of_tilts, tilts_of
from decoder.instruments.reading import Readings
from decoder.instruments.sampling import ALL, GaugeSampler, Part, Reader, Samples, SeenGauge
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.pivot_search import drawn_needles_deg, needle_pivot
from decoder.panel.arrays import Floats, Mask
from decoder.panel.gauge import Gauge
from decoder.panel.kinds.needles import Needle as DescribedNeedle
from decoder.panel.vocabulary import Method
from decoder.registration.pivot import Pivot
from decoder.registration.thresholds import NOISE_LEVELS


class _FindsNeedles(Protocol):
    """Finds needles in many frames at once."""

    def read(self, frames: Sequence[Samples]) -> Found:
        """Find them in F frames: (F, K)."""
        ...


class _FoundReader:
    """Turns needles found as arrays (F, K) into readings."""

    def __init__(self, needles: Sequence[Needle], finder: _FindsNeedles) -> None:
        self._needles, self._finder = list(needles), finder
        self._gauges = [needle.gauge_index for needle in needles]

    def read(self, frames: Sequence[Samples], place_sigmas_deg: Floats) -> Readings:
        """Read F frames; `place_sigmas_deg` (F, gauges) is the uncertainty of angles due to the dials' positions."""
        return readings_of(self._finder.read(frames), self._needles, place_sigmas_deg[:, self._gauges])


def _has_still_face(gauge: Gauge) -> bool:
    """Whether a gauge has needles, and no card below them."""
    return bool(gauge.needles) and gauge.card is None


class NeedleKind:
    """Needles that are read one by one, or as a pair by the pixels around it."""

    is_searched = True

    def owns(self, gauge: Gauge) -> bool:
        return _has_still_face(gauge) and is_simple(gauge)

    def sampled_part(self, _grid: Grid) -> Part:
        return ALL

    def reader(
        self, instruments: Sequence[Instrument], appearance: Appearance, sampler: GaugeSampler, method: Method
    ) -> Reader:
        needles = [needle for instrument in instruments for needle in instrument.needles(appearance)]
        return _FoundReader(needles, NeedleReader(needles, sampler, method, appearance.evenly_lit_score))

    def first_look(self, drawn: DrawnInstrument) -> Look:
        return needles_in_picture(drawn)

    def learned_pictures(
        self, _: Instrument, __: Sequence[UnwrappedGauge], ___: Mapping[str, LearnedPicture]
    ) -> Mapping[str, LearnedPicture]:
        return {}

    def settled_pictures(
        self, _: Instrument, __: Sequence[UnwrappedGauge], ___: Mapping[str, LearnedPicture]
    ) -> Mapping[str, LearnedPicture]:
        return {}

    def unexplained(self, _: Placed, __: UnwrappedGauge, ___: Sequence[UnwrappedGauge]) -> float | None:
        return None

    def grower(self, _: Instrument, __: Appearance) -> Grower | None:
        return None

    def hidden_look(self, _: Instrument, __: Appearance, ___: Sequence[UnwrappedGauge]) -> Look | None:
        return None

    def pivot(self, instrument: Instrument, appearance: Appearance, frames: Sequence[SeenGauge]) -> Pivot:
        gauge, grid, face = instrument.gauge, instrument.grid, instrument.face
        return pivot_of_tilts(tilts_of(gauge, grid, face, appearance.templates, frames))

    def far_pivot(self, instrument: Instrument, strips: Sequence[UnwrappedGauge]) -> tuple[float, float] | None:
        return needle_pivot(instrument.grid, strips)

    def squeeze(self, _: Instrument, __: Sequence[UnwrappedGauge], *, is_lost: bool) -> Squeeze | None:
        del is_lost
        return None

    def seen_deg(
        self, instrument: Instrument, own: UnwrappedGauge, strips: Sequence[UnwrappedGauge]
    ) -> Sequence[tuple[float, float]]:
        cuts = self._cuts(instrument.gauge)
        seen = drawn_needles_deg(instrument.grid, cuts, own, strips)
        return [(at_deg, seen_deg) for (at_deg, _), seen_deg in zip(cuts, seen, strict=True) if seen_deg is not None]

    def findings(self, _: Gauge, __: Appearance) -> Sequence[str]:
        return ()

    @staticmethod
    def _cuts(gauge: Gauge) -> list[tuple[float, float]]:
        """List where needles are cut from the panel picture, and how wide, degrees."""
        cuts = [(each.at, each.span) for each in (needle.template for needle in gauge.needles) if each.picture is None]
        return [(at_deg, span_deg) for at_deg, span_deg in cuts if at_deg is not None and span_deg is not None]


class _Hands:
    def __init__(self, needles: Sequence[list[Needle]], sampler: GaugeSampler) -> None:
        self._readers = [(own, GearedReader(own)) for own in needles]
        self._sampler = sampler

    def read(self, frames: Sequence[Samples], place_sigmas_deg: Floats) -> Readings:
        readings: Readings = [{} for _ in frames]
        for needles, reader in self._readers:
            index = needles[0].gauge_index
            own_deg = place_sigmas_deg[:, index]
            together = reader.read(self._sampler.strips(frames, index))
            hands = readings_of(together.hands, needles, np.repeat(own_deg[:, None], len(needles), axis=1))
            for found, own, value, sigma_deg in zip(readings, hands, together.values, own_deg.tolist(), strict=True):
                found.update({**own, reader.name: value.in_place_within(reader.share * sigma_deg)})
        return readings


def _hand_alone(drawn: DrawnInstrument, look: Look, needle: DescribedNeedle) -> NeedleTemplate:
    """Return a hand's template without anything else that lies on its axis in its picture.

    That is numerals beyond its tip; and if the hand shows only near the rim, a hub or another hand further in.
    """
    template = look.templates[needle.name]
    is_filled = (template.transparency < HALF).all(axis=0)
    shows = np.ptp(template.pixels, axis=0) > 3 * NOISE_LEVELS
    covered = covers_axis(template) & (shows | is_filled)
    own = covered & ~is_filled & ~_others_reach(drawn, needle)
    is_hand = needle_columns(drawn.grid.tail_columns, covered, own)
    pixels, light, transparency = (
        np.where(is_hand, seen, nothing).astype(np.float32)
        for seen, nothing in (
            (template.pixels, median_of(look.face)),
            (template.light, 0.0),
            (template.transparency, 1.0),
        )
    )
    return NeedleTemplate(pixels, light, transparency, template.trust, template.step_deg)


def _others_reach(drawn: DrawnInstrument, needle: DescribedNeedle) -> Mask:
    """(C,): where the panel picture shows no gap between the axes of a needle and another, so it may show either."""
    strip, reach = drawn.strip, np.zeros(drawn.grid.columns, bool)
    if needle.template.at is None or needle.template.picture is not None:
        return reach
    own = row_of_angle(drawn.grid, needle.template.at)
    shows = np.abs(strip - median_of(strip))
    for rows in rows_to_others(drawn.gauge, needle, drawn.grid):
        first, last = np.rint(sorted((own, own + rows))).astype(int).clip(0, len(strip) - 1).tolist()
        here, there = (first, last) if rows > 0 else (last, first)
        gap = shows[first : last + 1].min(axis=0) < HALF * shows[here]
        reach |= ~gap & (shows[there] > 3 * NOISE_LEVELS)
    return reach


class GearedKind(NeedleKind):
    """Hands that show one value, such as those of an altimeter or a clock."""

    is_searched = False

    def first_look(self, drawn: DrawnInstrument) -> Look:
        """Cut each hand from where it begins to its tip only: the columns learned later from a flight may have gaps."""
        look = needles_in_picture(drawn)
        return replace(look, templates={each.name: _hand_alone(drawn, look, each) for each in drawn.gauge.needles})

    def hidden_look(
        self, instrument: Instrument, appearance: Appearance, strips: Sequence[UnwrappedGauge]
    ) -> Look | None:
        return learn_hidden_hand(instrument, appearance, strips)

    def owns(self, gauge: Gauge) -> bool:
        return gauge.combination is not None and len(gauge.combination.parts) == len(gauge.needles)

    def reader(
        self, instruments: Sequence[Instrument], appearance: Appearance, sampler: GaugeSampler, _: Method
    ) -> Reader:
        return _Hands([instrument.needles(appearance) for instrument in instruments], sampler)


class _StackFinder:
    def __init__(self, needles: Sequence[Sequence[Needle]], sampler: GaugeSampler) -> None:
        self._readers = [(own[0].gauge_index, StackReader(own)) for own in needles]
        self._sampler = sampler

    def read(self, frames: Sequence[Samples]) -> Found:
        found = [reader.read(self._sampler.strips(frames, index)) for index, reader in self._readers]
        return Found.beside(found)


class StackKind(NeedleKind):
    """Needles above each other, each read given what is known of the others."""

    is_searched = False

    def owns(self, gauge: Gauge) -> bool:
        return _has_still_face(gauge) and not is_simple(gauge)

    def reader(
        self, instruments: Sequence[Instrument], appearance: Appearance, sampler: GaugeSampler, _: Method
    ) -> Reader:
        needles = [instrument.needles(appearance) for instrument in instruments]
        return _FoundReader([needle for own in needles for needle in own], _StackFinder(needles, sampler))
