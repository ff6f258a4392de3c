"""The panel: what `panel.yaml` says of one cockpit, validated once at the edge and never again.

All positions are (x, y) in the panel picture's pixels, pixel centres on whole numbers; dial angles are degrees, 0 =
right, positive clockwise; a sweep may pass 360. Unknown keys are errors, and every message names the path of the
wrong value. The format is described for its authors in docs/panel.md.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Self

from pydantic import Field, field_validator, model_validator

from decoder.panel.arrays import NO_TRUTH, at_most
from decoder.panel.description import (
    FocalLength,
    Name,
    PictureName,
    Pixels,
    Point,
    ReferencePoint,
    Strict,
    Text,
    check_description,
    parse_description,
)
from decoder.panel.errors import PanelError
from decoder.panel.gauge import Gauge
from decoder.panel.kinds.needles import Needle
from decoder.panel.parameters import Column
from decoder.panel.scale import MOST_POINTS, Combination, Quantity
from decoder.panel.thresholds import MOST_NEEDLES

# No cockpit has half as many; each gauge and each anchor is searched for in every frame.
MOST_GAUGES, MOST_ANCHORS = 200, 200
LEADING_COLUMNS = ("frame", "time_utc", "time_s")
NEEDLE_SUFFIXES = ("", "_status", "_score", "_sigma")


Side = Annotated[float, Field(ge=8, allow_inf_nan=False), NO_TRUTH, at_most(1e5)]


class Anchor(Strict):
    """A fixed feature of the panel, found in every frame by NCC. `box` is left, top, width, height in pixels."""

    name: Text
    """What the flight data call it where it failed."""
    box: tuple[Pixels, Pixels, Side, Side]
    """Left, top, width, height, pixels; needs contrast and a shape that stands nowhere else."""


class Panel(Strict):
    """The instrument panel of one cockpit."""

    name: Text
    """Of the cockpit."""
    picture: PictureName
    """File beside the panel.yaml, or attached to the flight file under this name."""
    focal_length_mm: FocalLength | None = None
    """The zoom at which the picture was taken; frames of another are looked for at its scale."""
    reference_points: Annotated[tuple[ReferencePoint, ...], Field(max_length=MOST_POINTS)] = ()
    """Known places in inches: square up an oblique view, and tell where the camera was. Four or more, or three with a
    camera.yaml."""
    level: tuple[Point, Point] | None = None
    """Both ends of an edge that is vertical on the panel; tells the roll where there is one anchor."""
    anchors: Annotated[tuple[Anchor, ...], Field(min_length=1, max_length=MOST_ANCHORS)]
    """One gives the shift; with `level`, or two, roll too; four or more the full perspective."""
    gauges: Annotated[tuple[Gauge, ...], Field(min_length=1, max_length=MOST_GAUGES)]
    """At least one."""
    columns: Annotated[Mapping[Name, Column], Field(max_length=MOST_POINTS)] = {}
    """What is known of columns besides how they are read, by their names."""

    @field_validator("level")
    @classmethod
    def _level_has_length(cls, level: tuple[Point, Point] | None) -> tuple[Point, Point] | None:
        if level is not None and abs(level[1][1] - level[0][1]) + abs(level[1][0] - level[0][0]) < 16:  # noqa: PLR2004
            raise ValueError("is shorter than 16 pixels; mark a longer edge")
        return level

    @model_validator(mode="after")
    def _names_are_unique(self) -> Self:
        if len(self.needles) > MOST_NEEDLES:
            raise ValueError(f"has {len(self.needles)} needles, more than the {MOST_NEEDLES} that a panel may have")
        names = [quantity.name for quantity in self.quantities]
        columns = [*LEADING_COLUMNS, *(name + suffix for name in names for suffix in NEEDLE_SUFFIXES)]
        for column in _twice(columns):
            raise ValueError(f"two columns of the flight data would be called {column}; rename a needle")
        for name in self.columns:
            if name not in names:
                raise ValueError(f"`columns` names {name}, which no gauge shows; there are {', '.join(names)}")
        for name in _twice(gauge.name for gauge in self.gauges):
            raise ValueError(f"two gauges are called {name}; rename one")
        for name in _twice(anchor.name for anchor in self.anchors):
            raise ValueError(f"two anchors are called {name}; rename one")
        return self

    def with_columns(self, said: Mapping[str, Mapping[str, Any]]) -> Panel:
        """Add to, or replace, what is said of some columns.

        Raises
        ------
        PanelError
            If there is no such column, or no such parameter, or a limit is not a number.
        """
        if not said:
            return self
        there = {name: column.model_dump(exclude_none=True) for name, column in self.columns.items()}
        content = {"columns": {**there, **{name: there.get(name, {}) | dict(own) for name, own in said.items()}}}
        found = check_description(_Columns, content, error=PanelError, thing="option", source="--column").columns
        for name in found:
            if name not in {quantity.name for quantity in self.quantities}:
                raise PanelError(name, "is no column that this panel gives", source="--column")
        return self.model_copy(update={"columns": found})

    @property
    def needles(self) -> tuple[Needle, ...]:
        """All needles, in the order of the file."""
        return tuple(needle for gauge in self.gauges for needle in gauge.needles)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Everything that has a column in the flight data."""
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
        others = (name for gauge in self.gauges for name in gauge.pictures.values())
        return tuple(dict.fromkeys([self.picture, *others]))


class _Columns(Strict):
    """What is said of columns on a command line."""

    columns: Mapping[Name, Column]
    """As `Panel.columns`."""


def _twice(names: Iterable[str]) -> list[str]:
    return sorted(name for name, count in Counter(names).items() if count > 1)


def parse_panel(text: bytes | str, *, source: str = "panel.yaml") -> Panel:
    """Parse a panel's YAML.

    Raises
    ------
    PanelError
        Naming the path of the first wrong value, such as `gauges[2].sweep`.
    """
    return parse_description(Panel, text, error=PanelError, thing="panel", page="docs/panel.md", source=source)


def parse_content(content: object) -> Panel:
    """Check a content that was already parsed from YAML; see `parse_panel`."""
    return check_description(Panel, content, error=PanelError, thing="panel", source="panel.yaml")
