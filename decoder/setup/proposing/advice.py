"""Advice: how a gauge might be drawn better, offered only if all frames of the sample together fit it better.

The frames show where needles turn, and where their axes are. A gauge is redrawn accordingly and tried again on all
frames before it is offered, since moving a centre turns axes with it, and an axis from one picture may fit the others
worse. An offer must read more values; or as many, with no lower score and at most half of the error that prompted it,
so that offers come to an end. If it reads no more, the panel picture must also show the same values as before: frames
show where a needle turns, not what it points at.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Self

import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.instruments.reading import Status
from decoder.learning.thresholds import SETTLED_PX
from decoder.panel.errors import PanelError
from decoder.panel.scale import FULL_CIRCLE_DEG, Scale, shortest
from decoder.registration.thresholds import CLEAR_SCORE
from decoder.setup.drafts import RememberedPanel, Stale
from decoder.setup.drawn_plane import XY, DrawnPlane, height_inches
from decoder.setup.proposals import AROUND_DEG, Dial, needle_at
from decoder.setup.requests import TrialQuestion
from decoder.setup.session import SetupSession
from decoder.setup.thresholds import MAX_MOVE_PX
from decoder.setup.trial import Trial, tried
from decoder.timeseries.thresholds import SMALLEST_PART

GaugeDraft = dict[str, Any]
"""A gauge in the words of `panel.yaml`."""
Try = Callable[[GaugeDraft], Trial]
Axis = Callable[[GaugeDraft, float, XY], float]
"""Measures the axis of the needle of a gauge near an angle, in degrees, which turns around a place in the picture."""

PLACES = 4
SCORE_PLACES = 3
# The point along a needle that stays in place when it is redrawn, as a part of the outer radius.
ON_NEEDLE = 0.7


@dataclass(frozen=True, slots=True)
class Fit:
    """How well the frames of a sample fit a gauge as it is drawn.

    Attributes
    ----------
    read, of
        How many of its values are read, and how many there are.
    score
        The average over all its needles in all frames in which they are not hidden; 0 for one that is missing.
    beside_px
        How far from its centre its needles turn.
    off_deg
        How far the axis of the worst needle is from where it is drawn.
    """

    read: int
    of: int
    score: float
    beside_px: float
    off_deg: float

    @classmethod
    def of_trial(cls, trial: Trial, gauge: Mapping[str, Any]) -> Self:
        """Compute it from a trial of a gauge."""
        readings = [each for frame in trial.frames for each in frame.readings]
        a_frame = max((len(frame.readings) for frame in trial.frames), default=0)
        alone = max((sum(not each.is_together for each in frame.readings) for frame in trial.frames), default=0)
        needles = [each for each in readings if not each.is_together]
        hidden = sum(each.status is Status.HIDDEN for each in needles)
        scores = [each.score for each in needles if each.status not in (Status.MISSING, Status.HIDDEN)]
        beside_px = 0.0 if trial.moved_px is None else math.hypot(*trial.moved_px)
        return cls(
            read=sum(each.status is not Status.MISSING for each in readings),
            of=a_frame * len(trial.frames),
            score=round(sum(filter(math.isfinite, scores)) / max(alone * len(trial.frames) - hidden, 1), SCORE_PLACES),
            beside_px=beside_px,
            off_deg=max((abs(off) for _, off in _axes_off(trial, gauge, math.inf)), default=0.0),
        )

    @property
    def order(self) -> tuple[float, ...]:
        """All of it, the most important first, larger is better."""
        return self.read, self.score, -self.beside_px, -self.off_deg

    def is_better_than(self, other: Fit) -> bool:
        """Whether more is read with it; or as much, nothing is worse, and something is clearly better."""
        if self.read != other.read:  # additional values may well match a little less
            return self.read > other.read and self.score >= min(other.score, CLEAR_SCORE)
        is_clearly = self.beside_px < HALF * other.beside_px or self.off_deg < HALF * other.off_deg
        return is_clearly and all(own >= their for own, their in zip(self.order, other.order, strict=True))

    def gain_over(self, other: Fit) -> str:
        """Say by how much it is better."""
        parts = [f"values read {_from_to(other.read, self.read)} of {self.of}"]
        parts += [f"mean score {_from_to(f'{other.score:.3f}', f'{self.score:.3f}')}"]
        if other.beside_px:
            parts.append(f"needles turn {_from_to(f'{other.beside_px:.2f}', f'{self.beside_px:.2f}')} px off it")
        if other.off_deg:
            parts.append(f"axes are {_from_to(f'{other.off_deg:.2f}', f'{self.off_deg:.2f}')}° off")
        return ", ".join(parts)


def _from_to(before: object, after: object) -> str:
    return f"{before}" if str(before) == str(after) else f"{before} → {after}"


@dataclass(frozen=True, slots=True)
class Offer:
    """A better way to draw a gauge.

    Attributes
    ----------
    key
        Of what is offered: `centre`, `height`, `around` or `axes`.
    said, does
        What the frames show, and how the offer changes the gauge, for people.
    gauge
        The whole gauge, changed.
    gain
        By how much the sample fits better; empty until that was tried.
    """

    key: str
    said: str
    does: str
    gauge: GaugeDraft
    gain: str = ""


@dataclass(frozen=True, slots=True)
class Sight:
    """What advice needs to know of a gauge besides how it is drawn.

    Attributes
    ----------
    drawn
        Its plane in the panel picture.
    is_oblique
        Whether that differs from square on.
    height_inches
        The height at which its needles would turn where they do, if any explains that.
    """

    drawn: DrawnPlane
    is_oblique: bool
    height_inches: float | None


def advice_answer(session: SetupSession, asked: TrialQuestion, stale: Stale) -> dict[str, Any]:
    """Offer ways to draw a gauge of a draft that fit the sample better, and say by how much."""
    document, key, place = asked.document, asked.picture, asked.gauge
    gauge, frames, planes = document["gauges"][place], session.frames(), session.planes(document, key)

    def source_of(drawn: GaugeDraft) -> RememberedPanel:
        gauges = [*document["gauges"][:place], drawn, *document["gauges"][place + 1 :]]
        return session.panel_of_gauge({**document, "gauges": gauges}, key, place)

    def sight(moved_px: XY | None) -> Sight:
        drawn = planes.drawn(tuple(gauge["centre"]), gauge.get("rim"))
        is_oblique = bool(gauge.get("rim")) or planes.inches is not None or drawn.lens is not None
        return Sight(drawn, is_oblique, height_inches(source_of(gauge), moved_px))

    def axis(drawn: GaugeDraft, near_deg: float, pivot: XY) -> float:
        centre, (inner_px, outer_px) = tuple(drawn["centre"]), drawn["radius"]
        plane = planes.drawn(centre, drawn.get("rim")).around(pivot).plane
        sweep_deg = near_deg - AROUND_DEG, near_deg + AROUND_DEG
        dial = Dial(centre, (inner_px, outer_px), sweep_deg, plane, planes.raised(drawn.get("needle_height_inches")))
        return needle_at(session.seen(document, key, stale), dial, near_deg).at_deg

    try:
        offers = (
            []
            if gauge.get("window")
            else advised(gauge, sight, lambda drawn: tried(source_of(drawn), frames, stale), axis)
        )
    except PanelError:  # the trial reports it
        offers = []
    return {"offers": [asdict(each) for each in offers]}


def advised(gauge: Mapping[str, Any], sight: Callable[[XY | None], Sight], tries: Try, axis: Axis) -> list[Offer]:
    """Offer at most one change that fits all frames of the sample better, with everything that follows from it.

    Parameters
    ----------
    gauge
        As it is drawn.
    sight
        Returns how it is seen, by how far from its centre its needles turn.
    tries
        Tries a gauge on the sample.
    axis
        Measures a needle in the panel picture.
    """
    now = copy.deepcopy(dict(gauge))
    trial = tries(now)
    before = Fit.of_trial(trial, now)
    if not before.beside_px and not before.off_deg:
        return []
    for group in (_elsewhere(now, trial, sight(trial.moved_px), axis), _turned_only(now, trial)):
        better = [
            (after, replace(offer, gauge=drawn, gain=after.gain_over(before)))
            for offer in group
            for drawn, after in _settled(offer.gauge, tries)
            if after.is_better_than(before) and (after.read > before.read or shows_the_same(now, drawn))
        ]
        if better:
            _, best = max(better, key=lambda each: each[0].order)
            return [best]
    return []


def shows_the_same(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether needles show nearly the same values where they are drawn on two drafts of a gauge."""
    pairs = zip(_drawn_values(one), _drawn_values(other), strict=True)
    return all(
        abs(shortest(np.array(value - before), turn)) <= SMALLEST_PART * full_scale
        for (before, full_scale, turn), (value, _, _) in pairs
    )


def _drawn_values(gauge: Mapping[str, Any]) -> Iterator[tuple[float, float, float | None]]:
    """Yield, for needles cut from the panel picture, the value shown there, its full scale, and the value of a turn."""
    for needle in gauge.get("needles") or ():
        own = needle if needle.get("scale") else gauge
        marks, turn, at = sorted(own.get("scale") or ()), own.get("wraps"), needle["template"].get("at")
        if at is not None and len(marks) > 1:
            middle = (marks[0][0] + marks[-1][0]) / 2
            angle = middle + float(shortest(np.array(at - middle), FULL_CIRCLE_DEG))
            value = float(Scale.of(marks, turn).values_at(np.array([angle]))[0])
            yield value, turn or abs(marks[-1][1] - marks[0][1]), turn


def _settled(gauge: GaugeDraft, tries: Try) -> Iterator[tuple[GaugeDraft, Fit]]:
    """Try a gauge, and again with the axes that the frames then show; nothing if it cannot be read."""
    try:
        trial = tries(gauge)
        yield gauge, Fit.of_trial(trial, gauge)
        turned = _with_axes(gauge, trial)
        if turned is not None:
            yield turned, Fit.of_trial(tries(turned), turned)
    except PanelError:
        return


def _elsewhere(gauge: GaugeDraft, trial: Trial, seen: Sight, axis: Axis) -> Iterator[Offer]:
    """Make offers for needles that turn elsewhere than at the centre."""
    if trial.moved_px is None:
        return
    right, down = trial.moved_px
    there = gauge["centre"][0] + right, gauge["centre"][1] + down
    said = (
        f"The needle turns {abs(right):.2f} px {'left' if right < 0 else 'right'} of and"
        f" {abs(down):.2f} px {'above' if down < 0 else 'below'} the centre"
    )

    def found(drawn: GaugeDraft) -> GaugeDraft:
        """Add the axes of all needles as the panel picture shows them around that centre."""
        for template in _templates(drawn):
            template["at"] = round(axis(drawn, template["at"], there), PLACES)
        return drawn

    if seen.height_inches is not None:
        high = found(copy.deepcopy(gauge) | {"needle_height_inches": seen.height_inches})
        words = f"{said}: the parallax of a needle {seen.height_inches:g} inches above its face"
        yield Offer("height", words, "Use that height", high)
        return
    if seen.is_oblique and not gauge.get("needle_height_inches"):
        words = f"{said}, as any needle above its face does when seen from the side"
        yield Offer("around", words, "Find its axis around there", found(copy.deepcopy(gauge)))
    moved = _recentred(gauge, seen.drawn, there, are_points=trial.are_points)
    yield Offer("centre", said, "Move the centre there", found(moved))


def _turned_only(gauge: GaugeDraft, trial: Trial) -> Iterator[Offer]:
    """Turn its needles' axes to where all frames together show them."""
    turned = _with_axes(gauge, trial)
    if turned is not None:
        parts = [
            f"{name} lies {abs(off):.2f}° {'clockwise' if off > 0 else 'anticlockwise'}"
            for name, off in _axes_off(trial, gauge)
        ]
        said = f"Over all frames the axis of {' and that of '.join(parts)} of where it is drawn"
        yield Offer("axes", said, "Turn it there", turned)


def _templates(gauge: Mapping[str, Any]) -> list[dict[str, Any]]:
    needles: Sequence[dict[str, Any]] = gauge.get("needles") or ()
    return [each["template"] for each in needles if isinstance(each["template"].get("at"), int | float)]


def _axes_off(trial: Trial, gauge: Mapping[str, Any], most_px: float = MAX_MOVE_PX) -> list[tuple[str, float]]:
    """List the needles that are clearly elsewhere than drawn, by at most `most_px`, and by how many degrees."""
    drawn = {each["name"]: each["template"] for each in gauge.get("needles") or ()}
    return [
        (name, off)
        for name, off in trial.axes_deg.items()
        if "at" in drawn.get(name, {}) and SETTLED_PX <= abs(math.radians(off)) * gauge["radius"][1] <= most_px
    ]


def _with_axes(gauge: GaugeDraft, trial: Trial) -> GaugeDraft | None:
    """Turn axes to where a trial of the gauge shows them; None if they are drawn well enough."""
    off = dict(_axes_off(trial, gauge))
    if not off:
        return None
    turned = copy.deepcopy(gauge)
    for needle in turned["needles"]:
        if needle["name"] in off:
            needle["template"]["at"] = round(needle["template"]["at"] + off[needle["name"]], PLACES)
    return turned


def _recentred(gauge: GaugeDraft, drawn: DrawnPlane, there: XY, *, are_points: bool) -> GaugeDraft:
    """Draw the gauge around another centre; needles keep their places in the picture, marks theirs or their angles."""
    moved, around, outer = copy.deepcopy(gauge), drawn.around(there), gauge["radius"][1]

    def carried(angle: float, radius: float) -> float:
        seen = around.polar(drawn.place(angle, radius))[0]
        return round(seen - 360.0 * round((seen - angle) / 360.0), PLACES)

    if are_points:
        for own in (moved, *moved.get("needles", ())):
            if own.get("scale"):
                own["scale"] = [[carried(angle, outer), value] for angle, value in own["scale"]]
    for template in _templates(moved):  # they were pointed at in the picture, whatever the marks are
        template["at"] = carried(template["at"], outer * ON_NEEDLE)
    right, down = (new - old for new, old in zip(there, gauge["centre"], strict=True))
    if moved.get("rim"):
        moved["rim"] = [[round(x + right, 3), round(y + down, 3)] for x, y in moved["rim"]]
    moved["centre"] = [round(each, 3) for each in there]
    return moved
