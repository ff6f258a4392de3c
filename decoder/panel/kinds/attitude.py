"""An attitude indicator, as `panel.yaml` describes it: a horizon that turns and shifts behind a window."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, field_validator

from decoder.panel.arrays import Degrees, Number
from decoder.panel.description import Name, Pixels, Positive, Strict
from decoder.panel.kind import Control, Dial, Drawn, Form, Plain, Pointer, Polar, Usual
from decoder.panel.scale import FULL_CIRCLE_DEG, MOST_POINTS, Quantity, Scale, monotone

DOWN_DEG, UP_DEG = 90.0, 270.0
HALF_TURN_DEG = 180.0
QUARTER_TURN_DEG = 90.0
PITCHES_DEG = -90.0, 90.0

Ladder = Annotated[tuple[tuple[Pixels, Number], ...], Field(max_length=MOST_POINTS)]


class Attitude(Plain, Strict):
    """A horizon that turns with bank and shifts with pitch behind a window. The gauge's scale is that of bank.

    The scale tells the angles at which degrees of bank lie in the panel picture on what turns: a ring of marks, or the
    pointer of a horizon whose marks stand still.
    """

    roll: Name
    """Column of the flight data: bank, from -180 to 180."""
    pitch: Name
    """Column of the flight data: pitch."""
    index: Degrees = UP_DEG
    """The angle on the dial at which bank is read."""
    window: Positive
    """How far from the centre the horizon is in sight, pixels."""
    ring: Positive | None = None
    """From so far outwards all turns with bank and nothing shifts, pixels; without it bank is the horizon's tilt."""
    ladder: Ladder
    """[pixels, degrees of pitch] of two marks or more: how far above the centre each lies in the panel picture."""
    horizon_turn: Positive = 1.0
    """By how many degrees the horizon turns for one of the ring."""
    shift_turn: Annotated[Number, Field(ge=0)] = 1.0
    """By how many degrees the way of its shift turns for one of the ring; 0 where it stays upright."""
    max_rate: Positive | None = None
    """How fast either value can change, degrees a second."""

    form: ClassVar[Form] = Form(
        "attitude",
        "an `attitude`: a horizon behind a window",
        "a horizon: attitude",
        "a horizon",
        begun={"roll": "roll_deg", "pitch": "pitch_deg"},
        controls=(
            Control("roll", "Name of roll"),
            Control("pitch", "Name of pitch"),
            Control("index", "Bank read at", "optional", "degrees; 270, straight up", is_angle=True),
            Control("window", "Horizon seen to", "number", "pixels from the centre"),
            Control("ring", "Bank ring from", "optional", "pixels from the centre, if it turns"),
            Control(
                "ladder",
                "Pitch marks",
                "pairs",
                "pixels above the centre, degrees: 0 0, 31 10",
                upright="horizon_turn",
            ),
            Control("horizon_turn", "Horizon turns", "optional", "degrees for one of the ring; 1"),
            Control("shift_turn", "Its way turns", "optional", "degrees for one of the ring; 1, or 0 if upright"),
            Control("max_rate", "Fastest change", "optional", "degrees a second, if known"),
        ),
        hint="Click the marks of bank that turn, right bank positive, give them their degrees, and say that a turn is"
        " worth 360. Pitch marks: how far above the centre each lies along the horizon's own upright, and its degrees.",
        turning="ring",
        usual=(Usual("attitude", "deg", ("roll_deg", "pitch_deg"), FULL_CIRCLE_DEG),),
    )

    @field_validator("ladder")
    @classmethod
    def _ladder_is_monotone(cls, ladder: Ladder) -> Ladder:
        if len(ladder) < 2:  # noqa: PLR2004 - a line needs two points
            raise ValueError("needs two [pixels above the centre, degrees of pitch] or more")
        return monotone(ladder)

    def check(self, dial: Dial) -> None:
        """ValueError where it does not fit its dial."""
        if dial.wraps != FULL_CIRCLE_DEG or dial.tail:
            raise ValueError("an `attitude` needs a `scale` of bank with `wraps: 360`, and no `tail`")
        if self.roll == self.pitch:
            raise ValueError("an `attitude` needs two names: one for `roll`, one for `pitch`")
        inner_px, outer_px = dial.radius
        if not inner_px < self.window <= outer_px:
            raise ValueError("`window` must lie within the gauge's `radius`")
        if self.ring is not None and not self.window <= self.ring <= outer_px - 2:  # as wide as a `radius`, at least
            raise ValueError("`ring` must lie between the `window` and two pixels within the gauge's outer `radius`")

    def arc_px(self, dial: Dial) -> float:
        """Return the radius at which a shift counts as an arc: pitch too is then an angle on the dial."""
        return sum(dial.radius) / 2

    def quantities(self, dial: Dial) -> tuple[Quantity, ...]:
        """Return roll and pitch; pitch by the angle whose arc is as long as the horizon has shifted."""
        a_pixel_deg = math.degrees(1.0 / self.arc_px(dial))
        shifts = tuple((up_px * a_pixel_deg, pitch_deg) for up_px, pitch_deg in self.ladder)
        return (
            Quantity(
                self.roll,
                dial.name,
                dial.unit,
                dial.scale,
                dial.wraps,
                None,
                self.max_rate,
                lowest=-HALF_TURN_DEG,
                has_drawn_zero=self._has_drawn_index,
                has_upright_zero=not self._has_drawn_index,
            ),
            Quantity(
                self.pitch, dial.name, dial.unit, shifts, None, None, self.max_rate, limits=PITCHES_DEG, is_shift=True
            ),
        )

    def turned_deg(self, dial: Dial) -> float:
        """Return how far the ring is turned clockwise in the panel picture."""
        (level_deg,) = Scale.of(dial.scale, dial.wraps).angles_of(np.zeros(1)).tolist()
        return float((level_deg - self.index + HALF_TURN_DEG) % FULL_CIRCLE_DEG - HALF_TURN_DEG)

    def tilt_deg(self, dial: Dial) -> float:
        """Return how far the horizon is turned clockwise in the panel picture, whose camera may be rolled."""
        return self._camera_roll_deg + self.horizon_turn * self.turned_deg(dial)

    @property
    def _camera_roll_deg(self) -> float:
        """How far its case is turned clockwise: its index is at the top of it, at a side or at the bottom."""
        return math.remainder(self.index, QUARTER_TURN_DEG)

    def pointers(self) -> tuple[Pointer, ...]:
        """Return the index of bank."""
        return (Pointer(self.roll, self.index, is_fixed=True),)

    def lines(self, dial: Dial, values: Mapping[str, float]) -> Mapping[str, tuple[Polar, Polar]]:
        """Return the horizon across the window, where both values are known and it is in sight."""
        if not all(math.isfinite(values[name]) for name in (self.roll, self.pitch)):
            return {}
        banks, ladder = Scale.of(dial.scale, dial.wraps), Scale.of(self.ladder)
        level_deg, bank_deg = banks.angles_of(np.array([0.0, values[self.roll]])).tolist()
        level_px, at_centre_px = ladder.angles_of(np.array([0.0, values[self.pitch]])).tolist()
        ring_deg = level_deg - bank_deg
        part = math.cos(math.radians((self.shift_turn - self.horizon_turn) * ring_deg))
        down_px = (at_centre_px - level_px) * part
        if abs(down_px) >= self.window:
            return {}
        half_deg = math.degrees(math.acos(down_px / self.window))
        below_deg = DOWN_DEG + self._camera_roll_deg + self.horizon_turn * ring_deg
        return {self.pitch: ((below_deg + half_deg, self.window), (below_deg - half_deg, self.window))}

    def at_angles(self, true_deg: Callable[[float], float]) -> Mapping[str, object]:
        """Return it with its index at its true angle; its marks of bank are the gauge's."""
        return {self.form.key: self._indexed(true_deg)}

    def _indexed(self, true_deg: Callable[[float], float]) -> Attitude:
        """Return it with its index at its true angle, or straight up if it was left out: nobody drew it elsewhere."""
        return self.model_copy(update={"index": true_deg(self.index)} if self._has_drawn_index else {})

    @property
    def _has_drawn_index(self) -> bool:
        return "index" in self.model_fields_set

    def squared_up(
        self, dial: Dial, true_deg: Callable[[float], float], true_size: Callable[[float], float]
    ) -> Mapping[str, object]:
        """Return it with its index at its true angle, and its ladder as long as it is along its own upright."""
        size = true_size(UP_DEG + self.tilt_deg(dial))
        ladder = tuple((up_px * size, pitch_deg) for up_px, pitch_deg in self.ladder)
        return {self.form.key: self._indexed(true_deg).model_copy(update={"ladder": ladder})}

    @staticmethod
    def carry(gauge: Drawn, turn_deg: float, size: float, angles_deg: Mapping[str, float]) -> float:
        """Turn the index, and move the ladder to where its marks lie there; the scale lies as the ring is turned."""
        own = gauge["attitude"]
        index_deg = own.get("index", UP_DEG)
        ring_turn_deg = float(index_deg - angles_deg.get(own["roll"], index_deg))
        own["index"] = round(index_deg + turn_deg, 4)
        arc_px = sum(gauge["radius"]) / 2
        at_centre_px = math.radians(angles_deg.get(own["pitch"], 0.0)) * arc_px
        own["ladder"] = [[round(up_px * size - at_centre_px, 3), pitch_deg] for up_px, pitch_deg in own["ladder"]]
        for key in ("window", "ring"):
            if own.get(key):
                own[key] = round(own[key] * size, 3)
        return ring_turn_deg
