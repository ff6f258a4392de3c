"""The kinds of instrument there are, behind one protocol, and the readers of one panel's instruments.

Whoever reads, learns or draws asks for a gauge's kind here and goes by the answer. A new kind is a module with a class
like those below, a line in `KINDS`, and its part of the schema in `decoder.panel.gauge`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Protocol

import numpy as np

from decoder.imaging.unwrapping import UnwrappedGauge, Unwrapper, rows_in_sweep
from decoder.instruments.appearance import (
    Appearance,
    DrawnInstrument,
    Instrument,
    LearnedPicture,
    Look,
    needles_in_picture,
)
from decoder.instruments.attitude import AttitudePicture, AttitudeReader, Attitudes, first_attitude, learn_attitude
from decoder.instruments.card import CardReader, first_card, learn_card
from decoder.instruments.found import Found, Needle, readings_of
from decoder.instruments.geared import GearedReader, told_together
from decoder.instruments.needle_lines import SeenGauge, pivot_of_tilts, tilts_of
from decoder.instruments.needles import NeedleReader, is_simple
from decoder.instruments.reading import Reading, Status
from decoder.instruments.sampling import GaugeSampler, Samples
from decoder.instruments.stack import StackReader
from decoder.matching.pivot_search import card_pivot, drawn_needles_deg, needle_pivot
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.panel.vocabulary import Method
from decoder.registration.placement import UNKNOWN, Pivot

Readings = list[dict[str, Reading]]
"""By frame the readings by name."""


class Reader(Protocol):
    """Reads all instruments of one kind on a panel, in many frames at once."""

    def read(self, frames: Sequence[Samples], place_sigmas_deg: Floats) -> Readings:
        """Read F frames; `place_sigmas_deg` (F, gauges) is how uncertain dials' places make angles."""
        ...


class Kind(Protocol):
    """One kind of instrument: all that the rest of the program needs of it."""

    is_searched: bool
    """Whether its gauges are searched on every third row and column of each frame."""

    def owns(self, gauge: Gauge) -> bool:
        """Whether a gauge is of this kind."""
        ...

    def reader(
        self, instruments: Sequence[Instrument], appearance: Appearance, sampler: GaugeSampler, method: Method
    ) -> Reader:
        """Return a reader of all gauges of this kind on a panel."""
        ...

    def first_look(self, drawn: DrawnInstrument) -> Look:
        """Return what the panel's pictures alone tell of it.

        Raises
        ------
        PanelError
            If they do not show it.
        """
        ...

    def learned_pictures(
        self, instrument: Instrument, strips: Sequence[UnwrappedGauge], known: Mapping[str, LearnedPicture]
    ) -> Mapping[str, LearnedPicture]:
        """Learn by quantity, from a sample's frames in one light, what its looks are besides face and templates."""
        ...

    def pivot(self, instrument: Instrument, appearance: Appearance, frames: Sequence[SeenGauge]) -> Pivot:
        """Return where it turns, relative to where it is unwrapped, as a sample's frames tell by what was read."""
        ...

    def far_pivot(
        self, instrument: Instrument, own: UnwrappedGauge, strips: Sequence[UnwrappedGauge]
    ) -> tuple[float, float] | None:
        """Return how far beside its centre it turns, (x, y) px of its own plane; None if it is near, or nothing tells.

        `own` is the gauge in the panel picture, `strips` are a sample's frames in its light.
        """
        ...

    def seen_deg(
        self, instrument: Instrument, own: UnwrappedGauge, strips: Sequence[UnwrappedGauge]
    ) -> Sequence[tuple[float, float]]:
        """Return of what turns where it is drawn, and where the panel picture shows it around its pivot.

        Of some of it, as of a card, a picture does not tell; of what never moves neither.
        """
        ...


class _Needles:
    """Needles that are read one by one, or as a pair by the pixels around it."""

    is_searched = True

    def owns(self, gauge: Gauge) -> bool:
        return bool(gauge.needles) and is_simple(gauge)

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

    def pivot(self, instrument: Instrument, appearance: Appearance, frames: Sequence[SeenGauge]) -> Pivot:
        gauge, grid, face = instrument.gauge, instrument.grid, instrument.face
        return pivot_of_tilts(tilts_of(gauge, grid, face, appearance.templates, frames))

    def far_pivot(
        self, instrument: Instrument, own: UnwrappedGauge, strips: Sequence[UnwrappedGauge]
    ) -> tuple[float, float] | None:
        gauge, grid = instrument.gauge, instrument.grid
        return needle_pivot(grid, rows_in_sweep(gauge, grid), self._cuts(gauge), own, strips)

    def seen_deg(
        self, instrument: Instrument, own: UnwrappedGauge, strips: Sequence[UnwrappedGauge]
    ) -> Sequence[tuple[float, float]]:
        cuts = self._cuts(instrument.gauge)
        seen = drawn_needles_deg(instrument.grid, cuts, own, strips)
        return [(at_deg, seen_deg) for (at_deg, _), seen_deg in zip(cuts, seen, strict=True) if seen_deg is not None]

    @staticmethod
    def _cuts(gauge: Gauge) -> list[tuple[float, float]]:
        """Where needles are cut out of the panel picture, and how many degrees."""
        cuts = [(each.at, each.span) for each in (needle.template for needle in gauge.needles) if each.picture is None]
        return [(at_deg, span_deg) for at_deg, span_deg in cuts if at_deg is not None and span_deg is not None]


class _Geared(_Needles):
    """Hands that tell one value: an altimeter's, a clock's."""

    is_searched = False

    def owns(self, gauge: Gauge) -> bool:
        return gauge.combination is not None and len(gauge.combination.parts) == len(gauge.needles)

    def reader(
        self, instruments: Sequence[Instrument], appearance: Appearance, sampler: GaugeSampler, _: Method
    ) -> Reader:
        return _Hands([instrument.needles(appearance) for instrument in instruments], sampler)


class _Stack(_Needles):
    """Needles above each other, each read by what is known of the others."""

    is_searched = False

    def owns(self, gauge: Gauge) -> bool:
        return bool(gauge.needles) and not is_simple(gauge)

    def reader(
        self, instruments: Sequence[Instrument], appearance: Appearance, sampler: GaugeSampler, _: Method
    ) -> Reader:
        needles = [instrument.needles(appearance) for instrument in instruments]
        return _FoundReader([needle for own in needles for needle in own], _Stacks(needles, sampler))


class _Card:
    """A card that turns under a fixed index."""

    is_searched = False

    def owns(self, gauge: Gauge) -> bool:
        return gauge.card is not None

    def reader(
        self, instruments: Sequence[Instrument], appearance: Appearance, sampler: GaugeSampler, _: Method
    ) -> Reader:
        return _Cards(instruments, appearance, sampler)

    def first_look(self, drawn: DrawnInstrument) -> Look:
        face = needles_in_picture(drawn).face
        return Look(face, pictures={self._name(drawn.gauge): first_card(face, drawn.grid)})

    def learned_pictures(
        self, instrument: Instrument, strips: Sequence[UnwrappedGauge], known: Mapping[str, LearnedPicture]
    ) -> Mapping[str, LearnedPicture]:
        name = self._name(instrument.gauge)
        return {name: learn_card(instrument.gauge, instrument.grid, strips, known[name])}

    def pivot(self, instrument: Instrument, appearance: Appearance, frames: Sequence[SeenGauge]) -> Pivot:
        reader = CardReader(instrument.gauge, instrument.grid, appearance.pictures[self._name(instrument.gauge)])
        return reader.pivot([strip for strip, _, _ in frames])

    def far_pivot(
        self, instrument: Instrument, _: UnwrappedGauge, strips: Sequence[UnwrappedGauge]
    ) -> tuple[float, float] | None:
        return card_pivot(instrument.grid, strips)

    def seen_deg(
        self, _: Instrument, __: UnwrappedGauge, ___: Sequence[UnwrappedGauge]
    ) -> Sequence[tuple[float, float]]:
        return []

    @staticmethod
    def _name(gauge: Gauge) -> str:
        return gauge.quantities[0].name


class _Attitude:
    """A horizon that turns and shifts behind a window; what is learned of it stands under its roll."""

    is_searched = False

    def owns(self, gauge: Gauge) -> bool:
        return gauge.attitude is not None

    def reader(
        self, instruments: Sequence[Instrument], appearance: Appearance, sampler: GaugeSampler, _: Method
    ) -> Reader:
        return _Attitudes(instruments, appearance, sampler)

    def first_look(self, drawn: DrawnInstrument) -> Look:
        own = Attitudes.of(drawn.gauge, drawn.grid)
        ring = None if own.own.ring is None else first_card(drawn.strip[:, own.ring], own.ring_grid)
        return Look(drawn.strip, pictures={own.own.roll: first_attitude(own, drawn.strip, ring)})

    def learned_pictures(
        self, instrument: Instrument, strips: Sequence[UnwrappedGauge], known: Mapping[str, LearnedPicture]
    ) -> Mapping[str, LearnedPicture]:
        own = Attitudes.of(instrument.gauge, instrument.grid)
        given: AttitudePicture = known[own.own.roll]
        if given.ring is not None:
            rings = [strip[:, own.ring] for strip in strips]
            given = replace(given, ring=learn_card(own.gauge, own.ring_grid, rings, given.ring))
        return {own.own.roll: learn_attitude(own, strips, given, _ring_of(own, given))}

    def pivot(self, instrument: Instrument, appearance: Appearance, frames: Sequence[SeenGauge]) -> Pivot:
        own = Attitudes.of(instrument.gauge, instrument.grid)
        ring = _ring_of(own, appearance.pictures[own.own.roll])
        return UNKNOWN if ring is None else ring.pivot([strip[:, own.ring] for strip, _, _ in frames])

    def far_pivot(self, _: Instrument, __: UnwrappedGauge, ___: Sequence[UnwrappedGauge]) -> tuple[float, float] | None:
        return None

    def seen_deg(
        self, _: Instrument, __: UnwrappedGauge, ___: Sequence[UnwrappedGauge]
    ) -> Sequence[tuple[float, float]]:
        return []


KINDS: tuple[Kind, ...] = (_Needles(), _Geared(), _Stack(), _Card(), _Attitude())


def kind_of(gauge: Gauge) -> Kind:
    """Return the kind of a gauge."""
    return next(kind for kind in KINDS if kind.owns(gauge))


class _FindsNeedles(Protocol):
    def read(self, frames: Sequence[Samples]) -> Found: ...


class _FoundReader:
    """Makes readings of what is found of needles, (F, K)."""

    def __init__(self, needles: Sequence[Needle], finder: _FindsNeedles) -> None:
        self._needles, self._finder = list(needles), finder
        self._gauges = [needle.gauge_index for needle in needles]

    def read(self, frames: Sequence[Samples], place_sigmas_deg: Floats) -> Readings:
        return readings_of(self._finder.read(frames), self._needles, place_sigmas_deg[:, self._gauges])


class _Stacks:
    def __init__(self, needles: Sequence[Sequence[Needle]], sampler: GaugeSampler) -> None:
        self._readers = [(own[0].gauge_index, StackReader(own)) for own in needles]
        self._sampler = sampler

    def read(self, frames: Sequence[Samples]) -> Found:
        found = [reader.read(self._sampler.strips(frames, index)) for index, reader in self._readers]
        return Found.beside(found)


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


class _Cards:
    def __init__(self, instruments: Sequence[Instrument], appearance: Appearance, sampler: GaugeSampler) -> None:
        names = [instrument.gauge.quantities[0].name for instrument in instruments]
        self._readers = [
            (name, instrument.index, CardReader(instrument.gauge, instrument.grid, appearance.pictures[name]))
            for name, instrument in zip(names, instruments, strict=True)
        ]
        self._sampler = sampler

    def read(self, frames: Sequence[Samples], place_sigmas_deg: Floats) -> Readings:
        columns = {
            name: [
                reading.in_place_within(sigma_deg)
                for reading, sigma_deg in zip(
                    reader.read(self._sampler.strips(frames, index)), place_sigmas_deg[:, index].tolist(), strict=True
                )
            ]
            for name, index, reader in self._readers
        }
        return [dict(zip(columns, own, strict=True)) for own in zip(*columns.values(), strict=True)]


def _ring_of(own: Attitudes, picture: AttitudePicture) -> CardReader | None:
    """Return what reads the ring around a horizon, if one turns."""
    return None if picture.ring is None else CardReader(own.gauge, own.ring_grid, picture.ring)


class _Attitudes:
    def __init__(self, instruments: Sequence[Instrument], appearance: Appearance, sampler: GaugeSampler) -> None:
        self._readers: list[tuple[list[str], int, AttitudeReader]] = []
        for instrument in instruments:
            own = Attitudes.of(instrument.gauge, instrument.grid)
            picture: AttitudePicture = appearance.pictures[own.own.roll]
            reader = AttitudeReader(own, picture, _ring_of(own, picture))
            self._readers.append(([own.own.roll, own.own.pitch], instrument.index, reader))
        self._sampler = sampler

    def read(self, frames: Sequence[Samples], place_sigmas_deg: Floats) -> Readings:
        readings: Readings = [{} for _ in frames]
        for names, index, reader in self._readers:
            found = reader.read(self._sampler.strips(frames, index))
            for own, both, sigma_deg in zip(readings, found, place_sigmas_deg[:, index].tolist(), strict=True):
                own |= {name: one.in_place_within(sigma_deg) for name, one in zip(names, both, strict=True)}
        return readings


class InstrumentReaders:
    """Reads all instruments of one panel.

    Parameters
    ----------
    gauges
        From the panel.
    unwrapper
        Of their grids, in the same order.
    """

    def __init__(self, gauges: Sequence[Gauge], unwrapper: Unwrapper, appearance: Appearance, method: Method) -> None:
        self._gauges, self._unwrapper = gauges, unwrapper
        self.appearance, self.method = appearance, method
        plain = method is Method.XCORR  # then every needle is looked for by itself
        self._kinds = [KINDS[0] if plain and gauge.needles else kind_of(gauge) for gauge in gauges]

    @cached_property
    def sampler(self) -> GaugeSampler:
        """Samples the panel's gauges."""
        return GaugeSampler(self._unwrapper, [index for index, kind in enumerate(self._kinds) if kind.is_searched])

    @cached_property
    def _readers(self) -> list[Reader]:
        parts = zip(self._gauges, self._unwrapper.grids, self.appearance.faces, strict=True)
        instruments = [Instrument(index, *own) for index, own in enumerate(parts)]
        of_kinds = [
            (kind, [own for own, its in zip(instruments, self._kinds, strict=True) if its is kind]) for kind in KINDS
        ]
        return [kind.reader(own, self.appearance, self.sampler, self.method) for kind, own in of_kinds if own]

    def with_appearance(self, appearance: Appearance) -> InstrumentReaders:
        """Return readers of the same panel that have learned something else."""
        readers = InstrumentReaders(self._gauges, self._unwrapper, appearance, self.method)
        readers.sampler = self.sampler
        return readers

    def read(self, frames: Sequence[Samples], whole: Sequence[Sequence[bool]], place_sigmas_deg: Floats) -> Readings:
        """Read F frames; what is read of one does not depend on the others.

        Parameters
        ----------
        frames
            As `sampler` takes them.
        whole
            By frame for each gauge whether all of it lies in the frame: else nothing is known of it.
        place_sigmas_deg
            (F, gauges): what angles are uncertain by because the places of their dials are.
        """
        if not frames:
            return []
        parts = [reader.read(frames, place_sigmas_deg) for reader in self._readers]
        found = [
            {name: reading for part in parts for name, reading in part[number].items()} for number in range(len(frames))
        ]
        return [
            {
                name: reading
                for gauge, is_whole in zip(self._gauges, there, strict=True)
                for name, reading in _told(gauge, own, is_whole=is_whole).items()
            }
            for own, there in zip(found, whole, strict=True)
        ]


def _told(gauge: Gauge, found: Mapping[str, Reading], *, is_whole: bool) -> dict[str, Reading]:
    """By name what one gauge tells in one frame: its quantities, and what several of them show together."""
    names = [quantity.name for quantity in gauge.quantities]
    together = None if gauge.combination is None else gauge.combination.quantity.name
    if not is_whole:
        unread = Reading(Status.MISSING, np.nan, np.inf, 0.0)
        return dict.fromkeys([*names, *([] if together is None else [together])], unread)
    own = {name: found[name] for name in names}
    if together is None:
        return own
    return own | {together: found[together] if together in found else told_together(gauge, own)}
