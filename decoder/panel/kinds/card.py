"""A card that turns under a fixed index, as `panel.yaml` describes it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import ClassVar

from decoder.panel.arrays import Degrees
from decoder.panel.description import Name, Positive, Strict
from decoder.panel.kind import Control, Dial, Drawn, Form, Plain, Pointer, Usual
from decoder.panel.scale import FULL_CIRCLE_DEG, Quantity

UP_DEG = 270.0


class Card(Plain, Strict):
    """A card that turns under a fixed index, at an angle of the dial. The gauge's scale is the card's own.

    The scale tells the angles at which its marks lie in the panel picture.
    """

    name: Name
    """Column of the flight data, as of a needle."""
    index: Degrees = UP_DEG
    """The angle on the dial at which it is read; straight up in the panel picture if left out."""
    ring: Positive | None = None
    """Of a card under needles: from so far outwards its marks lie, pixels; without it they lie in all of `radius`."""
    max_rate: Positive | None = None
    """How fast its value can change, in its unit a second."""

    form: ClassVar[Form] = Form(
        "card",
        "a `card` that turns under an index",
        "a card under an index",
        "a card",
        begun={},
        controls=(
            Control("name", "Name"),
            Control("index", "Index at", "optional", "degrees; 270, straight up", is_angle=True),
            Control("ring", "Its marks from", "optional", "pixels from the centre, under needles"),
            Control("max_rate", "Fastest change", "optional", "a second, if known"),
        ),
        hint="Click its marks wherever the card is turned in this picture, and say what a turn is worth.",
        turning="radius",
        usual=(Usual("heading", "deg", ("heading_deg",), FULL_CIRCLE_DEG),),
    )

    def check(self, dial: Dial) -> None:
        """ValueError where it does not go all the way round."""
        if self.ring is not None:
            raise ValueError("a `card` without needles needs no `ring`: give `radius` from where its marks lie")
        if dial.wraps is None or dial.tail:
            raise ValueError("a `card` goes all the way round: give `wraps`, the value of a turn, and no `tail`")

    def quantities(self, dial: Dial) -> tuple[Quantity, ...]:
        """Return the one that stands under the index."""
        own = self.name, dial.name, dial.unit, dial.scale, dial.wraps, None, self.max_rate
        return (Quantity(*own, has_drawn_zero=True, has_upright_zero=not self._has_drawn_index),)

    def pointers(self) -> tuple[Pointer, ...]:
        """Return the index."""
        return (Pointer(self.name, self.index, is_fixed=True),)

    def at_angles(self, true_deg: Callable[[float], float]) -> Mapping[str, object]:
        """Return it with its index at its true angle, or straight up if it was left out; its marks are the gauge's."""
        return {self.form.key: self.model_copy(update={"index": true_deg(self.index)} if self._has_drawn_index else {})}

    @property
    def _has_drawn_index(self) -> bool:
        return "index" in self.model_fields_set

    @staticmethod
    def carry(gauge: Drawn, turn_deg: float, size: float, angles_deg: Mapping[str, float]) -> float:
        """Turn the index and enlarge the ring; the scale lies as the card is turned there."""
        card = gauge["card"]
        index_deg = card.get("index", UP_DEG)
        card_turn_deg = float(index_deg - angles_deg.get(card["name"], index_deg))
        card["index"] = round(index_deg + turn_deg, 4)
        if card.get("ring"):
            card["ring"] = round(card["ring"] * size, 3)
        return card_turn_deg
