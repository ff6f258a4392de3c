"""Linear scales: a pointer that slides along a straight scale, as in a flap indicator or an edgewise instrument.

Seen along its window, such a pointer only shifts, as a needle does in an unwrapped dial. So its template is searched
for over the scale's face in the same way, and fitted by least squares; template and face are learned from the flight. A
match is not trusted if another place matches nearly as well. The end of a bar is such a pointer, too: one that covers
the scale as far as its bar goes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from decoder.imaging.sorting import median_of
from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import UnwrappedGauge, WindowGrid, needle_pixels
from decoder.instruments.appearance import Placed
from decoder.instruments.kinds.windows.window import WindowKind
from decoder.instruments.reading import Reading, Status
from decoder.instruments.thresholds import CLEARLY_WORSE, FRAMES_TO_LEARN, MIDDLE_PART
from decoder.matching.correlation import face_moments, partial_normxcorr
from decoder.matching.faces import bare_face, in_light_of, learn_face
from decoder.matching.needle_fit import Fits, Settled, WindowFitter, settle
from decoder.matching.needle_layer import cut_over, first_layer, in_local_light, layer_over, layered
from decoder.matching.needle_search import peaks_of
from decoder.matching.needle_template import NeedleTemplate, odd_rows
from decoder.matching.strips import blocks_of, rows_at, rows_of_each
from decoder.matching.thresholds import MAX_PEAK_ROWS, MIN_VIEWS, MIN_VISIBLE, OUTLIER_SPREADS, SETTLED_ROWS
from decoder.panel.arrays import Floats, Indices, Mask
from decoder.panel.gauge import Gauge
from decoder.panel.kinds.linear import Linear
from decoder.panel.kinds.straight import ACROSS
from decoder.panel.thresholds import BEYOND_SWEEP_DEG
from decoder.registration.thresholds import LIKELY_SCORE, NOISE_LEVELS, SCORE_THRESHOLD

ROUNDS = 3
# Rounds in which a pointer that was only likely found comes to rest, if it is no error.
LIKELY_ROUNDS = 8
# How precisely a mark is drawn on a scale, and the pointer's place in the panel picture.
MARK_PX = 0.5


@dataclass(frozen=True, slots=True)
class LinearPicture:
    """What a linear scale looks like; its rows go along it.

    Attributes
    ----------
    drawn, face
        (R, C): the window in the panel picture, and the scale without its pointer.
    before, behind
        (R, C): the scale before its pointer and behind it, which differ if that ends a bar; NaN in rows that no picture
        shows there.
    given, pointer
        Its pointer in the panel picture, and as learned from the flight.
    at_row
        Where it is in the panel picture.
    restless
        (R,): rows beyond the scale's ends that often change, such as a readout's digits.
    """

    drawn: UnwrappedGauge
    face: UnwrappedGauge
    before: UnwrappedGauge
    behind: UnwrappedGauge
    given: NeedleTemplate
    pointer: NeedleTemplate
    at_row: float
    restless: Mask

    @property
    def bar(self) -> tuple[bool, bool]:
        """Whether its pointer is the end of a bar that goes on before it, or behind it, as the panel picture shows."""
        return _bar_sides(self.given)

    def ending_on(self, row: float) -> Floats:
        """(R, C): what the window shows if its bar ends on a row; unknown parts are as the nearest that are known."""
        sides = (self.before, self.pointer.pixels[0]), (self.behind, self.pointer.pixels[-1])
        before, behind = (_filled_up(*side) for side in sides)
        return np.where(np.arange(len(self.face))[:, None] < row, before, behind)


@dataclass(frozen=True, slots=True)
class Slide:
    """One linear scale on its grid, whose rows go along the scale."""

    own: Linear
    grid: WindowGrid
    ends_px: tuple[float, float]

    @classmethod
    def of(cls, gauge: Gauge, grid: WindowGrid) -> Slide:
        """Return that of a gauge that has one."""
        if gauge.linear is None:
            raise AssertionError(f"{gauge.name} is no linear scale")
        (quantity,) = gauge.quantities
        return cls(gauge.linear, grid, (quantity.marks[0][0], quantity.marks[-1][0]))

    @property
    def row_px(self) -> float:
        """How many pixels of the panel picture a row is."""
        width_px, height_px = self.grid.cell_px
        return width_px if self.own.moves == ACROSS else height_px

    def row_of(self, along_px: float) -> float:
        """Return the row of a position in pixels along the window."""
        return along_px / self.row_px + self.grid.margin - 0.5

    def px_of(self, row: Floats) -> Floats:
        """Return the positions of rows in pixels along the window."""
        along_px: Floats = (row - self.grid.margin + 0.5) * self.row_px
        return along_px

    def along(self, strips: Floats) -> Floats:
        """(..., R, C): turn sampled windows so that rows go along the scale, with surroundings only at both ends."""
        down, across = self.grid.within
        if self.own.moves == ACROSS:
            return np.ascontiguousarray(np.swapaxes(strips[..., down, :], -1, -2))
        return np.ascontiguousarray(strips[..., across])


class SlideReader:
    """Reads one linear scale."""

    def __init__(self, slide: Slide, picture: LinearPicture, *, begins: float | None = None) -> None:
        self._slide, self._picture, self._pointer, self._face = slide, picture, picture.pointer, picture.face
        self._name = slide.own.name
        self._hand_px = math.hypot(MARK_PX, MIDDLE_PART * _beside_rows(picture) * slide.row_px)
        self._axis = (picture.pointer.rows - 1) // 2
        height = picture.pointer.rows
        pixels = [min(1.0, slide.grid.cell_px[0] * slide.grid.cell_px[1])]
        self._fitter = WindowFitter([picture.pointer], pixels)
        self._moments = face_moments(picture.face[None], picture.pointer)
        self._faces = blocks_of(picture.face.astype(np.float32), height)
        count = len(picture.face) - height + 1
        places_px = slide.px_of(np.arange(len(picture.face), dtype=np.float64))
        first_px, last_px = slide.ends_px
        self._on_scale = (places_px >= first_px - BEYOND_SWEEP_DEG) & (places_px <= last_px + BEYOND_SWEEP_DEG)
        self._allowed = self._on_scale[self._axis : self._axis + count].copy()
        beginning = self._middle_of(picture) if begins is None else begins
        self._other = None
        if beginning is not None:
            # What looks like its end there is the beginning of a bar that grows the other way.
            past = np.arange(count) + self._axis - beginning
            self._allowed &= past * (1 if picture.bar[0] else -1) > MAX_PEAK_ROWS
            if begins is None:
                self._other = SlideReader(slide, _mirrored(picture, beginning), begins=beginning)

    def _middle_of(self, picture: LinearPicture) -> float | None:
        """Return the row at which a bar begins, if there are marks on both sides of it; else it grows one way only."""
        filled = np.flatnonzero(_filled(picture))
        if not any(picture.bar) or not filled.size:
            return None
        begins = float(filled[0 if picture.bar[0] else -1])
        nearest_px, farthest_px = self._slide.px_of(begins + self._axis * np.array([-1.0, 1.0])).tolist()
        first_px, last_px = self._slide.ends_px
        return begins if first_px < nearest_px and farthest_px < last_px else None

    def read(self, strips: Floats, place_sigmas_px: Floats) -> list[dict[str, Reading]]:
        """Read F frames of its window, (F, R, C) as they are sampled."""
        found, is_read = self.seen_in(self._slide.along(strips))
        rows = np.nan_to_num(found.row)
        places_px, sigmas_px = self._slide.px_of(rows), found.sigma_rows * self._slide.row_px
        return [
            {
                self._name: Reading(
                    Status.READ if own else Status.MISSING,
                    place_px,
                    math.hypot(sigma_px, off_px, self._hand_px),
                    score,
                )
            }
            for own, place_px, sigma_px, off_px, score in zip(
                is_read.tolist(),
                places_px.tolist(),
                np.nan_to_num(sigmas_px, nan=np.inf).tolist(),
                place_sigmas_px.tolist(),
                np.nan_to_num(found.score).tolist(),
                strict=True,
            )
        ]

    def seen_in(self, along: Floats) -> tuple[Settled, Mask]:
        """Find the pointer in F windows along their scale, (F, R, C), and where it is read; a bar one way at a time."""
        found, is_alone = self.found(along)
        is_read = found.is_settled & is_alone & (found.score >= SCORE_THRESHOLD)
        for number in np.flatnonzero(is_read).tolist():
            where = along[number], found.row[number], found.gain[number]
            is_read[number] = self._is_in_light_of_rest(*where) and self._is_rest_as_known(*where)
        if self._other is None:
            return found, is_read
        other, is_other = self._other.seen_in(along)
        return _where(is_other, other, found), is_read ^ is_other

    def found(self, along: Floats) -> tuple[Settled, Mask]:
        """Find the pointer in F windows along their scale, (F, R, C), and whether no other place matches as well."""
        scores = np.concatenate([self._scores(window) for window in along])
        beside = np.pad(scores, ((0, 0), (1, 1)), constant_values=-1.0)
        peaks = (scores >= beside[:, 2:]) & (scores >= beside[:, :-2])
        peaks &= self._allowed
        _, place = peaks_of(scores, peaks)
        found = self._settled(along, place)
        reach = self._pointer.half_width_deg + MAX_PEAK_ROWS
        elsewhere = peaks & (np.abs(np.arange(scores.shape[1]) - place[:, None]) > reach)
        top, second = peaks_of(scores, elsewhere)
        rival = scores[np.arange(len(scores)), top]
        doubt = np.flatnonzero(elsewhere.any(axis=1) & (rival >= LIKELY_SCORE))
        is_alone = np.asarray(peaks.any(axis=1))
        if doubt.size:
            other = np.nan_to_num(self._settled(along[doubt], second[doubt]).score)
            left = 1.0 - np.maximum(np.maximum(other, rival[doubt]), 0.0) ** 2
            is_alone[doubt] &= left > CLEARLY_WORSE * (1.0 - np.nan_to_num(found.score[doubt]) ** 2)
        return found, is_alone

    def _top_at(self, row: float, count: int) -> int:
        """Return the first row of a pointer; at a window's end, it may lie most of a row beyond where it fits in."""
        return int(np.clip(round(row) - self._axis, 0, count - self._pointer.rows))

    def _known_around(self, row: float) -> Floats:
        """(R, C): the scale, and the bar, with the pointer on a row; NaN where no picture showed them."""
        return np.where(np.arange(len(self._face))[:, None] < row, self._picture.before, self._picture.behind)

    def _is_in_light_of_rest(self, window: Floats, row: float, gain: float) -> bool:
        """Whether a pointer is less than twice as strong as the light on the rest of its window (R, C) makes it.

        What is stronger is an edge of something else: of another colour that a bar has above a level, or of a glint.
        """
        top = self._top_at(row, len(window))
        own = slice(top, top + self._pointer.rows)
        known = self._known_around(row)
        known[own] = np.nan
        strength = float((self._pointer.light + self._pointer.transparency * self._face[own]).std(axis=0).mean())
        telling = known > strength  # haze changes darker parts by more than the light does
        if not telling.any():
            return True
        usual = float(np.median(window[telling] / known[telling]))
        if any(self._picture.bar):  # it may be stronger here than where it was learned
            usual *= float(self._picture.ending_on(row)[own].std(axis=0).mean()) / strength
        return HALF * gain < usual

    def _is_rest_as_known(self, window: Floats, row: float, gain: float) -> bool:
        """Whether a window (R, C) shows the scale, and the bar, where the pointer is not.

        What differs from them within as much of the scale as a pointer takes, and is half as strong, may be the pointer
        itself, or something that lies over it: what was found may be its edge.
        """
        return not self._differs(window, row, gain).any()

    def restless(self, views: Floats) -> Mask:
        """(R,): where F views (F, R, C) that show the pointer often differ from what is known, beyond the scale."""
        found, is_alone = self.found(views)
        is_sure = found.is_settled & is_alone & (found.score >= SCORE_THRESHOLD)
        seen = zip(views[is_sure], found.row[is_sure], found.gain[is_sure], strict=True)
        differs = [self._differs(view, row, gain) for view, row, gain in seen]
        if not differs:
            return self._picture.restless
        restless: Mask = ~self._on_scale & (np.mean(differs, axis=0) > HALF**2)
        return restless

    def _differs(self, window: Floats, row: float, gain: float) -> Mask:
        """(R,): where a window (R, C) differs from scale and bar by half as much as a pointer there would."""
        height, top = self._pointer.rows, self._top_at(row, len(window))
        known = self._known_around(row)
        known[self._picture.restless] = np.nan
        known[max(top - self._axis, 0) : top + height + self._axis] = np.nan
        # Light may differ from place to place, and a pointer across this one cross it, but not from row to row.
        spread = _spread_around(window - gain * known, height)
        own = self._pointer.light + (self._pointer.transparency - 1.0) * self._face[top : top + height]
        least = HALF * gain**2 * float(own.var(axis=0).mean()) + NOISE_LEVELS**2
        differs: Mask = spread > least
        return differs

    def _scores(self, window: Floats) -> Floats:
        """(1, N): the partial NCC with the pointer starting at each row of the window."""
        scores, _ = partial_normxcorr(window[None], self._face[None], self._pointer, moments=self._moments)
        return scores

    def _settled(self, along: Floats, places: Floats) -> Settled:
        """Fit the pointer by least squares."""
        height = 2 * self._axis + 1
        windows = blocks_of(np.ascontiguousarray(along, np.float32), height)

        def fit(open_: Indices, rows: Indices, guess_rows: Floats) -> Fits:
            top = rows - self._axis
            return self._fitter.fit(windows[open_, top], self._faces[top], guess_rows)

        return settle(fit, places + self._axis, (self._axis, along.shape[1] - self._axis - 1), MAX_PEAK_ROWS)


def _where(which: Mask, these: Settled, those: Settled) -> Settled:
    """Return these in some frames (F,), and those in the others."""
    parts = ("row", "sigma_rows", "score", "correlation", "gain", "is_settled")
    return Settled(*(np.where(which, getattr(these, name), getattr(those, name)) for name in parts))


def _filled_up(side: Floats, otherwise: Floats) -> Floats:
    """(R, C): take rows that no picture shows from the nearest that one does, if there is any."""
    shown = np.flatnonzero(np.isfinite(side).all(axis=1))
    if not shown.size:
        return np.broadcast_to(otherwise, side.shape)
    nearest = shown[np.abs(np.arange(len(side))[:, None] - shown).argmin(axis=1)]
    filled: Floats = side[nearest]
    return filled


def _filled(picture: LinearPicture) -> Mask:
    """(R,): where the bar of a picture was seen, if it has one."""
    before, behind = picture.bar
    levels = picture.before if before else picture.behind if behind else picture.face
    off = np.abs(np.where(np.isfinite(levels), levels - picture.face, 0.0).mean(axis=1))
    filled: Mask = off > HALF * off.max()
    return filled


def _mirrored(picture: LinearPicture, begins: float) -> LinearPicture:
    """Return the picture of a bar that grows the other way from where it begins."""
    is_before, _ = picture.bar
    bar = median_of((picture.before if is_before else picture.behind)[_filled(picture)])
    every = np.arange(len(picture.face))[:, None]
    grown = np.where(every > begins if is_before else every < begins, picture.face, bar)
    sides = (picture.face, grown) if is_before else (grown, picture.face)

    def turned(pointer: NeedleTemplate) -> NeedleTemplate:
        layers = pointer.pixels, pointer.light, pointer.transparency, pointer.trust
        pixels, light, transparency, trust = (np.ascontiguousarray(layer[::-1]) for layer in layers)
        return replace(pointer, pixels=pixels, light=light, transparency=transparency, trust=trust)

    before, behind = sides
    return replace(picture, before=before, behind=behind, given=turned(picture.given), pointer=turned(picture.pointer))


def _spread_around(levels: Floats, height: int) -> Floats:
    """(R,): the mean variance along columns of levels (R, C) within so many rows; 0 where half of those are unknown."""
    is_known = np.isfinite(levels)
    part, mean, square = (
        cv2.blur(np.where(is_known, each, 0.0), (1, height), borderType=cv2.BORDER_CONSTANT)
        for each in (np.ones_like(levels), levels, np.square(levels))
    )
    spread = square / np.maximum(part, HALF) - np.square(mean / np.maximum(part, HALF))
    return np.asarray(np.where(part >= HALF, spread, 0.0).mean(axis=1), np.float32)


def first_linear(slide: Slide, drawn: UnwrappedGauge) -> LinearPicture:
    """Build it from the panel picture's window, as it is sampled."""
    strip = slide.along(drawn)
    at_row, rows = slide.row_of(slide.own.at_px(slide.grid.corners)), odd_rows(slide.own.span / slide.row_px, 1.0)
    return _first(strip, at_row, rows, median_of(strip))


def _first(strip: Floats, at_row: float, rows: int, plain: Floats) -> LinearPicture:
    """Build it from one window along the scale, (R, C), with its pointer on a row; the scale is (C,) beside it."""
    cut = rows_at(strip, at_row + np.arange(rows) - (rows - 1) / 2).astype(np.float32)
    layer = first_layer(cut, plain, 1.0)
    face = bare_face(strip, _covered(strip.shape, layer, at_row, _bar_sides(layer)))
    pointer = cut_over(layer, _behind(face, at_row, rows))
    restless = np.zeros(len(strip), bool)
    return LinearPicture(strip, face, *_sides(pointer, [strip], [at_row]), pointer, pointer, at_row, restless)


def _otherwise(given: LinearPicture) -> list[LinearPicture]:
    """Take for the scale what the panel picture shows before its pointer, or behind it, if the other is then a bar.

    A bar that covers half of its window there may be taken for its scale, or for neither.
    """
    beside_rows = given.given.rows / 2
    before = given.drawn[: max(math.floor(given.at_row - beside_rows), 0)]
    behind = given.drawn[math.ceil(given.at_row + beside_rows) + 1 :]
    tried = [
        _first(given.drawn, given.at_row, given.given.rows, median_of(side)) for side in (before, behind) if len(side)
    ]
    return [one for one in tried if any(one.bar) and one.bar != given.bar]


def _sides(pointer: NeedleTemplate, seen: Sequence[Floats], rows: Sequence[float]) -> tuple[Floats, Floats]:
    """(R, C) twice: the scale before its pointer, and behind it, as views with the pointer on these rows show it."""
    views, every = np.stack(seen).astype(np.float32), np.arange(len(seen[0]))
    off_rows, reach = every - np.array(rows)[:, None], (pointer.rows - 1) / 2
    before, behind = (
        np.stack(
            [
                median_of(views[its, row]) if its.any() else np.full(views.shape[2], np.nan)
                for row, its in enumerate(shown.T)
            ]
        )
        for shown in (off_rows < -reach, off_rows > reach)
    )
    return before, behind


def _covered(shape: tuple[int, int], pointer: NeedleTemplate, row: float, bar: tuple[bool, bool]) -> Mask:
    """(R, C): what a pointer covers with its axis on a row: its place, and the whole of its bar, if it has one."""
    covered = np.zeros(shape, bool)
    covered.reshape(-1)[needle_pixels(shape, pointer.touched, row)] = True
    before, behind = bar
    reach = (pointer.rows - 1) / 2
    covered[: max(math.floor(row - reach), 0)] |= before
    covered[min(math.ceil(row + reach) + 1, shape[0]) :] |= behind
    return covered


def _bar_sides(pointer: NeedleTemplate) -> tuple[bool, bool]:
    """Whether a pointer is the end of a bar that goes on before it, or behind it: it then fills that end only."""
    ends = pointer.transparency[:MIN_VIEWS], pointer.transparency[-MIN_VIEWS:]
    before, behind = (bool(np.mean(end) < MIN_VISIBLE) for end in ends)
    return before and not behind, behind and not before


def _beside_rows(picture: LinearPicture) -> float:
    """Return how far a pointer's middle, or a bar's end, lies from its zero: all readings may be off by as much."""
    before, behind = picture.bar
    if not (before or behind):
        return abs(picture.pointer.beside_deg)
    # Drawn at its end, a bar covers half of its picture. How much a learned pointer covers shows it less well: at its
    # edge, that is not told from how bright it is there.
    rows = picture.given.rows
    own = picture.given.pixels - _behind(picture.face, picture.at_row, rows)
    whole = (own[:MIN_VIEWS] if before else own[-MIN_VIEWS:]).mean(axis=0)
    covered = np.clip(own @ whole / max(float(whole @ whole), NOISE_LEVELS**2), 0.0, 1.0)
    return abs(float(covered.sum()) - rows / 2)


def _behind(face: Floats, row: float, rows: int) -> Floats:
    return rows_at(face, row + np.arange(rows) - (rows - 1) / 2)


def learn_linear(slide: Slide, strips: Sequence[UnwrappedGauge], given: LinearPicture) -> LinearPicture:
    """Learn scale and pointer from a sample's frames, unless the pointer is then found in fewer of them.

    That happens, for example, to a bar that is as bright as parts of its scale: there it looks like print, and its end
    is no longer found once it is learned. Which side of its end is the bar is tried: only the scale may be uneven.
    If nothing is learned, and the pointer is sure in hardly any frame, those in which it is likely found may teach it.
    """
    lit = in_light_of(given.drawn, (slide.along(strip) for strip in strips))
    views = [view for view in lit if view is not None]
    if len(views) < FRAMES_TO_LEARN:
        return given
    tried = [_taught(slide, each, views) for each in (given, *_otherwise(given))]
    learned, _ = max(tried, key=lambda one: one[1])
    if learned is given and _sure(slide, given, views)[1].sum() < FRAMES_TO_LEARN:
        likely = (_likely_taught(slide, each, views) for each in (_bared(given, views), given))
        learned = next(filter(None, likely), given)
    return replace(learned, restless=SlideReader(slide, learned).restless(np.stack(views)))


def _taught(slide: Slide, given: LinearPicture, views: Sequence[Floats]) -> tuple[LinearPicture, float]:
    """Learn from views (R, C), and also return the sum of scores of those in which the pointer is found."""
    known, (found, is_sure) = given, _sure(slide, given, views)
    score, learned = float(found.score[is_sure].sum()), _bared(given, views)
    for _ in range(ROUNDS + 1):
        found, again = _sure(slide, learned, views)
        if again.sum() < max(is_sure.sum(), FRAMES_TO_LEARN):
            break
        known, is_sure, score = learned, again, float(found.score[again].sum())
        learned = _learned(known, [view for view, own in zip(views, is_sure, strict=True) if own], found.row[is_sure])
    return known, score


def _likely_taught(slide: Slide, known: LinearPicture, views: Sequence[Floats]) -> LinearPicture | None:
    """Learn from views (R, C) in which the pointer is only likely found; None if that may be an error.

    A sharp panel picture, or one that shows print behind the pointer, matches none of a flight's frames well. What they
    teach is the pointer if it moves, is sure in all of them and where the picture shows it, and comes to rest there.
    """
    found, is_alone = SlideReader(slide, known).found(np.stack(views))
    is_likely = found.is_settled & is_alone & (found.score >= LIKELY_SCORE)
    learned, rows = known, found.row[is_likely]
    if len(rows) < FRAMES_TO_LEARN or np.ptp(rows) < known.pointer.rows:
        return None
    seen = [view for view, own in zip(views, is_likely, strict=True) if own]
    for _ in range(LIKELY_ROUNDS):
        learned = _learned(learned, seen, rows)
        again, is_sure = _sure(slide, learned, [known.drawn, *seen])
        if not is_sure.all() or abs(float(again.row[0]) - known.at_row) > known.pointer.rows * HALF:
            return None
        moved_rows, rows = np.abs(again.row[1:] - rows), again.row[1:]
        if moved_rows.max() < HALF * SETTLED_ROWS:
            return learned
    return None


def _sure(slide: Slide, picture: LinearPicture, views: Sequence[Floats]) -> tuple[Settled, Mask]:
    """Find the pointer in F windows along their scale, and where that is sure, (F,)."""
    found, is_alone = SlideReader(slide, picture).found(np.stack(views))
    is_sure: Mask = found.is_settled & is_alone & (found.score >= SCORE_THRESHOLD)
    return found, is_sure


def _learned(known: LinearPicture, seen: Sequence[Floats], rows: Floats) -> LinearPicture:
    """Learn scale and pointer from views (R, C) and the rows at which it was found in them."""
    if any(known.bar):
        seen = [_relit(view, known.ending_on(row)) for view, row in zip(seen, rows.tolist(), strict=True)]
    covered = [_covered(known.face.shape, known.pointer, row, known.bar) for row in rows.tolist()]
    before, behind = _sides(known.pointer, [*seen, known.drawn], [*rows.tolist(), known.at_row])
    fills_before, fills_behind = known.bar
    bare = behind if fills_before else before if fills_behind else known.face
    # A single view of what a bar nearly always covers says more than the rest of its column.
    fallback = np.where(np.isfinite(bare), bare, known.face)
    face = learn_face(seen, [np.flatnonzero(each) for each in covered], fallback)
    learned = replace(known, face=face, before=before, behind=behind)
    return replace(learned, pointer=_pointer(learned, seen, rows))


def _relit(view: Floats, shown: Floats) -> Floats:
    """(R, C): bring a view into the light of the bar and scale that it shows.

    Where a bar covers most of a window in one picture and little in another, the whole of it seems to be lit otherwise.
    """
    (lit,) = in_light_of(shown, [view])
    return view if lit is None else lit


def _bared(given: LinearPicture, views: Sequence[Floats]) -> LinearPicture:
    """Separate scale and pointer by the views from which the pointer has moved away, if there are enough.

    If the pointer nearly always stands where the panel picture shows it, few views show the scale behind it.
    """
    rows, at = given.given.rows, given.at_row
    if any(_bar_sides(given.given)):
        return given
    place = needle_pixels(given.face.shape, np.ones_like(given.given.pixels, bool), at)
    drawn = given.drawn.ravel()[place]
    off = [float(np.sqrt(np.square(view.ravel()[place] - drawn).mean())) for view in views]
    gone = [
        view.ravel()[place] for view, apart in zip(views, off, strict=True) if apart > OUTLIER_SPREADS * NOISE_LEVELS
    ]
    if len(gone) < MIN_VIEWS:
        return given
    face = given.drawn.copy()
    face.reshape(-1)[place] = np.median(gone, axis=0)
    cut = rows_at(given.drawn, at + np.arange(rows) - (rows - 1) / 2).astype(np.float32)
    pointer = layer_over(cut, _behind(face, at, rows).astype(np.float32), 1.0)
    return replace(given, face=face, given=pointer, pointer=pointer)


def _pointer(known: LinearPicture, seen: Sequence[Floats], found_rows: Floats) -> NeedleTemplate:
    """Learn the pointer from its cuts, keeping its zero as in the panel picture."""
    before, rows = known.pointer, known.pointer.rows
    behind = _behind(known.face, known.at_row, rows)

    def learned(shift_rows: float) -> NeedleTemplate:
        places = (found_rows + shift_rows)[:, None] + np.arange(rows) - (rows - 1) / 2
        faces = rows_of_each([known.face] * len(seen), places)
        cuts = in_local_light(rows_of_each(seen, places), before, faces)
        both = np.concatenate([cuts, known.given.pixels[None]]), np.concatenate([faces, behind[None]])
        return layered(*both, before.pixels, 1.0)

    pointer = learned(0.0)
    fits = WindowFitter([pointer], [1.0]).fit(
        known.given.pixels.reshape(1, -1), behind.reshape(1, -1).astype(np.float32), np.zeros(1)
    )
    off_rows = float(fits.fraction[0])
    return learned(-off_rows) if abs(off_rows) < rows / 8 else pointer


class LinearKind(WindowKind):
    """A pointer that slides along a straight scale."""

    def owns(self, gauge: Gauge) -> bool:
        return gauge.linear is not None

    def first(self, gauge: Gauge, grid: WindowGrid, drawn: UnwrappedGauge) -> LinearPicture:
        return first_linear(Slide.of(gauge, grid), drawn)

    def learned(
        self, gauge: Gauge, grid: WindowGrid, strips: Sequence[UnwrappedGauge], known: LinearPicture
    ) -> LinearPicture:
        return learn_linear(Slide.of(gauge, grid), strips, known)

    def unexplained(self, placed: Placed, drawn: UnwrappedGauge, strips: Sequence[UnwrappedGauge]) -> float | None:
        gauge, grid = placed.gauge, placed.window
        picture = self.learned(gauge, grid, strips, self.first(gauge, grid, drawn))
        if not any(picture.bar):
            return None  # a pointer has one colour, a bar may have several
        frames = self.window_reader(gauge, grid, picture).read(np.stack(strips), np.zeros(len(strips)))
        found = [own for each in frames for own in each.values()]
        return float(np.mean([1.0 - own.score**2 if own.status is Status.READ else 1.0 for own in found]))

    def window_reader(self, gauge: Gauge, grid: WindowGrid, picture: LinearPicture) -> SlideReader:
        return SlideReader(Slide.of(gauge, grid), picture)
