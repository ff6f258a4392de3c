"""A ball in a curved tube, as `panel.yaml` describes it, or anything else that moves along a line."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, ValidationError

from decoder.panel.arrays import Number
from decoder.panel.description import Name, Pixels, Positive, Strict
from decoder.panel.kind import Control, Dial, Form, Plain, Polar
from decoder.panel.scale import FULL_CIRCLE_DEG, MOST_POINTS, Marks, Quantity, Scale

# A straighter tube is bent so much: its middle then lies a hundredth of its length beside where it is drawn.
STRAIGHTEST_RADII = 12.0

Tube = Annotated[tuple[tuple[Pixels, Pixels, Number], ...], Field(max_length=MOST_POINTS)]


class Ball(Plain, Strict):
    """What moves along a curved tube, a slip ball: the gauge's circle, sweep and scale follow from the tube."""

    name: Name
    """Column of the flight data."""
    tube: Tube
    """[x, y, value] of three places or more of the ball's middle, from one end of its way to the other."""
    width: Positive
    """Of the tube across its length, pixels: about the ball's size."""
    max_rate: Positive | None = None
    """How fast its value can change, in its unit a second."""

    form: ClassVar[Form] = Form(
        "ball",
        "a `ball` in a tube",
        "a ball in a tube",
        "a ball",
        begun={"width": 20.0},
        controls=(
            Control("name", "Name"),
            Control("tube", "Its way", "points", "x y value: 80 90 -1, 120 96 0, 160 90 1"),
            Control("width", "Tube's width", "number", "pixels"),
            Control("max_rate", "Fastest change", "optional", "a second, if known"),
        ),
        hint="Its way: x, y and value of the ball's middle at three places or more, from one end to the other.",
    )

    def check(self, dial: Dial) -> None:
        """ValueError where the dial is more than the tube."""
        if dial.wraps is not None or dial.tail:
            raise ValueError("a `ball` has no `wraps` and no `tail`")

    def quantities(self, dial: Dial) -> tuple[Quantity, ...]:
        """Return where the ball is."""
        return (Quantity(self.name, dial.name, dial.unit, dial.scale, None, None, self.max_rate),)

    def lines(self, dial: Dial, values: Mapping[str, float]) -> Mapping[str, tuple[Polar, Polar] | None]:
        """Return a line across the tube through the ball's middle."""
        (at_deg,) = Scale.of(dial.scale).angles_of(np.array([values[self.name]])).tolist()
        ends = (at_deg, dial.radius[0]), (at_deg, dial.radius[1])
        return {self.name: ends if math.isfinite(at_deg) else None}

    def unwrapped_deg(self, dial: Dial) -> tuple[float, float]:
        """Return the ball's path, with half a ball beyond each end, and the dial beside it."""
        first_deg, last_deg = dial.reach
        margin_deg = dial.beyond_deg + math.degrees(1.5 * self.width / dial.radius[1]) + 1.0
        return first_deg - margin_deg, last_deg + margin_deg


def tube_gauge(ball: Mapping[str, Any]) -> dict[str, object]:
    """Return centre, radius, sweep and scale of a gauge with a tube.

    Raises
    ------
    ValueError
        If its places are no line. What else is wrong is said of the parts of the ball; then the gauge is a stand-in.
    """
    try:
        own = Ball.model_validate(ball)
    except ValidationError:  # which its own field will say
        return {"centre": [0, 0], "radius": [1, 9], "sweep": [0, 90], "scale": [[0, 0], [90, 1]]}
    places, width = np.array(own.tube, np.float64).reshape(-1, 3), own.width
    if len(places) < 3:  # noqa: PLR2004 - a circle
        raise ValueError(
            "`ball` needs a `tube` of three places [x, y, value] or more: both ends of the ball's way, and its middle"
        )
    points, values = places[:, :2], places[:, 2]
    chord = points[-1] - points[0]
    length_px = float(np.hypot(*chord))
    if length_px == 0.0 or not np.isfinite(places).all():
        raise ValueError("the `tube` of a `ball` must end elsewhere than it begins")
    along = chord / length_px
    across = np.array([-along[1], along[0]])
    middle = (points[0] + points[-1]) / 2
    x, y = (points - middle) @ along, (points - middle) @ across
    # The circle through both ends: (x^2 - a^2) + y^2 = 2 y h, with its middle h across the chord.
    square, half = x**2 + y**2 - (length_px / 2) ** 2, STRAIGHTEST_RADII * length_px
    away_px = float((y * square).sum() / (2 * (y**2).sum())) if y.any() else half
    away_px = math.copysign(min(abs(away_px), half), away_px)
    centre = middle + away_px * across
    outward = points - centre
    radius_px = float(np.hypot(*outward.T).mean())
    if not 0 < width < radius_px:
        raise ValueError("a `ball` needs the `width` of its tube, which is less than the radius of its bend")
    middle_deg = math.degrees(math.atan2(*(middle - centre)[::-1]))
    angles = np.degrees(np.arctan2(outward[:, 1], outward[:, 0]))
    angles = middle_deg + (angles - middle_deg + FULL_CIRCLE_DEG / 2) % FULL_CIRCLE_DEG - FULL_CIRCLE_DEG / 2
    scale: Marks = tuple(zip(angles.tolist(), values.tolist(), strict=True))
    return {
        "centre": centre.tolist(),
        "radius": [radius_px - width / 2, radius_px + width / 2],
        "sweep": [float(angles.min()), float(angles.max())],
        "scale": scale,
    }
