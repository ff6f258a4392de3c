"""The turns on which all frames of a card agree, found without knowing what is printed on it.

Two frames alone are easily taken for turned by one mark too many. But if the second has turned by 30 degrees since the
first, and the third by 20 since the second, then the third has turned by 50 since the first: a wrong turn contradicts
the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.instruments.thresholds import SURE_SCORE
from decoder.matching.correlation import ROUNDING, changing, noise_between, turned_correlation
from decoder.matching.thresholds import MUCH_BETTER
from decoder.panel.arrays import Floats, Indices, Mask
from decoder.registration.thresholds import MIN_SPREAD_LEVELS

SWEEPS = 5
RIVALS = 4
STARTS = 8


@dataclass(frozen=True, slots=True)
class CommonTurns:
    """How far F frames have turned, in rows, and whether every other turn of theirs explains them clearly worse."""

    rows: Indices
    clear: Mask


def common_turns(pictures: Floats, reach: int, *, most_of_two: float = MUCH_BETTER) -> CommonTurns:
    """Find the turns on which all pairs of F pictures of a card (F, P, C) agree best.

    A turn further away than `reach` rows is another one. The least clear pictures are left out until all others are
    clear, since a wrong turn makes others look right. Two turns alone cannot contradict each other, and a card that is
    seen around another centre may match best half a turn off: of two, each leaves at most the part `most_of_two` of
    what any other does.
    """
    pictures = _in_one_light(pictures)
    noise_levels = noise_between(pictures)
    scores, weights = turned_correlation(pictures, noise_levels), changing(pictures, noise_levels)
    settings = _settings(scores, reach)
    rows, clear = np.zeros(len(scores), np.intp), np.zeros(len(scores), bool)
    while len(settings) > 1:
        search = _Search.of(scores, settings, reach)
        found = search.best()
        views = _Views.of(pictures[search.first], weights, found, search, noise_levels)
        parts = [views.part_of_rivals(number, search.rivals(number, found)) for number in range(len(settings))]
        if max(parts) < (MUCH_BETTER if search.turns(found) > 2 else most_of_two):  # noqa: PLR2004
            for setting, row in zip(settings, found, strict=True):
                frames = list(setting)
                rows[frames], clear[frames] = row + np.array(list(setting.values())), True
            break
        del settings[int(np.argmax(parts))]
    return CommonTurns(rows, clear)


def _in_one_light(pictures: Floats) -> Floats:
    """Bring pictures (F, P, C) to one mean and one spread, which do not change as a card turns."""
    means, spreads = (each(pictures, axis=(1, 2), keepdims=True) for each in (np.mean, np.std))
    gains = np.median(spreads) / np.maximum(spreads, MIN_SPREAD_LEVELS)
    lit: Floats = (np.median(means) + gains * (pictures - means)).astype(np.float32)
    return lit


def _settings(scores: Floats, reach: int) -> list[dict[int, int]]:
    """Group frames with the card at the same turn, since these would confirm each other's turn, right or wrong.

    For each group, its frames, and the rows by which the card has turned since its first frame.
    """
    settings: list[dict[int, int]] = []
    for frame in range(len(scores)):
        for setting in settings:
            own = scores[next(iter(setting)), frame]
            further = (int(own.argmax()) + reach) % len(own) - reach
            if further <= reach and own.max() >= SURE_SCORE:
                setting[frame] = further
                break
        else:
            settings.append({frame: 0})
    return settings


@dataclass(frozen=True, slots=True)
class _Search:
    """The scores (S, S, P) of S settings with each other, 0 with themselves.

    `first` and `frames` (S,) are the first frame of each, and how many there are.
    """

    scores: Floats
    first: Indices
    frames: Indices
    reach: int

    @classmethod
    def of(cls, scores: Floats, settings: Sequence[Mapping[int, int]], reach: int) -> Self:
        first = np.array([next(iter(setting)) for setting in settings])
        own = scores[np.ix_(first, first)]
        own[np.diag_indices(len(first))] = 0.0
        return cls(own, first, np.array([len(setting) for setting in settings]), reach)

    def best(self) -> Indices:
        """(S,): the rows on which settings agree best, of all that are found from any of them."""
        starts = np.argsort(-self.frames, kind="stable")[:STARTS]
        return max((self._from_start(int(start)) for start in starts), key=self._agreement)

    def _from_start(self, start: int) -> Indices:
        """(S,): rows of settings, found from one: always the clearest next, against those so far; then each anew."""
        rows, placed = np.zeros(len(self.frames), np.intp), [start]
        total = self._told_by(start, 0)
        while len(placed) < len(rows):
            gains = self._gains(total)
            gains[placed] = -1.0
            placed.append(int(gains.argmax()))
            rows[placed[-1]] = total[placed[-1]].argmax()
            total += self._told_by(placed[-1], rows[placed[-1]])
        for _ in range(SWEEPS):
            before = rows.copy()
            for setting in placed:
                best = int(total[setting].argmax())
                total += self._told_by(setting, best) - self._told_by(setting, rows[setting])
                rows[setting] = best
            if (rows == before).all():
                break
        return rows

    def _agreement(self, rows: Indices) -> float:
        """Return the mean score of frames, each with all others of another setting."""
        return float(self.frames @ self._against_others(rows).max(axis=1) / self.frames.sum())

    def rivals(self, setting: int, rows: Indices) -> list[int]:
        """List the rows of the other turns at which a setting matches all others best."""
        scores, found = self._against_others(rows)[setting], [int(rows[setting])]
        for _ in range(RIVALS):
            scores[self._near(found[-1])] = -1.0
            found.append(int(scores.argmax()))
        return found[1:]

    def is_same(self, rows: Indices) -> Mask:
        """(S, S): which settings are at the same turn, themselves among them."""
        size = self.scores.shape[2]
        same: Mask = np.abs((rows[:, None] - rows + size // 2) % size - size // 2) <= self.reach
        return same

    def turns(self, rows: Indices) -> int:
        """Count the turns at which settings are."""
        same, told = self.is_same(rows), list[int]()
        for setting in range(len(rows)):
            if not same[setting, told].any():
                told.append(setting)
        return len(told)

    def _against_others(self, rows: Indices) -> Floats:
        """(S, P): how well each turn of each setting matches all others at their present rows."""
        told = sum((self._told_by(setting, row) for setting, row in enumerate(rows)), np.zeros(self.scores.shape[1:]))
        scores: Floats = told / (self.frames.sum() - self.frames)[:, None]
        return scores

    def _told_by(self, setting: int, row: int) -> Floats:
        """(S, P): how well each turn of every setting matches one setting on a row, times that one's frames."""
        told: Floats = self.frames[setting] * np.roll(self.scores[setting], row, axis=1)
        return told

    def _gains(self, scores: Floats) -> Floats:
        """(S,): how far the best score of each setting (S, P) is above any other."""
        best = scores.argmax(axis=1)
        elsewhere = scores.copy()
        np.put_along_axis(elsewhere, self._near(best[:, None]), -np.inf, axis=1)
        gains: Floats = scores.max(axis=1) - elsewhere.max(axis=1)
        return gains

    def _near(self, rows: int | Indices) -> Indices:
        near: Indices = (rows + np.arange(-self.reach, self.reach + 1)) % self.scores.shape[2]
        return near


@dataclass(frozen=True, slots=True)
class _Views:
    """Pictures of S settings, and the card as settings at all other turns show it: (S, P, C) each.

    Settings found at the same turn would confirm each other, right or wrong. `known` (S, P, C) is what of the card the
    others show, `moves` (P, C) where on the dial the card shows at all.
    """

    seen: Floats
    cards: Floats
    known: Mask
    moves: Mask
    rows: list[int]
    noise_levels: float

    @classmethod
    def of(cls, seen: Floats, weights: Floats, found: Indices, search: _Search, noise_levels: float) -> Self:
        """Learn the card from one picture of each setting, turned back; `weights` (P, C) is where the dial changes."""
        rows, share = found.tolist(), search.frames / search.frames.sum()
        is_other = (~search.is_same(found)).astype(np.float64)
        parts = np.array([np.roll(weights, -row, axis=0) for row in rows]) * share[:, None, None]
        backs = parts * np.stack([np.roll(picture, -row, axis=0) for picture, row in zip(seen, rows, strict=True)])
        shown, told = (np.tensordot(is_other, each, axes=1) for each in (parts, backs))
        is_known = shown > HALF * np.maximum(is_other @ share, ROUNDING)[:, None, None]
        return cls(seen, told / np.maximum(shown, ROUNDING), is_known, weights > HALF, rows, noise_levels)

    def part_of_rivals(self, setting: int, rivals: Sequence[int]) -> float:
        """Return the card's distance from a picture at its own turn, as a part of that at the best of `rivals`.

        Regular marks match at many turns, so each pixel is weighted by how much the card differs between the two turns.
        Anything that lies over the card is far off at any turn, so absolute differences count, not their squares.
        """
        seen, known, card = self.seen[setting], self.known[setting], self.cards[setting]

        def compared(row: int) -> float:
            own, other = (np.roll(card, turn, axis=0) for turn in (self.rows[setting], row))
            shown = self.moves & np.roll(known, self.rows[setting], axis=0) & np.roll(known, row, axis=0)
            counts = shown * np.abs(other - own)
            noise = self.noise_levels * max(float(counts.sum()), 1.0)
            off, own_off = (float((counts * np.abs(seen - each)).sum()) + noise for each in (other, own))
            return own_off / off

        return max(map(compared, rivals))
