"""What turns on a gauge: needles with their templates, a card under an index, pointers that count for each other.

A part of the panel format, see `decoder.panel`; for its writers docs/panel.md.
"""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, field_validator, model_validator

from decoder.description import Number, Positive, Strict
from decoder.scale_marks import Marks, check_turn, monotone

MIN_TEMPLATE_SPAN_DEG = 2.0

Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]


class Template(Strict):
    """Where a needle's template comes from.

    `at` and `span`: cut from the panel picture (or from `picture`, another picture of the same panel and size) around
    the angle `at`, `span` degrees wide. `picture` without `at`: a cropped unwrapped needle, rows of angle by columns
    of radius over the gauge's whole `radius`, `span` degrees high, its needle in the middle row.
    """

    at: Number | None = None
    """The angle at which the needle points where it is cut."""
    span: Annotated[float, Field(ge=MIN_TEMPLATE_SPAN_DEG, le=90)] | None = None
    """How many degrees are cut, two or three times the width of the needle."""
    picture: str | None = None
    """With `at`: another picture of the panel to cut from. Without: a cropped unwrapped needle."""

    @model_validator(mode="after")
    def _has_a_source(self) -> Self:
        if self.at is None and self.picture is None:
            raise ValueError(
                "give `at` (the needle's angle in the panel picture) or `picture` (a cropped unwrapped needle)"
            )
        if self.at is not None and self.span is None:
            raise ValueError("`at` needs `span`, the degrees that the template covers")
        return self


class Needle(Strict):
    """One pointer. `covered_by` names the needle of the same gauge that turns above it.

    A `scale` of its own, with its own `wraps`, stands in for the gauge's. `max_rate` is how fast its value can change,
    in its unit a second.
    """

    name: Name
    """Column of the flight data: letters, digits and underscores, the unit at its end."""
    template: Template
    """What it looks like."""
    covered_by: str | None = None
    """The needle of the same gauge that turns above this one."""
    scale: Marks | None = None
    """Its own, where it shows another thing than the gauge."""
    wraps: Positive | None = None
    """Its own, beside its own scale."""
    max_rate: Positive | None = None
    """How fast its value can change, in its unit a second; what is faster is listed among the outliers."""

    @field_validator("scale")
    @classmethod
    def _scale_is_monotone(cls, scale: Marks | None) -> Marks | None:
        return None if scale is None else monotone(scale)

    @model_validator(mode="after")
    def _turn_closes(self) -> Self:
        if self.wraps is not None:
            if self.scale is None:
                raise ValueError("`wraps` of a needle needs a `scale` beside it; the gauge's scale has the gauge's")
            check_turn(self.scale, self.wraps)
        return self


class Card(Strict):
    """A card that turns under a fixed index, at an angle of the dial. The gauge's scale is the card's own.

    The scale tells the angles at which its marks lie in the panel picture.
    """

    name: Name
    """Column of the flight data, as of a needle."""
    index: Number
    """The angle on the dial at which it is read."""
    max_rate: Positive | None = None
    """How fast its value can change, in its unit a second."""


class Combined(Strict):
    """A value that several pointers of one gauge show together, such as the altitude of a three-pointer altimeter.

    Values lie in a turn of the coarsest pointer that begins at `lowest`. `tolerance` is how far a coarser pointer may
    be from where the finer one puts it, in turns of the finer.
    """

    name: Name
    """Column of the flight data, as of a needle."""
    needles: Annotated[tuple[Name, ...], Field(min_length=2)]
    """Which count for each other; a turn of each is a whole number of turns of the next finer."""
    tolerance: Annotated[float, Field(gt=0, lt=0.5)] = 0.2
    """How far a coarser needle may be from where the finer one puts it, in turns of the finer."""
    lowest: Number = 0.0
    """Where its values begin."""
    max_rate: Positive | None = None
    """How fast its value can change, in its unit a second."""
