"""Gauges proposed: each dial as for `panel.yaml`, with its evidence, and what is not known.

A scale with any doubt is not proposed: a wrong value costs more than a dial that somebody has to draw.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from decoder.matching.thresholds import MIN_VIEWS
from decoder.panel.arrays import Floats
from decoder.panel.thresholds import BEYOND_SWEEP_DEG
from decoder.registration.thresholds import LIKELY_SCORE, SCORE_THRESHOLD
from decoder.setup.drawn_plane import Planes
from decoder.setup.finding.dials import FoundDial, fits_around
from decoder.setup.finding.geared import GEARED, Face, Geared, GearedDraft, geared_drafts
from decoder.setup.finding.hands import turning, what_is_not_told
from decoder.setup.finding.legends import Legend, legend_of
from decoder.setup.finding.marks import Marked, marked
from decoder.setup.finding.motion import turned_deg
from decoder.setup.finding.numerals import Text, is_there, level_deg
from decoder.setup.finding.thresholds import LEAST_RUN, OFF_DEG
from decoder.setup.finding.ticks import Comb, comb_about, shaped
from decoder.setup.proposals import Dial, Pictures, Proposal, proposed

Document = dict[str, Any]

# Needles are measured between these parts of their ticks' inner ends: clear of the hub, short of the marks.
FROM_PART, TO_PART = 0.3, 0.98
PLACES = 3
# The sweep of a dial with no evidence of one, as the page begins one.
BEGUN_SWEEP = (135.0, 405.0)
UP_DEG = 270.0
# Uncertainty of the panel's vertical, one sigma: from its words, and without any.
LEVEL_DEG, ROLL_DEG = 1.5, 2.0


@dataclass(frozen=True, slots=True)
class SeenMark:
    """A value of a scale, and where its mark and its numeral are in the picture."""

    value: float
    said: str
    sure: float
    numeral: tuple[float, float]
    mark: tuple[float, float]


@dataclass(frozen=True, slots=True)
class ProposedGauge:
    """A dial.

    Attributes
    ----------
    gauge
        As for `panel.yaml`; None if something that it needs is unknown.
    drawn
        The same as far as it is known, for somebody to complete: marks of a doubtful scale have no value.
    centre, rim
        Where it is in the picture.
    name
        For people.
    marks
        Its scale, as far as it was read.
    evidence
        What supports it, sentence by sentence.
    lacking
        What was not found, sentence by sentence.
    read
        How many values were read on the flight, and of how many; None if it was not tried.
    measured_px
        For hands that turn over each other, between which distances each is clear.
    otherwise
        The same dial with fewer of its hands, in case the flight cannot be read with all of them.
    """

    gauge: Document | None
    drawn: Document
    centre: tuple[float, float]
    rim: tuple[tuple[float, float], ...]
    name: str
    marks: tuple[SeenMark, ...]
    evidence: tuple[str, ...]
    lacking: tuple[str, ...]
    read: tuple[int, int] | None = None
    measured_px: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    otherwise: tuple[ProposedGauge, ...] = ()


def gauge_of(dial: FoundDial, seen: Pictures, taken: set[str], *, words: Sequence[Text], hands: bool) -> ProposedGauge:
    """Propose a dial as far as it is known.

    Parameters
    ----------
    taken : names of others
    words : of the whole picture
    hands : whether what moves on it points at its pivot
    """
    evidence = [f"{len(dial.comb.ticks)} ticks around one point, on a ring {dial.comb.miss_px:.1f} px off a circle"]
    lacking: list[str] = []
    scale = _scale(dial)
    legend = _legend(dial, scale)
    is_rose = scale is not None and scale.fit.family is not None and scale.fit.family.has_letters
    name = _free(legend.name or ("compass" if is_rose else "dial"), taken)
    marks = () if scale is None else _marks(scale, dial)
    gauge: Document | None = None
    doubt = ""
    drafts: Sequence[GearedDraft] = ()
    if scale is None:
        lacking.append("no numerals in order around it" if is_there() else "its numerals are not read")
    else:
        evidence.append(_words(scale, legend))
        doubt = scale.doubt or _doubt_of_values(scale, legend)
        if doubt:
            lacking.append(f"no scale: {doubt}")
        else:
            kind = GEARED.get(scale.fit.family.name) if scale.fit.family is not None else None
            if kind is not None:
                name = _free(name.replace("dial", kind.value), taken)
                drafts, why = _geared(kind, dial, scale, name, seen, legend=legend)
                if why:
                    lacking.append(why)
            else:
                gauge, said = _gauge(dial, scale, legend, name, seen, words=words, hands=hands)
                (evidence if gauge is not None else lacking).extend(said)
    if scale is not None and not legend.unit and (scale.fit.family is None or scale.fit.family.name == "altimeter"):
        lacking.append("no word gives its unit")
    so_far = _so_far(dial, name, scale, legend, is_told=not doubt)
    plain = ProposedGauge(gauge, so_far, dial.centre, _ring(dial), name, marks, tuple(evidence), tuple(lacking))
    ways = [
        replace(
            plain,
            gauge=_native(each.gauge),
            evidence=(*plain.evidence, *each.said),
            lacking=(*plain.lacking, *each.lacking),
            measured_px=each.measured_px,
        )
        for each in drafts
    ]
    return replace(ways[0], otherwise=tuple(ways[1:])) if ways else plain


def _doubt_of_values(scale: Marked, legend: Legend) -> str:
    """Say why marks with known numerals may have other values; empty if they do not."""
    family, largest = scale.fit.family, max(abs(mark.value) for mark in scale.marks)
    if scale.fit.is_centred and legend.unit not in ("fpm", "A"):
        return "it rises to both sides of 0, and nothing shows which side is positive"
    if family is not None and family.name == "altimeter" and legend.name != "altimeter":
        return "its digits go all the way round, and no word says what they count"
    if family is None and legend.lacks_factor(largest):
        return f"its numbers are too small for {legend.unit}: their factor was not read"
    return ""


def settled(dial: FoundDial, seen: Pictures, planes: Planes, shape: Floats | None) -> FoundDial:
    """Measure the ticks of a partial dial again, around where the needle turns, given how the panel is seen.

    The dial's own circles may show that better than `shape`, (2, 2), what the others have in common: the one in which
    its ticks end on circles is kept.
    """
    if dial.comb.is_all_round or planes.inches is not None:
        return dial
    shapes = [dial.comb.shape] if shape is None or dial.comb.rim.points is not None else []
    shapes += [] if shape is None else [shape]
    again = [comb for each in shapes if (comb := _settled(dial, seen, planes, each)) is not None]
    return replace(dial, comb=min(again, key=lambda each: each.miss_px, default=dial.comb))


def _settled(dial: FoundDial, seen: Pictures, planes: Planes, shape: Floats) -> Comb | None:
    flat = shaped(dial.centre, shape)
    turns = turning(seen, flat, dial.comb.ring_px[0]) if len(seen.frames) >= MIN_VIEWS else None
    return comb_about(seen.picture, planes, dial.comb, turns or flat)


def _ring(dial: FoundDial) -> tuple[tuple[float, float], ...]:
    """Return the places of a dial's outer ring in the picture."""
    return tuple((float(x), float(y)) for x, y in dial.comb.rim.drawn.ring(dial.comb.ring_px[1]).T)


def _scale(dial: FoundDial) -> Marked | None:
    inner_px, outer_px = dial.comb.ring_px
    found = [
        marked(fit, dial.comb)
        for fit in fits_around(dial.texts, dial.comb.rim.drawn)
        if 0.6 * inner_px < fit.radius_px < 1.5 * outer_px
    ]
    return max(found, key=lambda each: (not each.doubt, each.fit.weight), default=None)


def _legend(dial: FoundDial, scale: Marked | None) -> Legend:
    drawn = dial.comb.rim.drawn
    radius_px = scale.fit.radius_px if scale is not None else dial.comb.ring_px[0]
    reach_px = 1.3 * dial.comb.ring_px[1]
    words = [text for text in dial.texts if text.value is None and drawn.polar(text.at)[1] < reach_px]
    words.sort(key=lambda text: abs(drawn.polar(text.at)[1] - radius_px))
    legend = legend_of([text.said for text in words])
    return legend.about_zero() if scale is not None and scale.fit.is_centred else legend


def _free(name: str, taken: set[str]) -> str:
    number, free = 1, name
    while free in taken:
        number += 1
        free = f"{name} {number}"
    return free


def _marks(scale: Marked, dial: FoundDial) -> tuple[SeenMark, ...]:
    radius_px = sum(dial.comb.ring_px) / 2
    return tuple(
        SeenMark(
            mark.value,
            mark.numeral.said,
            mark.numeral.sure,
            mark.numeral.at,
            dial.comb.rim.drawn.place(mark.angle_deg, radius_px),
        )
        for mark in scale.marks
    )


def _words(scale: Marked, legend: Legend) -> str:
    numerals = ", ".join(each.said for each in scale.fit.numerals)
    kind = (
        f"numbered as {'an' if scale.fit.family.name[0] == 'a' else 'a'} {scale.fit.family.name}"
        if scale.fit.family
        else ("evenly spaced" if scale.is_even else "unevenly spaced")
    )
    told = (
        f"; {' '.join(legend.said)!r} means {legend.name or 'the unit'}{', ' + legend.unit if legend.unit else ''}"
        if legend.said
        else ""
    )
    times = f", each times {legend.factor:g}" if legend.factor != 1 else ""
    return f"numerals {numerals}, {kind}{'' if scale.doubt else ', with their marks'}{told}{times}"


def _gauge(
    dial: FoundDial, scale: Marked, legend: Legend, name: str, seen: Pictures, *, words: Sequence[Text], hands: bool
) -> tuple[Document | None, list[str]]:
    family = scale.fit.family
    if family is not None and family.has_letters:
        return _rose(dial, scale, name, seen, words=words, hands=hands)
    pairs = _pairs(scale, legend.factor)
    sweep = _sweep([angle for angle, _ in pairs])
    needles = _needles(dial, sweep, seen)
    if not needles:
        return None, [f"no needle: nothing moved on it in {len(seen.frames)} frames"]
    if len(seen.frames) >= MIN_VIEWS:
        why = what_is_not_told(seen, dial.comb.rim.drawn, dial.comb.ring_px[0], needles[0].at_deg)
        if why:
            return None, [why]
    column = "_".join(name.split()) + (f"_{_plain(legend.unit)}" if legend.unit else "")
    gauge = {
        **_placed(dial, name, sweep),
        "unit": legend.unit,
        "scale": [[round(angle, 2), round(value, PLACES)] for angle, value in pairs],
        "needles": [_needle(column, needles[0])],
    }
    return _native(gauge), [f"its needle points to {needles[0].at_deg % 360:.0f} degrees here"]


def _geared(
    kind: Geared, dial: FoundDial, scale: Marked, name: str, seen: Pictures, *, legend: Legend
) -> tuple[Sequence[GearedDraft], str]:
    """Draft a dial whose hands count each other's turns."""
    zero_deg = _zero_deg(scale)
    placed = _placed(dial, name, _turn_from(zero_deg))
    unit = legend.unit if kind.unit is None else kind.unit
    if len(seen.frames) < MIN_VIEWS:
        return (), "more pictures are needed to tell its hands apart"
    return geared_drafts(kind, Face(placed, dial.comb.rim.drawn, dial.comb.ring_px[0], zero_deg, unit), seen)


def _zero_deg(scale: Marked) -> float:
    """Return the angle of 0 on a scale that goes all the way round."""
    first = scale.marks[0]
    return (first.angle_deg - first.value * 360.0 / (scale.turn or 360.0)) % 360.0


def _rose(
    dial: FoundDial, scale: Marked, name: str, seen: Pictures, *, words: Sequence[Text], hands: bool
) -> tuple[Document | None, list[str]]:
    """Propose a compass: a card if its rose turns between frames, else a rose with a needle over it."""
    start = _zero_deg(scale)
    sweep = _turn_from(start)
    inner_px, outer_px = dial.comb.ring_px
    heights = float(np.median([mark.numeral.height_px for mark in scale.marks]))
    ring = (
        min(inner_px, scale.fit.radius_px - heights / 2) - 1.0,
        max(outer_px, scale.fit.radius_px + heights / 2) + 1.0,
    )
    turns = [abs(turn) for turn, score in turned_deg(seen, dial.comb.rim, ring) if score >= SCORE_THRESHOLD]
    if len(seen.frames) < MIN_VIEWS:
        return None, ["more pictures are needed to tell whether its rose or a needle over it turns"]
    turning = bool(turns) and max(turns) > 2.0  # noqa: PLR2004
    needles = _needles(dial, sweep, seen) if hands and not turning else []
    column = "_".join(name.split()) + "_deg"
    common = {**_placed(dial, name, sweep), "unit": "deg",
              "scale": [[round(start, 2), 0], [round(start + 180.0, 2), 180]], "wraps": 360}  # fmt: skip
    if needles:
        return _native({**common, "tail": True, "needles": [_needle(column, needles[0])]}), [
            f"its rose stands still and a needle turns over it, at {needles[0].at_deg % 360:.0f} degrees here",
            "the end that shows most clearly is taken for its head: check it",
        ]
    said = (
        f"its rose turns, by {max(turns):.0f} degrees"
        if turning
        else "its rose stood still, and nothing turned over it: taken for a card that did not turn"
    )
    index_deg, doubt_deg, told = _index(dial, words, seen.picture.shape)
    gauge = {
        **common,
        "doubt_deg": round(doubt_deg, 2),
        "sweep": [0, 360],
        "radius": [round(each, 2) for each in ring],
        "card": {"name": column, "index": round(index_deg, 2)},
    }
    return _native(gauge), [said, _of_index(told, doubt_deg)]


def banked(dial: FoundDial, zero_deg: float, seen: Pictures, taken: set[str], words: Sequence[Text]) -> ProposedGauge:
    """Propose the bank scale of an attitude indicator, if it turns."""
    name, (inner_px, outer_px) = _free("bank", taken), dial.comb.ring_px
    evidence = ["marks at 0, 10, 20, 30 and 60 degrees on both sides of one, as on a bank scale"]
    lacking: list[str] = []
    turns = [
        abs(turn) for turn, score in turned_deg(seen, dial.comb.rim, (inner_px, outer_px)) if score >= LIKELY_SCORE
    ]
    gauge: Document | None = None
    if sum(turn > 2 * OFF_DEG for turn in turns) < LEAST_RUN:
        lacking.append("its marks were not seen to turn: another part moves")
    else:
        index_deg, doubt_deg, told = _index(dial, words, seen.picture.shape)
        evidence += [
            f"they turn, by {max(turns):.0f} degrees; banks to the left count down from 360",
            _of_index(told, doubt_deg),
        ]
        gauge = _native(
            {
                **_placed(dial, name, (0.0, 360.0)),
                "radius": [round(inner_px - 1.0, 2), round(outer_px + 1.0, 2)],
                "unit": "deg",
                "scale": [[round(zero_deg, 2), 0], [round(zero_deg + 180.0, 2), 180]],
                "wraps": 360,
                "doubt_deg": round(doubt_deg, 2),
                "card": {"name": "_".join(name.split()) + "_deg", "index": round(index_deg, 2)},
            }
        )
    so_far = _so_far(dial, name, None, Legend(), is_told=False)
    return ProposedGauge(gauge, so_far, dial.centre, _ring(dial), name, (), tuple(evidence), tuple(lacking))


def _of_index(told: str, doubt_deg: float) -> str:
    return f"its index is taken to be straight up,{told} give or take {doubt_deg:.1f} degrees: check it"


def _index(dial: FoundDial, texts: Sequence[Text], size_px: tuple[int, ...]) -> tuple[float, float, str]:
    """Assume a card's index straight up: return its angle, the uncertainty, and how it was determined."""
    drawn = dial.comb.rim.drawn
    level = level_deg(texts, dial.centre, size_px)
    if level is None:
        # If a panel is seen from the side and from above, its vertical is not the picture's.
        skewed_deg = math.degrees(drawn.plane.obliqueness**2 / math.sqrt(8.0))
        return UP_DEG, math.hypot(ROLL_DEG, skewed_deg), ""
    turn, reach = math.radians(level), dial.comb.ring_px[0]
    (x, y), (right, down) = dial.centre, (reach * math.cos(turn), reach * math.sin(turn))
    return (drawn.polar((x + right, y + down))[0] + UP_DEG) % 360.0, LEVEL_DEG, " as the words around are level,"


def _so_far(dial: FoundDial, name: str, scale: Marked | None, legend: Legend, *, is_told: bool) -> Document:
    """Describe what is known of a dial, for somebody to complete; doubtful values are left out."""
    is_told = is_told and scale is not None and scale.fit.family is None
    marks = _pairs(scale, legend.factor) if scale is not None and scale.marks else []
    sweep = _sweep([angle for angle, _ in marks]) if marks else BEGUN_SWEEP
    so_far = {
        **_placed(dial, name, sweep),
        "unit": legend.unit if is_told else "",
        "scale": [[round(angle, 2), round(value, PLACES) if is_told else None] for angle, value in marks],
        "needles": [],
    }
    return {key: _native(part) for key, part in so_far.items()}


def _pairs(scale: Marked, factor: float) -> list[tuple[float, float]]:
    """List the marks' angles, on the turn that begins at 0, with their values."""
    shift = 360.0 * math.floor(scale.marks[0].angle_deg / 360.0)
    return [(mark.angle_deg - shift, mark.value * factor) for mark in scale.marks]


def _native(part: Any) -> Any:  # noqa: ANN401 - any part of a draft
    """Convert numpy's numbers to Python's, for YAML and JSON."""
    if isinstance(part, dict):
        return {key: _native(each) for key, each in part.items()}
    if isinstance(part, list | tuple):
        return [_native(each) for each in part]
    return part.item() if isinstance(part, np.generic) else part


def _placed(dial: FoundDial, name: str, sweep: tuple[float, float]) -> Document:
    rim = dial.comb.rim
    inner_px, _ = dial.comb.ring_px
    placed: Document = {
        "name": name,
        "centre": [round(at, 2) for at in rim.centre],
        "radius": [round(FROM_PART * inner_px, 2), round(TO_PART * inner_px, 2)],
        "sweep": [round(each, 2) for each in sweep],
    }
    if rim.points is not None:
        placed["rim"] = rim.points
    return placed


def _turn_from(start_deg: float) -> tuple[float, float]:
    first = float(round(start_deg))
    return first, first + 360.0


def _sweep(angles: Sequence[float]) -> tuple[float, float]:
    first, last = angles[0], angles[-1]
    beyond = min(BEYOND_SWEEP_DEG, (360.0 - (last - first)) / 2)
    return first - beyond, last + beyond


def _plain(unit: str) -> str:
    return "".join(each if each.isalnum() else "_" for each in unit)


def _needle(column: str, found: Proposal) -> Document:
    return {"name": column, "template": {"at": round(found.at_deg, 2), "span": found.span_deg}}


def _needles(dial: FoundDial, sweep: tuple[float, float], seen: Pictures) -> list[Proposal]:
    inner_px, _ = dial.comb.ring_px
    span = (sweep[0], min(sweep[1], sweep[0] + 360.0))
    shown = Dial(dial.centre, (FROM_PART * inner_px, TO_PART * inner_px), span, dial.comb.rim.drawn.plane)
    return proposed(seen, shown) if len(seen.frames) > 1 else []
