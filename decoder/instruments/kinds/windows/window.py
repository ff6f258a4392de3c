"""Common base of all kinds that are read in a window: they learn a picture, and nothing turns."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from decoder.imaging.unwrapping import UnwrappedGauge, WindowGrid
from decoder.instruments.appearance import Appearance, DrawnInstrument, Instrument, LearnedPicture, Look, Still
from decoder.instruments.reading import Reading, Readings
from decoder.instruments.sampling import GaugeSampler, Samples
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.panel.vocabulary import Method

# Standard deviation of a uniform distribution of width 1.
UNIFORM_SIGMA = 12**-0.5


class WindowReader(Protocol):
    """Reads one window."""

    def read(self, strips: Floats, place_sigmas_px: Floats) -> list[dict[str, Reading]]:
        """Read F frames of it, (F, R, C), by name; `place_sigmas_px` (F,) is the uncertainty of its position."""
        ...


class WindowKind(Still, ABC):
    """A kind that is read in a window; its picture is stored under the name of its first quantity."""

    is_searched = False

    @abstractmethod
    def owns(self, gauge: Gauge) -> bool:
        """Whether a gauge is of this kind."""

    @abstractmethod
    def first(self, gauge: Gauge, grid: WindowGrid, drawn: UnwrappedGauge) -> LearnedPicture:
        """Build its picture from the panel picture, (R, C)."""

    @abstractmethod
    def learned(
        self, gauge: Gauge, grid: WindowGrid, strips: Sequence[UnwrappedGauge], known: LearnedPicture
    ) -> LearnedPicture:
        """Learn its picture from a sample's frames, (R, C) each, in their own light."""

    @abstractmethod
    def window_reader(self, gauge: Gauge, grid: WindowGrid, picture: LearnedPicture) -> WindowReader:
        """Return a reader for it."""

    def reader(
        self, instruments: Sequence[Instrument], appearance: Appearance, sampler: GaugeSampler, _: Method
    ) -> _Windows:
        readers = {
            each.index: self.window_reader(each.gauge, each.window, appearance.pictures[_key(each.gauge)])
            for each in instruments
        }
        return _Windows(readers, [each.gauge.arc_px for each in instruments], sampler)

    def first_look(self, drawn: DrawnInstrument) -> Look:
        return Look(drawn.strip, pictures={_key(drawn.gauge): self.first(drawn.gauge, drawn.window, drawn.strip)})

    def learned_pictures(
        self, instrument: Instrument, strips: Sequence[UnwrappedGauge], known: Mapping[str, LearnedPicture]
    ) -> Mapping[str, LearnedPicture]:
        name = _key(instrument.gauge)
        return {name: self.learned(instrument.gauge, instrument.window, strips, known[name])}


def _key(gauge: Gauge) -> str:
    return gauge.quantities[0].name


class _Windows:
    """Reads all windows of one kind, by their index in the panel."""

    def __init__(self, readers: Mapping[int, WindowReader], arcs_px: Sequence[float], sampler: GaugeSampler) -> None:
        self._readers, self._arcs_px, self._sampler = readers, arcs_px, sampler

    def read(self, frames: Sequence[Samples], place_sigmas_deg: Floats) -> Readings:
        readings: Readings = [{} for _ in frames]
        for (index, reader), arc_px in zip(self._readers.items(), self._arcs_px, strict=True):
            sigmas_px = np.radians(place_sigmas_deg[:, index]) * arc_px
            found = reader.read(self._sampler.strips(frames, index), sigmas_px)
            readings = [before | own for before, own in zip(readings, found, strict=True)]
        return readings
