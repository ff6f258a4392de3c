"""Dials with geared hands, such as an altimeter or a clock: each hand as in `panel.yaml`, and their common value.

The values of such a dial's hands are known; the flight shows which moving thing is which hand. Nothing is known of a
hand that did not move: an altimeter is then read within a turn of the coarsest hand that did, a clock not at all.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from decoder.panel.arrays import Floats
from decoder.setup.drawn_plane import DrawnPlane, rim_of
from decoder.setup.finding.hands import Hands, together
from decoder.setup.finding.thresholds import LONG_PART
from decoder.setup.proposals import AROUND_DEG, Dial, Pictures, Proposal, needle_at

Document = dict[str, Any]

# How far around a hand templates are measured clear of what turns beside it, relative to its length.
CLEAR_PART = 1.06
# How far below zero an altimeter may go, in turns of its longest hand.
BELOW = 0.5


@dataclass(frozen=True, slots=True)
class Way:
    """Hands that a dial may have, the finest first: their names, the values of a turn, and what comes next.

    `further` is how often the coarsest goes round per turn of a coarser one that may exist as well.
    """

    names: tuple[str, ...]
    turns: tuple[float, ...]
    further: int | None = None

    @property
    def ratios(self) -> tuple[int, ...]:
        """How often each goes round per turn of the next one."""
        return tuple(round(coarser / finer) for finer, coarser in pairwise(self.turns))


@dataclass(frozen=True, slots=True)
class Geared:
    """A dial with geared hands.

    Attributes
    ----------
    value
        The name of their common value.
    unit
        Its unit, whatever the dial says; None if the dial has to say it.
    ways
        The sets of hands that it may have, the largest first.
    """

    value: str
    unit: str | None
    ways: tuple[Way, ...]


GEARED: Mapping[str, Geared] = {
    "altimeter": Geared(
        "altitude",
        None,
        (
            Way(("hundreds", "thousands", "ten_thousands"), (1e3, 1e4, 1e5)),
            Way(("hundreds", "thousands"), (1e3, 1e4), 10),
        ),
    ),
    "clock": Geared(
        "clock",
        "s",
        (
            Way(("second_hand", "minute_hand", "hour_hand"), (60.0, 3600.0, 43200.0)),
            Way(("minute_hand", "hour_hand"), (3600.0, 43200.0)),
        ),
    ),
}


@dataclass(frozen=True, slots=True)
class GearedDraft:
    """A dial as for `panel.yaml`, with remarks; `measured_px` is between which distances each hand was measured."""

    gauge: Document
    measured_px: Mapping[str, tuple[float, float]]
    said: tuple[str, ...]
    lacking: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Face:
    """What is known of a dial before its hands: its keys for `panel.yaml`, its plane, and its marks.

    `ring_px` is the radius at which they begin, `zero_deg` the angle of 0, `unit` that of the values.
    """

    placed: Document
    drawn: DrawnPlane
    ring_px: float
    zero_deg: float
    unit: str


def geared_drafts(kind: Geared, face: Face, seen: Pictures) -> tuple[list[GearedDraft], str]:
    """Draft a dial with all its hands, and with fewer; or return why there is none."""
    drafts: list[GearedDraft] = []
    why = ""
    for way in kind.ways:
        found = together(seen, face.drawn, face.ring_px, face.zero_deg, way.ratios, further=way.further)
        if isinstance(found, str):
            why = why or found
            continue
        values, ends = np.array(found.turns) * way.turns[0], (way.turns[0], way.turns[-1])
        begin = None if way.further is None else lowest(values, ends, is_counted=found.is_counted)
        if way.further is None or begin is not None:
            drafts.append(_draft(kind, way, found, face, seen, begin=begin))
        else:
            why = why or "its slowest hand goes round, and no other hand counts its turns"
    return drafts, "" if drafts else why


def _draft(kind: Geared, way: Way, hands: Hands, face: Face, seen: Pictures, *, begin: float | None) -> GearedDraft:
    number = "".join(f"_{part}" for part in str(face.placed["name"]).split() if part.isdigit())
    suffix = number + (f"_{face.unit}" if face.unit else "")
    there = face.drawn.around(hands.centre)
    clear_px = CLEAR_PART * hands.others_px
    inner_px = max(face.placed["radius"][0], clear_px)
    radius = (inner_px, face.placed["radius"][1])
    names = [f"{name}{suffix}" for name in way.names]
    measured = {name: _clear_px(hands, index, radius) for index, name in enumerate(names)}
    first = float(round(face.zero_deg))
    needles = []
    for index, name in enumerate(names):
        needle = pointed(seen, there, measured[name], hands.angles_deg[index])
        turn = way.turns[index]
        needles.append(
            {
                "name": name,
                "template": {"at": round(needle.at_deg, 2), "span": needle.span_deg},
                **({"covered_by": names[index - 1]} if index else {}),
                "scale": [[round(face.zero_deg, 2), 0], [round(face.zero_deg + 180.0, 2), turn / 2]],
                "wraps": turn,
            }
        )
    combined: Document = {"name": f"{kind.value}{suffix}", "needles": names}
    said = [
        f"{len(names)} hands that turn together in {hands.pictures[0]} of {hands.pictures[1]} pictures: "
        + ", ".join(
            f"{name.replace('_', ' ')} at {angle % 360:.0f}"
            for name, angle in zip(way.names, hands.angles_deg, strict=True)
        )
        + " degrees here"
    ]
    lacking = []
    if begin is not None:
        combined["lowest"] = begin
        missing = kind.ways[0].names[len(way.names)].replace("_", " ")
        lacking.append(
            f"the hand for {missing} is not read: values are taken to lie from {begin:g} to"
            f" {begin + way.turns[-1]:g} {face.unit}, where the flight was"
            + ("" if hands.is_counted else " unless it went higher than the other hands show")
        )
    gauge = {
        **face.placed,
        "centre": [round(each, 2) for each in hands.centre],
        "radius": [round(each, 2) for each in radius],
        "sweep": [first, first + 360.0],
        "unit": face.unit,
        "scale": needles[0]["scale"],
        "wraps": way.turns[0],
        "combined": combined,
        "needles": needles[::-1],
    }
    if face.placed.get("rim") is not None:
        gauge["rim"] = rim_of(there, face.ring_px)
    return GearedDraft(gauge, measured, tuple(said), tuple(lacking))


def pointed(seen: Pictures, drawn: DrawnPlane, radius_px: tuple[float, float], near_deg: float) -> Proposal:
    """Measure the hand that points near an angle, where nothing else overlaps it."""
    sweep = near_deg - AROUND_DEG, near_deg + AROUND_DEG
    return needle_at(seen, Dial(drawn.centre, radius_px, sweep, drawn.plane), near_deg)


def _clear_px(hands: Hands, index: int, radius_px: tuple[float, float]) -> tuple[float, float]:
    """Return between which distances a hand is clear: to its tip, and beyond shorter ones if enough of it remains."""
    inner_px, outer_px = radius_px
    reach_px = min(hands.reaches_px[index], outer_px)
    beyond_px = CLEAR_PART * max((each for each in hands.reaches_px if each < reach_px), default=0.0)
    start_px = beyond_px if reach_px - beyond_px > LONG_PART * reach_px else inner_px
    return max(start_px, inner_px), reach_px


# Three hands count ten turns of the second.
COUNTED_TURNS = 10


def lowest(values: Floats, turns: tuple[float, float], *, is_counted: bool) -> float | None:
    """Choose where values begin that continue beyond a turn of the coarsest hand; None if they may exceed it.

    Parameters
    ----------
    values : that were seen; within a turn of the coarsest unless they are counted
    turns : of the finest and of the coarsest hand
    """
    fine, turn = turns
    least = -BELOW * fine
    if not is_counted:
        if values.min() < fine and values.max() > turn - fine:
            return None
        return _step(max((float(values.min()) + float(values.max()) - turn) / 2, least), fine)
    round_ = COUNTED_TURNS * turn
    values = np.where(values > round_ - fine, values - round_, values)  # just below 0
    inside = max(
        (values[(values >= low) & (values < low + turn)] for low in np.sort(values)), key=lambda part: part.size
    )
    # Values further off were miscounted; those that continue beyond a turn are real, and would be read a turn off.
    around = (values > float(inside.min()) - turn) & (values < float(inside.max()) + turn)
    if around.sum() > inside.size:
        return None
    spare = turn - float(np.ptp(inside))
    return _step(max(float(inside.min()) - spare / 2, least), fine)


def _step(value: float, fine: float) -> float:
    return float(np.floor(value / (fine / 10)) * fine / 10)
