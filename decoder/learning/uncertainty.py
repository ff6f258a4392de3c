"""Uncertainty of readings beyond that from their own frames: the panel's drawing, the pivot, the dial's position.

A frame shows how sharp a needle is and how well the panel is located. It does not show how precisely somebody drew the
scale (to a fifth of a pixel, or as carelessly as the centres), from which side the camera sees needles that stand above
their marks, where the needles truly turn (estimated from their tilts), or how far off a dial is located (estimated from
the scatter of those tilts).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.planes import Squeeze
from decoder.imaging.thresholds import HALF
from decoder.instruments.reading import ANYWHERE, Reading, Status
from decoder.instruments.thresholds import MIDDLE_PART
from decoder.learning.budget import Cause
from decoder.learning.drawn_points import marks_missed_px, slips_deg, uneven_deg
from decoder.learning.pivot_path import PivotPath, Vector
from decoder.learning.thresholds import HAND_PX, MOST_MARK_PART
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.thresholds import MIN_VIEWS
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.panel.kind import Pointer
from decoder.panel.scale import FULL_CIRCLE_DEG, Quantity, Scale, shortest
from decoder.registration.pivot import Pivot, across
from decoder.registration.thresholds import CERTAIN_SIGMAS

# Marks are drawn more precisely than centres, because a mark is a visible line while a pivot lies under a cap: their
# error is this part of the centres' error, limited to a part of the radius (`MOST_MARK_PART`).
MARK_PART = 1 / 3
# Height of needles above their marks, in radii: 0.05 inches on a dial with a radius of 1.25 inches.
NEEDLE_HEIGHT_PART = 0.04
# Tangent of the usual viewing angle, as a minimum: a camera as far from a panel as it is wide sees its edges at 0.5.
USUAL_VIEW = 0.2
# Position error of a dial that is located by itself, beyond its own pixels' noise.
FOUND_PX = 0.02
# Error of a raised needle's apparent pivot that no tilt shows, as a part of its height: the needle casts a shadow to
# one side, and its height is given to a hundredth of an inch only.
HEIGHT_PART = 0.005
# Places all round a dial, to average over.
BETWEEN_MARKS = 361
# One dial's needles hardly show how well it is located: the scatter of all dials counts like this many of its tilts.
SHARED_TILTS = 16


@dataclass(frozen=True, slots=True)
class QuantityUncertainty:
    """The uncertainty of one quantity's readings.

    Attributes
    ----------
    drawn_deg
        From its scale as it was drawn.
    seen_deg
        From the side the camera sees it from: an allowance only, since nothing in a flight shows it.
    place_px
        From the position at which its dial is located.
    radius_px
        The radius at which it is read.
    pivot
        Its gauge's.
    missed_px
        How far beside the pivot marks and zero may have been seen from, (x, y).
    rim_px
        The radius of its marks. The needle was seen along its whole length, at `radius_px` on average.
    zero_deg
        The angle at which the needle's zero was set; None for a card, which is read all around, so that the effects of
        a wrong pivot on its two halves cancel.
    scale
        Its marks; None where it is read all around, so that no angle lies beyond them.
    beside_deg
        From the distance between a needle's middle and where it is drawn: an allowance only, since nothing in a flight
        shows which of the two is where it points.
    bowed
        The quantity, if its scale may be bowed between its marks.
    slips_deg
        For each mark of its scale how far it is off what its neighbours make of it, if any is.
    stretched_part
        The part by which a shift may be longer or shorter, seen from aside, than where its ladder was drawn.
    is_seen_aside
        Whether the picture or the flight shows that its dial is seen from aside, which it is read without.
    """

    drawn_deg: float
    seen_deg: float
    place_px: float
    radius_px: float
    pivot: Pivot
    missed_px: Vector
    rim_px: float
    zero_deg: float | None
    scale: Scale | None = None
    beside_deg: float = 0.0
    bowed: Quantity | None = None
    slips_deg: Floats | None = None
    stretched_part: float = 0.0
    is_seen_aside: bool = False

    @property
    def allowed_deg(self) -> float:
        """The part of the uncertainty that is an allowance, not estimated from this panel or flight."""
        return math.hypot(0.0 if self.is_seen_aside else self.seen_deg, self.beside_deg)

    def sigma_deg(self, angles_deg: Floats) -> Floats:
        """(N,): the standard uncertainty of readings at these angles."""
        return _together(self.parts_deg(angles_deg).values())

    def parts_deg(self, angles_deg: Floats) -> dict[Cause, Floats]:
        """(N,) for each cause: the contributions, whose root sum of squares is the standard uncertainty."""
        drawn_deg, pivot_deg = np.full_like(angles_deg, self.drawn_deg), np.zeros_like(angles_deg)
        if self.zero_deg is not None:
            drawn_deg = np.hypot(drawn_deg * self._lever(angles_deg), self._missed_deg(angles_deg, self.zero_deg))
            if self.scale is not None:  # it may bend between its marks, or run straight
                drawn_deg = np.hypot(drawn_deg, np.nan_to_num(self.scale.bends_deg(angles_deg)))
                drawn_deg = np.hypot(drawn_deg, self._slipped_deg(angles_deg, self.scale))
            pivot_deg = self.pivot.sigma_deg(angles_deg, self.zero_deg, self.radius_px)
        if self.bowed is not None:
            drawn_deg = np.hypot(drawn_deg, Scale.of(self.bowed.marks).bowed_deg(angles_deg, self.bowed.bow_per_deg))
        return {
            Cause.DRAWN: np.hypot(drawn_deg, self.beside_deg),
            Cause.PIVOT: pivot_deg,
            Cause.VIEWED: np.hypot(self.seen_deg, self.stretched_part * angles_deg),
            Cause.PLACED: np.full_like(angles_deg, math.degrees(self.place_px / self.radius_px)),
        }

    def _slipped_deg(self, angles_deg: Floats, scale: Scale) -> Floats:
        """(N,): how far off values next to a mark may be that does not fit its neighbours; either may be wrong."""
        if self.slips_deg is None:
            return np.zeros_like(angles_deg)
        after = np.clip(np.searchsorted(scale.angles_deg, angles_deg), 1, len(self.slips_deg) - 1)
        slipped_deg: Floats = np.maximum(*np.abs([self.slips_deg[after - 1], self.slips_deg[after]]))
        return slipped_deg

    def _missed_deg(self, angles_deg: Floats, zero_deg: float) -> Floats:
        """(N,): the error if marks and zero were seen from `missed_px` beside the pivot; larger at small radii."""
        missed_px = np.array(self.missed_px)
        marks, zero = across(angles_deg) @ missed_px, across(np.array([zero_deg])) @ missed_px
        off_deg: Floats = np.degrees(np.abs(marks / self.rim_px - zero / self.radius_px))
        return off_deg

    def _lever(self, angles_deg: Floats) -> Floats:
        """(N,): the error of the scale relative to that of one mark; beyond the marks it extrapolates from two."""
        if self.scale is None:
            return np.ones_like(angles_deg)
        first, second, *_ = self.scale.angles_deg
        *_, before, last = self.scale.angles_deg
        beyond = np.maximum((first - angles_deg) / (second - first), (angles_deg - last) / (last - before))
        beyond = np.maximum(np.nan_to_num(beyond), 0.0)
        lever: Floats = np.hypot(1.0 + beyond, beyond)
        return lever


@dataclass(frozen=True, slots=True)
class _Care:
    """How carelessly a panel is drawn: the error of centres, as a part of the radius, and of marks beyond HAND_PX."""

    centres_part: float
    marks_px: float


@dataclass(frozen=True, slots=True)
class _View:
    """The parts by which a dial may be squeezed beyond what its reading knows: all around it, and along a shift.

    `obliqueness` is the tangent of the angle from which it is seen, and `rolled_deg` how far the dial's own upright may
    be from straight up, if nobody drew it.
    """

    around_part: float
    along_part: float
    obliqueness: float
    rolled_deg: float = 0.0


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
    squeezes: Sequence[Squeeze | None] = (),
    squared_up: Sequence[Squeeze | None] = (),
) -> dict[str, QuantityUncertainty]:
    """Estimate, for each quantity, the uncertainty of its readings beyond that from their own frames.

    Parameters
    ----------
    drawn
        The panel as it was given, before pivots were moved.
    told
        Its gauges with angles as they are read, around their pivots.
    pivots
        For each gauge in the panel's order, what remains uncertain of its pivot.
    paths
        In the same order: how far each was moved from where it is drawn.
    log_odds
        The log odds that marks are points as seen from where centres are drawn, rather than angles.
    care_part
        How far the panel's centres are drawn from their pivots, as a part of the radius; marks were drawn alike.
    dials_move
        Whether each dial is located by itself.
    found
        For each frame of a sample, what was read.
    templates
        For each needle, what it looks like in the flight.
    squeezes
        For each gauge that was not squared up, how the view squeezes it, if that is known.
    squared_up
        For each gauge that was, how it was squeezed: others of the panel are likely seen about as obliquely.
    """
    places_px = _places_px(pivots, FOUND_PX if dials_move else 0.0)
    care = _Care(care_part, marks_missed_px(told))
    views = _views(drawn, squeezes, squared_up)
    uncertainties = {}
    for index, parts in enumerate(zip(drawn.panel.gauges, told, pivots, places_px, paths, views, strict=True)):
        gauge, as_told, pivot, place_px, path, view = parts
        squeeze = squeezes[index] if squeezes else None
        as_card = _of_card(drawn, index, pivot, path, log_odds=log_odds, care=care, squeeze=squeeze, view=view)
        as_needle = replace(
            as_card, drawn_deg=_by_hand_deg(gauge, care), place_px=place_px, missed_px=_missed_px(path, log_odds)
        )
        as_written = replace(as_card, drawn_deg=0.0, seen_deg=0.0)  # its scale is given in writing, not drawn
        # If the marks are uneven, they were seen from off-centre, and so was everything else on the dial.
        marks_deg = max((uneven_deg(quantity) for quantity in as_told.quantities), default=0.0)
        as_card, as_needle = (replace(each, drawn_deg=max(each.drawn_deg, marks_deg)) for each in (as_card, as_needle))
        needles, mistaken = {needle.name for needle in gauge.turning}, _mistaken(gauge, pivot, found, templates)
        for quantity in as_told.quantities:
            name = quantity.name
            if quantity.written is not None or not quantity.is_drawn:
                uncertainties[name] = as_written
            elif name in needles:
                own = _of_needle(as_needle, gauge, quantity, care, is_mistaken=name in mistaken)
                own = replace(
                    own,
                    seen_deg=math.hypot(own.seen_deg, _between_marks_deg(quantity, view.around_part)),
                    is_seen_aside=squeeze is not None and squeeze.part > MOST_MARK_PART,
                )
                uncertainties[name] = _beside_middle(own, gauge, name, templates)
            else:
                uncertainties[name] = _of_other(as_card, gauge, quantity, path, care, view=view)
    return uncertainties


def _views(
    drawn: PanelPictures, squeezes: Sequence[Squeeze | None], squared_up: Sequence[Squeeze | None]
) -> Iterator[_View]:
    """For each gauge, say how obliquely it may be seen beyond what its reading takes into account."""
    none = (None,) * len(drawn.panel.gauges)
    others = max(
        (each for each in squared_up if each is not None), key=lambda each: each.part, default=Squeeze(0.0, 0.0)
    )
    for index, (own, known) in enumerate(zip(squeezes or none, squared_up or none, strict=True)):
        plane, likely = drawn.grid(index).plane, own or others
        if known is not None:
            yield _View(known.doubt, known.doubt, known.obliqueness, _rolled_deg(others))
        elif plane is not None:
            yield _View(0.0, 0.0, plane.obliqueness)
        else:
            along_part = math.hypot(likely.part, USUAL_VIEW**2 / 4)
            yield _View(likely.part, along_part, likely.obliqueness, _rolled_deg(likely))


def _rolled_deg(squeeze: Squeeze) -> float:
    """Estimate how far from straight up an upright appears where a circle appears like that.

    On a dial that is squared up, uprights are as far to one side if the camera is held along uprights as they are to
    the other side if it is held along levels: by `askew`, which may be anything up to the squeeze's part.
    """
    return math.degrees(squeeze.part / math.sqrt(2.0))


def _of_other(
    dial: QuantityUncertainty, gauge: Gauge, quantity: Quantity, path: PivotPath, care: _Care, *, view: _View
) -> QuantityUncertainty:
    """Estimate it for anything but a needle; an error in drawing a zero of its own affects all values alike."""
    dial = replace(dial, bowed=quantity if quantity.bow_per_deg else None)
    if quantity.has_drawn_zero or quantity.has_upright_zero:
        hand_deg = _hand_deg(gauge, care) if quantity.has_drawn_zero else 0.0
        rolled_deg = view.rolled_deg if quantity.has_upright_zero else 0.0
        return replace(dial, drawn_deg=math.hypot(dial.drawn_deg, hand_deg, rolled_deg))
    return replace(_of_shift(dial, path, care), stretched_part=view.along_part) if quantity.is_shift else dial


def _of_needle(
    dial: QuantityUncertainty, gauge: Gauge, quantity: Quantity, care: _Care, *, is_mistaken: bool
) -> QuantityUncertainty:
    """Estimate it for one needle of a dial; if it may be mistaken for something else, allow for the whole sweep.

    Where the needle was cut was drawn by hand, like the marks: an error there shifts all readings.
    """
    first_deg, last_deg = gauge.sweep
    (zero_deg,) = (needle.at_deg for needle in gauge.turning if needle.name == quantity.name)
    cut_deg = 0.0 if zero_deg is None else _hand_deg(gauge, care)
    anywhere_deg = ANYWHERE * (last_deg - first_deg) if is_mistaken else 0.0
    return replace(
        dial,
        drawn_deg=math.hypot(dial.drawn_deg, cut_deg, anywhere_deg),
        zero_deg=(first_deg + last_deg) / 2 if zero_deg is None else zero_deg,
        scale=None if quantity.wraps is not None else Scale.of(quantity.marks),
        slips_deg=slips if (slips := slips_deg(quantity)).any() else None,
    )


def _beside_middle(
    dial: QuantityUncertainty, gauge: Gauge, name: str, templates: Mapping[str, NeedleTemplate]
) -> QuantityUncertainty:
    """Allow for most of the distance between a needle's middle and its drawn angle, if it was cut from the picture."""
    if name not in templates or any(each.name == name and each.at_deg is None for each in gauge.turning):
        return dial
    return replace(dial, beside_deg=MIDDLE_PART * abs(templates[name].beside_deg))


def _of_card(
    drawn: PanelPictures,
    index: int,
    pivot: Pivot,
    path: PivotPath,
    *,
    log_odds: float,
    care: _Care,
    squeeze: Squeeze | None,
    view: _View,
) -> QuantityUncertainty:
    """Estimate it for a card, allowing for marks that were not drawn around its pivot."""
    gauge = drawn.panel.gauges[index]
    rim_px = gauge.radius[1]
    card_px = 0.0
    if gauge.window is None:
        missed, points = _to_allow_for(-abs(log_odds)), _to_allow_for(log_odds)
        doubt_px = pivot.sigma_px if path.was_moved else care.centres_part * _drawn_px(gauge)
        card_px = math.hypot(missed * math.hypot(*path.beside_px), points * doubt_px)
    aside_deg = 0.0 if squeeze is None else squeeze.turns_off_deg
    seen_deg = _parallax_deg(drawn, index, view) if gauge.turning else _squeezed_deg(drawn, index)
    return QuantityUncertainty(
        drawn_deg=math.hypot(_by_hand_deg(gauge, care), math.degrees(card_px / rim_px)),
        seen_deg=math.hypot(seen_deg, aside_deg),
        place_px=0.0,
        radius_px=gauge.arc_px,
        pivot=pivot.blurred(_height_px(drawn, index)),
        missed_px=(0.0, 0.0),
        rim_px=rim_px,
        zero_deg=None,
    )


def _of_shift(dial: QuantityUncertainty, path: PivotPath, care: _Care) -> QuantityUncertainty:
    """Estimate it for a shift, such as pitch, which is measured from the pivot and so shares its error.

    Its marks lie beside the pivot, not along the rim, so their drawing errors count in full. Seen from aside, a shift
    one way appears longer than one the other way, and the horizon shifts along whichever its bank makes its upright.
    """
    beside_px = math.hypot(care.marks_px, dial.pivot.sigma_px if path.was_moved else 0.0)
    return replace(dial, drawn_deg=math.hypot(dial.drawn_deg, math.degrees(beside_px / dial.radius_px)))


def _by_hand_deg(gauge: Gauge, care: _Care) -> float:
    """Estimate how precisely a scale is drawn: from the panel's care in general, and the gauge's own `doubt_deg`."""
    return math.hypot(_hand_deg(gauge, care), gauge.doubt_deg)


def _hand_deg(gauge: Gauge, care: _Care) -> float:
    """Estimate how precisely one angle is drawn: like the panel's centres and marks, and to HAND_PX at best."""
    missed = MARK_PART * care.centres_part
    missed_px = min(missed, MOST_MARK_PART) * _drawn_px(gauge)
    return math.degrees(
        math.hypot(HAND_PX / gauge.arc_px, care.marks_px / gauge.radius[1], missed_px / gauge.radius[1])
    )


def _drawn_px(gauge: Gauge) -> float:
    """Return how large a gauge is drawn: its radius, or half of a tube, of whose bend nobody draws the centre."""
    is_tube = gauge.window is None and not (gauge.turning or gauge.is_round)
    return gauge.radius[1] * (math.radians(np.ptp(gauge.sweep)) / 2 if is_tube else 1.0)


def _missed_px(path: PivotPath, log_odds: float) -> Vector:
    """Return from how far beside the pivot marks and zero may have been seen, (x, y), reduced if that is unlikely."""
    missed = _to_allow_for(-abs(log_odds))
    return missed * path.beside_px[0], missed * path.beside_px[1]


def _to_allow_for(log_odds: float) -> float:
    """Return the factor on an error that is present with these log odds.

    A 95 % interval has to cover it, unless it is less likely than one in twenty.
    """
    return math.sqrt(min(10.0 * (1.0 + math.tanh(log_odds / 2)), 1.0))


def _mistaken(
    gauge: Gauge, pivot: Pivot, found: Sequence[Mapping[str, Reading]], templates: Mapping[str, NeedleTemplate]
) -> frozenset[str]:
    """Name needles whose cut may show not the needle but the dial beside it or beyond its tip.

    A cut may miss the needle sideways if the drawn centre is far off. Then a needle that is found anywhere else proves
    that it was not missed. A cut may also lie beyond the needle's tip if `radius` begins there. Then it is a needle if
    it moves in most frames by more than its uncertainty; or if it is found elsewhere in some frames while nothing
    covers the place where it was cut, since print would still be seen there. Geared hands are exempt from this second
    test: they may stand still for long, but have to agree.
    """
    mistaken = set()
    agreeing = () if gauge.combination is None else gauge.combination.parts
    for needle in gauge.turning:
        if needle.at_deg is not None and needle.hides_deg is not None:
            at_deg, half_deg = np.array([needle.at_deg]), needle.hides_deg / 2
            sideways = across(at_deg)[0]
            beside_deg = math.degrees(math.sqrt(sideways @ pivot.covariance_px2 @ sideways) / gauge.arc_px)
            read = [each[needle.name] for each in found if each[needle.name].is_seen]
            off_deg = shortest(np.array([reading.angle_deg for reading in read]) - at_deg, FULL_CIRCLE_DEG)
            sigma_deg = np.array([reading.sigma_deg for reading in read])
            moves = np.abs(off_deg - off_deg[:, None]) > CERTAIN_SIGMAS * sigma_deg  # from each of them
            moved = int(moves.sum(axis=1).min(initial=len(read)))
            is_beside = CERTAIN_SIGMAS * beside_deg > half_deg and not (np.abs(off_deg) > half_deg).any()
            is_beyond = needle.name not in agreeing and needle in gauge.over_face
            is_beyond &= not _comes_from_hub(templates.get(needle.name))
            is_seen_to_move = moved > HALF * len(read) or _times_elsewhere(gauge, needle, found) >= MIN_VIEWS
            if is_beside or (is_beyond and not is_seen_to_move):
                mistaken.add(needle.name)
    return frozenset(mistaken)


def _times_elsewhere(gauge: Gauge, needle: Pointer, found: Sequence[Mapping[str, Reading]]) -> int:
    """Count the frames in which a needle is surely elsewhere than where it was cut, with no other needle in that place.

    Half of its own width away is enough: it would not be `READ` if print at that place matched about as well.
    """

    def is_there(pointer: Pointer, readings: Mapping[str, Reading]) -> bool:
        others_deg = 0.0 if pointer.name == needle.name else pointer.hides_deg or 0.0
        reach_deg = ((needle.hides_deg or 0.0) + others_deg) / 2
        off_deg = shortest(np.array(readings[pointer.name].angle_deg - (needle.at_deg or 0.0)), FULL_CIRCLE_DEG)
        return readings[pointer.name].status is Status.MISSING or abs(float(off_deg)) <= reach_deg

    return sum(
        readings[needle.name].status is Status.READ and not any(is_there(each, readings) for each in gauge.turning)
        for readings in found
    )


def _comes_from_hub(template: NeedleTemplate | None) -> bool:
    """Whether something covers a needle's axis in the inner half of its search area; True if unknown."""
    if template is None:
        return True
    covers = 1.0 - template.transparency[template.rows // 2]
    return float(covers[: -(-len(covers) // 2)].mean()) > HALF


def _parallax_deg(drawn: PanelPictures, index: int, view: _View) -> float:
    """Estimate the uncertainty due to parallax of needles whose height above their marks is unknown.

    Seen obliquely, a needle appears beside the mark it points to, by up to its height times the tangent of the view.
    """
    if drawn.grid(index).raised is not None:
        return 0.0  # its height is known
    return math.degrees(NEEDLE_HEIGHT_PART * math.hypot(USUAL_VIEW, view.obliqueness) / math.sqrt(2.0))


def _squeezed_deg(drawn: PanelPictures, index: int) -> float:
    """Estimate the error of a turn if the dial is described as seen square on, although it may not be.

    A circle seen obliquely is an ellipse. Fixed marks, and the positions of a ball in its tube, are drawn as they
    appear on that ellipse; marks that turn move along it.
    """
    if drawn.grid(index).plane is not None or not drawn.panel.gauges[index].is_round:
        return 0.0
    return math.degrees(USUAL_VIEW**2 / 4 / math.sqrt(2.0))


def _between_marks_deg(quantity: Quantity, part: float) -> float:
    """Estimate the error of a needle between marks of a dial with such a squeeze.

    Marks are drawn where they appear on the ellipse, and a needle between two of them is read as if along a circle.
    """
    around = np.sort(np.radians([angle_deg for angle_deg, _ in quantity.marks]))
    if quantity.wraps is not None:
        around = np.append(around, around[0] + math.tau)
        part = math.hypot(part, USUAL_VIEW**2 / 4)
    angles = np.linspace(around[0], around[-1], BETWEEN_MARKS)
    ahead = np.exp(2j * angles) - np.interp(angles, around, np.exp(2j * around))
    return math.degrees(part / math.sqrt(2.0) * math.sqrt(float(np.square(np.abs(ahead)).mean())))


def _height_px(drawn: PanelPictures, index: int) -> float:
    """Estimate the uncertainty of a pivot that is due to its needle's height."""
    raised = drawn.grid(index).raised
    if raised is None:
        return 0.0
    x, y = drawn.optics.straight(np.array(drawn.panel.gauges[index].centre)[:, None])[:, 0].tolist()
    return HEIGHT_PART * raised.px_at((x, y))


def _places_px(pivots: Sequence[Pivot], least_px: float) -> list[float]:
    """For each gauge, how far its dial is from where it is unwrapped, from the scatter of its needles' tilts."""
    shared_px2 = _middling([pivot.scatter_px2 for pivot in pivots if pivot.tilts])
    own_px2 = [
        (pivot.tilts * pivot.scatter_px2 + SHARED_TILTS * shared_px2) / (pivot.tilts + SHARED_TILTS) for pivot in pivots
    ]
    return [math.hypot(least_px, math.sqrt(max(value, 0.0))) for value in own_px2]


def _together(parts: Iterable[Floats]) -> Floats:
    total: Floats = functools.reduce(np.hypot, parts)
    return total


def _middling(values: Sequence[float]) -> float:
    """Average all but the lowest and the highest, so that one odd gauge does not affect the others."""
    if not values:
        return 0.0
    inner = sorted(values)[1:-1] or values
    return sum(inner) / len(inner)
