"""Needles as `panel.yaml` describes them: what they look like, and which turns above which."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator

from decoder.panel.arrays import NO_TRUTH, Degrees
from decoder.panel.description import Name, PictureName, Positive, Strict, Text
from decoder.panel.kind import Dial, Drawn, Form, Plain, Pointer, Usual
from decoder.panel.scale import DialMarks, Quantity, check_turn, marks_at, turned

MIN_TEMPLATE_SPAN_DEG = 2.0
# Of a cropped needle, if the panel does not say: usual needles.
PICTURE_SPAN_DEG = 16.0


class Template(Strict):
    """Where a needle's template comes from.

    `at` and `span`: cut from the panel picture (or from `picture`, another picture of the same panel and size) around
    the angle `at`, `span` degrees wide. `picture` without `at`: a cropped unwrapped needle, rows of angle by columns
    of radius over the gauge's whole `radius`, `span` degrees high, its needle in the middle row.
    """

    at: Degrees | None = None
    """The angle at which the needle points where it is cut."""
    span: Annotated[float, Field(ge=MIN_TEMPLATE_SPAN_DEG, le=90), NO_TRUTH] | None = None
    """How many degrees are cut, two or three times the width of the needle."""
    picture: PictureName | None = None
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

    @property
    def span_deg(self) -> float:
        """How many degrees it spans, whether the panel says so or not."""
        return self.span or PICTURE_SPAN_DEG

    @property
    def is_cut_there(self) -> bool:
        """Whether the panel picture shows the needle where it is cut."""
        return self.at is not None and self.picture is None


class Needle(Strict):
    """One pointer. `covered_by` names the needle of the same gauge that turns above it.

    A `scale` of its own, with its own `wraps`, stands in for the gauge's. `max_rate` is how fast its value can change,
    in its unit a second.
    """

    name: Name
    """Column of the flight data: letters, digits and underscores, the unit at its end."""
    template: Template
    """What it looks like."""
    covered_by: Text | None = None
    """The needle of the same gauge that turns above this one."""
    scale: DialMarks | None = None
    """Its own, where it shows another thing than the gauge."""
    wraps: Positive | None = None
    """Its own, beside its own scale."""
    on_card: Name | None = None
    """Of a needle with its own scale over a `card`: the column of what stands on the card where it points."""
    max_rate: Positive | None = None
    """How fast its value can change, in its unit a second; what is faster is listed among the outliers."""

    @model_validator(mode="after")
    def _turn_closes(self) -> Self:
        if self.wraps is not None:
            if self.scale is None:
                raise ValueError("`wraps` of a needle needs a `scale` beside it; the gauge's scale has the gauge's")
            check_turn(self.scale, self.wraps)
        return self

    def at_angles(self, true_deg: Callable[[float], float]) -> Self:
        """Return the needle with each drawn angle exchanged for the true one."""
        at_deg = self.template.at
        template = self.template.model_copy(update={"at": None if at_deg is None else true_deg(at_deg)})
        scale = None if self.scale is None else marks_at(self.scale, true_deg)
        return self.model_copy(update={"template": template, "scale": scale})


@dataclass(frozen=True, slots=True)
class Needles(Plain):
    """The needles of one dial."""

    form: ClassVar[Form] = Form(
        "needles",
        "`needles`",
        "needles",
        "a needle",
        along=("tail", "combined"),
        usual=(
            Usual("airspeed", "kt", ("airspeed_kt",)),
            Usual(
                "altimeter", "ft", ("hundreds_ft", "thousands_ft", "ten_thousands_ft"), 1000.0, together="altitude_ft"
            ),
            Usual("vertical speed", "fpm", ("vertical_speed_fpm",)),
            Usual("turn coordinator", "standard rate", ("turn_rate",), both_ends=True),
            Usual("tachometer", "rpm", ("tach_rpm",)),
        ),
    )
    has_still_face: ClassVar[bool] = True

    each: tuple[Needle, ...]
    is_over_card: bool = False

    def check(self, dial: Dial) -> None:
        """ValueError where a tail is in no template, needles cover each other in a circle, or a card is missing."""
        for needle in self.each:
            if needle.on_card is not None and not self.is_over_card:
                raise ValueError(f"needle {needle.name}: `on_card` needs a `card` on the same gauge")
            if dial.tail and needle.template.at is None:
                raise ValueError(f"needle {needle.name}: with `tail` a template needs `at`; a cropped needle has none")
        above = {needle.name: needle.covered_by for needle in self.each}
        for name in above:
            seen, lower = {name}, name
            while (cover := above[lower]) is not None:
                if cover not in above:
                    raise ValueError(f"needle {name}: `covered_by` names {cover}, which is no needle of this gauge")
                if cover in seen:
                    raise ValueError(f"needle {name}: covered_by runs in a circle")
                seen.add(cover)
                lower = cover

    def quantities(self, dial: Dial) -> tuple[Quantity, ...]:
        """Return one for each needle."""
        return tuple(
            Quantity(
                name=needle.name,
                gauge=dial.name,
                unit=dial.unit,
                marks=needle.scale or dial.scale,
                wraps=dial.wraps if needle.scale is None else needle.wraps,
                covered_by=needle.covered_by,
                max_rate=needle.max_rate,
            )
            for needle in self.each
        )

    def pointers(self) -> tuple[Pointer, ...]:
        """Return one for each needle, which turns."""
        return tuple(
            Pointer(needle.name, own.at, is_fixed=False, hides_deg=own.span if own.is_cut_there else None)
            for needle in self.each
            for own in [needle.template]
        )

    def unwrapped_deg(self, dial: Dial) -> tuple[float, float]:
        """Return where needles go, and as much beyond as the widest template needs.

        On a round dial, that is enough for two neighbouring needles to lie side by side wherever one of them is.
        """
        widest_deg = max(needle.template.span_deg for needle in self.each)
        margin_deg = dial.beyond_deg + widest_deg / 2 + 1.0
        if dial.is_round and len(self.each) > 1:
            margin_deg += widest_deg
        first_deg, last_deg = dial.reach
        return first_deg - margin_deg, last_deg + margin_deg

    def pictures(self) -> Mapping[str, str]:
        """Return those that templates are cut from, or are."""
        return {
            f"needles[{place}].template.picture": needle.template.picture
            for place, needle in enumerate(self.each)
            if needle.template.picture is not None
        }

    def at_angles(self, true_deg: Callable[[float], float]) -> Mapping[str, object]:
        """Return the needles, cut at their true angles, with their own marks at theirs."""
        return {self.form.key: tuple(needle.at_angles(true_deg) for needle in self.each)}

    @staticmethod
    def carry(gauge: Drawn, turn_deg: float, _: float, angles_deg: Mapping[str, float]) -> float:
        """Turn templates and own scales; a needle that was read there is cut where it is read."""
        for needle in gauge["needles"]:
            template = needle["template"]
            if template.get("at") is not None:
                read_deg = angles_deg.get(needle["name"])
                card = gauge.get("card")
                if read_deg is not None and card and not needle.get("scale"):  # it was read on the card
                    read_deg += card["index"] - angles_deg.get(card["name"], card["index"])
                template["at"] = round((template["at"] if read_deg is None else read_deg) + turn_deg, 4)
            if needle.get("scale"):
                needle["scale"] = turned(needle["scale"], turn_deg)
        return 0.0
