"""Instruments as their kinds have them: drawn in a panel, and with what they look like beyond its description."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.unwrapping import PolarGrid, UnwrappedGauge
from decoder.instruments.found import Needle
from decoder.matching.needle_template import NeedleTemplate
from decoder.panel.gauge import Gauge


@dataclass(frozen=True, slots=True)
class CardPicture:
    """A card that turns, as it lies in the panel picture; both (P, C) float32, one turn of rows from the sweep's start.

    Attributes
    ----------
    card
        Its grey levels.
    weights
        In [0, 1]: where on the dial, which stands still, the card is to be seen.
    """

    card: UnwrappedGauge
    weights: UnwrappedGauge

    @property
    def is_learned(self) -> bool:
        """Whether a flight told the card from what stands still over it."""
        return bool((self.weights < 1.0).any())


LearnedPicture = Any
"""What a kind learns of a quantity beside a dial's face and templates; only that kind understands it."""


@dataclass(frozen=True, slots=True)
class Look:
    """What one instrument looks like: as `Appearance`, of its own quantities."""

    face: UnwrappedGauge
    templates: Mapping[str, NeedleTemplate] = field(default_factory=dict)
    pictures: Mapping[str, LearnedPicture] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Appearance:
    """First taken from the panel picture alone (`panel_appearance`), then from the flight's own frames.

    Where things are is the other half of what a flight teaches: `decoder.registration.placement.Placement`.

    Attributes
    ----------
    templates
        By needle.
    faces
        For each gauge in the panel's order, the unwrapped dial without needles, (rows, columns) float32.
    evenly_lit_score
        What a needle in even light scores at least. One that matches less well may stand in a light that changes over
        the dial, which moves its reading.
    pictures
        By quantity, of the kinds that learn more than needles do.
    doubted
        Needles that were found in few of the sampled frames only. What is found of them may be what lay behind them in
        the panel picture.
    """

    templates: Mapping[str, NeedleTemplate]
    faces: tuple[UnwrappedGauge, ...]
    evenly_lit_score: float
    pictures: Mapping[str, LearnedPicture] = field(default_factory=dict)
    doubted: frozenset[str] = frozenset()

    @classmethod
    def of(cls, looks: Sequence[Look], evenly_lit_score: float) -> Appearance:
        """Gather what a panel's instruments look like, in the panel's order."""
        templates = {name: template for look in looks for name, template in look.templates.items()}
        pictures = {name: picture for look in looks for name, picture in look.pictures.items()}
        return cls(templates, tuple(look.face for look in looks), evenly_lit_score, pictures)


@dataclass(frozen=True, slots=True)
class DrawnInstrument:
    """One gauge, `index` its place in the panel, and how the panel picture shows it: `strip`, on its grid."""

    source: PanelPictures
    index: int
    gauge: Gauge
    grid: PolarGrid
    strip: UnwrappedGauge


@dataclass(frozen=True, slots=True)
class Instrument:
    """One gauge of a panel as its kind sees it; `index` is its place in the panel, `face` the dial without needles."""

    index: int
    gauge: Gauge
    grid: PolarGrid
    face: UnwrappedGauge

    def needles(self, appearance: Appearance) -> list[Needle]:
        """Return its needles as they are looked for."""
        return [
            Needle(needle.name, self.index, self.gauge, self.grid, self.face, appearance.templates[needle.name])
            for needle in self.gauge.needles
        ]
