"""One gauge as `panel.yaml` describes it: a dial, and the instrument of one kind that is on it.

A part of the panel format, see `decoder.panel.panel`; for its writers docs/panel.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, field_validator, model_validator

from decoder.panel.arrays import NO_TRUTH, Degrees, Number, at_most
from decoder.panel.description import Name, Point, Positive, Strict, Text
from decoder.panel.kind import DescribedKind, Pointer, Polar
from decoder.panel.kinds.attitude import Attitude
from decoder.panel.kinds.ball import Ball, tube_gauge
from decoder.panel.kinds.card import Card
from decoder.panel.kinds.digits import Digits
from decoder.panel.kinds.lamp import Lamp
from decoder.panel.kinds.linear import Linear
from decoder.panel.kinds.needles import Needle, Needles
from decoder.panel.kinds.over_card import OverCard
from decoder.panel.kinds.printed import Printed
from decoder.panel.kinds.tape import Tape
from decoder.panel.scale import (
    FULL_CIRCLE_DEG,
    MOST_POINTS,
    Combination,
    DialMarks,
    Gearing,
    Quantity,
    check_turn,
    marks_at,
)
from decoder.panel.thresholds import BEYOND_SWEEP_DEG
from decoder.panel.window import WINDOW_ARC_PX, Corners, as_dial, check_corners

RadiusPx = Annotated[Positive, at_most(10_000)]

# A dial that is read all the way round is unwrapped with this much overlap, so that a peak at either end is whole.
OVERLAP_DEG = 2.0
MOST_DOUBT_DEG = 20.0

KINDS: tuple[type[DescribedKind], ...] = (Needles, Card, Attitude, Ball, Lamp, Linear, Tape, Digits, Printed)


class Combined(Strict):
    """A value that several pointers of one gauge show together, such as the altitude of a three-pointer altimeter.

    Values lie in a turn of the coarsest pointer that begins at `lowest`. `tolerance` is how far a coarser pointer may
    be from where the finer one puts it, in turns of the finer.
    """

    name: Name
    """Column of the flight data, as of a needle."""
    needles: Annotated[tuple[Name, ...], Field(min_length=2, max_length=20)]
    """Which count for each other; a turn of each is a whole number of turns of the next finer."""
    tolerance: Annotated[float, Field(gt=0, lt=0.5), NO_TRUTH] = 0.2
    """How far a coarser needle may be from where the finer one puts it, in turns of the finer."""
    lowest: Number = 0.0
    """Where its values begin."""
    max_rate: Positive | None = None
    """How fast its value can change, in its unit a second."""


class Gauge(Strict):
    """One dial: where it is, what it covers, what its marks mean, and the needles that turn on it."""

    name: Text
    """Of the dial; `decode frames --gauge` calls it so."""
    window: Annotated[Corners, AfterValidator(check_corners)] | None = None
    """The corners of what is no dial, clockwise from its top left; in place of `centre`, `radius`, `sweep`, `scale`."""
    centre: Point
    """Where the needle turns, which need not be the middle of the dial."""
    radius: tuple[RadiusPx, RadiusPx]
    """From the bottom of the needle, clear of the hub, to the outer perimeter, pixels."""
    rim: Annotated[tuple[Point, ...], Field(max_length=MOST_POINTS)] | None = None
    """Five points or more all round a circle about the pivot, on an oblique dial."""
    needle_height_inches: Annotated[float, Field(ge=0, le=2)] = 0.0
    """How high the needles turn above the face; their parallax is then taken out."""
    doubt_deg: Annotated[float, Field(ge=0, le=MOST_DOUBT_DEG), NO_TRUTH] = 0.0
    """How far its marks and index may lie beside where they are drawn, one sigma; readings' sigma allows for that."""
    sweep: tuple[Degrees, Degrees]
    """First and last angle that the needle points to, clockwise; may pass 360."""
    stops: tuple[Degrees, Degrees] | None = None
    """Angles at which the needle comes to rest beyond the scale, around the sweep."""
    tail: bool = False
    """The needle reaches across its centre into the ring, and its tail may be taken for its tip."""
    unit: Text = ""
    """Of the values; the flight data carry it."""
    scale: DialMarks
    """[angle, value] of two marks or more; straight in between, and beyond the outermost."""
    wraps: Positive | None = None
    """What a full turn is worth, where values begin again after it; the sweep is then 360 degrees."""
    needles: Annotated[tuple[Needle, ...], Field(min_length=1, max_length=20)] = ()
    """In any order; either these or one of what follows, or these over a card."""
    card: Card | None = None
    """A scale that turns under a fixed index, by itself or under needles."""
    attitude: Attitude | None = None
    """A horizon that turns and shifts behind a window, instead of needles."""
    ball: Ball | None = None
    """A ball in a curved tube, instead of needles; the tube tells `centre`, `radius`, `sweep` and `scale`."""
    lamp: Lamp | None = None
    """A warning light in a window."""
    linear: Linear | None = None
    """A pointer that slides along a straight scale in a window."""
    tape: Tape | None = None
    """A scale that slides or turns behind an index in a window."""
    digits: Digits | None = None
    """A display of digits in a window."""
    printed: Printed | None = None
    """Printed digits in a window, on drums or not."""
    combined: Combined | None = None
    """A value that several needles of the dial show together."""

    @model_validator(mode="before")
    @classmethod
    def _place_is_told(cls, given: Any) -> Any:  # noqa: ANN401 - as it was typed
        if not isinstance(given, Mapping):
            return given
        return as_dial(dict(given)) if given.get("window") is not None else _with_tube(given)

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

    @property
    def _given(self) -> list[DescribedKind]:
        """The kinds described on it; one, if the panel is right."""
        needles = Needles(self.needles) if self.needles else None
        card: DescribedKind | None = self.card
        if needles is not None and self.card is not None:
            needles, card = None, OverCard(self.card, Needles(self.needles, is_over_card=True))
        in_windows = self.lamp, self.linear, self.tape, self.digits, self.printed
        each: tuple[DescribedKind | None, ...] = (needles, card, self.attitude, self.ball, *in_windows)
        return [kind for kind in each if kind is not None]

    @property
    def kind(self) -> DescribedKind:
        """What is on it."""
        return self._given[0]

    @model_validator(mode="after")
    def _is_of_one_kind(self) -> Self:
        if len(self._given) != 1:
            raise ValueError(f"needs either {' or '.join(kind.form.said for kind in KINDS)}")
        if self.kind.in_window and self.window is None:
            raise ValueError(f"needs a `window` for its `{self.kind.form.key}`: its four corners")
        if self.window is not None and not self.kind.in_window:
            raise ValueError(f"has `{self.kind.form.key}`, which are no window's: give `centre`, `radius` and `sweep`")
        self.kind.check(self)
        return self

    @model_validator(mode="after")
    def _turn_closes(self) -> Self:
        turns = () if self.kind.in_window else (self.wraps, *(quantity.wraps for quantity in self.quantities))
        if any(wraps is not None for wraps in turns):
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

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """What the gauge shows, in the order of the flight data's columns."""
        return self.kind.quantities(self)

    @property
    def pointers(self) -> tuple[Pointer, ...]:
        """What is drawn of it in pictures and in the report."""
        return self.kind.pointers()

    def lines(self, values: Mapping[str, float]) -> Mapping[str, tuple[Polar, Polar] | None]:
        """Return what each quantity's value looks like if it is not a pointer's line; `values` is by quantity."""
        return self.kind.lines(self, values)

    @property
    def turning(self) -> tuple[Pointer, ...]:
        """Those of its pointers that turn."""
        return tuple(pointer for pointer in self.pointers if not pointer.is_fixed)

    @property
    def over_face(self) -> tuple[Pointer, ...]:
        """Those that turn over a still face."""
        return self.turning if self.kind.has_still_face else ()

    @property
    def unwrapped_deg(self) -> tuple[float, float]:
        """The first and the last angle that are unwrapped."""
        return self.kind.unwrapped_deg(self)

    @property
    def pictures(self) -> Mapping[str, str]:
        """The pictures that it needs besides the panel picture, by their paths below the gauge."""
        return self.kind.pictures()

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
        """List the pointers of a combined value, the finest first."""
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
    def gearing(self) -> Gearing | None:
        """How the pointers of a combined value follow from it, if there is one."""
        if self.combination is None:
            return None
        drawn_deg = {pointer.name: pointer.at_deg for pointer in self.turning if pointer.at_deg is not None}
        return Gearing.of(self.quantities, self.combination, drawn_deg)

    def at_angles(self, true_deg: Callable[[float], float]) -> Self:
        """Return the gauge with every drawn angle replaced by the true one."""
        return self._at_angles(true_deg, self.kind.at_angles(true_deg))

    def squared_up(self, true_deg: Callable[[float], float], true_size: Callable[[float], float]) -> Self:
        """Return a gauge that is drawn as it appears obliquely as it is square on; see `Kind.squared_up`."""
        return self._at_angles(true_deg, self.kind.squared_up(self, true_deg, true_size))

    def _at_angles(self, true_deg: Callable[[float], float], own: Mapping[str, object]) -> Self:
        first, last = self.sweep
        told: dict[str, object] = {"scale": marks_at(self.scale, true_deg), **own}
        if not self.is_round:
            told["sweep"] = (true_deg(first), true_deg(last))
            told["stops"] = self.stops and (true_deg(self.stops[0]), true_deg(self.stops[1]))
        return self.model_copy(update=told)

    @property
    def arc_px(self) -> float:
        """The radius at which angles and pixels are converted into each other."""
        return sum(self.radius) / 2 if self.window is None else WINDOW_ARC_PX

    @property
    def reach(self) -> tuple[float, float]:
        """Where needles can go: from stop to stop, or along the sweep."""
        return self.stops or self.sweep

    @property
    def is_in_picture(self) -> bool:
        """Whether it is drawn as it appears, in no plane of its own: as a line in the picture, with a far pivot."""
        return self.ball is not None

    @property
    def is_round(self) -> bool:
        """Whether the dial is read all the way round, with no seam."""
        return self.sweep[1] - self.sweep[0] == FULL_CIRCLE_DEG

    @property
    def beyond_deg(self) -> float:
        """How far beyond its reach a needle's axis may lie."""
        if self.is_round:
            return OVERLAP_DEG
        first_deg, last_deg = self.reach
        return min(BEYOND_SWEEP_DEG, (FULL_CIRCLE_DEG - (last_deg - first_deg)) / 2)


def _with_tube(given: Mapping[str, Any]) -> Mapping[str, Any]:
    """Add the keys that follow from the tube to a gauge with a ball."""
    ball = given.get("ball")
    return {**given, **tube_gauge(ball)} if isinstance(ball, Mapping) else given


def stand_in_gauge(centre: Point) -> dict[str, object]:
    """Describe a dummy gauge, so that anchors and level alone form a panel, as finding it needs no dials."""
    return {
        "name": "stand-in",
        "centre": list(centre),
        "radius": [2.0, 6.0],
        "sweep": [0.0, 90.0],
        "scale": [[0.0, 0.0], [90.0, 1.0]],
        "needles": [{"name": "stand_in", "template": {"at": 0.0, "span": 4.0}}],
    }
