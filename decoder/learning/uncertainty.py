"""What readings are uncertain by beyond what their own frames tell: the panel's drawing, the pivot, the dial's place.

A frame tells how sharply a needle is seen and how well the panel is found. It does not tell how precisely somebody
drew the scale (to a fifth of a pixel, or as carelessly as the centres), from which side the camera sees needles that
turn above their marks, where they truly turn (their tilts do), nor by how much a dial is found beside its place (the
scatter of those tilts does).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.sorting import median
from decoder.imaging.thresholds import HALF
from decoder.instruments.reading import Reading, Status
from decoder.learning.budget import Cause
from decoder.learning.drawn_points import uneven_deg
from decoder.learning.pivot_path import PivotPath, Vector
from decoder.learning.thresholds import HAND_PX, MOST_MARK_PART
from decoder.matching.needle_template import NeedleTemplate
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.panel.scale import FULL_CIRCLE_DEG, Quantity, shortest
from decoder.registration.pivot import Pivot, across
from decoder.registration.thresholds import CERTAIN_SIGMAS

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
# Of a uniform distribution the standard deviation, for each unit of its width: what was not seen may be anywhere.
ANYWHERE = 12**-0.5
# One dial's needles tell little of how well dials are found: the others count for as much as so many tilts of its own.
SHARED_TILTS = 16


@dataclass(frozen=True, slots=True)
class QuantityUncertainty:
    """One quantity's.

    Attributes
    ----------
    drawn_deg
        By its scale, as somebody drew it.
    seen_deg
        By the side from which the camera sees it: that is only allowed for, as nothing in a flight tells it.
    place_px
        By where its dial is found.
    radius_px
        At which it is read.
    pivot
        Its gauge's.
    missed_px
        From how far beside it marks and zero may have been seen, (x, y).
    rim_px
        How far out its marks are. The needle was seen along all of its length, on average at `radius_px`.
    zero_deg
        The angle at which the needle's zero was set; None for a card, which is read all round: beside its pivot one
        half makes up for the other.
    marks_deg
        Where its marks are, rising; none where it is read all round, and no angle lies beyond them.
    """

    drawn_deg: float
    seen_deg: float
    place_px: float
    radius_px: float
    pivot: Pivot
    missed_px: Vector
    rim_px: float
    zero_deg: float | None
    marks_deg: tuple[float, ...] = ()

    def sigma_deg(self, angles_deg: Floats) -> Floats:
        """(N,): a standard uncertainty for readings at these angles."""
        return _together(self.parts_deg(angles_deg).values())

    def parts_deg(self, angles_deg: Floats) -> dict[Cause, Floats]:
        """(N,) by cause: what the standard uncertainty is the root of the sum of squares of."""
        drawn_deg, pivot_deg = np.full_like(angles_deg, self.drawn_deg), np.zeros_like(angles_deg)
        if self.zero_deg is not None:
            drawn_deg = np.hypot(drawn_deg * self._lever(angles_deg), self._missed_deg(angles_deg, self.zero_deg))
            pivot_deg = self.pivot.sigma_deg(angles_deg, self.zero_deg, self.radius_px)
        return {
            Cause.DRAWN: drawn_deg,
            Cause.PIVOT: pivot_deg,
            Cause.VIEWED: np.full_like(angles_deg, self.seen_deg),
            Cause.PLACED: np.full_like(angles_deg, math.degrees(self.place_px / self.radius_px)),
        }

    def _missed_deg(self, angles_deg: Floats, zero_deg: float) -> Floats:
        """(N,): by how much marks and zero are off if they were seen from that far beside: what is nearer by more."""
        missed_px = np.array(self.missed_px)
        marks, zero = across(angles_deg) @ missed_px, across(np.array([zero_deg])) @ missed_px
        off_deg: Floats = np.degrees(np.abs(marks / self.rim_px - zero / self.radius_px))
        return off_deg

    def _lever(self, angles_deg: Floats) -> Floats:
        """(N,): how many times as far a scale is off as one of its marks: beyond the last the last two tell it."""
        if len(self.marks_deg) < 2:  # noqa: PLR2004 - then nothing lies beyond them
            return np.ones_like(angles_deg)
        first, second, *_ = self.marks_deg
        *_, before, last = self.marks_deg
        beyond = np.maximum((first - angles_deg) / (second - first), (angles_deg - last) / (last - before))
        beyond = np.maximum(np.nan_to_num(beyond), 0.0)
        lever: Floats = np.hypot(1.0 + beyond, beyond)
        return lever


def quantity_uncertainties(
    drawn: PanelPictures,
    told: Sequence[Gauge],
    pivots: Sequence[Pivot],
    *,
    paths: Sequence[PivotPath],
    log_odds: float,
    care_part: float,
    dials_move: bool,
    found: Sequence[Mapping[str, Reading]] = (),
    templates: Mapping[str, NeedleTemplate] = MappingProxyType({}),
) -> dict[str, QuantityUncertainty]:
    """Estimate, by quantity, what its readings are uncertain by beyond what their frames tell.

    Parameters
    ----------
    drawn
        The panel as it was given, before pivots were moved.
    told
        Its gauges with angles as they are read, around their pivots.
    pivots
        By the gauges' order in the panel: what is still to be thought of each.
    paths
        By the same order: how far each was moved from where it is drawn.
    log_odds
        Of marks that are points seen from where centres are drawn, and not angles.
    care_part
        How far beside their pivots the panel's centres are drawn, of the radius: the same hand drew its marks.
    dials_move
        Whether each dial is found by itself.
    found
        By frame of a sample, what was read.
    templates
        By needle, what it looks like to the flight.
    """
    places_px = _places_px(pivots, FOUND_PX if dials_move else 0.0)
    uncertainties = {}
    for index, parts in enumerate(zip(drawn.panel.gauges, told, pivots, places_px, paths, strict=True)):
        gauge, as_told, pivot, place_px, path = parts
        as_card = _of_card(drawn, index, pivot, path, log_odds=log_odds, care_part=care_part)
        missed = _to_allow_for(-abs(log_odds))
        as_needle = replace(
            as_card,
            drawn_deg=_by_hand_deg(gauge, care_part),
            place_px=place_px,
            missed_px=(missed * path.beside_px[0], missed * path.beside_px[1]),
        )
        as_written = replace(as_card, drawn_deg=0.0, seen_deg=0.0)  # what is written was drawn by nobody
        # Marks that are uneven were seen from beside their middle, and so was all else on the dial.
        marks_deg = max((uneven_deg(quantity) for quantity in as_told.quantities), default=0.0)
        as_card, as_needle = (replace(each, drawn_deg=max(each.drawn_deg, marks_deg)) for each in (as_card, as_needle))
        needles, mistaken = {needle.name for needle in gauge.turning}, _mistaken(gauge, pivot, found, templates)
        for quantity in as_told.quantities:
            name = quantity.name
            if quantity.written is not None or not quantity.is_drawn:
                uncertainties[name] = as_written
            elif name in needles:
                uncertainties[name] = _of_needle(as_needle, gauge, quantity, is_mistaken=name in mistaken)
            else:
                uncertainties[name] = as_card
    return uncertainties


def _of_needle(
    dial: QuantityUncertainty, gauge: Gauge, quantity: Quantity, *, is_mistaken: bool
) -> QuantityUncertainty:
    """Estimate it for one needle of a dial; one that may be another thing may point anywhere along the sweep."""
    first_deg, last_deg = gauge.sweep
    (zero_deg,) = (needle.at_deg for needle in gauge.turning if needle.name == quantity.name)
    anywhere_deg = ANYWHERE * (last_deg - first_deg) if is_mistaken else 0.0
    return replace(
        dial,
        drawn_deg=math.hypot(dial.drawn_deg, anywhere_deg),
        zero_deg=(first_deg + last_deg) / 2 if zero_deg is None else zero_deg,
        marks_deg=() if quantity.wraps is not None else tuple(angle_deg for angle_deg, _ in quantity.marks),
    )


def _of_card(
    drawn: PanelPictures, index: int, pivot: Pivot, path: PivotPath, *, log_odds: float, care_part: float
) -> QuantityUncertainty:
    """Estimate it for a card, whose marks are carried to where it turns, as far as that is known."""
    gauge = drawn.panel.gauges[index]
    rim_px = gauge.radius[1]
    card_px = 0.0
    if gauge.window is None:
        missed, points = _to_allow_for(-abs(log_odds)), _to_allow_for(log_odds)
        doubt_px = pivot.sigma_px if path.was_moved else care_part * rim_px
        card_px = math.hypot(missed * math.hypot(*path.beside_px), points * doubt_px)
    return QuantityUncertainty(
        drawn_deg=math.hypot(_by_hand_deg(gauge, care_part), math.degrees(card_px / rim_px)),
        seen_deg=_parallax_deg(drawn, index) if gauge.turning else _squeezed_deg(drawn, index),
        place_px=0.0,
        radius_px=gauge.arc_px,
        pivot=pivot.blurred(_height_px(drawn, index)),
        missed_px=(0.0, 0.0),
        rim_px=rim_px,
        zero_deg=None,
    )


def _by_hand_deg(gauge: Gauge, care_part: float) -> float:
    """Estimate how precisely a scale is drawn: as its centre, as is said, and to a fifth of a pixel at best."""
    missed = MARK_PART * care_part
    hand = math.hypot(HAND_PX / gauge.arc_px, min(missed, MOST_MARK_PART))
    return math.hypot(math.degrees(hand), gauge.doubt_deg)


def _to_allow_for(log_odds: float) -> float:
    """Tell by which part of itself an error counts that is there at such odds.

    A 95 % interval has to hold it, unless it is less likely than one in twenty.
    """
    return math.sqrt(min(10.0 * (1.0 + math.tanh(log_odds / 2)), 1.0))


def _mistaken(
    gauge: Gauge, pivot: Pivot, found: Sequence[Mapping[str, Reading]], templates: Mapping[str, NeedleTemplate]
) -> frozenset[str]:
    """Name needles that may not be what was cut for them, but the dial beside or beyond them.

    The cut may lie beside a needle around a centre that is far off, and beyond its tip where `radius` begins there.
    Around such a centre what was found elsewhere than where it was cut is a needle for all that; what was cut beyond a
    tip is if it mostly moves, by more than its readings are uncertain by. Hands that tell one value may stand still for
    long, but must go together.
    """
    mistaken = set()
    agreeing = () if gauge.combination is None else gauge.combination.parts
    for needle in gauge.turning:
        if needle.at_deg is not None and needle.hides_deg is not None:
            at_deg, half_deg = np.array([needle.at_deg]), needle.hides_deg / 2
            sideways = across(at_deg)[0]
            beside_deg = math.degrees(math.sqrt(sideways @ pivot.covariance_px2 @ sideways) / gauge.arc_px)
            read = [each[needle.name] for each in found if each[needle.name].status is not Status.MISSING]
            off_deg = shortest(np.array([reading.angle_deg for reading in read]) - at_deg, FULL_CIRCLE_DEG)
            sigma_deg = np.array([reading.sigma_deg for reading in read])
            moves = np.abs(off_deg - (median(off_deg) if read else 0.0)) > CERTAIN_SIGMAS * sigma_deg
            is_beside = CERTAIN_SIGMAS * beside_deg > half_deg and not (np.abs(off_deg) > half_deg).any()
            is_beyond = needle.name not in agreeing and needle in gauge.over_face
            is_beyond &= not _comes_from_hub(templates.get(needle.name))
            if is_beside or (is_beyond and moves.sum() <= HALF * len(read)):
                mistaken.add(needle.name)
    return frozenset(mistaken)


def _comes_from_hub(template: NeedleTemplate | None) -> bool:
    """Whether something covers a needle's axis in the inner half of where it is looked for, as far as is known."""
    if template is None:
        return True
    covers = 1.0 - template.transparency[template.rows // 2]
    return float(covers[: -(-len(covers) // 2)].mean()) > HALF


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


def _together(parts: Iterable[Floats]) -> Floats:
    total: Floats = functools.reduce(np.hypot, parts)
    return total


def _middling(values: Sequence[float]) -> float:
    """Average all but the lowest and the highest: one odd gauge says nothing of the others."""
    if not values:
        return 0.0
    inner = sorted(values)[1:-1] or values
    return sum(inner) / len(inner)
