"""What readings are uncertain by beyond what their own frames tell: the panel's drawing, the pivot, the dial's place.

A frame tells how sharply a needle is seen and how well the panel is found. It does not tell how precisely somebody
drew the scale (to a fifth of a pixel, or as carelessly as the centres), from which side the camera sees needles that
turn above their marks, where they truly turn (their tilts do), nor by how much a dial is found beside its place (the
scatter of those tilts does).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decoder.imaging.panel_pictures import PanelPictures
from decoder.learning.thresholds import HAND_PX, MOST_MARK_PART
from decoder.panel.arrays import Floats
from decoder.registration.pivot import Pivot

# A mark is a line to draw to, while a pivot lies under a cap: marks are off by such a part of what centres are off, and
# by no more than such a part of the radius.
MARK_PART = 1 / 3
# Needles turn so high above their marks, in radii: 0.05 inches on a dial of 2.5.
NEEDLE_HEIGHT_PART = 0.04
# The tangent at which cameras see dials at least: as far before a panel as it is wide they see its edges at 0.5.
USUAL_VIEW = 0.2
# A dial that is found by itself is off by about this beyond its own pixels' noise.
FOUND_PX = 0.02
# A needle above its dial throws a shadow to one side of it, and is as high as somebody wrote to a hundredth of an inch:
# by such a part of its height it seems to turn elsewhere, and no tilt tells.
HEIGHT_PART = 0.005
# One dial's needles tell little of how well dials are found: the others count for as much as so many tilts of its own.
SHARED_TILTS = 16


@dataclass(frozen=True, slots=True)
class QuantityUncertainty:
    """One quantity's: `drawn_deg` by its scale, `place_px` by where its dial is found, and its gauge's pivot.

    `zero_deg` is the angle at which the needle's zero was set; None for a card, which is read all round: beside its
    pivot one half makes up for the other.
    """

    drawn_deg: float
    place_px: float
    radius_px: float
    pivot: Pivot
    zero_deg: float | None

    def sigma_deg(self, angles_deg: Floats) -> Floats:
        """(N,): a standard uncertainty for readings at these angles."""
        constant_deg = math.hypot(self.drawn_deg, math.degrees(self.place_px / self.radius_px))
        if self.zero_deg is None:
            return np.full_like(angles_deg, constant_deg)
        sigma: Floats = np.hypot(constant_deg, self.pivot.sigma_deg(angles_deg, self.zero_deg, self.radius_px))
        return sigma


def quantity_uncertainties(
    drawn: PanelPictures, pivots: Sequence[Pivot], *, marks_px: Sequence[float], care_px: float, dials_move: bool
) -> dict[str, QuantityUncertainty]:
    """Estimate, by quantity, what its readings are uncertain by.

    Parameters
    ----------
    drawn
        The panel as it was given, before pivots were moved.
    pivots
        By the gauges' order in the panel: what is still to be thought of each.
    marks_px
        By gauge: how far marks may be off because they were drawn around another centre.
    care_px
        How far beside their pivots the panel's centres are drawn: the same hand drew its marks.
    dials_move
        Whether each dial is found by itself.
    """
    places_px = _places_px(pivots, FOUND_PX if dials_move else 0.0)
    careless_px = MARK_PART * care_px
    uncertainties = {}
    parts = zip(drawn.panel.gauges, pivots, places_px, marks_px, strict=True)
    for index, (gauge, pivot, place_px, moved_px) in enumerate(parts):
        radius_px = gauge.arc_px
        zeros_deg = {needle.name: needle.at_deg for needle in gauge.turning}
        mark_px = min(careless_px, MOST_MARK_PART * gauge.radius[1])
        drawn_deg = math.hypot(
            math.degrees(math.hypot(HAND_PX, mark_px) / radius_px),
            math.degrees(moved_px / gauge.radius[1]),
            _parallax_deg(drawn, index) if zeros_deg else _squeezed_deg(drawn, index),
        )
        for quantity in gauge.quantities:
            if quantity.written is not None:  # what is written was drawn by nobody
                uncertainties[quantity.name] = QuantityUncertainty(0.0, 0.0, radius_px, pivot, None)
                continue
            zero_deg = zeros_deg.get(quantity.name)
            uncertainties[quantity.name] = QuantityUncertainty(
                drawn_deg,
                place_px if quantity.name in zeros_deg else 0.0,
                radius_px,
                pivot.as_drawn_by(care_px).blurred(_height_px(drawn, index)),
                (sum(gauge.sweep) / 2 if zero_deg is None else zero_deg) if quantity.name in zeros_deg else None,
            )
    return uncertainties


def _parallax_deg(drawn: PanelPictures, index: int) -> float:
    """Estimate what needles of unknown height above their marks leave in doubt, from the side the camera sees them.

    Seen obliquely a needle lies beside the marks that it points to, up to its height times the tangent of the view.
    """
    if drawn.grid(index).raised is not None:
        return 0.0  # then its height is known
    plane = drawn.grid(index).plane
    oblique = math.hypot(USUAL_VIEW, 0.0 if plane is None else plane.obliqueness)
    return math.degrees(NEEDLE_HEIGHT_PART * oblique / math.sqrt(2.0))


def _squeezed_deg(drawn: PanelPictures, index: int) -> float:
    """Estimate by how much a turn is read too far or not far enough on a dial drawn as seen square on, which it is not.

    A circle that is seen obliquely is an ellipse; marks that stand still are drawn on it, those that turn are not.
    """
    if drawn.grid(index).plane is not None or drawn.panel.gauges[index].window is not None:
        return 0.0
    return math.degrees(USUAL_VIEW**2 / 4 / math.sqrt(2.0))


def _height_px(drawn: PanelPictures, index: int) -> float:
    """Estimate what a needle's height leaves to doubt of where it turns."""
    raised = drawn.grid(index).raised
    if raised is None:
        return 0.0
    x, y = drawn.optics.straight(np.array(drawn.panel.gauges[index].centre)[:, None])[:, 0].tolist()
    return HEIGHT_PART * raised.px_at((x, y))


def _places_px(pivots: Sequence[Pivot], least_px: float) -> list[float]:
    """By gauge: how far its dial is beside where it is unwrapped, as its needles' tilts scatter."""
    shared_px2 = _middling([pivot.scatter_px2 for pivot in pivots if pivot.tilts])
    own_px2 = [
        (pivot.tilts * pivot.scatter_px2 + SHARED_TILTS * shared_px2) / (pivot.tilts + SHARED_TILTS) for pivot in pivots
    ]
    return [math.hypot(least_px, math.sqrt(max(value, 0.0))) for value in own_px2]


def _middling(values: Sequence[float]) -> float:
    """Average all but the lowest and the highest: one odd gauge says nothing of the others."""
    if not values:
        return 0.0
    inner = sorted(values)[1:-1] or values
    return sum(inner) / len(inner)
