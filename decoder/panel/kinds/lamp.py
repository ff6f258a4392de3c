"""A warning light, as `panel.yaml` describes it: a window that is lit or not."""

from __future__ import annotations

from typing import ClassVar

from decoder.panel.description import Name, Strict
from decoder.panel.kind import Control, Dial, Form, Windowed
from decoder.panel.scale import Quantity
from decoder.panel.written import BOOLEAN

PERCENT = 0.0, 100.0


class Lamp(Windowed, Strict):
    """A light that is on or off."""

    name: Name
    """Column of the flight data: true where it is lit."""
    lit: bool = False
    """Whether it is lit in the panel picture."""
    light: Name | None = None
    """Column of how much light it adds, in percent of what the camera can show; without it there is none."""

    form: ClassVar[Form] = Form(
        "lamp",
        "a `lamp`",
        "a lamp",
        "a lamp",
        begun={"name": "lamp_on"},
        controls=(
            Control("name", "Name"),
            Control("lit", "lit in this picture", "check"),
            Control("light", "Name of its light", "optional_text", "if how bright it is counts"),
        ),
        hint="Click the four corners of the light, clockwise from its top left, close around what shines.",
    )
    margin_part: ClassVar[float] = 1.5

    @property
    def brightens(self) -> bool:
        """Return whether it lights up, which a lamp that is dark in the panel picture does."""
        return not self.lit

    def check(self, _: Dial) -> None:
        """ValueError where both columns have one name."""
        if self.name == self.light:
            raise ValueError("a `lamp` needs another name for its `light`")
        if self.light is not None and self.lit:
            raise ValueError("tells a lamp's `light` only beyond a dark one: draw it on a picture in which it is off")

    def quantities(self, dial: Dial) -> tuple[Quantity, ...]:
        """Return whether it is lit, and how much light it adds."""
        state = Quantity.stepped(self.name, dial.name, "", BOOLEAN)
        if self.light is None:
            return (state,)
        marks = ((0.0, 0.0), (100.0, 100.0))
        return state, Quantity(self.light, dial.name, "%", marks, None, None, None, limits=PERCENT, is_drawn=False)
