"""The panel: what `panel.yaml` says of one cockpit, checked once at the edge and never again.

All positions are (x, y) in the panel picture's pixels, pixel centres on whole numbers; dial angles are degrees, 0 =
right, positive clockwise; a sweep may pass 360. Unknown keys are errors, and every message names the path of the
wrong value. The format is described for its writers in docs/panel.md.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Self

from pydantic import Field, field_validator, model_validator

from decoder.description import Number, Point, Positive, Strict, parse_description
from decoder.errors import PanelError

FULL_CIRCLE_DEG = 360.0
MIN_TEMPLATE_SPAN_DEG = 2.0
LEADING_COLUMNS = ("frame", "time_utc", "time_s")
NEEDLE_SUFFIXES = ("", "_status", "_score", "_sigma")

Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]


class ReferencePoint(Strict):
    """A place on the panel known in inches."""

    at: Point
    inches: Point


class Anchor(Strict):
    """A fixed feature of the panel, found in every frame by NCC. `box` is left, top, width, height in pixels."""

    name: str
    box: tuple[Number, Number, Annotated[float, Field(ge=8)], Annotated[float, Field(ge=8)]]


class Template(Strict):
    """Where a needle's template comes from.

    `at` and `span`: cut from the panel picture (or from `picture`, another picture of the same panel and size) around
    the angle `at`, `span` degrees wide. `picture` without `at`: a cropped unwrapped needle, rows of angle by columns
    of radius over the gauge's whole `radius`, `span` degrees high, its needle in the middle row.
    """

    at: Number | None = None
    span: Annotated[float, Field(ge=MIN_TEMPLATE_SPAN_DEG, le=90)] | None = None
    picture: str | None = None

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
    """One pointer. `covered_by` names the needle of the same gauge that turns above it."""

    name: Name
    template: Template
    covered_by: str | None = None


class Gauge(Strict):
    """One dial: where it is, what it covers, what its marks mean, and the needles that turn on it."""

    name: str
    centre: Point
    radius: tuple[Positive, Positive]
    sweep: tuple[Number, Number]
    unit: str = ""
    scale: tuple[tuple[Number, Number], ...]
    needles: Annotated[tuple[Needle, ...], Field(min_length=1)]

    @field_validator("radius")
    @classmethod
    def _radius_grows(cls, radius: tuple[float, float]) -> tuple[float, float]:
        if radius[1] - radius[0] < 2:  # noqa: PLR2004 - fewer than two pixels hold no needle
            raise ValueError("must run outward from the bottom of the needle to the outer perimeter, at least 2 pixels")
        return radius

    @field_validator("sweep")
    @classmethod
    def _sweep_is_not_empty(cls, sweep: tuple[float, float]) -> tuple[float, float]:
        if not 0 < sweep[1] - sweep[0] <= FULL_CIRCLE_DEG:
            raise ValueError("is empty or more than a turn; give it clockwise, such as [120, 420]")
        return sweep

    @field_validator("scale")
    @classmethod
    def _scale_is_monotone(cls, scale: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        if len(scale) < 2:  # noqa: PLR2004 - a line needs two points
            raise ValueError("needs at least two [angle, value] marks")
        marks = sorted(scale)
        turns = {after[0] > before[0] for before, after in pairwise(marks)}
        steps = {(after[1] > before[1]) - (after[1] < before[1]) for before, after in pairwise(marks)}
        if turns != {True} or steps not in ({1}, {-1}):
            raise ValueError(
                "must be monotone: each mark at another angle, values only rising or only falling along the dial"
            )
        return tuple(marks)

    @model_validator(mode="after")
    def _covering_needles_exist(self) -> Self:
        above = {needle.name: needle.covered_by for needle in self.needles}
        for name in above:
            seen, lower = {name}, name
            while (cover := above[lower]) is not None:
                if cover not in above:
                    raise ValueError(f"needle {name}: covered_by names {cover}, which is no needle of this gauge")
                if cover in seen:
                    raise ValueError(f"needle {name}: covered_by runs in a circle")
                seen.add(cover)
                lower = cover
        return self

    @property
    def full_scale(self) -> float:
        """The span of values between the outermost marks, in the gauge's unit."""
        return abs(self.scale[-1][1] - self.scale[0][1])


class Panel(Strict):
    """The instrument panel of one cockpit."""

    name: str
    picture: str
    focal_length_mm: Positive | None = None
    reference_points: tuple[ReferencePoint, ...] = ()
    level: tuple[Point, Point] | None = None
    anchors: Annotated[tuple[Anchor, ...], Field(min_length=1)]
    gauges: Annotated[tuple[Gauge, ...], Field(min_length=1)]

    @field_validator("level")
    @classmethod
    def _level_has_length(cls, level: tuple[Point, Point] | None) -> tuple[Point, Point] | None:
        if level is not None and abs(level[1][1] - level[0][1]) + abs(level[1][0] - level[0][0]) < 16:  # noqa: PLR2004
            raise ValueError("is shorter than 16 pixels; mark a longer edge")
        return level

    @model_validator(mode="after")
    def _columns_are_unique(self) -> Self:
        columns = list(LEADING_COLUMNS)
        for needle in self.needles:
            columns += [needle.name + suffix for suffix in NEEDLE_SUFFIXES]
        twice = sorted({column for column in columns if columns.count(column) > 1})
        if twice:
            raise ValueError(f"two columns of the flight data would be called {twice[0]}; rename a needle")
        return self

    @property
    def needles(self) -> tuple[Needle, ...]:
        """All needles, in the order of the file: the order of the flight data's columns."""
        return tuple(needle for gauge in self.gauges for needle in gauge.needles)

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
