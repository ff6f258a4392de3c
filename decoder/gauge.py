"""One gauge as `panel.yaml` describes it: where the dial is, what its marks mean, and what turns on it.

A part of the panel format, see `decoder.panel`; for its writers docs/panel.md.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Self

from pydantic import Field, field_validator, model_validator

from decoder.description import Number, Point, Positive, Strict
from decoder.pointers import Card, Combined, Needle
from decoder.quantity import Combination, Quantity
from decoder.scale_marks import FULL_CIRCLE_DEG, Marks, check_turn, monotone


class Gauge(Strict):
    """One dial: where it is, what it covers, what its marks mean, and the needles that turn on it."""

    name: str
    """Of the dial; `decode frames --gauge` calls it so."""
    centre: Point
    """Where the needle turns, which need not be the middle of the dial."""
    radius: tuple[Positive, Positive]
    """From the bottom of the needle, clear of the hub, to the outer perimeter, pixels."""
    rim: tuple[Point, ...] | None = None
    """Five points or more all round a circle about the pivot, on an oblique dial."""
    needle_height_inches: Annotated[float, Field(ge=0, le=2)] = 0.0
    """How high the needles turn above the face; their parallax is then taken out."""
    sweep: tuple[Number, Number]
    """First and last angle that the needle points to, clockwise; may pass 360."""
    stops: tuple[Number, Number] | None = None
    """Angles at which the needle comes to rest beyond the scale, around the sweep."""
    tail: bool = False
    """The needle reaches across its centre into the ring, and its tail may be taken for its tip."""
    unit: str = ""
    """Of the values; the flight data carry it."""
    scale: Marks
    """[angle, value] of two marks or more; straight in between, and beyond the outermost."""
    wraps: Positive | None = None
    """What a full turn is worth, where values begin again after it; the sweep is then 360 degrees."""
    needles: Annotated[tuple[Needle, ...], Field(min_length=1)] = ()
    """In any order; either these or a card."""
    card: Card | None = None
    """A scale that turns under a fixed index, instead of needles."""
    combined: Combined | None = None
    """A value that several needles of the dial show together."""

    @field_validator("radius")
    @classmethod
    def _radius_grows(cls, radius: tuple[float, float]) -> tuple[float, float]:
        if radius[1] - radius[0] < 2:  # noqa: PLR2004 - fewer than two pixels hold no needle
            raise ValueError("must run outward from the bottom of the needle to the outer perimeter, at least 2 pixels")
        return radius

    @field_validator("rim")
    @classmethod
    def _rim_is_enough(cls, rim: tuple[Point, ...] | None) -> tuple[Point, ...] | None:
        if rim is not None and len(rim) < 5:  # noqa: PLR2004 - an ellipse has five parameters
            raise ValueError("needs five points or more, all round a circle about the pivot")
        return rim

    @field_validator("sweep")
    @classmethod
    def _sweep_is_not_empty(cls, sweep: tuple[float, float]) -> tuple[float, float]:
        if not 0 < sweep[1] - sweep[0] <= FULL_CIRCLE_DEG:
            raise ValueError("is empty or more than a turn; give it clockwise, such as [120, 420]")
        return sweep

    @field_validator("scale")
    @classmethod
    def _scale_is_monotone(cls, scale: Marks) -> Marks:
        return monotone(scale)

    @model_validator(mode="after")
    def _something_turns(self) -> Self:
        if (self.card is None) == (not self.needles):
            raise ValueError("needs either `needles` or a `card` that turns under an index")
        if self.card is not None and (self.wraps is None or self.tail):
            raise ValueError("a `card` goes all the way round: give `wraps`, the value of a turn, and no `tail`")
        return self

    @model_validator(mode="after")
    def _turn_closes(self) -> Self:
        if any(wraps is not None for wraps in (self.wraps, *(needle.wraps for needle in self.needles))):
            if self.sweep[1] - self.sweep[0] != FULL_CIRCLE_DEG:
                raise ValueError("`wraps` needs a `sweep` of exactly 360 degrees: such a needle goes all the way round")
            if self.stops is not None:
                raise ValueError("a scale that `wraps` has no `stops`: such a needle goes all the way round")
        if self.wraps is not None:
            check_turn(self.scale, self.wraps)
        return self

    @model_validator(mode="after")
    def _stops_hold_the_sweep(self) -> Self:
        if self.stops is not None:
            first, last = self.stops
            if not (first <= self.sweep[0] and self.sweep[1] <= last and last - first <= FULL_CIRCLE_DEG):
                raise ValueError(
                    "`stops` must hold the `sweep` and be no more than a turn; give both clockwise, such as [110, 425]"
                )
        return self

    @model_validator(mode="after")
    def _tails_are_in_the_templates(self) -> Self:
        for needle in self.needles:
            if self.tail and needle.template.at is None:
                raise ValueError(f"needle {needle.name}: with `tail` a template needs `at`; a cropped needle has none")
        return self

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
    def quantities(self) -> tuple[Quantity, ...]:
        """What the gauge shows, in the order of the flight data's columns."""
        if self.card is not None:
            name, max_rate = self.card.name, self.card.max_rate
            return (Quantity(name, self.name, self.unit, self.scale, self.wraps, None, max_rate),)
        return tuple(
            Quantity(
                name=needle.name,
                gauge=self.name,
                unit=self.unit,
                marks=needle.scale or self.scale,
                wraps=self.wraps if needle.scale is None else needle.wraps,
                covered_by=needle.covered_by,
                max_rate=needle.max_rate,
            )
            for needle in self.needles
        )

    @model_validator(mode="after")
    def _pointers_combine(self) -> Self:
        if self.combined is not None:
            turns = [quantity.wraps for quantity in self._parts(self.combined)]
            if len(turns) < len(set(self.combined.needles)) or len(turns) < len(self.combined.needles):
                raise ValueError("`combined` names a needle that this gauge does not have, or one twice")
            if any(coarser is None or finer is None for finer, coarser in pairwise(turns)):
                raise ValueError("`combined` needs needles that go all the way round: give each `scale` and `wraps`")
            ratios = [(coarser or 0.0) / (finer or 1.0) for finer, coarser in pairwise(turns)]
            if any(ratio < 2 or ratio != round(ratio) for ratio in ratios):  # noqa: PLR2004 - a counter counts
                raise ValueError("`combined`: a turn of each needle must be a whole number of turns of the next finer")
        return self

    def _parts(self, combined: Combined) -> list[Quantity]:
        """The pointers of a combined value, the finest first."""
        parts = [quantity for quantity in self.quantities if quantity.name in combined.needles]
        return sorted(parts, key=lambda quantity: quantity.wraps or 0.0)

    @property
    def combination(self) -> Combination | None:
        """What several of its pointers show together, if they do."""
        if self.combined is None:
            return None
        parts, own = self._parts(self.combined), self.combined
        turn = parts[-1].wraps or 0.0
        quantity = Quantity(
            name=own.name,
            gauge=self.name,
            unit=self.unit,
            marks=((0.0, own.lowest), (FULL_CIRCLE_DEG, own.lowest + turn)),
            wraps=turn,
            covered_by=None,
            max_rate=own.max_rate,
            lowest=own.lowest,
        )
        names = tuple(part.name for part in parts)
        return Combination(quantity, names, turn, own.tolerance)

    @property
    def reach(self) -> tuple[float, float]:
        """Where needles go: from stop to stop, or along the sweep."""
        return self.stops or self.sweep

    @property
    def is_round(self) -> bool:
        """Whether the dial is read all the way round, with no seam."""
        return self.sweep[1] - self.sweep[0] == FULL_CIRCLE_DEG
