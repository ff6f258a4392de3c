"""Parameters: which column of the flight data is the aircraft's altitude, which its heading, and so on.

A column's name identifies it, without its unit: `heading_deg`, `hi_heading_deg` and `heading_2_deg` are headings, since
they end with that word; `heading_bug_deg` and `selected_heading_deg` are not. Where names do not tell, `columns` in
`panel.yaml` does.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from decoder.panel.arrays import Number
from decoder.panel.description import Strict
from decoder.panel.units import engine_stem_of

NONE = "none"
WORDS: dict[str, tuple[str, ...]] = {
    "airspeed": ("airspeed", "ias", "indicated_airspeed", "asi"),
    "true airspeed": ("tas", "true_airspeed"),
    "altitude": ("altitude", "alt", "altitude_baro", "altimeter"),
    "altimeter setting": ("altimeter_setting", "alt_setting", "baro", "qnh"),
    "vertical speed": ("vertical_speed", "vsi", "vs"),
    "pitch": ("pitch",),
    "roll": ("roll", "bank"),
    "heading": ("heading", "hdg"),
    "compass": ("compass",),
    "turn rate": ("turn_rate", "rate_of_turn"),
}
CLOCKWISE = ("airspeed", "true airspeed", "altitude", "vertical speed")
"""What rises clockwise on the dials of all makers."""
# Before the word, these mean that something other than the aircraft's own value is meant.
OTHERS = {"bug", "commanded", "gps", "preset", "radio", "sel", "selected", "set", "standby", "target", "true", "wind"}

Parameter = Literal[
    "airspeed", "true airspeed", "altitude", "altimeter setting", "vertical speed", "pitch", "roll", "heading",
    "compass", "turn rate", "none",
]  # fmt: skip


class Column(Strict):
    """What is known of a column of the flight data besides how it is read."""

    means: Parameter | None = None
    """Which of the aircraft's parameters it is, where its name does not tell or tells it wrongly; `none` for no one."""
    above: Annotated[Number, Field()] | None = None
    """A limit: values above it are listed as exceedances, in the column's unit."""
    below: Annotated[Number, Field()] | None = None
    """A limit: values below it are listed as exceedances."""

    @model_validator(mode="after")
    def _limits_leave_room(self) -> Self:
        if self.above is not None and self.below is not None and self.below >= self.above:
            raise ValueError("`below` must be less than `above`: between them nothing is exceeded")
        return self


def parameter_of(name: str) -> str | None:
    """Return which parameter a column is by its name; None if unknown."""
    stem, _ = engine_stem_of(name)
    for parameter, words in WORDS.items():
        for word in words:
            before = stem.removesuffix(word)
            if stem == word or (before != stem and before.endswith("_") and not OTHERS & set(before.split("_"))):
                return parameter
    return None
