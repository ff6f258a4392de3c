"""The kinds of instrument there are, and the readers of one panel's instruments.

Whatever reads, learns or draws asks here for a gauge's kind, and uses only that. A new kind is a module in `kinds`, a
line in `KINDS`, and its part of the schema in `decoder.panel.gauge`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from decoder.imaging.unwrapping import Unwrapper
from decoder.instruments.appearance import Appearance, Instrument
from decoder.instruments.kind import Kind
from decoder.instruments.kinds.dials.attitude import AttitudeKind
from decoder.instruments.kinds.dials.ball import BallKind
from decoder.instruments.kinds.dials.card import CardKind
from decoder.instruments.kinds.dials.geared import told_together
from decoder.instruments.kinds.dials.needle_dials import GearedKind, NeedleKind, StackKind
from decoder.instruments.kinds.dials.over_card import OverCardKind
from decoder.instruments.kinds.windows.digits import DigitsKind
from decoder.instruments.kinds.windows.lamp import LampKind
from decoder.instruments.kinds.windows.linear import LinearKind
from decoder.instruments.kinds.windows.printed import PrintedKind
from decoder.instruments.kinds.windows.tape import TapeKind
from decoder.instruments.reading import Reading, Readings, Status
from decoder.instruments.sampling import GaugeSampler, Reader, Samples
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.panel.vocabulary import Method

_NEEDLES: tuple[Kind, ...] = (NeedleKind(), GearedKind(), StackKind())
KINDS: tuple[Kind, ...] = (
    *_NEEDLES,
    CardKind(),
    AttitudeKind(),
    OverCardKind(_NEEDLES),
    BallKind(_NEEDLES[0]),
    LampKind(),
    LinearKind(),
    TapeKind(),
    DigitsKind(),
    PrintedKind(),
)


def kind_of(gauge: Gauge) -> Kind:
    """Return the kind of a gauge."""
    return next(kind for kind in KINDS if kind.owns(gauge))


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
        plain = method is Method.XCORR  # then every needle is searched for by itself
        kinds = [kind_of(gauge) for gauge in gauges]
        self._kinds = [KINDS[0] if plain and isinstance(kind, NeedleKind) else kind for kind in kinds]

    @cached_property
    def sampler(self) -> GaugeSampler:
        """Samples the panel's gauges."""
        searched = [index for index, kind in enumerate(self._kinds) if kind.is_searched]
        parts = [kind.sampled_part(grid) for kind, grid in zip(self._kinds, self._unwrapper.grids, strict=True)]
        return GaugeSampler(self._unwrapper, searched, dict(enumerate(parts)))

    @cached_property
    def _readers(self) -> list[Reader]:
        parts = zip(self._gauges, self._unwrapper.grids, self.appearance.faces, strict=True)
        instruments = [Instrument(index, *own) for index, own in enumerate(parts)]
        of_kinds = [
            (kind, [own for own, its in zip(instruments, self._kinds, strict=True) if its is kind]) for kind in KINDS
        ]
        return [kind.reader(own, self.appearance, self.sampler, self.method) for kind, own in of_kinds if own]

    @cached_property
    def _columns(self) -> list[_Columns]:
        return [_Columns.of(gauge) for gauge in self._gauges]

    def with_appearance(self, appearance: Appearance) -> InstrumentReaders:
        """Return readers of the same panel with another appearance."""
        readers = InstrumentReaders(self._gauges, self._unwrapper, appearance, self.method)
        readers.sampler = self.sampler
        return readers

    def read(self, frames: Sequence[Samples], whole: Sequence[Sequence[bool]], place_sigmas_deg: Floats) -> Readings:
        """Read F frames, each independently of the others.

        Parameters
        ----------
        frames
            As `sampler` takes them.
        whole
            For each frame and gauge, whether all of it lies in the frame; if not, it is missing.
        place_sigmas_deg
            (F, gauges): the uncertainty of angles due to the positions of their dials.
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
                for columns, is_whole in zip(self._columns, there, strict=True)
                for name, reading in columns.told(own, is_whole=is_whole).items()
            }
            for own, there in zip(found, whole, strict=True)
        ]


@dataclass(frozen=True, slots=True)
class _Columns:
    """What is read of one gauge: the names of its quantities, and of what several of them show together."""

    gauge: Gauge
    names: tuple[str, ...]
    together: str | None

    @classmethod
    def of(cls, gauge: Gauge) -> Self:
        """Collect the names once, as frames are many."""
        together = None if gauge.combination is None else gauge.combination.quantity.name
        return cls(gauge, tuple(quantity.name for quantity in gauge.quantities), together)

    def told(self, found: Mapping[str, Reading], *, is_whole: bool) -> dict[str, Reading]:
        """Return by name what the gauge tells in one frame."""
        if not is_whole:
            unread = Reading(Status.MISSING, np.nan, np.inf, 0.0)
            return dict.fromkeys([*self.names, *([] if self.together is None else [self.together])], unread)
        own = {name: found[name] for name in self.names}
        if self.together is None:
            return own
        value = found[self.together] if self.together in found else told_together(self.gauge, own)
        return own | {self.together: value}
