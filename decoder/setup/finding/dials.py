"""Dials found: pivots that ticks aim at, with the numerals and the comb around each, read again from close up.

A panel is first read as a whole. A place that is aimed at from all around, and has numerals in order around it or a
comb, is a dial. Its face is then enlarged and read again, also unrolled, since numerals may follow their ring.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.imaging.thresholds import HALF
from decoder.panel.arrays import Floats
from decoder.setup.dial_edges import sampled_at
from decoder.setup.drawn_plane import XY, DrawnPlane, Planes
from decoder.setup.finding.marks import marked
from decoder.setup.finding.numerals import Text, is_there, numbers_at, readings, seen_at, texts_once
from decoder.setup.finding.scales import LETTERS, Fit, Numeral, fits
from decoder.setup.finding.strokes import CELL_PX, Strokes, aimed_at, peaks, strokes_in
from decoder.setup.finding.thresholds import (
    CLEAR_DIRECTIONS,
    CLEAR_TICKS,
    ENOUGH,
    LEAST_RADIUS_PX,
    LEAST_RUN,
    MOST_BEND,
    MOST_HEIGHTS,
    RAGGED_PX,
)
from decoder.setup.finding.ticks import Comb, as_circles_show, comb_around, comb_on, combs_by

# How many places that are aimed at are examined, and their minimum distance.
PLACES, APART_PX = 60, 10.0
# How many of the places from which the same numerals agree are tried.
TRIED = 4
# The size to which a face is enlarged for reading, and the height of an unrolled ring of numerals.
FACE_PX = (640.0, 960.0)
UNROLLED_PX = 140.0
SHOWN = 1.9
# Of a numeral, enough to have some on its own ring among them.
NEIGHBOURS = 12
LINES, OVERLAPPING, PAGE_EDGE = 4, 1.25, 20


@dataclass(frozen=True, slots=True)
class FoundDial:
    """A dial: its comb, its texts as seen from the pivot, and the scales that they may form."""

    comb: Comb
    texts: tuple[Text, ...]
    fits: tuple[Fit, ...]
    aimed: float

    @property
    def centre(self) -> XY:
        """The printed pivot, px of the picture."""
        return self.comb.rim.centre


@dataclass(frozen=True, slots=True)
class Page:
    """A panel picture with what was seen in it; `still` is the picture without what moves, as far as frames show."""

    picture: NDArray[np.uint8]
    still: NDArray[np.uint8]
    planes: Planes
    strokes: Strokes
    texts: tuple[Text, ...]


def seen_around(texts: Sequence[Text], drawn: DrawnPlane) -> list[Numeral]:
    """Return numbers, and letters of a compass, as seen from a pivot."""
    found = []
    for text in texts:
        angle_deg, radius_px = drawn.polar(text.at)
        letter = LETTERS.get(text.said.strip(" .'-"))
        value = text.value if letter is None else letter
        height = min(text.size_px)
        if value is None or not height < radius_px < MOST_HEIGHTS * height:
            continue
        found.append(
            Numeral(text.said, value, angle_deg % 360.0, radius_px, text.sure, letter is not None, text.at, height)
        )
    return found


def fits_around(texts: Sequence[Text], drawn: DrawnPlane) -> list[Fit]:
    """List the scales that numbers around a pivot may form, in any of their readings, each once."""
    return list(dict.fromkeys(fit for reading in readings(texts) for fit in fits(seen_around(reading, drawn))))


@dataclass(frozen=True, slots=True)
class Place:
    """A place that may be a dial's, and how far from it its marks are."""

    centre: XY
    radius_px: float


def dials_seen(page: Page) -> Iterator[Place | FoundDial]:
    """Find the dials of a panel, the surest first; each place is yielded before it is examined."""
    aimed = aimed_at(page.strokes, page.picture.shape)
    places = list(peaks(aimed, PLACES, APART_PX))
    amid = [(place, 0.0) for place in amid_numerals(page.texts)]
    looks = sorted(_looks(page, [*places, *amid]), key=lambda look: -look[0])
    found: list[FoundDial] = []
    taken: set[tuple[float, float]] = set()
    for group in _groups(looks):
        if {each.at for each in group[0][2].numerals} & taken:
            continue
        yield Place(group[0][1], group[0][2].radius_px)
        comb = _best(page, [(place, fit.radius_px) for _, place, fit in group], group[0][2])
        if comb is None or any(_same(comb, other.comb) for other in found):
            continue
        dial = _read(page, comb, aimed)
        found.append(dial)
        taken |= {each.at for fit in dial.fits for each in fit.numerals}
        yield dial
    for place, directions in places:
        if directions < CLEAR_DIRECTIONS or any(
            math.dist(place, each.centre) < each.comb.rim.radius_px for each in found
        ):
            continue
        likely = likely_px(page.strokes, place)
        if likely:
            yield Place(place, likely[0])
        comb = _best(page, [(place, radius_px) for radius_px in likely])
        if comb is None or len(comb.ticks) < CLEAR_TICKS or any(_same(comb, each.comb) for each in found):
            continue
        dial = _read(page, comb, aimed)
        found.append(dial)
        yield dial


def holds_others(dial: FoundDial, found: Sequence[FoundDial]) -> bool:
    """Whether a ring surrounds the middle of another dial, and thus is none; known only once all are found."""
    inner_px, _ = dial.comb.ring_px
    return any(
        inner_px / 2 < math.dist(dial.centre, other.centre) < inner_px + other.comb.ring_px[0] / 2
        and inner_px > other.comb.ring_px[1]
        for other in found
    )


def _same(one: Comb, other: Comb) -> bool:
    return math.dist(one.rim.centre, other.rim.centre) < max(one.rim.radius_px, other.rim.radius_px)


def _looks(page: Page, places: Sequence[tuple[XY, float]]) -> Iterator[tuple[float, XY, Fit]]:
    for place, directions in places:
        for fit in fits_around(page.texts, DrawnPlane.square_on(place)):
            if fit.weight > LEAST_RUN - HALF:
                yield fit.weight + directions / 6.0, place, fit


def _groups(looks: Sequence[tuple[float, XY, Fit]]) -> Iterator[list[tuple[float, XY, Fit]]]:
    """Group looks at the same numerals."""
    left = list(looks)
    while left:
        first = {each.at for each in left[0][2].numerals}
        group = [look for look in left if len(first & {each.at for each in look[2].numerals}) * 2 > len(first)]
        yield group[:TRIED]
        left = [look for look in left if look not in group]


def likely_px(strokes: Strokes, place: XY) -> list[float]:
    """Guess the distance of a dial's ticks from its pivot: where there are most strokes that aim at it."""
    far, miss = strokes.seen_from(place)
    own = far[(miss < 0.02 * far + 1.0) & (far > LEAST_RADIUS_PX) & (strokes.length_px < 0.4 * far)]
    if not len(own):
        return []
    counts, edges = np.histogram(own, bins=np.geomspace(LEAST_RADIUS_PX, 400.0, 30))
    counts = counts / np.sqrt(edges[1:])
    return [float(edges[at : at + 2].mean()) for at in np.argsort(counts)[::-1][:2]]


def amid_numerals(texts: Sequence[Text]) -> Iterator[XY]:
    """Yield the places around which numbers of one size stand in circles, those with most numbers first.

    Three neighbours determine a circle, and most threes of one ring have about the same.
    """
    numbers = [text for text in texts if text.value is not None]
    if len(numbers) < LEAST_RUN:
        return
    at, high = np.array([text.at for text in numbers]), np.array([min(text.size_px) for text in numbers])
    near = np.hypot(*(at - at[:, None]).transpose(2, 0, 1)).argsort(axis=1)[:, : NEIGHBOURS + 1]
    threes = np.array([(own, *pair) for own, *others in near for pair in combinations(others, 2)])
    threes = threes[high[threes].max(axis=1) < MOST_BEND * high[threes].min(axis=1)]
    first, second, third = at[threes].swapaxes(0, 1)
    b, c = second - first, third - first
    cross = 2.0 * (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])
    bb, cc = (b**2).sum(axis=1), (c**2).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        centre = np.stack([c[:, 1] * bb - b[:, 1] * cc, b[:, 0] * cc - c[:, 0] * bb], axis=1) / cross[:, None]
    radius = np.hypot(*centre.T)
    fits_px = (radius > LEAST_RADIUS_PX) & (radius < MOST_HEIGHTS * high[threes].mean(axis=1))
    centre = (centre + first)[fits_px]
    width, height = (int(side / CELL_PX) + 2 for side in centre.max(axis=0, initial=0.0))
    votes = np.zeros((height, width), np.float32)
    column, row = np.rint(np.maximum(centre, 0.0) / CELL_PX).astype(np.intp).T
    np.add.at(votes, (row, column), 1.0)
    smooth: Floats = np.asarray(cv2.GaussianBlur(votes, (0, 0), 2.0))
    for place, most in peaks(smooth, PLACES, APART_PX):
        if most > 0:
            yield place


def _best(page: Page, tries: Sequence[tuple[XY, float]], numbered: Fit | None = None) -> Comb | None:
    """Find the likeliest comb of a dial; None where the ends of no comb's ticks lie on circles."""
    strokes = page.strokes if numbered is None else _beside(page.strokes, numbered)
    found = [comb_around(page.picture, page.planes, strokes, place, radius_px) for place, radius_px in tries]
    combs = [_Likely.of(page, comb) for comb in found if comb is not None]
    if numbered is not None and not any(each.numbered for each in combs):
        short = _short_comb(page, tries[0][0], numbered)
        combs += [] if short is None else [_Likely.of(page, short)]
    if page.planes.inches is None and all(each.comb.miss_px > RAGGED_PX for each in combs):
        aside = [as_circles_show(page.picture, page.planes, each.comb) for each in combs]
        combs = [_Likely.of(page, comb) for comb in aside if comb is not None]
    best = max(combs, key=lambda each: each.rank, default=None)
    return None if best is None or best.comb.miss_px > RAGGED_PX else best.comb


@dataclass(frozen=True, slots=True)
class _Likely:
    """A comb that may be a dial's, and the weight of the numerals that fit its ticks without any doubt."""

    comb: Comb
    numbered: float

    @classmethod
    def of(cls, page: Page, comb: Comb) -> _Likely:
        scales = (marked(fit, comb) for fit in fits_around(page.texts, comb.rim.drawn))
        return cls(comb, max((scale.fit.weight for scale in scales if not scale.doubt), default=0.0))

    @property
    def rank(self) -> tuple[float, float]:
        """The likelier, the larger."""
        return self.numbered, (len(self.comb.ticks) + self.comb.lines) / (1.0 + self.comb.miss_px)


def _read(page: Page, comb: Comb, aimed: Floats) -> FoundDial:
    """Read what is printed on a dial, from close up."""
    drawn = comb.rim.drawn
    reach_px = max(tick.outer_px for tick in comb.ticks) * SHOWN
    texts = [text for text in page.texts if drawn.polar(text.at)[1] < reach_px]
    if is_there():
        texts = texts_once([*texts, *face_texts(page.still, comb), *unrolled_texts(page.picture, comb)])
    column, row = (round(each / 2.0) for each in comb.rim.centre)
    there_aimed = float(aimed[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3].max(initial=0.0))
    return FoundDial(comb, tuple(texts), tuple(fits_around(texts, drawn)), there_aimed)


def _beside(strokes: Strokes, numbered: Fit) -> Strokes:
    """Select the strokes that are not part of a numeral, or they would pass for its tick."""
    high_px = np.array([each.height_px for each in numbered.numerals])
    away_px = np.hypot(*(strokes.at[:, None] - np.array([each.at for each in numbered.numerals])).transpose(2, 0, 1))
    return strokes.where((away_px > HALF * high_px).all(axis=1))


def _short_comb(page: Page, place: XY, numbered: Fit) -> Comb | None:
    """Find the ring of ticks that enough numerals around a place fit best, however short the ticks are."""
    if len(numbered.numerals) <= ENOUGH:
        return None
    height_px = float(np.median([each.height_px for each in numbered.numerals]))
    rough = max(
        (_Likely.of(page, comb) for comb in combs_by(page.picture, page.planes, place, numbered.radius_px, height_px)),
        key=lambda each: (each.numbered, -each.comb.miss_px),
        default=None,
    )
    if rough is None or not rough.numbered:
        return None
    return comb_on(page.picture, page.planes, rough.comb)


def face_texts(picture: NDArray[np.uint8], comb: Comb) -> list[Text]:
    """Read the enlarged face of a dial."""
    drawn = comb.rim.drawn
    reach = comb.ring_px[1] * 1.5
    left, top = (max(round(at - reach), 0) for at in drawn.centre)
    crop = picture[top : round(drawn.centre[1] + reach) + 1, left : round(drawn.centre[0] + reach) + 1]
    crop = np.ascontiguousarray(crop)
    scales = sorted({max(across / max(crop.shape), 1.0) for across in FACE_PX})
    texts = [text for scale in scales for text in seen_at(crop, scale)]
    return [text.shifted(left, top) for text in (*texts, *numbers_at(crop, scales[0]))]


def unrolled_texts(picture: NDArray[np.uint8], comb: Comb) -> list[Text]:
    """Read an unrolled dial, the outside up, with numerals along its ring: in lines that overlap, as a page."""
    drawn = comb.rim.drawn
    low, high = comb.ring_px
    outer_px = high
    radii = np.linspace(outer_px * 1.5, outer_px * 0.5, round(UNROLLED_PX))
    px = abs(radii[1] - radii[0])
    line = np.arange(0.0, 2 * np.pi * OVERLAPPING / LINES, px / outer_px)
    starts = np.arange(LINES) * (2 * np.pi / LINES)
    turn = starts[:, None, None] + line
    points = np.stack([np.cos(turn) * radii[:, None], np.sin(turn) * radii[:, None]])
    x, y = drawn.to_picture(points.reshape(2, -1)).reshape(2, -1, len(line))
    light = sampled_at(picture, x, y).reshape(LINES, len(radii), -1)
    # A line of ticks below numerals would be read as letters.
    between = (radii > low - 1.0) & (radii < high + 1.0)
    light[:, between] = np.median(light, axis=(1, 2), keepdims=True)
    written = np.clip(light.reshape(-1, len(line)), 0, 255).astype(np.uint8)
    found = []
    edges = (PAGE_EDGE,) * 4
    page = np.asarray(cv2.copyMakeBorder(written, *edges, cv2.BORDER_REPLICATE), np.uint8)
    for text in (*seen_at(page, 1.0), *numbers_at(page, 1.0)):
        number, row = divmod(text.at[1] - PAGE_EDGE, len(radii))
        begin = dict(enumerate(starts)).get(int(number))
        if begin is None:
            continue
        angle = float(begin + np.interp(text.at[0] - PAGE_EDGE, np.arange(len(line)), line))
        radius = float(np.interp(row, np.arange(len(radii)), radii))
        size = text.size_px[0] * px, text.size_px[1] * px
        found.append(text.put(drawn.place(math.degrees(angle), radius), size, math.degrees(angle) + 90.0))
    return found


def page_of(picture: NDArray[np.uint8], still: NDArray[np.uint8], planes: Planes, texts: Sequence[Text]) -> Page:
    """Find a panel picture's strokes."""
    return Page(picture, still, planes, strokes_in(picture), tuple(texts))
