"""Moving cards: how far a card, such as a heading indicator's, has turned, and what it looks like.

In the unwrapped gauge the whole card shifts around the circle. The best shift comes from the circular NCC of card and
gauge, by Fourier transforms along the rows; least squares on the pixels there give the fraction of a row and the
uncertainty, as for a needle. What does not turn with the card (a lubber line, an aircraft symbol) has no weight. Light
does not turn with it either: a reflection in the glass or a lamp at one side varies slowly around the dial but by more
than fine print does, so slow variations are removed first.

The card is learned as what all frames share once each is turned back by its reading. Whatever stands still instead is
smeared out by that, and shows where the frames differ from the card.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import combinations

import numpy as np

from decoder.imaging.planes import Squeeze
from decoder.imaging.sorting import MAD_TO_SIGMA
from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import PolarGrid, UnwrappedGauge
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
from decoder.instruments.kinds.dials.common_turns import CommonTurns, common_turns
from decoder.instruments.kinds.dials.near_repetitions import least_unlike
from decoder.instruments.needle_lines import places_of
from decoder.instruments.reading import Reading, Readings, Status
from decoder.instruments.sampling import GaugeSampler, Samples, SeenGauge
from decoder.instruments.thresholds import (
    CLEARLY_WORSE,
    FRAMES_TO_LEARN,
    MIN_PLACES,
    MIN_TURN_DEG,
    STILL_ROWS,
    SURE_SCORE,
)
from decoder.matching.correlation import (
    Spectrum,
    explained,
    is_singular,
    noise_between,
    products,
    shared_weights,
    weighted_correlation,
)
from decoder.matching.pivot_search import ROW_DEG, card_pivot, card_rings, card_squeeze
from decoder.matching.strips import rows_between
from decoder.matching.thresholds import FAR_PART, MAX_PEAK_ROWS
from decoder.panel.arrays import Floats, Mask
from decoder.panel.gauge import Gauge
from decoder.panel.scale import FULL_CIRCLE_DEG, shortest
from decoder.panel.vocabulary import Method
from decoder.registration.pivot import PRIOR_PX, UNKNOWN, Pivot
from decoder.registration.thresholds import (
    CERTAIN_SIGMAS,
    LIKELY_SCORE,
    MIN_SPREAD_LEVELS,
    NOISE_LEVELS,
    SCORE_THRESHOLD,
)

FIT_STEPS = 3
# Another match this far away is a rival; nearer, it is the same peak.
RIVAL_REACH_DEG = 8.0
ROUNDS = 3
# Waves per turn: light on a dial has this many at most, marks have more. In other people's pictures of a compass, 2 and
# 12 give the same readings.
SHADING_WAVES = 4
LOOKS_ALIKE = (
    "its card looks nearly alike at several turns, and what tells them apart is too faint: does its `radius` hold all"
    " letters and numerals?"
)


@dataclass(frozen=True, slots=True)
class Turn:
    """How many rows a card has turned, with sigma and score, and whether no other turn matches as well."""

    rows: float
    sigma_rows: float
    score: float
    is_alone: bool


def card_rows(grid: PolarGrid) -> int:
    """Return how many rows of a card's grid are one turn: all but the last, which repeats the first."""
    return grid.rows - 1


class CardReader:
    """Reads the card of one gauge; `picture` is the card as it lies in the panel picture.

    A card that `is_doubted`, because most frames of a sample do not match it, is not read: it was learned wrongly, or
    is seen obliquely, and any match is by chance. Nor is it read where more is unexplained than a turn and its
    near-repetitions differ by.
    """

    def __init__(self, gauge: Gauge, grid: PolarGrid, picture: CardPicture, *, is_doubted: bool = False) -> None:
        self._index_deg = gauge.sweep[0] if gauge.card is None else gauge.card.index
        self._first_deg = gauge.sweep[0]
        self._grid = grid
        self._rows = card_rows(grid)
        self._picture = picture
        self._is_doubted = is_doubted
        self._gauge = gauge
        weights = picture.weights
        self._total = float(weights.sum())
        self._middle = np.float32(picture.card.mean())
        transformed = np.fft.rfft(picture.card, axis=0).conj()
        self._transformed = transformed
        self._mean = self._shifted_sums(weights, transformed) / self._total
        square = self._shifted_sums(weights, np.fft.rfft(picture.card**2, axis=0).conj()) / self._total
        self._spread = np.sqrt(np.maximum(square - self._mean**2, 0.0))

    def read(self, strips: Floats) -> list[Reading]:
        """Read the card on the gauge in F frames: (F, R, C) float32."""
        return [self.reading(self.turn(strip)) for strip in strips]

    def turn(self, unwrapped: UnwrappedGauge) -> Turn:
        """Measure how far the card has turned from where it lies in the panel picture."""
        return self.lit_turn(evenly_lit(unwrapped, self._grid))

    def lit_turn(self, seen: Floats) -> Turn:
        """Do as `turn` for one turn of the dial (P, C) from which the light was removed."""
        rough = self._searched(seen)
        row, sigma_rows, score = self._fitted(seen, rough.rows, self._picture.weights)
        return Turn(row, sigma_rows, score, rough.is_alone)

    def rough_turn(self, unwrapped: UnwrappedGauge) -> Turn:
        """Do as `turn` to a tenth of a row, without a fit; sigma is infinite."""
        return self._searched(evenly_lit(unwrapped, self._grid))

    def turn_without(self, unwrapped: UnwrappedGauge, hidden: Mask, about: Turn) -> Turn:
        """Do as `turn`, ignoring what is `hidden` of the card (P, C), from a rough turn `about`."""
        seen = evenly_lit(unwrapped, self._grid)
        around = about if about.is_alone else self._searched(seen)
        shown = np.where(hidden, np.float32(0.0), self._picture.weights)
        row, sigma_rows, score = self._fitted(seen, around.rows, shown)
        return Turn(row, sigma_rows, score, around.is_alone)

    def pivot(self, strips: Sequence[UnwrappedGauge]) -> Pivot:
        """Estimate where the card turns, relative to the point it is unwrapped around, from F frames (R, C).

        Around a centre beside its pivot the card moves along a circle as it turns. Least squares over all pixels give
        that circle, together with each frame's own light and turn.
        """
        found = [(evenly_lit(strip, self._grid), self.turn(strip)) for strip in strips]
        views = [(turned(strip, -turn.rows), turn.rows) for strip, turn in found if turn.score >= SCORE_THRESHOLD]
        if len(views) < FRAMES_TO_LEARN:
            return UNKNOWN
        ways = np.stack([_turned_back(math.radians(rows * self._grid.step_deg)) for _, rows in views])
        ways = ways - ways.mean(axis=0)  # what all frames share was absorbed by the learned card
        told = [self._told(view, way) for (view, _), way in zip(views, ways, strict=True)]
        normal, product, left = (np.sum(parts, axis=0) for parts in zip(*told, strict=True))
        noise = max(float(left[0] / left[1]), 1.0) / self._grid.pixels_per_sample
        covariance = np.linalg.inv(normal / noise + np.eye(2) / PRIOR_PX**2)
        x, y = (covariance @ product / noise).tolist()
        if math.hypot(x, y) > FAR_PART * self._grid.radii_px[-1]:
            return UNKNOWN  # too far off for this estimate: `card_pivot` finds it
        pivot = replace(UNKNOWN, offset_px=(x, y), covariance_px2=covariance)
        places = places_of(rows * self._grid.step_deg for _, rows in views)
        return pivot.doubted() if places <= MIN_PLACES else pivot

    def _told(self, view: Floats, way: Floats) -> tuple[Floats, Floats, Floats]:
        """Set up one frame's least squares for an offset that appears rotated by `way` in the turned-back view.

        Return its normal matrix (2, 2), its right side (2,), and the sum of squares it leaves, with the sum of weights.
        """
        card = self._picture.card
        around = (np.roll(card, -1, axis=0) - np.roll(card, 1, axis=0)) / 2
        moved = -(self._gradient(around) @ way).reshape(-1, 2).T
        known = np.stack([card, around, np.ones_like(card)]).reshape(3, -1).astype(np.float64)
        weights = self._picture.weights
        columns = np.concatenate([moved, view.reshape(1, -1)])
        for _ in range(2):  # the second time without what the first does not explain
            flat = known * weights.ravel()
            shares = np.linalg.solve(flat @ known.T + np.eye(3), flat @ columns.T).T
            left = columns - shares @ known
            weights = self._picture.weights * explained(left[2].reshape(view.shape), self._picture.weights)
        gain, weighted = shares[2, 0], left * weights.ravel()
        squares = np.array([float(weighted[2] @ left[2]), float(weights.sum())])
        return gain**2 * weighted[:2] @ left[:2].T, gain * weighted[:2] @ left[2], squares

    def _gradient(self, around: Floats) -> Floats:
        """(P, C, 2): the gradient of the card's levels to the right and downwards, per pixel."""
        angles = np.radians(self._grid.angle_deg(0) + self._grid.step_deg * np.arange(self._rows))
        outward = np.gradient(self._picture.card, self._grid.column_px, axis=1)[..., None]
        sideways = (around / math.radians(self._grid.step_deg) / self._grid.radii_px)[..., None]
        out, side = (
            np.stack([np.cos(angles), np.sin(angles)], axis=1),
            np.stack([-np.sin(angles), np.cos(angles)], axis=1),
        )
        gradient: Floats = outward * out[:, None] + sideways * side[:, None]
        return gradient

    def reading(self, turn: Turn) -> Reading:
        """Convert a turn to what stands under the index."""
        angle_deg = self._index_deg - turn.rows * self._grid.step_deg
        angle_deg = self._first_deg + (angle_deg - self._first_deg) % FULL_CIRCLE_DEG
        # On a card that was not learned from the flight, fixed parts over it may match as well as the card does.
        least = SCORE_THRESHOLD if self._picture.is_learned else SURE_SCORE
        left = 1.0 - min(turn.score, 1.0) ** 2
        is_told = left + self._unlike > CLEARLY_WORSE * left
        matches = turn.score >= least and turn.is_alone and is_told and not self._is_doubted
        status = Status.READ if matches else Status.MISSING
        return Reading(status, angle_deg, turn.sigma_rows * self._grid.step_deg, turn.score)

    @cached_property
    def _unlike(self) -> float:
        return unlike_itself(self._gauge, self._picture)

    def _scores(self, seen: Floats) -> Floats:
        """Return the weighted NCC of a gauge (P, C) with the card turned by each number of rows: (P,) in [-1, 1]."""
        weighted = self._picture.weights * seen
        mean = float(weighted.sum()) / self._total
        spread = math.sqrt(max(float((weighted * seen).sum()) / self._total - mean**2, 0.0))
        if spread < MIN_SPREAD_LEVELS:
            return np.zeros(self._rows, np.float32)
        together = self._shifted_sums(weighted, self._transformed) / self._total - mean * self._mean
        known = self._spread > MIN_SPREAD_LEVELS
        scores = np.divide(together, self._spread * spread, out=np.zeros_like(together), where=known)
        clipped: Floats = np.clip(scores, -1.0, 1.0)
        return clipped

    def _shifted_sums(self, image: Floats, transformed: Spectrum) -> Floats:
        """Sum the product of an image (P, C) and another turned by each number of rows: (P,)."""
        spectrum = (np.fft.rfft(image, axis=0) * transformed).sum(axis=1)
        sums: Floats = np.fft.irfft(spectrum, self._rows)
        return sums

    def _searched(self, seen: Floats) -> Turn:
        """Find the turn at which one turn of the dial (P, C) matches best, and whether no other matches as well."""
        scores = self._scores(seen)
        best = int(scores.argmax())
        before, score, after = scores[[best - 1, best, (best + 1) % self._rows]].tolist()
        bend = before - 2 * score + after
        row = best + (0.5 * (before - after) / bend if bend < 0 else 0.0)
        alone = 1.0 - self._rival(scores, best) ** 2 > CLEARLY_WORSE * (1.0 - min(score, 1.0) ** 2)
        return Turn(row, math.inf, score, alone)

    def _rival(self, scores: Floats, best: int) -> float:
        """Return the best score away from the peak."""
        reach = round(RIVAL_REACH_DEG / self._grid.step_deg)
        elsewhere = scores.take(np.arange(best + reach, best + self._rows - reach), mode="wrap")
        return float(elsewhere.max(initial=0.0))

    def _fitted(self, seen: Floats, row: float, shown_there: Floats) -> tuple[float, float, float]:
        """Fit gain, offset and shift by least squares with weights (P, C); return row, sigma and score.

        Outliers have no weight in the fit but full weight in the score, since a few pixels match in many places.
        """
        start, trusted = row, shown_there
        columns = np.ones((3, seen.size), np.float32)
        shown, slope = columns[:2].reshape(2, *seen.shape)
        for _ in range(FIT_STEPS):
            weights = trusted
            card = turned(self._picture.card, row, beyond=1)
            np.subtract(card[1:-1], self._middle, out=shown)
            np.subtract(card[:-2], card[2:], out=slope)
            slope /= 2
            weighted = columns * weights.ravel()
            normal = products(weighted, columns).astype(np.float64)
            if is_singular(normal):  # a card without marks has no direction
                return start, math.inf, 0.0
            inverse = np.linalg.inv(normal)
            gain, shift, _offset = solution = inverse @ (weighted @ seen.ravel())
            step_rows = float(shift / gain) if gain > 0 else math.inf
            row += step_rows
            if not abs(row - start) <= MAX_PEAK_ROWS:
                return start, math.inf, 0.0
            left = seen - (solution.astype(np.float32) @ columns).reshape(seen.shape)
            if abs(step_rows) < STILL_ROWS:
                break
            trusted = shown_there * explained(left, shown_there)
        noise = float((weights * left**2).sum() / weights.sum())
        sigma_rows = math.sqrt(noise * float(inverse[1, 1]) / self._grid.pixels_per_sample) / float(gain)
        return row, sigma_rows, weighted_correlation(seen, left, shown_there)


def unlike_itself(gauge: Gauge, picture: CardPicture) -> float:
    """Return the part of its variance by which a card differs from its nearest repetition: 0 to 1."""
    rows, columns = picture.card.shape
    reach_px = math.radians(RIVAL_REACH_DEG) * gauge.arc_px
    reach = round(rows * RIVAL_REACH_DEG / FULL_CIRCLE_DEG), round(columns * reach_px / np.ptp(gauge.radius))
    return least_unlike(picture.card, picture.weights, reach)


def what_is_alike(gauge: Gauge, picture: CardPicture, *, is_doubted: bool) -> Sequence[str]:
    """Say of a card that was hardly read if that is because it looks nearly alike at several turns."""
    is_alike = is_doubted and 1.0 - unlike_itself(gauge, picture) > SURE_SCORE**2
    return (LOOKS_ALIKE,) if is_alike else ()


def _turned_back(turn: float) -> Floats:
    """(2, 2): the matrix that turns a vector anticlockwise by an angle in radians."""
    return np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])


def turned(card: Floats, rows: float, *, beyond: int = 0) -> Floats:
    """Return a card (P, C) turned clockwise by a number of rows, whole or not, with `beyond` more rows at each end."""
    first = math.floor(-rows)
    around = card.take(np.arange(first - beyond - 1, first + len(card) + beyond + 2), axis=0, mode="wrap")
    (there,) = rows_between(around[None], np.array([-rows - first]))
    return np.asarray(there)


def far_card_pivot(grid: PolarGrid, strips: Sequence[UnwrappedGauge]) -> tuple[float, float] | None:
    """Search for a card's pivot with `card_pivot`, in frames (R, C) in which it has turned; None if it stood still.

    It must be clear how most frames have turned around it, or that they have turned at all, or whatever moves over a
    card that stands still is taken for the card. On a compass rose turns are unclear by whole points, around any pivot.
    """
    found = card_pivot(grid, strips)
    if found is None:
        return None
    turns = common_turns(card_rings(grid, strips, found), round(RIVAL_REACH_DEG / ROW_DEG))
    return found if turns.clear.mean() >= HALF or not stands_still(grid, strips) else None


def stands_still(grid: PolarGrid, strips: Sequence[UnwrappedGauge]) -> bool:
    """Whether a card does not turn in frames (R, C): between most pairs of them, most of the way round stays as it is.

    A card that turns takes marks to other places all round, but a needle over a card that stands still is at two places
    only. Whether the frames agree after a turn does not tell: any turn that brings the needle onto itself would do.
    """
    rings = card_rings(grid, strips, (0.0, 0.0))
    # Print that is aligned to a part of a pixel changes by less than its contrast, print elsewhere by all of it.
    clear = max(float(rings.std()), 2 * CERTAIN_SIGMAS * noise_between(rings)) if len(rings) else 0.0
    pairs = [np.abs(one - other) > clear for one, other in combinations(rings, 2)]
    changed = [(pair.mean(axis=1) > HALF**3).mean() for pair in pairs]
    return bool(changed) and float(np.median(changed)) < HALF**2


def first_card(strip: UnwrappedGauge, grid: PolarGrid) -> CardPicture:
    """Return the card as the panel picture (R, C) shows it, with all that lies over it."""
    card = evenly_lit(strip, grid)
    return CardPicture(card, np.ones_like(card))


def evenly_lit(strip: UnwrappedGauge, grid: PolarGrid) -> UnwrappedGauge:
    """Return one turn of a dial (P, C) without slow variations around it, keeping the mean."""
    turn = strip[: card_rows(grid)]
    waves = _slow_waves(len(turn))
    lit: UnwrappedGauge = turn - waves @ (waves.T @ turn)
    return lit


@cache
def _slow_waves(rows: int) -> Floats:
    """(P, 2 * SHADING_WAVES) float32: the slow waves around a dial, each of unit length."""
    turns = np.arange(1, SHADING_WAVES + 1) * (2 * np.pi / rows * np.arange(rows)[:, None])
    return (math.sqrt(2 / rows) * np.concatenate([np.cos(turns), np.sin(turns)], axis=1)).astype(np.float32)


def learn_card(gauge: Gauge, grid: PolarGrid, strips: Sequence[UnwrappedGauge], given: CardPicture) -> CardPicture:
    """Learn the card from frames (R, C) in the panel picture's light; return it as given if they do not suffice.

    If a frame were turned back by a wrong turn that looks alike, the result would be no card, or one printed twice. So
    frames are turned back by the turns on which all of them agree, and those for which another turn is nearly as likely
    are left out. The rest must share most of the result, which must match the panel picture at one place only, or
    clearly at the place that all frames agree on with it: in uneven light it matches no place much better than others.
    It must be seen most of the way round: in a short arc regular marks are taken for each other, and numerals have no
    weight since they fit at no turn.
    """
    lit = [evenly_lit(strip, grid) for strip in strips]
    if len(lit) < FRAMES_TO_LEARN:
        return given
    turns = _agreed(lit, grid)
    views = [
        (seen, rows) for seen, rows, is_clear in zip(lit, turns.rows.tolist(), turns.clear, strict=True) if is_clear
    ]
    if len(views) < FRAMES_TO_LEARN or arc_deg([rows for _, rows in views], grid) < MIN_TURN_DEG:
        return given
    known, turned_rows = shared(views), np.array([rows for _, rows in views])
    known = replace(known, weights=np.where(_stands_still(views, known.card, grid), np.float32(0.0), known.weights))
    for _ in range(ROUNDS):
        reader = CardReader(gauge, grid, known)
        found = [reader.lit_turn(seen) for seen, _ in views]
        off_deg = shortest((np.array([turn.rows for turn in found]) - turned_rows) * grid.step_deg, FULL_CIRCLE_DEG)
        if not np.isclose(off_deg, 0.0, atol=RIVAL_REACH_DEG).all():
            return given
        views = [(seen, turn.rows) for (seen, _), turn in zip(views, found, strict=True)]
        known = shared(views, known.weights)
    if _part_of_way_round(views, known.card) < HALF:
        return given
    off = CardReader(gauge, grid, known).lit_turn(given.card)
    matches = off.score >= LIKELY_SCORE and (off.is_alone or _is_agreed(off, given, lit, turns, grid))
    if float(known.weights.mean()) < HALF or not matches:
        return given
    return CardPicture(turned(known.card, off.rows), known.weights)


def _agreed(lit: Sequence[Floats], grid: PolarGrid) -> CommonTurns:
    """Find the turns on which frames (P, C) agree."""
    return common_turns(np.stack(lit), round(RIVAL_REACH_DEG / grid.step_deg), most_of_two=1.0 / CLEARLY_WORSE)


def _is_agreed(off: Turn, given: CardPicture, lit: Sequence[Floats], turns: CommonTurns, grid: PolarGrid) -> bool:
    """Whether frames (P, C) that agree on these turns clearly agree, too, that a card given has turned so far `off`."""
    together = _agreed([given.card, *lit], grid)
    both = turns.clear & together.clear[1:]
    if not together.clear[0] or both.sum() < FRAMES_TO_LEARN:
        return False
    rows = together.rows[0] - together.rows[1:][both] + turns.rows[both]
    off_deg = shortest((rows - off.rows) * grid.step_deg, FULL_CIRCLE_DEG)
    return bool(np.isclose(off_deg, 0.0, atol=RIVAL_REACH_DEG).all())


def shared(views: Sequence[tuple[Floats, float]], known_weights: Floats | None = None) -> CardPicture:
    """Return what frames (P, C), each with its turn in rows, share when turned back; weights drop where they differ.

    Pixels with little weight in `known_weights` (P, C) lie over the card and are left out. Otherwise regular fixed
    marks, which coincide when the card has turned by their distance, would be taken for its own.
    """
    backs = np.stack([turned(seen, -rows) for seen, rows in views])
    middle = np.median(backs, axis=0)
    is_over = np.zeros(middle.shape, bool) if known_weights is None else known_weights < HALF
    if is_over.any():
        hidden = np.stack([np.roll(is_over, -round(rows), axis=0) for _, rows in views])
        never_seen = hidden.all(axis=0)
        middle = np.nanmedian(np.where(hidden & ~never_seen, np.nan, backs), axis=0)
        middle[never_seen] = np.median(middle)
    card = middle.astype(np.float32)
    apart = MAD_TO_SIGMA * np.median([np.abs(seen - turned(card, rows)) for seen, rows in views], axis=0)
    return CardPicture(card, shared_weights(apart, float(card.std())))


def _part_of_way_round(views: Sequence[tuple[Floats, float]], card: Floats) -> float:
    """Return the part of the way round in which frames (P, C) change as the card does that turns by their rows."""
    seen = np.stack([strip for strip, _ in views])
    changes = np.square(seen - np.median(seen, axis=0)).mean(axis=0)
    left = np.square(seen - np.stack([turned(card, rows) for _, rows in views])).mean(axis=0)
    is_card = (changes > (2 * noise_between(seen)) ** 2) & (left < changes)
    return float(is_card.any(axis=1).mean())


def _stands_still(views: Sequence[tuple[Floats, float]], card: Floats, grid: PolarGrid) -> Mask:
    """(P, C): fixed parts over a card that were taken for its own because they coincide in most frames.

    A fixed part looks the same at every turn of the card, and at some turn it differs from what the card shows there.
    Each turn counts once, however many frames have it.
    """
    places = np.rint(np.array([rows for _, rows in views]) * grid.step_deg / RIVAL_REACH_DEG)
    at = [[view for view, place in zip(views, places, strict=True) if place == own] for own in np.unique(places)]
    seen = np.stack([np.median([strip for strip, _ in own], axis=0) for own in at])
    shown = np.stack([np.median([turned(card, rows) for _, rows in own], axis=0) for own in at])
    off = [np.abs(seen - each).max(axis=0) for each in (np.median(seen, axis=0), shown)]
    still, of_card = (NOISE_LEVELS**2 + each**2 for each in off)
    stands: Mask = still * CLEARLY_WORSE < of_card
    return stands


def arc_deg(rows: Sequence[float], grid: PolarGrid) -> float:
    """Return the arc that the card has covered, degrees."""
    angles_deg = np.sort(np.mod(np.array(rows) * grid.step_deg, FULL_CIRCLE_DEG))
    gaps = np.diff(np.append(angles_deg, angles_deg[0] + FULL_CIRCLE_DEG))
    return FULL_CIRCLE_DEG - float(gaps.max())


class _Cards:
    def __init__(self, instruments: Sequence[Instrument], appearance: Appearance, sampler: GaugeSampler) -> None:
        names = [instrument.gauge.quantities[0].name for instrument in instruments]
        self._readers = [
            (
                name,
                own.index,
                CardReader(own.gauge, own.grid, appearance.pictures[name], is_doubted=name in appearance.doubted),
            )
            for name, own in zip(names, instruments, strict=True)
        ]
        self._sampler = sampler

    def read(self, frames: Sequence[Samples], place_sigmas_deg: Floats) -> Readings:
        columns = {
            name: [
                reading.in_place_within(sigma_deg)
                for reading, sigma_deg in zip(
                    reader.read(self._sampler.strips(frames, index)), place_sigmas_deg[:, index].tolist(), strict=True
                )
            ]
            for name, index, reader in self._readers
        }
        return [dict(zip(columns, own, strict=True)) for own in zip(*columns.values(), strict=True)]


class CardKind(Still):
    """A card that turns under a fixed index."""

    is_searched = False

    def owns(self, gauge: Gauge) -> bool:
        return gauge.card is not None and not gauge.needles

    def reader(
        self, instruments: Sequence[Instrument], appearance: Appearance, sampler: GaugeSampler, _: Method
    ) -> _Cards:
        return _Cards(instruments, appearance, sampler)

    def first_look(self, drawn: DrawnInstrument) -> Look:
        face = needles_in_picture(drawn).face
        return Look(face, pictures={self._name(drawn.gauge): first_card(face, drawn.grid)})

    def learned_pictures(
        self, instrument: Instrument, strips: Sequence[UnwrappedGauge], known: Mapping[str, LearnedPicture]
    ) -> Mapping[str, LearnedPicture]:
        name = self._name(instrument.gauge)
        return {name: learn_card(instrument.gauge, instrument.grid, strips, known[name])}

    def pivot(self, instrument: Instrument, appearance: Appearance, frames: Sequence[SeenGauge]) -> Pivot:
        reader = CardReader(instrument.gauge, instrument.grid, appearance.pictures[self._name(instrument.gauge)])
        return reader.pivot([strip for strip, _, _ in frames])

    def far_pivot(self, instrument: Instrument, strips: Sequence[UnwrappedGauge]) -> tuple[float, float] | None:
        return far_card_pivot(instrument.grid, strips)

    def squeeze(self, instrument: Instrument, strips: Sequence[UnwrappedGauge], *, is_lost: bool) -> Squeeze | None:
        return card_squeeze(instrument.grid, strips) if is_lost else None

    def findings(self, gauge: Gauge, appearance: Appearance) -> Sequence[str]:
        name = self._name(gauge)
        return what_is_alike(gauge, appearance.pictures[name], is_doubted=name in appearance.doubted)

    @staticmethod
    def _name(gauge: Gauge) -> str:
        return gauge.quantities[0].name
