"""Attitude indicators: how far a horizon has turned and shifted behind its window, and what it looks like.

What moves is one picture, larger than the window: it turns with bank, and then shifts with pitch along its own vertical
axis. A ring of marks around the window turns with bank alone, like a card. Where there is one, bank is read from it,
and the horizon is searched for at the ring's turn only.

The picture is composed from frames, each turned and shifted back by its reading. What stands still in the window
instead (an aircraft symbol, the frame, a reflection) is smeared out by that, and shows where frames differ.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import cv2
import numpy as np

from decoder.imaging.planes import Squeeze
from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import UnwrappedGauge
from decoder.instruments.appearance import (
    Appearance,
    CardPicture,
    DrawnInstrument,
    Instrument,
    LearnedPicture,
    Look,
    Still,
)
from decoder.instruments.kinds.dials.card import CardReader, arc_deg, first_card, learn_card
from decoder.instruments.kinds.dials.horizon import (
    AS_DRAWN,
    HALF_TURN_DEG,
    NOT_SEEN,
    REACH_RADII,
    SEARCH_STEP_DEG,
    AttitudePicture,
    Attitudes,
    HorizonReader,
    Place,
    Sight,
    sampled_at,
    softened,
)
from decoder.instruments.reading import Reading, Readings, Status
from decoder.instruments.sampling import GaugeSampler, Samples, SeenGauge
from decoder.instruments.thresholds import FRAMES_TO_LEARN, MIN_TURN_DEG, SURE_SCORE
from decoder.matching.pivot_search import SQUEEZE_AXES, card_squeeze
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.panel.scale import FULL_CIRCLE_DEG, in_turn
from decoder.panel.vocabulary import Method
from decoder.registration.pivot import UNKNOWN, Pivot
from decoder.registration.thresholds import LIKELY_SCORE, SCORE_THRESHOLD

ROUNDS = 5
# Steps of the search for the law by which an unusual horizon shifts, in such parts of its turn.
LAW_STEPS, LAW_PARTS = (4, 2, 1), 24
# Directions around the mean that count, in steps of the estimate of a horizon's level.
LEVEL_STEPS_DEG = 25.0, 15.0, 10.0, 6.0, 4.0, 4.0
LEVEL_ROUNDS = 2


@dataclass(frozen=True, slots=True)
class Seen:
    """Ring and horizon in one frame; `ring_deg` is how far the ring, or the horizon instead, is turned clockwise.

    Neither is sure where the horizon matches better at another turn than the ring's.
    """

    ring_deg: float
    ring_sigma_deg: float
    ring_score: float
    is_ring_sure: bool
    horizon: Sight


class Turned(Protocol):
    """How far a ring has turned clockwise, as `decoder.instruments.kinds.dials.card.Turn`."""

    @property
    def rows(self) -> float: ...
    @property
    def sigma_rows(self) -> float: ...
    @property
    def score(self) -> float: ...
    @property
    def is_alone(self) -> bool: ...


class Ring(Protocol):
    """Reads a ring of marks, as `decoder.instruments.kinds.dials.card.CardReader`."""

    def turn(self, unwrapped: UnwrappedGauge) -> Turned:
        """Measure how far it has turned from where it lies in the panel picture."""
        ...


_View = tuple[UnwrappedGauge, Turned | None]
"""A gauge (R, C), and how far its ring has turned, if it has one."""


def _views(own: Attitudes, strips: Iterable[UnwrappedGauge], ring: Ring | None) -> Iterator[_View]:
    """Read the ring in each frame (R, C), once: its turn is the same however often the horizon is searched for."""
    for strip in strips:
        yield strip, None if ring is None else ring.turn(strip[:, own.ring])


class AttitudeReader:
    """Reads roll and pitch of one gauge; `picture` is what it looks like, `ring` reads the ring if there is one."""

    def __init__(self, own: Attitudes, picture: AttitudePicture, ring: Ring | None) -> None:
        self._own, self._ring, self._origin = own.moving_as(picture), ring, picture.origin
        # What a ring was to tell, and did not, the horizon must tell surely.
        self._least_score = SURE_SCORE if ring is None and own.own.ring is not None else SCORE_THRESHOLD
        self._horizon = HorizonReader(self._own, picture)

    def read(self, strips: Floats) -> list[tuple[Reading, Reading]]:
        """Read roll and pitch in F frames of the gauge: (F, R, C) float32."""
        return [self._readings(self.seen(view)) for view in _views(self._own, strips, self._ring)]

    def seen(self, view: _View) -> Seen:
        """Find the horizon in a gauge whose ring has been read."""
        (strip, turn), turn_part, sight = view, self._own.own.horizon_turn, self.horizon(view)
        if turn is None:
            sight = self._horizon.without_quarters(strip, sight)
            turned_deg = sight.place.turned_deg - self._origin.turned_deg
            ring_deg = (turned_deg + self._own.tilted_deg) / turn_part
            is_sure = sight.is_sure and sight.score >= self._least_score
            is_sure = is_sure and self._own.is_level_in_sight(self._since_drawn(sight))
            return Seen(ring_deg, sight.sigma_deg / turn_part, sight.score, is_sure, sight)
        is_sure = turn.score >= SCORE_THRESHOLD and turn.is_alone
        is_sure = is_sure and not (sight.is_sure and self._horizon.turns_on(strip, sight.place))
        return Seen(self._ring_deg(turn), turn.sigma_rows * self._own.grid.step_deg, turn.score, is_sure, sight)

    def horizon(self, view: _View, *, is_upright: bool = False) -> Sight:
        """Find only where the horizon lies: whether the ring is to be believed takes another fit.

        Without a ring, it may be known to be upright.
        """
        (strip, turn), own = view, self._own.own
        at_deg = None if turn is None else self._origin.turned_deg + own.horizon_turn * self._ring_deg(turn)
        return self._horizon.sight(strip, at_deg, is_upright=is_upright)

    def _ring_deg(self, turn: Turned) -> float:
        return float(in_turn(np.array(turn.rows * self._own.grid.step_deg), FULL_CIRCLE_DEG, -HALF_TURN_DEG))

    def origin_in(self, window: UnwrappedGauge) -> Place | None:
        """Return where the panel picture's window (P, C) shows the horizon, or None where it is not found.

        What was composed began there, so it lies near, even if it matches a mark of its ladder further on about as
        well. Only where no ring shows which way is up, it may also have been composed upside down.
        """
        if self._ring is None:
            sight = self._horizon.without_quarters(window, self._horizon.sight(window, None))
        else:
            sight = self._horizon.sight(window, 0.0)
        is_near = sight.score >= LIKELY_SCORE and self._horizon.is_near(sight.place, AS_DRAWN)
        is_near = is_near and (self._ring is not None or self._horizon.is_worse_upside_down(window, sight))
        return sight.place if sight.is_sure or is_near else None

    def _readings(self, seen: Seen) -> tuple[Reading, Reading]:
        own, sight, first_deg = self._own.own, seen.horizon, self._own.gauge.sweep[0]
        angle_deg = first_deg + (own.index - seen.ring_deg - first_deg) % FULL_CIRCLE_DEG
        roll = Reading(_status(seen.is_ring_sure), angle_deg, seen.ring_sigma_deg, seen.ring_score)
        place = self._since_drawn(sight)
        up_px, worth = self._own.up_px(place)
        sigma_px = math.hypot(sight.sigma_px * worth, self._own.drawn_sigma_px(up_px))
        a_pixel_deg = self._own.a_pixel_deg
        is_sure = seen.is_ring_sure and sight.is_sure and self._own.is_level_in_sight(place)
        return roll, Reading(_status(is_sure), up_px * a_pixel_deg, sigma_px * a_pixel_deg, sight.score)

    def _since_drawn(self, sight: Sight) -> Place:
        """Return where the horizon lies relative to where the panel picture shows it."""
        here, there = sight.place, self._origin
        return Place(here.turned_deg - there.turned_deg, here.down_px - there.down_px)


def _status(is_sure: bool) -> Status:  # noqa: FBT001 - its only argument
    return Status.READ if is_sure else Status.MISSING


def first_attitude(own: Attitudes, strip: UnwrappedGauge, ring: CardPicture | None) -> AttitudePicture:
    """Return it as the panel picture (R, C) shows it, with all that lies over it."""
    weights = np.ones((own.rows, own.window), np.float32)
    horizon, known = _composed([_moved_back(own, weights, strip, NOT_SEEN)])
    return AttitudePicture(horizon, known, weights, ring, strip[: own.rows, : own.window], own.own.shift_turn)


def learn_attitude(
    own: Attitudes, strips: Sequence[UnwrappedGauge], given: AttitudePicture, ring: Ring | None
) -> AttitudePicture:
    """Learn it from frames (R, C) in the panel picture's light; return it as given if they do not suffice.

    A ring that is not read in most frames, or at another turn than its horizon, may be none: something else moves where
    it was drawn, as the sky does beside a ring that is drawn too wide. If more than twice as many frames are read by
    the horizon alone, and more rolls than by the ring, it is learned without a ring. A ring around a horizon that is
    hard to see tells more. A law that was learned around another pivot stays as it is.
    """
    views, bare = list(_views(own, strips, ring)), list(_views(own, strips, None))
    if ring is not None and own.is_odd and not given.is_law_from_afar and _has_banked(own, views):
        learned = _learn_with_law(own, views, given, ring)
    else:
        learned = _put_together(own, views, given, ring, ROUNDS)
    if ring is not None:
        rolls, both = _told(own, views, learned, ring)
        if both < HALF * len(views):
            alone = _put_together(own, bare, replace(given, ring=None), None, ROUNDS)
            rolls_alone, both_alone = _told(own, bare, alone, None)
            learned = alone if both < HALF * both_alone and rolls < rolls_alone else learned
    return _levelled(own, bare, learned) if learned.ring is None and learned.is_learned else learned


def _told(own: Attitudes, views: Sequence[_View], learned: AttitudePicture, ring: Ring | None) -> tuple[int, int]:
    """Count the frames that show roll, and roll and pitch."""
    reader = AttitudeReader(own, learned, ring)
    told = [one for one in map(reader.seen, views) if one.is_ring_sure]
    return len(told), sum(one.horizon.is_sure for one in told)


def _levelled(own: Attitudes, views: Sequence[_View], learned: AttitudePicture) -> AttitudePicture:
    """Learn it from frames again, tilted by as much as the horizon that was learned lies off its level.

    Without a ring, somebody drew at which angle a pointer stands, or where up is on a horizon that is seen from aside.
    Its line and its ladder show that themselves: clearly, once it is shifted back along its own upright.
    """
    for _ in range(LEVEL_ROUNDS):
        own = replace(own, tilted_deg=own.tilted_deg + off_level_deg(learned))
        start = replace(first_attitude(own, learned.drawn, None), tilted_deg=own.tilted_deg)
        again = _put_together(own, views, start, None, ROUNDS)
        if not again.is_learned:
            break
        learned = again
    return learned


def off_level_deg(picture: AttitudePicture) -> float:
    """Return how far clockwise most lines of a horizon are off the level: the weighted mean direction of its edges.

    Edges count by the square of their slope, and ever fewer directions around the mean: numerals, lines that run
    together on the ground, and a scale of bank are left out.
    """
    soft = softened(picture.horizon, 1.0, 1.0)
    across, down = (cv2.Sobel(soft, cv2.CV_32F, *order) for order in ((1, 0), (0, 1)))
    is_known = cv2.erode(picture.known, np.ones((5, 5), np.uint8)) > 0
    tilts_deg = -np.degrees(np.arctan2(across * np.sign(down), np.abs(down)))[is_known]
    strengths = np.square(across)[is_known] + np.square(down)[is_known]
    off_deg = 0.0
    for within_deg in LEVEL_STEPS_DEG:
        counts = strengths * (np.abs(tilts_deg - off_deg) < within_deg)
        off_deg = float(counts @ tilts_deg / max(float(counts.sum()), 1.0))
    return off_deg


def _has_banked(own: Attitudes, views: Sequence[_View]) -> bool:
    """Whether the ring has turned far enough in frames to tell how the horizon shifts in a bank."""
    rows = [turn.rows for _, turn in views if turn is not None]
    return len(rows) >= FRAMES_TO_LEARN and arc_deg(rows, own.ring_grid) >= MIN_TURN_DEG


def _learn_with_law(own: Attitudes, views: Sequence[_View], given: AttitudePicture, ring: Ring) -> AttitudePicture:
    """Learn it from frames, together with the law by which the direction of its shift turns with the ring.

    The law that leaves least of the frames unexplained is chosen, near the panel's own. Each law is tried with all
    frames and the picture composed by the best one so far: with a new picture, or fewer frames, chance would decide.
    """

    def composed(parts: float, start: AttitudePicture, rounds: int) -> AttitudePicture:
        law = own.own.shift_turn + parts * own.own.horizon_turn / LAW_PARTS
        return _put_together(own, views, replace(start, shift_turn=law), ring, rounds)

    def tried_from(start: AttitudePicture, parts: int, rounds: int) -> tuple[float, AttitudePicture]:
        picture = composed(parts, start, rounds)
        return _unexplained(own, views, picture, ring), picture

    tried, best = {0: tried_from(given, 0, ROUNDS)}, 0
    for step in LAW_STEPS:
        for _ in range(LAW_PARTS):
            for parts in (best - step, best + step):
                if parts not in tried:
                    tried[parts] = tried_from(tried[best][1], parts, 1)
            before, best = best, min(tried, key=lambda parts: tried[parts][0])
            if best == before:
                break
        else:
            return tried[0][1]  # the frames do not tell
    below, here, above = (tried[best + parts][0] for parts in (-1, 0, 1))
    bend = below - 2 * here + above
    lowest = best + (below - above) / (2 * bend) if bend > 0 else best
    learned = composed(lowest, tried[best][1], 2)
    return given if learned.horizon is given.horizon else learned


def _unexplained(own: Attitudes, views: Sequence[_View], picture: AttitudePicture, ring: Ring) -> float:
    """Return the part of the horizon's variance that a picture leaves unexplained in frames, on average."""
    reader = AttitudeReader(own, picture, ring)
    return float(np.mean([1.0 - reader.horizon(view).score ** 2 for view in views]))


def _put_together(
    own: Attitudes, frames: Sequence[_View], given: AttitudePicture, ring: Ring | None, rounds: int
) -> AttitudePicture:
    """Compose it from frames, moving as the one that is given does.

    If the symbol covers the horizon in the panel picture, few frames match it, so until the last round the best matches
    are used even if they are poor. Without a ring, a frame that matches elsewhere about as well may be upside down, and
    is used only if there are few others; one that seems inverted is never used, as its sky may be the others' ground.
    """
    own, known = own.moving_as(given), given
    for number in range(rounds):
        reader = AttitudeReader(own, known, ring)
        # Until it is known what stands still over it, a horizon matches upside down as well as upright.
        sights = [(frame[0], reader.horizon(frame, is_upright=number == 0)) for frame in frames]
        in_sight = [
            (strip, sight)
            for strip, sight in sights
            if own.is_level_in_sight(sight.place) and (ring is not None or not sight.place.is_inverted)
        ]
        views = [(strip, sight) for strip, sight in in_sight if sight.score >= LIKELY_SCORE]
        alone = [(strip, sight) for strip, sight in views if sight.is_alone]
        views = alone if ring is None and len(alone) >= FRAMES_TO_LEARN else views
        if len(views) < FRAMES_TO_LEARN and number < rounds - 1:
            views = sorted(in_sight, key=lambda view: -view[1].score)[:FRAMES_TO_LEARN]
        if len(views) < FRAMES_TO_LEARN or not (known.weights > HALF).any():
            return given
        backs = [_moved_back(own, known.weights, *view) for view in views]
        if not np.isfinite(backs).any():
            return given
        horizon, shown = _composed(backs)
        known = replace(known, horizon=horizon, known=shown, is_learned=True)
        known = replace(known, weights=HorizonReader(own, known).still(views))
    origin = AttitudeReader(own, known, ring).origin_in(given.drawn)
    return given if origin is None else replace(known, origin=origin)


def _moved_back(own: Attitudes, weights: Floats, strip: UnwrappedGauge, sight: Sight) -> Floats:
    """(H, W): the part of the picture that a frame shows, in the picture's light; NaN elsewhere."""
    rows, columns, grid = own.rows, own.window, own.grid
    height, width = 2 * math.ceil(columns * (1.0 + REACH_RADII)) + 1, 2 * columns + 1
    y, x = np.mgrid[:height, :width].astype(np.float32)
    x = (x - (width - 1) / 2) * grid.column_px + own.aside_px(sight.place)
    y = (y - (height - 1) / 2) * grid.column_px + sight.place.down_px
    turned = np.degrees(np.arctan2(y, x)) + own.tilt_deg + sight.place.turned_deg
    row = in_turn((turned - grid.angle_deg(0)) / grid.step_deg, rows)
    column = (np.hypot(x, y) - grid.inner_px) / grid.column_px
    seen = np.where(weights > HALF, own.in_even_light(strip, sight), np.nan)
    shown = sampled_at(np.concatenate([seen, seen[:1]]), np.dstack([column, row]))
    return np.where((column >= 0) & (column <= columns - 1), shown, np.nan)


def _composed(views: Sequence[Floats]) -> tuple[Floats, Floats]:
    """(H, W): the median of what frames show; where none shows anything, the nearest pixel at the same height.

    Also return (H, W) where any shows something, as 1, else 0.
    """
    seen = np.sort(np.stack(views), axis=0)  # NaN is sorted last
    count = np.isfinite(seen).sum(axis=0)
    low, high = np.maximum(count - 1, 0) // 2, count // 2
    both = [np.take_along_axis(seen, np.minimum(each, len(seen) - 1)[None], axis=0)[0] for each in (low, high)]
    middle = np.where(count > 0, (both[0] + both[1]) / 2, np.nan)
    known = np.flatnonzero((count > 0).any(axis=1))
    across = np.arange(middle.shape[1])
    filled = []
    for row in range(len(middle)):
        near = middle[known[np.abs(known - row).argmin()]]
        there = np.isfinite(near)
        filled.append(np.interp(across, across[there], near[there]))
    return np.array(filled, np.float32), (count > 0).astype(np.float32)


def _ring_of(own: Attitudes, picture: AttitudePicture) -> CardReader | None:
    """Return a reader of the ring around a horizon, if there is one."""
    return None if picture.ring is None else CardReader(own.gauge, own.ring_grid, picture.ring)


class _Attitudes:
    def __init__(self, instruments: Sequence[Instrument], appearance: Appearance, sampler: GaugeSampler) -> None:
        self._readers: list[tuple[list[str], int, AttitudeReader]] = []
        for instrument in instruments:
            own = Attitudes.of(instrument.gauge, instrument.grid)
            picture: AttitudePicture = appearance.pictures[own.own.roll]
            reader = AttitudeReader(own, picture, _ring_of(own, picture))
            self._readers.append(([own.own.roll, own.own.pitch], instrument.index, reader))
        self._sampler = sampler

    def read(self, frames: Sequence[Samples], place_sigmas_deg: Floats) -> Readings:
        readings: Readings = [{} for _ in frames]
        for names, index, reader in self._readers:
            found = reader.read(self._sampler.strips(frames, index))
            for own, both, sigma_deg in zip(readings, found, place_sigmas_deg[:, index].tolist(), strict=True):
                own |= {name: one.in_place_within(sigma_deg) for name, one in zip(names, both, strict=True)}
        return readings


class AttitudeKind(Still):
    """A horizon that turns and shifts behind a window; its picture is stored under the name of its roll."""

    is_searched = False

    def owns(self, gauge: Gauge) -> bool:
        return gauge.attitude is not None

    def reader(
        self, instruments: Sequence[Instrument], appearance: Appearance, sampler: GaugeSampler, _: Method
    ) -> _Attitudes:
        return _Attitudes(instruments, appearance, sampler)

    def first_look(self, drawn: DrawnInstrument) -> Look:
        own = Attitudes.of(drawn.gauge, drawn.grid)
        ring = None if own.own.ring is None else first_card(drawn.strip[:, own.ring], own.ring_grid)
        picture = first_attitude(own, drawn.strip, ring)
        if drawn.known is not None:
            law = drawn.known[own.own.roll].shift_turn
            picture = replace(picture, shift_turn=law, is_law_from_afar=law != picture.shift_turn)
        return Look(drawn.strip, pictures={own.own.roll: picture})

    def learned_pictures(
        self, instrument: Instrument, strips: Sequence[UnwrappedGauge], known: Mapping[str, LearnedPicture]
    ) -> Mapping[str, LearnedPicture]:
        own = Attitudes.of(instrument.gauge, instrument.grid)
        given: AttitudePicture = known[own.own.roll]
        if given.ring is not None:
            rings = [strip[:, own.ring] for strip in strips]
            given = replace(given, ring=learn_card(own.gauge, own.ring_grid, rings, given.ring))
        return {own.own.roll: learn_attitude(own, strips, given, _ring_of(own, given))}

    def settled_pictures(
        self, instrument: Instrument, strips: Sequence[UnwrappedGauge], known: Mapping[str, LearnedPicture]
    ) -> Mapping[str, LearnedPicture]:
        own = Attitudes.of(instrument.gauge, instrument.grid)
        picture: AttitudePicture = known[own.own.roll]
        ring = _ring_of(own, picture)
        if ring is None or not picture.is_law_from_afar:
            return {}
        return {own.own.roll: learn_attitude(own, strips, first_attitude(own, picture.drawn, picture.ring), ring)}

    def squeeze(self, instrument: Instrument, strips: Sequence[UnwrappedGauge], *, is_lost: bool) -> Squeeze | None:
        """Return the squeeze for a horizon that is read: it makes bank marks seem to turn too far, or too little."""
        own = Attitudes.of(instrument.gauge, instrument.grid)
        if is_lost or own.own.ring is None:
            return None
        # Marks on one part of a ring draw apart around a wrong pivot just as they do in a squeeze.
        strips = [strip[:, own.ring] for strip in strips]
        return card_squeeze(own.ring_grid, strips, most_left=HALF, axes=SQUEEZE_AXES)

    def pivot(self, instrument: Instrument, appearance: Appearance, frames: Sequence[SeenGauge]) -> Pivot:
        own = Attitudes.of(instrument.gauge, instrument.grid)
        ring = _ring_of(own, appearance.pictures[own.own.roll])
        return UNKNOWN if ring is None else ring.pivot([strip[:, own.ring] for strip, _, _ in frames])

    def findings(self, gauge: Gauge, appearance: Appearance) -> Sequence[str]:
        if gauge.attitude is None:
            return ()
        picture: AttitudePicture = appearance.pictures[gauge.attitude.roll]
        found = []
        if gauge.attitude.ring is not None and picture.ring is None:
            found.append(
                "bank is read from its horizon alone, since what moves where its ring is drawn does not turn with it,"
                " or is hardly ever read: does its `ring` begin where nothing but its marks turns?"
            )
        if not np.isclose(picture.tilted_deg, 0.0, atol=SEARCH_STEP_DEG):
            found.append(
                f"bank is read from where its horizon is level, {abs(picture.tilted_deg):.1f} degrees from where it is"
                " drawn: draw the angle of its pointer with `decode setup`"
            )
        return tuple(found)
