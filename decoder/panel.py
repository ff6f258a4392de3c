"""The panel: what `panel.yaml` says of one cockpit, checked once at the edge and never again.

All positions are (x, y) in the panel picture's pixels, pixel centres on whole numbers; dial angles are degrees, 0 =
right, positive clockwise; a sweep may pass 360. Unknown keys are errors, and every message names the path of the
wrong value. The format is described for its writers in docs/panel.md.
"""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, field_validator, model_validator

from decoder.description import Number, Point, Positive, Strict, check_description, parse_description
from decoder.errors import PanelError
from decoder.gauge import Gauge
from decoder.pointers import Needle
from decoder.quantity import Combination, Quantity

LEADING_COLUMNS = ("frame", "time_utc", "time_s")
NEEDLE_SUFFIXES = ("", "_status", "_score", "_sigma")


class ReferencePoint(Strict):
    """A place on the panel known in inches."""

    at: Point
    """The place in the panel picture."""
    inches: Point
    """The same place on the panel; y may count up or down."""


class Anchor(Strict):
    """A fixed feature of the panel, found in every frame by NCC. `box` is left, top, width, height in pixels."""

    name: str
    """What the flight data call it where it failed."""
    box: tuple[Number, Number, Annotated[float, Field(ge=8)], Annotated[float, Field(ge=8)]]
    """Left, top, width, height, pixels; needs contrast and a shape that stands nowhere else."""


class Panel(Strict):
    """The instrument panel of one cockpit."""

    name: str
    """Of the cockpit."""
    picture: str
    """File beside the panel.yaml, or attached to the flight file under this name."""
    focal_length_mm: Positive | None = None
    """The zoom at which the picture was taken; frames of another are looked for at its scale."""
    reference_points: tuple[ReferencePoint, ...] = ()
    """Known places in inches: square up an oblique view, and tell where the camera was. Four or more, or three with a
    camera.yaml."""
    level: tuple[Point, Point] | None = None
    """Both ends of an edge that is vertical on the panel; tells the roll where there is one anchor."""
    anchors: Annotated[tuple[Anchor, ...], Field(min_length=1)]
    """One gives the shift; with `level`, or two, roll too; four or more the full perspective."""
    gauges: Annotated[tuple[Gauge, ...], Field(min_length=1)]
    """At least one."""

    @field_validator("level")
    @classmethod
    def _level_has_length(cls, level: tuple[Point, Point] | None) -> tuple[Point, Point] | None:
        if level is not None and abs(level[1][1] - level[0][1]) + abs(level[1][0] - level[0][0]) < 16:  # noqa: PLR2004
            raise ValueError("is shorter than 16 pixels; mark a longer edge")
        return level

    @model_validator(mode="after")
    def _columns_are_unique(self) -> Self:
        columns = list(LEADING_COLUMNS)
        for quantity in self.quantities:
            columns += [quantity.name + suffix for suffix in NEEDLE_SUFFIXES]
        twice = sorted({column for column in columns if columns.count(column) > 1})
        if twice:
            raise ValueError(f"two columns of the flight data would be called {twice[0]}; rename a needle")
        return self

    @property
    def needles(self) -> tuple[Needle, ...]:
        """All needles, in the order of the file."""
        return tuple(needle for gauge in self.gauges for needle in gauge.needles)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """All that the flight data have columns for."""
        return tuple(quantity for gauge in self.gauges for quantity in gauge.quantities) + tuple(
            combination.quantity for combination in self.combinations
        )

    @property
    def combinations(self) -> tuple[Combination, ...]:
        """All values that several needles show together."""
        return tuple(gauge.combination for gauge in self.gauges if gauge.combination is not None)

    @property
    def pictures(self) -> tuple[str, ...]:
        """The names of all pictures that the panel refers to, each once, the panel picture first."""
        templates = (needle.template.picture for needle in self.needles)
        return tuple(dict.fromkeys([self.picture, *(name for name in templates if name is not None)]))


def parse_panel(text: bytes | str, *, source: str = "panel.yaml") -> Panel:
    """The panel that a YAML text describes.

    Raises
    ------
    PanelError
        Naming the path of the first wrong value, such as `gauges[2].sweep`.
    """
    return parse_description(Panel, text, error=PanelError, thing="panel", page="docs/panel.md", source=source)


def parse_content(content: object, *, source: str = "panel.yaml") -> Panel:
    """The panel that a content describes which is no YAML text any more; see `parse_panel`."""
    return check_description(Panel, content, error=PanelError, thing="panel", source=source)
