"""Needles and bugs over a card that turns, as `panel.yaml` describes them: a `card` and `needles` on one gauge."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from decoder.panel.kind import DescribedKind, Dial, Form, Plain, Pointer, Polar
from decoder.panel.scale import Marks, Quantity, Scale


class _Card(DescribedKind, Protocol):
    """What is needed of `decoder.panel.kinds.card.Card`."""

    name: str
    index: float
    ring: float | None


class _Needle(Protocol):
    """What is needed of `decoder.panel.kinds.needles.Needle`."""

    name: str
    scale: Marks | None
    wraps: float | None
    on_card: str | None


class _Needles(DescribedKind, Protocol):
    """What is needed of `decoder.panel.kinds.needles.Needles`."""

    @property
    def each(self) -> Sequence[_Needle]: ...


@dataclass(frozen=True, slots=True)
class OverCard(Plain):
    """Needles over a card. One without a scale of its own shows what stands on the card where it points."""

    form: ClassVar[Form] = Form("card", "`needles` over a `card`", "needles over a card", "a card and needles")

    card: _Card
    needles: _Needles

    def check(self, dial: Dial) -> None:
        """ValueError where card or needles do not go all the way round, or a needle says too little."""
        if dial.wraps is None:
            raise ValueError("a `card` goes all the way round: give `wraps`, the value of a turn")
        if self.card.ring is not None and not dial.radius[0] <= self.card.ring <= dial.radius[1] - 2:
            raise ValueError("`ring` must lie within the gauge's `radius`, two pixels or more from the outer one")
        for needle in self.needles.each:
            if needle.scale is not None and needle.wraps is None:
                raise ValueError(
                    f"needle {needle.name}: over a card its own `scale` needs `wraps`, what a turn is worth"
                )
            if needle.on_card is not None and needle.scale is None:
                raise ValueError(
                    f"needle {needle.name}: `on_card` needs a `scale` of its own beside it: without one it is read on"
                    " the card already"
                )
        self.needles.check(dial)

    def quantities(self, dial: Dial) -> tuple[Quantity, ...]:
        """Return the card's value under the index, then for each needle its own, and the card's value below it."""
        on_card = tuple(
            Quantity(needle.on_card, dial.name, dial.unit, dial.scale, dial.wraps, None, None)
            for needle in self.needles.each
            if needle.on_card is not None
        )
        return self.card.quantities(dial) + self.needles.quantities(dial) + on_card

    def pointers(self) -> tuple[Pointer, ...]:
        """Return the index, and the needles."""
        return self.card.pointers() + self.needles.pointers()

    def lines(self, dial: Dial, values: Mapping[str, float]) -> Mapping[str, tuple[Polar, Polar] | None]:
        """Return the lines of needles that are read on the card, allowing for its turn; None if that is unknown."""
        card = Scale.of(dial.scale, dial.wraps)
        (under_deg,) = card.angles_of(np.array([values[self.card.name]])).tolist()
        lines: dict[str, tuple[Polar, Polar] | None] = {}
        for needle in self._read_on_card():
            (on_card_deg,) = card.angles_of(np.array([values[needle.name]])).tolist()
            at_deg = on_card_deg + self.card.index - under_deg
            ends = (at_deg, dial.radius[0]), (at_deg, dial.radius[1])
            lines[needle.name] = ends if math.isfinite(at_deg) else None
        return lines

    def _read_on_card(self) -> list[_Needle]:
        return [needle for needle in self.needles.each if needle.scale is None]

    def unwrapped_deg(self, dial: Dial) -> tuple[float, float]:
        """Return one turn, and as much more as needles need."""
        return self.needles.unwrapped_deg(dial)

    def pictures(self) -> Mapping[str, str]:
        """Return those that needles' templates are cut from, or are."""
        return self.needles.pictures()

    def at_angles(self, true_deg: Callable[[float], float]) -> Mapping[str, object]:
        """Return card and needles, each angle exchanged for the true one."""
        return {**self.card.at_angles(true_deg), **self.needles.at_angles(true_deg)}
