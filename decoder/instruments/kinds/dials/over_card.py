"""Needles and bugs over a card that turns: each is read in the card's own frame.

First the card is read, as without needles. With the dial turned back by its turn, the card becomes a fixed face with
needles over it, as on any other dial: they are found, learned and doubted like other needles. A needle's angle there is
its place on the card; its angle on the dial is that plus the card's turn. Needles hide parts of the card: once they are
found, the card is read again without these parts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.imaging.planes import Squeeze
from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import (
    Grid,
    PolarGrid,
    UnwrappedGauge,
    Unwrapper,
    needle_places,
    polar,
    row_of_angle,
    turn_rows,
)
from decoder.instruments.appearance import (
    Appearance,
    CardPicture,
    DrawnInstrument,
    Instrument,
    LearnedPicture,
    Look,
    Still,
    needles_in_picture,
)
from decoder.instruments.kind import Kind
from decoder.instruments.kinds.dials.card import (
    CardReader,
    Turn,
    arc_deg,
    far_card_pivot,
    first_card,
    learn_card,
    shared,
    stands_still,
    turned,
    what_is_alike,
)
from decoder.instruments.kinds.dials.card_parallax import CardParallax, parallax_of
from decoder.instruments.kinds.dials.tip_or_tail import BENT_DEG, FOUND_DEG, Facing, View, facing
from decoder.instruments.needle_learner import NeedleLearner
from decoder.instruments.reading import ANYWHERE, Reading, Readings, Status
from decoder.instruments.sampling import GaugeSampler, Part, Samples, SeenGauge
from decoder.instruments.thresholds import (
    APART_DEG,
    CLEAR_PART,
    CLEARLY_WORSE,
    FRAMES_TO_LEARN,
    MIN_TURN_DEG,
    NEEDLE_PART,
    SURE_SCORE,
)
from decoder.matching.correlation import normxcorr, partial_normxcorr
from decoder.matching.faces import face_behind, learn_face
from decoder.matching.needle_layer import layer_over
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.pivot_search import card_squeeze
from decoder.matching.strips import rows_at
from decoder.matching.thresholds import MIN_CONTRAST_PART, MIN_VIEWS, OUTLIER_SPREADS, WHOLE_VISIBLE
from decoder.panel.arrays import Floats, Mask
from decoder.panel.gauge import Gauge
from decoder.panel.scale import FULL_CIRCLE_DEG, shortest
from decoder.panel.vocabulary import Method
from decoder.registration.pivot import Pivot
from decoder.registration.thresholds import CERTAIN_SIGMAS, LIKELY_SCORE, NOISE_LEVELS, SCORE_THRESHOLD

ROUNDS = 3
NO_PARALLAX = CardParallax()
# The dial behind a needle is taken from the third of the frames that differ most there from the panel picture.
ELSEWHERE = 3
LIGHT_PASSES = 2
# Blurs to try where the panel picture is sharper than the frames, or they than it.
BLURS_PX = (0.0, 0.3, 0.5, 0.7, 0.9, 1.2, 1.6)


@dataclass(frozen=True, slots=True)
class OverCardPicture:
    """The appearance of a card under needles.

    Attributes
    ----------
    card
        Appearance of the card by itself.
    face
        (R, C) float32: the dial without needles on the gauge's grid, with the card as in the panel picture.
    templates
        By needle.
    drawn
        (R, C) float32: the panel picture with needles, without what stands still over the card once that is known.
    over
        (P, C): where something fixed lies over the card, in one turn of the dial.
    best_status
        For needles that no frame clearly distinguishes from the marks behind them in the panel picture, the best status
        that they can have: EDGE, with a sigma of the whole turn, if they never moved; MISSING if they did.
    parallaxes
        By needle, if learned from a flight.
    is_card_alone
        Whether a card that turned in a flight matched badly, and none of its needles was found over it: then whatever
        turned may just as well be a needle.
    """

    card: CardPicture
    face: UnwrappedGauge
    templates: Mapping[str, NeedleTemplate]
    drawn: UnwrappedGauge
    over: Mask
    best_status: Mapping[str, Status]
    parallaxes: Mapping[str, CardParallax] = field(default_factory=dict)
    is_card_alone: bool = False


@dataclass(frozen=True)
class _Dial:
    """One gauge on its grid, of more than a turn and perhaps across the centre; and the card's part of it."""

    gauge: Gauge
    grid: PolarGrid
    needle_kinds: Sequence[Kind]

    @property
    def bare_gauge(self) -> Gauge:
        """The gauge in the card's frame: needles over a fixed face; which end is the tip is not asked there."""
        return self.gauge.model_copy(update={"card": None, "tail": False})

    @property
    def needle_kind(self) -> Kind:
        """The kind that reads the needles there."""
        return next(kind for kind in self.needle_kinds if kind.owns(self.bare_gauge))

    @property
    def rows(self) -> int:
        """Number of rows in one turn."""
        return round(FULL_CIRCLE_DEG / self.grid.step_deg)

    @property
    def _outward_px(self) -> Floats:
        """(C,): radii of the columns, without those across the centre."""
        return self.grid.radii_px[self.grid.tail_columns :]

    @property
    def _ring(self) -> int:
        """Index of the first of these columns with the card's marks."""
        first_px = None if self.gauge.card is None else self.gauge.card.ring
        return 0 if first_px is None else int(np.searchsorted(self._outward_px[:-1], first_px))

    @property
    def card_grid(self) -> PolarGrid:
        """The part of the grid on which the card is read: one turn, at the radii of its marks."""
        columns = self.grid.columns - self.grid.tail_columns - self._ring
        inner_px = float(self._outward_px[self._ring])
        return replace(self.grid, rows=self.rows + 1, inner_px=inner_px, columns=columns, tail_columns=0)

    def part(self, strip: NDArray[Any]) -> NDArray[Any]:
        """(P, C): one turn of a gauge (R, C + tail), without the columns across the centre."""
        return strip[once(self.grid)]

    def card_part(self, part: NDArray[Any]) -> NDArray[Any]:
        """(P, N): the card's columns of such a turn."""
        return part[:, self._ring :]

    def whole(self, part: Floats) -> Floats:
        """(R, C + tail): a gauge from one turn of it; reverses `part`."""
        tail = self.grid.tail_columns
        across = np.roll(part, self.rows // 2, axis=0)[:, :tail][:, ::-1]
        return np.concatenate([across, part], axis=1)[np.arange(self.grid.rows) % self.rows]

    def blurred(self, strip: UnwrappedGauge, blur_px: float) -> UnwrappedGauge:
        """(R, C + tail): a gauge blurred by so many pixels."""
        if blur_px == 0.0:
            return strip
        part, grid = self.part(strip), self.grid
        row_px = math.radians(grid.step_deg) * float(self._outward_px.mean())
        across, along = blur_px / grid.column_px, blur_px / row_px
        around = cv2.GaussianBlur(
            np.concatenate([part] * 3), (0, 0), across, sigmaY=along, borderType=cv2.BORDER_REPLICATE
        )
        return self.whole(np.asarray(around[self.rows : 2 * self.rows], np.float32))

    def in_light(self, wanted: Floats, seen: Floats, what: Floats | None = None) -> Floats:
        """Bring a gauge (R, C + tail), or `what` in the same light, into the light of another, as the card shows it."""
        known, own = (self.card_part(self.part(each)) for each in (wanted, seen))
        is_like = np.ones(own.shape, bool)
        for _ in range(LIGHT_PASSES):
            gain, offset = np.polyfit(own[is_like], known[is_like], 1).tolist()
            left = np.abs(gain * own + offset - known)
            is_like = left <= OUTLIER_SPREADS * max(float(left.std()), NOISE_LEVELS)
        lit: Floats = (gain * (seen if what is None else what) + offset).astype(np.float32)
        return lit

    def with_rows(self, strip: UnwrappedGauge, first: int, rows: Floats) -> UnwrappedGauge:
        """(R, C + tail): a gauge with rows replaced from `first` on, wherever the grid shows them."""
        tail, part = self.grid.tail_columns, self.part(strip).copy()
        where = (first + np.arange(len(rows))) % self.rows
        part[where] = rows[:, tail:]
        part[(where + self.rows // 2) % self.rows, :tail] = rows[:, :tail][:, ::-1]
        return self.whole(part)

    def facing(self, view: View, template: NeedleTemplate, angle_deg: float, beside_deg: float = FOUND_DEG) -> Facing:
        """Tell a needle's tip from its tail."""
        return facing(view, template, self.grid, round(row_of_angle(self.grid, angle_deg)), beside_deg)

    def opposite_deg(self, angle_deg: float) -> float:
        """Return the angle half a turn on."""
        first_deg = self.grid.angle_deg(0)
        return first_deg + (angle_deg + FULL_CIRCLE_DEG / 2 - first_deg) % FULL_CIRCLE_DEG

    def hidden(self, templates: Mapping[str, NeedleTemplate], found: Mapping[str, Reading], rows: float) -> Mask:
        """(P, C): where needles found in the card's frame hide a card that has turned by `rows`."""
        hidden = np.zeros((self.grid.rows, self.grid.columns), bool)
        for name, reading in found.items():
            if reading.status is not Status.MISSING:
                row = row_of_angle(self.grid, reading.angle_deg)
                hidden |= needle_places(self.grid, templates[name].touched, row, turn_rows(self.gauge, self.grid))
        return np.roll(self.part(hidden), round(rows), axis=0)


def once(grid: PolarGrid) -> Part:
    """Return the rows and columns that show all of a dial once: one turn, from the centre outwards."""
    return slice(round(FULL_CIRCLE_DEG / grid.step_deg)), slice(grid.tail_columns, None)


@dataclass(frozen=True, slots=True)
class _Seen:
    """Card and needles in one frame.

    Attributes
    ----------
    turn
        The card's, without what needles hide.
    back_rows, back
        By how much the gauge was turned back before needles were found, and the gauge turned back, (R, C).
    found
        By needle, in the card's frame.
    likely
        The same; but if it is not clear which end of a needle is its tip, with the more likely one.
    """

    turn: Turn
    back_rows: float
    back: UnwrappedGauge
    found: Mapping[str, Reading]
    likely: Mapping[str, Reading]

    def at_deg(self, name: str, step_deg: float) -> float:
        """Return a needle's angle on the dial."""
        return self.found[name].angle_deg + self.back_rows * step_deg

    def turned_deg(self, step_deg: float) -> float:
        """Return the card's turn."""
        return self.turn.rows * step_deg


def _view(dial: _Dial, picture: OverCardPicture, back: UnwrappedGauge, turned_rows: float) -> View:
    """Return what a gauge (R, C) that was turned back by so many rows shows of card and needles."""
    shown = np.roll(~picture.over, -round(turned_rows), axis=0).astype(np.float32)
    return View(back, picture.face, dial.whole(shown))


class OverCardReader:
    """Reads card and needles of one gauge."""

    def __init__(
        self,
        dial: _Dial,
        picture: OverCardPicture,
        method: Method,
        evenly_lit_score: float,
        *,
        is_card_doubted: bool = False,
    ) -> None:
        self._dial, self._picture = dial, picture
        self._card = CardReader(dial.gauge, dial.card_grid, picture.card, is_doubted=is_card_doubted)
        self._sampler = GaugeSampler(Unwrapper([dial.grid]), [0])
        self._needles = dial.needle_kind.reader(
            [Instrument(0, dial.bare_gauge, dial.grid, picture.face)],
            Appearance(picture.templates, (picture.face,), evenly_lit_score),
            self._sampler,
            method,
        )

    def turn(self, part: UnwrappedGauge) -> Turn:
        """Find the card's turn in one turn of a dial (P, C), needles included."""
        return self._card.turn(self._dial.card_part(part))

    def on_card(self, backs: Sequence[UnwrappedGauge], place_sigmas_deg: Floats) -> Readings:
        """Find needles in gauges (R, C) turned back; `place_sigmas_deg` (F, 1) as in `Reader`."""
        return self._needles.read([self._sampler.of_unwrapped([back]) for back in backs], place_sigmas_deg)

    def read(self, parts: Sequence[UnwrappedGauge], place_sigmas_deg: Floats) -> Readings:
        """Read all quantities in one turn of F dials (P, C)."""
        sigmas_deg = place_sigmas_deg[:, 0].tolist()
        return [
            self._readings(seen, sigma_deg)
            for seen, sigma_deg in zip(self.seen(parts, place_sigmas_deg), sigmas_deg, strict=True)
        ]

    def seen(self, parts: Sequence[UnwrappedGauge], place_sigmas_deg: Floats) -> list[_Seen]:
        """Find card and needles in one turn of F dials (P, C)."""
        first = [self._card.rough_turn(self._dial.card_part(part)) for part in parts]
        backs = [self.turned_back(part, turn) for part, turn in zip(parts, first, strict=True)]
        found = [
            {name: self._as_shown(name, reading, turn.rows) for name, reading in own.items()}
            for own, turn in zip(self.on_card(backs, place_sigmas_deg), first, strict=True)
        ]
        told = zip(parts, first, backs, found, strict=True)
        return [
            # A needle hides the card along the same line whichever way it points.
            _Seen(self._turn_without(part, turn, own), turn.rows, back, *self._pointed(back, turn.rows, own))
            for part, turn, back, own in told
        ]

    def _pointed(
        self, back: UnwrappedGauge, turned_rows: float, found: Mapping[str, Reading]
    ) -> tuple[dict[str, Reading], dict[str, Reading]]:
        """Turn needles to where their tips are, in two versions: missing if that is unclear, and as is more likely."""
        clear, likely = dict(found), dict(found)
        if self._dial.grid.tail_columns:
            for name, reading in found.items():
                clear[name], likely[name] = self._towards_tip(back, turned_rows, name, reading)
        return clear, likely

    def _towards_tip(
        self, back: UnwrappedGauge, turned_rows: float, name: str, reading: Reading
    ) -> tuple[Reading, Reading]:
        """Do as `_pointed` for one needle, which may be missing because it resembles its own reverse."""
        is_found = reading.status is not Status.MISSING
        if not is_found and (reading.score < SCORE_THRESHOLD or not self._lies_alone(back, name, reading)):
            return reading, reading
        view = _view(self._dial, self._picture, back, turned_rows)
        beside_deg = FOUND_DEG if is_found else BENT_DEG
        towards = self._dial.facing(view, self._picture.templates[name], reading.angle_deg, beside_deg)
        if is_found and towards.ahead >= 0.0:
            likely = clear = reading
        else:  # the reverse matches, or about as well as the needle
            at_deg = reading.angle_deg if towards.ahead >= 0.0 else self._dial.opposite_deg(reading.angle_deg)
            sigma_deg = math.hypot(reading.sigma_deg, (1 + abs(towards.beside_rows)) * self._dial.grid.step_deg)
            likely = replace(reading, status=Status.READ if is_found else Status.EDGE, angle_deg=at_deg)
            clear = self._as_shown(name, replace(likely, status=Status.EDGE, sigma_deg=sigma_deg), turned_rows)
        return clear if towards.is_clear else replace(likely, status=Status.MISSING), likely

    def _lies_alone(self, back: UnwrappedGauge, name: str, reading: Reading) -> bool:
        """Whether a needle matches no other line through the centre nearly as well, one way or the other."""
        dial, template, face = self._dial, self._picture.templates[name], self._picture.face
        rows = np.arange(dial.rows + template.rows - 1) % dial.rows
        scores, _ = partial_normxcorr(back[rows], face[rows], template)
        axis_row = row_of_angle(dial.grid, reading.angle_deg) - (template.rows - 1) // 2
        on = np.maximum(scores, 0.0)
        beside = np.abs(shortest(np.arange(dial.rows) - axis_row, dial.rows / 2))
        rival = float(on[beside > template.rows].max(initial=0.0))
        return CLEARLY_WORSE * (1.0 - reading.score**2) < 1.0 - rival**2

    def _as_shown(self, name: str, reading: Reading, turned_rows: float) -> Reading:
        """Increase a needle's sigma by the part of its width that fixed parts over the card hide."""
        over, template = self._picture.over, self._picture.templates[name]
        if reading.status is Status.MISSING or not over.any():
            return reading
        covers = self._dial.hidden({name: template}, {name: reading}, turned_rows)
        shown = 1.0 - float((covers & over).sum()) / max(int(covers.sum()), 1)
        if shown >= WHOLE_VISIBLE:
            return reading
        status = Status.EDGE if shown >= HALF else Status.MISSING
        sigma_deg = math.hypot(reading.sigma_deg, (1.0 - shown) * template.half_width_deg)
        return Reading(status, reading.angle_deg, sigma_deg, reading.score)

    def _turn_without(self, part: UnwrappedGauge, turn: Turn, found: Mapping[str, Reading]) -> Turn:
        """Read a card without what needles hide, given its rough turn."""
        dial = self._dial
        hidden = dial.hidden(self._picture.templates, found, turn.rows)
        # The whole turn is needed to estimate the light on it.
        bare = self._with_card(part, turn, hidden) if hidden.any() else part
        return self._card.turn_without(dial.card_part(bare), dial.card_part(hidden), turn)

    def turned_back(self, part: UnwrappedGauge, turn: Turn) -> UnwrappedGauge:
        """(R, C): a gauge turned back, with the card drawn where something fixed lies over it."""
        over = self._picture.over
        return self._dial.whole(turned(self._with_card(part, turn, over) if over.any() else part, -turn.rows))

    def _with_card(self, seen: UnwrappedGauge, turn: Turn, instead: Mask) -> UnwrappedGauge:
        """(P, C): one turn of a dial with the card drawn at `instead`, in the light of the rest."""
        face = turned(self._dial.part(self._picture.face), turn.rows)
        rest = (~instead).astype(np.float32).ravel()
        face_mean, seen_mean = ((rest @ each.ravel()) / rest.sum() for each in (face, seen))
        shown = face - face_mean
        own = rest * shown.ravel()
        gain = (own @ seen.ravel()) / max(own @ shown.ravel(), np.float32(1.0))
        return np.where(instead, gain * shown + seen_mean, seen)

    def _readings(self, seen: _Seen, place_sigma_deg: float) -> dict[str, Reading]:
        """Return the readings of all quantities."""
        turn, found = seen.turn, seen.found
        gauge, step_deg = self._dial.gauge, self._dial.grid.step_deg
        card = self._card.reading(turn)
        readings = {gauge.quantities[0].name: card.in_place_within(place_sigma_deg)}
        first_deg = gauge.sweep[0]
        for needle in gauge.needles:
            own = found[needle.name]
            status, best = own.status, self._picture.best_status.get(needle.name, Status.READ)
            if status is Status.READ or best is Status.MISSING:
                status = best
            # The match may be a mark, and the needle may be anywhere.
            doubt_deg = 0.0 if best is Status.READ else ANYWHERE * FULL_CIRCLE_DEG
            at_deg = seen.at_deg(needle.name, step_deg)
            at_deg -= self._picture.parallaxes.get(needle.name, NO_PARALLAX).at(at_deg)
            on_card = Reading(
                status if card.status is Status.READ else Status.MISSING,
                first_deg + (at_deg - seen.turned_deg(step_deg) - first_deg) % FULL_CIRCLE_DEG,
                math.hypot(self.sigma_on_card_deg(seen, needle.name), doubt_deg),
                own.score,
            )
            if needle.scale is None:
                readings[needle.name] = on_card
                continue
            at_deg = first_deg + (at_deg - first_deg) % FULL_CIRCLE_DEG
            readings[needle.name] = Reading(status, at_deg, math.hypot(own.sigma_deg, doubt_deg), own.score)
            if needle.on_card is not None:
                readings[needle.on_card] = on_card
        return readings

    def sigma_on_card_deg(self, seen: _Seen, name: str) -> float:
        """Return the standard deviation of a needle's place on the card."""
        return math.hypot(seen.found[name].sigma_deg, self._card.reading(seen.turn).sigma_deg)


def learn_over_card(dial: _Dial, strips: Sequence[UnwrappedGauge], given: OverCardPicture) -> OverCardPicture:
    """Learn card, face and needles from frames (R, C) in the panel picture's light, as far as possible.

    A card that hardly turned cannot be separated from the fixed parts over it, but the needles can be.
    """
    parts = [dial.part(strip) for strip in strips]
    card = learn_card(dial.gauge, dial.card_grid, [dial.card_part(part) for part in parts], given.card)
    given = _without_overlays(dial, replace(given, card=card), parts)
    known, unmoved = given, dict[str, Status]()
    for number in range(ROUNDS):
        reader = OverCardReader(dial, known, Method.NORMXCORR, SCORE_THRESHOLD)
        seen = [each for each in reader.seen(parts, np.zeros((len(parts), 1))) if each.turn.score >= LIKELY_SCORE]
        if len(seen) < FRAMES_TO_LEARN:
            return replace(given, best_status={**unmoved, **given.best_status})
        unmoved = dict.fromkeys(_unmoved(dial, known, seen), Status.EDGE)
        usual = np.median([each.back for each in seen], axis=0)
        views = [(dial.in_light(usual, each.back), each.likely) for each in seen]
        if number == 0:
            known, apart = _bared(dial, known, [back for back, _ in views], [each.turn.rows for each in seen])
            views = [(back, {**found, **own}) for (back, found), own in zip(views, apart, strict=True)]
            given = known
        known = _learned(dial, given, known, views)
    best_status = {**unmoved, **known.best_status, **dict.fromkeys(_either_way(dial, known, seen), Status.MISSING)}
    return replace(
        known,
        parallaxes=_parallaxes(dial, reader, seen),
        best_status=best_status,
        is_card_alone=_is_card_alone(dial, seen),
    )


def _is_card_alone(dial: _Dial, frames: Sequence[_Seen]) -> bool:
    """Whether a card that turned matches badly, and most frames show none of its needles."""
    if arc_deg([seen.turn.rows for seen in frames], dial.grid) < MIN_TURN_DEG:
        return False
    found = sum(any(own.status is not Status.MISSING for own in seen.likely.values()) for seen in frames)
    return found < HALF * len(frames) and float(np.median([seen.turn.score for seen in frames])) < SURE_SCORE


def _either_way(dial: _Dial, known: OverCardPicture, frames: Sequence[_Seen]) -> Iterator[str]:
    """List learned needles that may point either way: in the panel picture, or in most frames in which they are found.

    Frames agree among themselves on which end is the tip; only the panel picture shows which of the two it is.
    """
    for needle in dial.gauge.turning:
        if needle.at_deg is not None and dial.grid.tail_columns:
            drawn = dial.facing(_view(dial, known, known.drawn, 0.0), known.templates[needle.name], needle.at_deg)
            found = [each for each in frames if each.likely[needle.name].status is not Status.MISSING]
            clear = sum(each.found[needle.name].status is not Status.MISSING for each in found)
            if drawn.ahead <= CERTAIN_SIGMAS * drawn.sigma or clear <= HALF * len(found):
                yield needle.name


def _unmoved(dial: _Dial, known: OverCardPicture, frames: Sequence[_Seen]) -> Iterator[str]:
    """List needles that, apart from stray matches, never moved over a card that turned: each may be a mark.

    Such a needle is always found where it is in the panel picture, as a mark of the card would be. While the fixed
    parts over the card are unknown, it may also be a mark on them, which is always found at one place on the dial.
    """
    if arc_deg([seen.turn.rows for seen in frames], dial.grid) <= APART_DEG:
        return
    for needle in dial.gauge.turning:
        own = [seen for seen in frames if seen.found[needle.name].status is Status.READ]
        on_card_deg = np.array([seen.found[needle.name].angle_deg for seen in own])
        stays = needle.at_deg is not None and _all_near(on_card_deg, needle.at_deg)
        if not known.card.is_learned and own:
            at_deg = np.array([seen.at_deg(needle.name, dial.grid.step_deg) for seen in own])
            stays = stays or any(_all_near(at_deg, each) for each in at_deg)
        if stays:
            yield needle.name


def _all_near(angles_deg: Floats, at_deg: float) -> bool:
    """Whether all angles but a few stray ones are near one, and at least one is."""
    is_near = np.abs(shortest(angles_deg - at_deg, FULL_CIRCLE_DEG)) <= APART_DEG
    return bool(is_near.any()) and int((~is_near).sum()) < MIN_VIEWS


def _parallaxes(dial: _Dial, reader: OverCardReader, frames: Sequence[_Seen]) -> dict[str, CardParallax]:
    """Estimate parallaxes of needles read only on the card, such as bugs: once set, they stay there for a while."""
    step_deg, found = dial.grid.step_deg, {}
    for needle in dial.gauge.needles:
        own = [seen for seen in frames if seen.found[needle.name].status is Status.READ]
        if needle.scale is None and len(own) >= FRAMES_TO_LEARN:
            at_deg = np.array([seen.at_deg(needle.name, step_deg) for seen in own])
            on_card_deg = at_deg - [seen.turned_deg(step_deg) for seen in own]
            sigmas_deg = [reader.sigma_on_card_deg(seen, needle.name) for seen in own]
            found[needle.name] = parallax_of(at_deg, on_card_deg, float(np.median(sigmas_deg)))
    return found


def _without_overlays(dial: _Dial, known: OverCardPicture, parts: Sequence[UnwrappedGauge]) -> OverCardPicture:
    """Draw the dial, from frames (P, C) turned back, where something fixed lies over it in the panel picture."""
    if not known.card.is_learned:
        return known
    reader = CardReader(dial.gauge, dial.card_grid, known.card)
    all_ = shared([(part, reader.turn(dial.card_part(part)).rows) for part in parts])
    # Frames that were turned back inexactly, or seen askew, differ at all marks at this radius.
    usual = np.median(all_.weights, axis=0) / OUTLIER_SPREADS**2
    clearly = np.asarray(all_.weights < np.minimum(usual, MIN_CONTRAST_PART), np.uint8)
    over = cv2.dilate(clearly, np.ones((3, 3), np.uint8)) > 0  # its rim is blurred by a pixel
    face, drawn = (
        dial.whole(np.where(over, all_.card, dial.part(each)).astype(np.float32)) for each in (known.face, known.drawn)
    )
    return replace(known, face=face, drawn=drawn, over=over)


def _learned(
    dial: _Dial,
    given: OverCardPicture,
    known: OverCardPicture,
    views: Sequence[tuple[UnwrappedGauge, Mapping[str, Reading]]],
) -> OverCardPicture:
    """Learn needles and the face below them from gauges (R, C) turned back, with the readings in each."""
    backs, found = [back for back, _ in views], [own for _, own in views]
    turn = turn_rows(dial.gauge, dial.grid)
    learner = NeedleLearner(dial.gauge.turning, dial.grid, turn, backs, given.face, given.templates)
    face = learner.face(found, known.templates)
    templates = {**known.templates, **learner.templates(found, known.templates, face)}
    card = known.card if known.card.is_learned else first_card(dial.card_part(dial.part(face)), dial.card_grid)
    return replace(known, card=card, face=face, templates=templates)


def _bared(
    dial: _Dial, given: OverCardPicture, backs: Sequence[UnwrappedGauge], turns_rows: Sequence[float]
) -> tuple[OverCardPicture, list[dict[str, Reading]]]:
    """Correct the card behind the panel picture's needles, from the frames that differ most from the picture there.

    A dim needle is cut together with brighter marks behind it, which would match themselves in every frame. Frames were
    turned back by `turns_rows`; where something fixed lay over the card, a frame shows neither card nor needle.
    """
    usual = np.median(backs, axis=0).astype(np.float32)
    picture_px, frames_px = _blurs_px(dial, given.drawn, usual)
    both = np.stack([dial.blurred(given.drawn, picture_px), dial.blurred(given.face, picture_px)])
    picture, face = dial.in_light(dial.blurred(usual, frames_px), both[0], both)
    backs = [dial.blurred(back, frames_px) for back in backs]
    shown = [dial.whole(np.roll(~given.over, -round(rows), axis=0)).astype(bool) for rows in turns_rows]
    templates, best_status = dict(given.templates), {}
    for needle in dial.gauge.turning:
        if needle.at_deg is None or needle.hides_deg is None:
            continue
        cut = templates[needle.name]
        first = round(row_of_angle(dial.grid, needle.at_deg)) - (cut.rows - 1) // 2
        rows = slice(first, first + cut.rows)
        drawn, views = picture[rows], np.stack([back[rows] for back in backs])
        is_shown = np.stack([each[rows] for each in shown])
        left = np.square(is_shown * (views - drawn)).sum(axis=(1, 2)) / np.maximum(is_shown.sum(axis=(1, 2)), 1)
        by_likeness, count = np.argsort(left), math.ceil(len(views) / ELSEWHERE)
        like, other = by_likeness[:count], by_likeness[-count:]
        behind = learn_face(list(views[other]), [np.flatnonzero(~is_shown[frame]) for frame in other], drawn)
        low, high = np.quantile(drawn, (0.02, 0.98))
        clear = max(OUTLIER_SPREADS * NOISE_LEVELS, CLEAR_PART * float(high - low))
        if float((np.abs(drawn - behind) > clear).mean()) > NEEDLE_PART:
            face = dial.with_rows(face, first, behind)
        else:
            has_moved = np.median(left[other]) > CLEARLY_WORSE * np.median(left[like])
            best_status[needle.name] = Status.MISSING if has_moved else Status.EDGE
        axis_rows = row_of_angle(dial.grid, needle.at_deg) + np.arange(cut.rows) - (cut.rows - 1) / 2
        there = face_behind(face, dial.grid, needle.at_deg, cut.rows)
        templates[needle.name] = layer_over(rows_at(picture, axis_rows), there, cut.step_deg)
    bared = replace(given, face=face, templates=templates, best_status=best_status)
    bare = [np.where(is_shown, back, face) for back, is_shown in zip(backs, shown, strict=True)]
    usual = np.median([np.abs(back - face) for back in bare], axis=0)
    seen = [_view(dial, bared, *each) for each in zip(bare, turns_rows, strict=True)]
    return bared, [_found_apart(dial, bared, view, usual) for view in seen]


def _blurs_px(dial: _Dial, drawn: UnwrappedGauge, usual: UnwrappedGauge) -> tuple[float, float]:
    """Find the blurs in pixels, of the panel picture and of frames, that make both equally sharp."""
    ways = [(blur_px, 0.0) for blur_px in BLURS_PX] + [(0.0, blur_px) for blur_px in BLURS_PX]
    pairs = [(dial.blurred(drawn, picture_px), dial.blurred(usual, frames_px)) for picture_px, frames_px in ways]
    left = [float(np.abs(frame - dial.in_light(frame, picture)).mean()) for picture, frame in pairs]
    return ways[int(np.argmin(left))]


def _found_apart(dial: _Dial, known: OverCardPicture, view: View, usual: UnwrappedGauge) -> dict[str, Reading]:
    """Find needles rather than marks: where a gauge differs from the bare card as the panel picture does.

    One picture does not show how a needle looks over other marks, only how it changes the card behind it. By how
    much frames usually differ (R, C) does not count: their marks were not turned back quite to where the card has them.
    """
    grid, found = dial.grid, {}
    left = _beyond(np.abs(view.seen - known.face), usual)
    for needle in dial.gauge.turning:
        if needle.name in known.best_status or needle.at_deg is None:
            continue
        cut = known.templates[needle.name]
        axis = (cut.rows - 1) // 2
        there = np.abs(cut.pixels - face_behind(known.face, grid, needle.at_deg, cut.rows))
        there = _beyond(there, face_behind(usual, grid, needle.at_deg, cut.rows))
        scores = normxcorr(left, there, np.ones_like(there))[: dial.rows]
        best = int(scores.argmax())
        rivals = np.roll(scores, -best)
        if grid.tail_columns:  # which end is the tip is decided below
            rivals[(dial.rows - cut.rows) // 2 : (dial.rows + cut.rows) // 2] = 0.0
        rival = rivals[cut.rows : -cut.rows].max(initial=0.0)
        # Changes over other marks are alike only in part. Half as clear as elsewhere is enough to begin learning with.
        is_clear = (1.0 - rival**2) ** 2 > CLEARLY_WORSE * (1.0 - min(scores[best], 1.0) ** 2) ** 2
        is_sure = scores[best] >= LIKELY_SCORE and is_clear
        status = Status.READ if is_sure else Status.MISSING
        reading = Reading(status, grid.angle_deg(best + axis), grid.step_deg, float(scores[best]))
        # Which end is the tip will be clear once it is learned from all frames.
        if is_sure and grid.tail_columns and dial.facing(view, cut, reading.angle_deg).ahead < 0.0:
            reading = replace(reading, angle_deg=dial.opposite_deg(reading.angle_deg))
        found[needle.name] = reading
    return found


def _beyond(left: Floats, usual: Floats) -> Floats:
    """(R, C): by how much more than usual a gauge differs, averaged over neighbours."""
    return np.asarray(cv2.blur(np.maximum(left - usual, 0.0), (3, 3)), np.float32)


class _OverCards:
    def __init__(self, readers: Sequence[tuple[int, OverCardReader]], sampler: GaugeSampler) -> None:
        self._readers, self._sampler = readers, sampler

    def read(self, frames: Sequence[Samples], place_sigmas_deg: Floats) -> Readings:
        readings: Readings = [{} for _ in frames]
        for index, reader in self._readers:
            parts = list(self._sampler.strips(frames, index))
            for frame, own in zip(readings, reader.read(parts, place_sigmas_deg[:, [index]]), strict=True):
                frame.update(own)
        return readings


def _name(gauge: Gauge) -> str:
    """Return the name under which a gauge's learned picture is kept: its card's."""
    return gauge.quantities[0].name


class OverCardKind(Still):
    """Needles over a card that turns; `needle_kinds` read needles over a fixed face."""

    is_searched = False

    def __init__(self, needle_kinds: Sequence[Kind]) -> None:
        self._needle_kinds = needle_kinds

    def _dial(self, gauge: Gauge, grid: PolarGrid) -> _Dial:
        return _Dial(gauge, grid, self._needle_kinds)

    def owns(self, gauge: Gauge) -> bool:
        return gauge.card is not None and bool(gauge.needles)

    def sampled_part(self, grid: Grid) -> Part:
        return once(polar(grid))

    def reader(
        self, instruments: Sequence[Instrument], appearance: Appearance, sampler: GaugeSampler, method: Method
    ) -> _OverCards:
        pictures: list[OverCardPicture] = [appearance.pictures[_name(own.gauge)] for own in instruments]
        readers = [
            (
                own.index,
                OverCardReader(
                    self._dial(own.gauge, own.grid),
                    picture,
                    method,
                    appearance.evenly_lit_score,
                    is_card_doubted=_name(own.gauge) in appearance.doubted or picture.is_card_alone,
                ),
            )
            for own, picture in zip(instruments, pictures, strict=True)
        ]
        return _OverCards(readers, sampler)

    def first_look(self, drawn: DrawnInstrument) -> Look:
        dial = self._dial(drawn.gauge, drawn.grid)
        look = needles_in_picture(drawn)
        card = first_card(dial.card_part(dial.part(look.face)), dial.card_grid)
        over = np.zeros(dial.part(look.face).shape, bool)
        untold = dict.fromkeys(look.templates, Status.EDGE)
        picture = OverCardPicture(card, look.face, look.templates, drawn.strip, over, untold)
        return replace(look, pictures={_name(drawn.gauge): picture})

    def learned_pictures(
        self, instrument: Instrument, strips: Sequence[UnwrappedGauge], known: Mapping[str, LearnedPicture]
    ) -> Mapping[str, LearnedPicture]:
        name = _name(instrument.gauge)
        return {name: learn_over_card(self._dial(instrument.gauge, instrument.grid), strips, known[name])}

    def pivot(self, instrument: Instrument, appearance: Appearance, frames: Sequence[SeenGauge]) -> Pivot:
        """Return the card's pivot or, if it stands still, the needles'."""
        dial = self._dial(instrument.gauge, instrument.grid)
        picture: OverCardPicture = appearance.pictures[_name(dial.gauge)]
        reader = CardReader(dial.gauge, dial.card_grid, picture.card)
        parts = [dial.card_part(dial.part(strip)) for strip, _, _ in frames]
        turns = [reader.turn(part) for part in parts]
        rows = [turn.rows for turn in turns if turn.score >= SCORE_THRESHOLD]
        if not rows or arc_deg(rows, dial.grid) >= MIN_TURN_DEG:
            return reader.pivot(parts)
        still = replace(instrument, gauge=dial.bare_gauge, face=picture.face)
        templates = {**appearance.templates, **picture.templates}
        return dial.needle_kind.pivot(still, replace(appearance, templates=templates), frames)

    def far_pivot(self, instrument: Instrument, strips: Sequence[UnwrappedGauge]) -> tuple[float, float] | None:
        dial = self._dial(instrument.gauge, instrument.grid)
        parts = [dial.card_part(dial.part(strip)) for strip in strips]
        found = far_card_pivot(dial.card_grid, parts)
        if found is None and stands_still(dial.card_grid, parts):
            return dial.needle_kind.far_pivot(replace(instrument, gauge=dial.bare_gauge), strips)
        return found

    def squeeze(self, instrument: Instrument, strips: Sequence[UnwrappedGauge], *, is_lost: bool) -> Squeeze | None:
        if not is_lost:
            return None
        dial = self._dial(instrument.gauge, instrument.grid)
        parts = [dial.card_part(dial.part(strip)) for strip in strips]
        return None if stands_still(dial.card_grid, parts) else card_squeeze(dial.card_grid, parts)

    def findings(self, gauge: Gauge, appearance: Appearance) -> Sequence[str]:
        picture: OverCardPicture = appearance.pictures[_name(gauge)]
        return what_is_alike(gauge, picture.card, is_doubted=_name(gauge) in appearance.doubted)
