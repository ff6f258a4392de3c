"""What readings are uncertain by beyond what their own frames tell: the panel's drawing, the pivot, the dial's place.

A frame tells how sharply a needle is seen and how well the panel is found. It does not tell how precisely somebody
drew the scale (the printed marks do), where the needle truly turns (its tilts do), nor by how much a dial is found
beside its place (the scatter of those tilts does).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from decoder.arrays import Floats
from decoder.panel_pictures import PanelPictures
from decoder.pivots import Pivot
from decoder.printed_marks import drawn_to_deg, marks_off_deg
from decoder.reading import Reading

# Where a dial's marks do not tell how precisely it is drawn: about a tenth of a pixel, at the needle's mean radius.
DRAWN_PX = 0.1
# Where they do, so much is left that no noise explains: blur and sampling do not treat all places of a needle alike.
MODEL_PX = 0.006
# The zero of a needle that the panel picture does not show.
ZERO_PX = 0.02
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
    drawn: PanelPictures, pivots: Sequence[Pivot], zeros: Sequence[Mapping[str, Reading]], *, dials_move: bool
) -> dict[str, QuantityUncertainty]:
    """By quantity's name.

    Parameters
    ----------
    drawn
        The panel as it was given, before pivots were moved.
    pivots
        By the gauges' order in the panel: what is still to be thought of each.
    zeros
        The needles as they are found in the panel picture, by the gauges' order.
    dials_move
        Whether each dial is found by itself.
    """
    places_px = _places_px(pivots, FOUND_PX if dials_move else 0.0)
    uncertainties = {}
    parts = zip(drawn.panel.gauges, pivots, zeros, places_px, strict=True)
    for index, (gauge, pivot, found, place_px) in enumerate(parts):
        radius_px, grid = sum(gauge.radius) / 2, drawn.grid(index)
        zeros_deg = {needle.name: needle.template.at for needle in gauge.needles}
        scales_deg: dict[tuple[float, ...], float | None] = {}  # needles of one gauge mostly have one scale
        for quantity in gauge.quantities:
            angles_deg = tuple(angle for angle, _ in quantity.marks)
            if angles_deg not in scales_deg:
                off_deg = marks_off_deg(angles_deg, gauge.radius[1], grid, drawn.picture, drawn.optics.own)
                scales_deg[angles_deg] = drawn_to_deg(off_deg, gauge.radius[1])
            scale_deg = scales_deg[angles_deg]
            drawn_deg = _drawn_deg(scale_deg, found.get(quantity.name), radius_px)
            zero_deg = zeros_deg.get(quantity.name)
            uncertainties[quantity.name] = QuantityUncertainty(
                drawn_deg,
                place_px if quantity.name in zeros_deg else 0.0,
                radius_px,
                pivot.blurred(_height_px(drawn, index)),
                (sum(gauge.sweep) / 2 if zero_deg is None else zero_deg) if quantity.name in zeros_deg else None,
            )
    return uncertainties


def _drawn_deg(scale_deg: float | None, zero: Reading | None, radius_px: float) -> float:
    """By the scale and the needle's zero, which has no marks: who drew the one with care drew the other with as much.

    Without marks, and without a needle in the panel picture, it is what can be drawn.
    """
    if scale_deg is None:
        return math.degrees(DRAWN_PX / radius_px)
    if zero is None or not math.isfinite(zero.sigma_deg):
        return math.hypot(scale_deg, math.degrees(ZERO_PX / radius_px))
    return math.hypot(scale_deg, scale_deg, zero.sigma_deg, math.degrees(MODEL_PX / radius_px))


def _height_px(drawn: PanelPictures, index: int) -> float:
    """What a needle's height leaves to doubt of where it turns."""
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
    """The mean without the lowest and the highest: one odd gauge says nothing of the others."""
    if not values:
        return 0.0
    inner = sorted(values)[1:-1] or values
    return sum(inner) / len(inner)
