"""Hands of one dial that show one value together: where each points in every frame, and which of them is which.

What moves over a dial ends in tips. A hand's tip is always at the same distance from the pivot, so its length
distinguishes it from the others. The flight tells whether a shorter hand counts the turns of a longer one: its angle
has to follow in each frame. In a single frame a tail may follow too, or a hand that lies under another, but only one
assignment holds in all of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, permutations, product
from typing import Self

import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import Unwrapper
from decoder.panel.arrays import Floats, Mask
from decoder.panel.gauge import Combined
from decoder.panel.scale import FULL_CIRCLE_DEG, shortest
from decoder.registration.thresholds import NOISE_LEVELS
from decoder.setup.drawn_plane import XY, DrawnPlane, away
from decoder.setup.finding.robust import Trust, meeting
from decoder.setup.finding.thresholds import ALIKE, LEAST_RUN, LONG_PART, MISS_PX, NEAR_DEG, RING_PART
from decoder.setup.proposals import Dial, Pictures

# For each place of the dial, the number of plainest frames, in which what is there is not a hand.
PLAINEST = 8
# Hands are searched for between these distances, in parts of the ring of marks.
HUB_PART, RIM_PART = 0.12, 0.97
# The brightest part of a dial in a frame that belongs to hands, percent.
LIT_PERCENTILE = 99.0
ROUNDS = 3
# The number of tips examined in a frame, longest first: three hands, their tails, and whatever else moves.
MOST_TIPS = 10
# The weight of a pivot's old place against one of the lines that meet.
STAYS = 0.1
# How near a coarser hand must point to where the finer one puts it, in turns of that: half of the reading tolerance.
AGREES_TURNS = Combined.model_fields["tolerance"].default / 2
# Views of a dial are distinct if its finest hand differs by one of this many parts of a turn.
LOOKS = 5


@dataclass(frozen=True, slots=True)
class Tip:
    """The end of something that moves: its angle on the dial, its distance, and its axis as points (N, 2) px."""

    angle_deg: float
    reach_px: float
    axis: Floats


@dataclass(frozen=True, slots=True)
class Hands:
    """Hands that go together, the finest first.

    Attributes
    ----------
    centre
        Where they turn, px of the picture.
    angles_deg, reaches_px
        Of each, in the panel picture.
    others_px
        The reach of shorter ends there: tails, and hands that do not belong.
    turns
        What they tell in the pictures in which they were seen together, in turns of the finest.
    is_counted
        Whether another hand was seen to count the turns of their coarsest.
    pictures
        In how many pictures they were seen together, and of how many.
    """

    centre: XY
    angles_deg: tuple[float, ...]
    reaches_px: tuple[float, ...]
    others_px: float
    turns: tuple[float, ...]
    is_counted: bool
    pictures: tuple[int, int]


def tips_on(seen: Pictures, drawn: DrawnPlane, ring_px: float) -> list[list[Tip]]:
    """Find the tips on a dial in the panel picture and in every frame, the longest first.

    Parameters
    ----------
    drawn : its plane, around where hands turn
    ring_px : the radius at which its marks begin
    """
    dial = Dial(drawn.centre, (HUB_PART * ring_px, RIM_PART * ring_px), (0.0, FULL_CIRCLE_DEG), drawn.plane)
    grid = dial.grid(0.0)
    rows, unwrapper = round(FULL_CIRCLE_DEG / grid.step_deg), Unwrapper([grid])
    views = [(seen.picture, seen.own), *seen.frames]
    strips = np.stack([unwrapper.unwrap(frame, alignment)[0][:rows] for frame, alignment in views])
    strips = strips - np.median(strips, axis=1, keepdims=True)
    face = np.median(strips, axis=0)
    lit = (strips * face).sum(axis=(1, 2), keepdims=True) / max(float((face * face).sum()), 1e-6)
    strips = strips / np.maximum(lit, HALF * HALF)
    plainest = np.argsort(np.abs(strips), axis=0)[[len(strips) // PLAINEST]]
    moving = np.abs(strips - np.take_along_axis(strips, plainest, axis=0))
    return [list(islice(_tips(frame, grid.radii_px, grid.step_deg), MOST_TIPS)) for frame in moving]


def _tips(moving: Floats, radii_px: Floats, step_deg: float) -> Iterator[Tip]:
    """Yield the tips in one frame: where bright pixels reach further out than beside it."""
    rows = len(moving)
    lightest = float(np.percentile(moving, LIT_PERCENTILE))
    level = max(HALF * lightest, 2 * NOISE_LEVELS)
    lit = moving > level
    reaches = _reaches(lit, radii_px)
    near = round(NEAR_DEG / step_deg)
    around = (np.arange(rows)[:, None] + np.arange(-near, near + 1)) % rows
    highest = (reaches >= reaches[around].max(axis=1)) & (reaches > radii_px[0])
    taken = np.zeros(rows, bool)
    for row in sorted(np.flatnonzero(highest), key=lambda each: -reaches[each]):
        if taken[row]:
            continue
        taken[around[row]] = True
        places = (radii_px[radii_px <= reaches[row]], step_deg)
        axis = np.array(list(_axis(lit, moving, places, int(row)))).reshape(-1, 2)
        if len(axis) >= LEAST_RUN:
            end = axis[axis[:, 1] >= np.median(axis[:, 1])]
            angle_deg = float(np.average(end[:, 0], weights=end[:, 1]))
            turn = np.radians(axis[:, 0])
            points = axis[:, 1:] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
            yield Tip(angle_deg % FULL_CIRCLE_DEG, float(reaches[row]), points)


def _reaches(lit: Mask, radii_px: Floats) -> Floats:
    """(R,): the reach of a bright run that is longer than a speck; the innermost radius if there is none."""
    long = max(round(LONG_PART * len(radii_px) / 2), LEAST_RUN)
    count = np.cumsum(np.pad(lit, ((0, 0), (1, 0))).astype(np.int64), axis=1)
    whole = count[:, long:] - count[:, :-long] == long
    last = whole.shape[1] - 1 - whole[:, ::-1].argmax(axis=1)
    reaches: Floats = np.where(whole.any(axis=1), radii_px[last + long - 1], radii_px[0])
    return reaches


def _axis(lit: Mask, moving: Floats, places: tuple[Floats, float], row: int) -> Iterator[tuple[float, float]]:
    """Yield the middle of a hand at each distance, angle and px, from its tip inwards while nothing overlaps it.

    Parameters
    ----------
    lit, moving : (R, C)
    places : of the columns up to its tip, px, and degrees per row
    row : of its tip
    """
    radii_px, step_deg = places
    rows, middle = len(lit), row
    for column in range(len(radii_px) - 1, -1, -1):
        if radii_px[column] < HALF * radii_px[-1]:
            return
        wide = round((NEAR_DEG + math.degrees(3.0 / radii_px[column])) / step_deg)
        around = np.arange(middle - wide, middle + wide + 1)
        here = lit[around % rows, column]
        if not here.any():
            continue
        runs = np.split(np.flatnonzero(here), np.flatnonzero(np.diff(np.flatnonzero(here)) > 1) + 1)
        own = min(runs, key=lambda run: float(np.abs(run - wide).min()))
        if own[0] == 0 or own[-1] == len(around) - 1:
            return  # it runs into something wider
        at = around[own]
        yield float(np.average(at, weights=moving[at % rows, column])) * step_deg, float(radii_px[column])
        middle = round(float(at.mean()))


def what_is_not_told(seen: Pictures, drawn: DrawnPlane, ring_px: float, at_deg: float) -> str:
    """Say why the thing that moves on a dial is not a single needle with a known head; empty if it is.

    Parameters
    ----------
    drawn, ring_px : as for tips
    at_deg : where a needle points in the panel picture
    """
    frames = tips_on(seen, turning(seen, drawn, ring_px) or drawn, ring_px)
    if has_several(frames):
        return "more than one needle moves on it, and which shows what is unknown"
    if reaches_across(frames[0], at_deg):
        return "its needle reaches as far on both sides of the pivot: which end is the tip is unknown"
    return ""


def has_several(frames: Sequence[Sequence[Tip]]) -> bool:
    """Whether something besides the longest hand and its tail is about as long, and moves by itself.

    A thing seen at one angle only is not a hand: it is the face there, which a hand hides in most frames.
    """
    others = [
        tip.angle_deg
        for longest, *shorter in filter(None, frames)
        for tip in shorter
        if tip.reach_px > HALF * longest.reach_px and not _is_near(tip.angle_deg, longest.angle_deg + 180.0)
    ]
    apart: list[float] = []
    for angle_deg in others:
        if not any(_is_near(angle_deg, other) for other in apart):
            apart.append(angle_deg)
    return len(apart) >= LEAST_RUN


def reaches_across(tips: Sequence[Tip], at_deg: float) -> bool:
    """Whether a needle reaches about as far on the other side, or further, so that its head is unknown."""
    own, other = (
        max((tip.reach_px for tip in tips if _is_near(tip.angle_deg, middle_deg)), default=0.0)
        for middle_deg in (at_deg, at_deg + 180.0)
    )
    return other > ALIKE * own


def _is_near(angle_deg: float, other_deg: float) -> bool:
    return abs(away(angle_deg, other_deg)) < 2 * NEAR_DEG


def turning(seen: Pictures, drawn: DrawnPlane, ring_px: float) -> DrawnPlane | None:
    """Move a dial's pivot to where what moves on it turns; None if that is not a single point near it."""
    for _ in range(ROUNDS):
        moved = turning_at(tips_on(seen, drawn, ring_px), drawn)
        if math.dist(moved.centre, drawn.centre) > HALF * HALF * ring_px:
            return None
        drawn = moved
    return drawn


def turning_at(frames: Sequence[Sequence[Tip]], drawn: DrawnPlane) -> DrawnPlane:
    """Move a dial's pivot to where the axes of all tips meet; it stays if they do not determine it."""
    lines = [line for tips in frames for tip in tips if (line := _line(tip.axis)) is not None]
    if len(lines) < 2 * LEAST_RUN:
        return drawn
    points, along, lengths = (np.array(each) for each in zip(*lines, strict=True))
    # Parallel lines tell nothing in their own direction; there it stays, to within some pixels.
    held = float(lengths.mean()) * STAYS * np.eye(2)
    return drawn.moved(*meeting(points, along, lengths, Trust(HALF, power=2), held=held))


def _line(axis: Floats) -> tuple[Floats, Floats, float] | None:
    """Fit a line to points (N, 2): a point of it, its direction and its length; None if they are not on a line."""
    middle = axis.mean(axis=0)
    _, spread, directions = np.linalg.svd(axis - middle, full_matrices=False)
    if len(axis) < 2 * LEAST_RUN or spread[1] > MISS_PX * math.sqrt(len(axis)) / 2:
        return None
    return middle, directions[0], float(spread[0])


def together(
    seen: Pictures,
    drawn: DrawnPlane,
    ring_px: float,
    zero_deg: float,
    ratios: Sequence[int],
    *,
    further: int | None = None,
) -> Hands | str:
    """Find hands that show one value together, or say why there are none.

    Parameters
    ----------
    drawn : the dial's plane
    ring_px : the radius at which its marks begin
    zero_deg : where all of them point at zero
    ratios : how often the finest goes round per turn of the next one, and so on
    further : the same for a coarser hand that may exist as well
    """
    turned = turning(seen, drawn, ring_px)
    if turned is None:
        return "the parts that move on it do not turn about one point"
    drawn = turned
    frames = tips_on(seen, drawn, ring_px)
    tried = (_Chain.of(frames, tips, zero_deg, ratios) for tips in permutations(frames[0], len(ratios) + 1))
    sure = [each for each in tried if each.is_sure(frames)]
    # What looks like a counting hand may itself be counted: an altimeter's second hand is its third's first.
    told = [each for each in sure if not any(each.tips[0] in other.tips[1:] for other in sure)]
    if not told:
        return "its hands were not seen to turn together"
    best = max(told, key=lambda each: sum(tip.reach_px for tip in each.tips))
    if any(each.contradicts(best) for each in told):
        return "which hand is which is ambiguous: more than one assignment fits all pictures"
    shortest_px = min(tip.reach_px for tip in best.tips)
    others = [tip.reach_px for tip in frames[0] if tip.reach_px < (1.0 - RING_PART) * shortest_px]
    counted = None if further is None else _counted(frames, best, zero_deg, (*ratios, further))
    turns = best.turns if counted is None else counted
    return Hands(
        drawn.centre,
        tuple(tip.angle_deg for tip in best.tips),
        tuple(tip.reach_px for tip in best.tips),
        max(others, default=0.0),
        tuple(each for each in turns if math.isfinite(each)),
        counted is not None,
        (int(np.isfinite(best.turns).sum()), len(frames)),
    )


@dataclass(frozen=True, slots=True)
class _Chain:
    """Tips of the panel picture taken for hands; their common value in each picture, turns of the finest, or NaN."""

    tips: tuple[Tip, ...]
    turns: tuple[float, ...]

    @classmethod
    def of(cls, frames: Sequence[Sequence[Tip]], tips: Sequence[Tip], zero_deg: float, ratios: Sequence[int]) -> Self:
        """Follow tips through all pictures by their length, and by how they go together."""
        turns = [_agreed([tips], zero_deg, ratios)]
        if math.isfinite(turns[0]):
            turns += [_agreed(_alike(frame, tips), zero_deg, ratios) for frame in frames[1:]]
        return cls(tuple(tips), tuple(turns))

    @property
    def looks(self) -> int:
        """The number of distinct views of the dial."""
        return len({round(LOOKS * turns) for turns in self.turns if math.isfinite(turns)})

    def is_sure(self, frames: Sequence[Sequence[Tip]]) -> bool:
        """Whether it holds in nearly all pictures, enough of which differ that this is not chance.

        In the panel picture nothing else may be as long as one of the coarser hands, since it could be mistaken for it.
        """
        agreed = sum(math.isfinite(turns) for turns in self.turns)
        alone = all(len(list(_alike(frames[0], [tip]))) == 1 for tip in self.tips[1:])
        return alone and agreed >= ALIKE * len(frames) and self.looks >= LEAST_RUN

    def contradicts(self, other: Self) -> bool:
        """Whether its value differs from another chain's, and not because it takes tails for tips."""
        tails = [
            abs(shortest(np.array(own.angle_deg - tip.angle_deg + 180.0), FULL_CIRCLE_DEG)) < NEAR_DEG
            and own.reach_px < ALIKE * tip.reach_px
            for own, tip in zip(self.tips, other.tips, strict=True)
        ]
        same = [own is tip or is_tail for own, tip, is_tail in zip(self.tips, other.tips, tails, strict=True)]
        return abs(self.turns[0] - other.turns[0]) > AGREES_TURNS and not all(same)


def _alike(frame: Sequence[Tip], tips: Sequence[Tip]) -> Iterator[Sequence[Tip]]:
    """Yield all combinations of a frame's tips that are as long as given ones."""
    yield from product(
        *([each for each in frame if abs(each.reach_px - tip.reach_px) < RING_PART * tip.reach_px] for tip in tips)
    )


def _agreed(choices: Iterable[Sequence[Tip]], zero_deg: float, ratios: Sequence[int]) -> float:
    """Return the turns of the finest of the tips that go together best; NaN if none do."""
    best, least = math.nan, AGREES_TURNS
    for chosen in choices:
        parts = [(tip.angle_deg - zero_deg) / FULL_CIRCLE_DEG % 1.0 for tip in chosen]
        turns, off = parts[-1], 0.0
        for ratio, part in zip(reversed(ratios), reversed(parts[:-1]), strict=True):
            whole = round(turns * ratio - part)
            off = max(off, abs(turns * ratio - part - whole))
            turns = (whole + part) % math.prod(ratios)
        if off < least:
            best, least = turns, off
    return best


def _counted(
    frames: Sequence[Sequence[Tip]], chain: _Chain, zero_deg: float, ratios: Sequence[int]
) -> tuple[float, ...] | None:
    """Count turns of the finest by one more hand of constant length; None if there is none."""
    whole = math.prod(ratios[:-1])
    others = [
        [tip for tip in frame if all(abs(tip.reach_px / own.reach_px - 1.0) > RING_PART for own in chain.tips)]
        for frame in frames
    ]
    best: tuple[float, ...] | None = None
    most = ALIKE * len(frames)
    for length in {tip.reach_px: tip for tips in others for tip in tips}.values():
        counted = []
        for tips, turns in zip(others, chain.turns, strict=True):
            coarsest = Tip(turns / whole * FULL_CIRCLE_DEG + zero_deg, 0.0, length.axis)
            choices = ((coarsest, *each) for each in _alike(tips, [length]))
            counted.append(_agreed(choices, zero_deg, ratios[-1:]) * whole if math.isfinite(turns) else math.nan)
        agreed = sum(math.isfinite(each) for each in counted)
        looks = len({round(LOOKS * each / whole) for each in counted if math.isfinite(each)})
        if agreed > most and looks >= LEAST_RUN:
            best, most = tuple(counted), agreed
    return best
