"""Needles proposed: what moves between frames on a dial, and where it stands in the panel picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from decoder.alignment import IDENTITY, Alignment
from decoder.arrays import Floats
from decoder.dial_plane import DialPlane
from decoder.parallax import Raised
from decoder.pictures import GreyPicture
from decoder.scale_marks import FULL_CIRCLE_DEG
from decoder.setup.needle_axis import REACH_DEG, axis_deg
from decoder.unwrapping import PolarGrid, Unwrapper, polar_grid

MARGIN_DEG = 8.0
MIN_LEVELS = 8.0
# A second needle leaves at least this part of what the first one leaves.
MIN_PART = 0.3
MOST = 3
CHANGED_PERCENTILE = 75
# In frames that differ this much from the panel picture around a needle, compared with the one that differs most and
# with the needle's own contrast, it is away.
AWAY_PART, AWAY_OF_CONTRAST = 0.6, 0.4
SPAN_WIDTHS = 2.5
SPAN_RANGE_DEG = (8.0, 40.0)
ROUGH_DEG = 2.0


@dataclass(frozen=True, slots=True)
class Proposal:
    """A needle: the angle at which it points in the panel picture, and how many degrees its template should span."""

    at_deg: float
    span_deg: float


@dataclass(frozen=True, slots=True)
class Dial:
    """What is known of a gauge before it has needles; `raised` is where they turn, if above its face."""

    centre: tuple[float, float]
    radius_px: tuple[float, float]
    sweep_deg: tuple[float, float]
    plane: DialPlane | None = None
    raised: Raised | None = None

    def grid(self, margin_deg: float = MARGIN_DEG) -> PolarGrid:
        """The dial unwrapped, with a margin at both ends."""
        first, last = self.sweep_deg
        margin_deg = min(margin_deg, (FULL_CIRCLE_DEG - (last - first)) / 2 + ROUGH_DEG)
        grid = polar_grid(self.centre, self.radius_px, first - margin_deg, last + margin_deg, plane=self.plane)
        return replace(grid, raised=self.raised)


@dataclass(frozen=True, slots=True)
class Pictures:
    """The panel picture, and frames of the flight, each with where the panel lies in it.

    `own` is where it lies in the panel picture itself: there, but for the lens.
    """

    picture: GreyPicture
    frames: Sequence[tuple[GreyPicture, Alignment]]
    own: Alignment = IDENTITY


def proposed(seen: Pictures, dial: Dial, most: int = MOST) -> list[Proposal]:
    """The needles on a dial, the clearest first; none if nothing moved.

    Parameters
    ----------
    seen : the pictures in which they may move
    most : how many are looked for
    """
    views = _views(seen, dial)
    if not len(views.others):
        return []
    # What other frames do not have there, and what is no plain dial here.
    changes = np.percentile(np.abs(views.others - views.own), CHANGED_PERCENTILE, axis=0)
    here = np.minimum(changes, np.abs(views.own - np.median(views.own, axis=0)))
    profile = _smooth(here.mean(axis=1), round(ROUGH_DEG / views.grid.step_deg))
    found: list[Proposal] = []
    highest = float(profile.max())
    while len(found) < most:
        row = int(profile.argmax())
        if profile[row] < max(MIN_LEVELS, MIN_PART * highest):
            break
        guess_deg = views.grid.angle_deg(row)
        light = views.light(guess_deg)
        found.append(_proposal(light, views.grid, guess_deg))
        reach = round((_width_deg(light, views.grid, guess_deg) + ROUGH_DEG) / views.grid.step_deg)
        profile[max(row - reach, 0) : row + reach + 1] = 0.0
    first, last = dial.sweep_deg
    return [each for each in found if first - MARGIN_DEG <= each.at_deg <= last + MARGIN_DEG]


def needle_at(seen: Pictures, dial: Dial, guess_deg: float) -> Proposal:
    """The needle that somebody pointed at, its axis to some hundredths of a degree; it need not move."""
    views = _views(seen, dial)
    return _proposal(views.light(guess_deg), views.grid, guess_deg)


@dataclass(frozen=True, slots=True)
class _Views:
    """A dial in the panel picture, (R, C), and in other frames, (N, R, C), all on one grid."""

    grid: PolarGrid
    own: Floats
    others: Floats

    def light(self, guess_deg: float) -> Floats:
        """(R, C): what the needle near an angle adds to the dial.

        The dial is what frames show in which that needle is away; where it never is, what the dial mostly shows at
        each radius.
        """
        plain: Floats = self.own - np.median(self.own, axis=0)
        row = round((guess_deg - self.grid.start_deg) / self.grid.step_deg)
        reach = round(REACH_DEG / self.grid.step_deg)
        window = slice(max(row - reach, 0), row + reach + 1)
        if not len(self.others):
            return plain
        changes = np.abs(self.others[:, window] - self.own[window]).mean(axis=(1, 2))
        away = changes > max(AWAY_PART * changes.max(), AWAY_OF_CONTRAST * np.abs(plain[window]).mean())
        light: Floats = self.own - np.median(self.others[away], axis=0) if away.any() else plain
        return light


def _views(seen: Pictures, dial: Dial) -> _Views:
    grid = dial.grid()
    unwrapper = Unwrapper([grid])
    own = unwrapper.unwrap(seen.picture, seen.own)[0]
    others = [unwrapper.unwrap(frame, alignment)[0] for frame, alignment in seen.frames]
    return _Views(grid, own, np.stack(others) if others else np.zeros((0, *own.shape), np.float32))


def _proposal(light: Floats, grid: PolarGrid, guess_deg: float) -> Proposal:
    low, high = SPAN_RANGE_DEG
    span_deg = round(min(max(SPAN_WIDTHS * _width_deg(light, grid, guess_deg), low), high))
    return Proposal(axis_deg(light, grid, guess_deg), span_deg)


def _smooth(profile: Floats, rows: int) -> Floats:
    smooth: Floats = np.convolve(profile, np.ones(rows) / rows, mode="same")
    return smooth


def _width_deg(light: Floats, grid: PolarGrid, at_deg: float) -> float:
    """How wide the needle is in the inner half of the ring, at half its contrast."""
    row = round((at_deg - grid.start_deg) / grid.step_deg)
    reach = round(SPAN_RANGE_DEG[1] / 2 / grid.step_deg)
    inner = np.abs(light[max(row - reach, 0) : row + reach + 1, : max(grid.columns // 2, 1)]).mean(axis=1)
    return float((inner > inner.max() / 2).sum()) * grid.step_deg
