"""Needles as they were found, as arrays: one frame is a batch of one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decoder.imaging.unwrapping import PolarGrid, UnwrappedGauge, rows_in_sweep, turn_rows
from decoder.instruments.reading import Reading, Status
from decoder.matching.needle_template import NeedleTemplate
from decoder.panel.arrays import Floats, Indices, Mask
from decoder.panel.gauge import Gauge
from decoder.panel.scale import FULL_CIRCLE_DEG

STATUSES = (Status.READ, Status.EDGE, Status.HIDDEN, Status.MISSING)
READ, EDGE, HIDDEN, MISSING = range(4)
_COLUMNS = ("status", "row", "sigma_rows", "score")
Which = Indices | Mask | tuple[Indices | slice, Indices | int]


@dataclass(frozen=True, slots=True)
class Found:
    """Needles as they were found, arrays of one shape, usually (F, K): K needles in F frames.

    Attributes
    ----------
    status
        Index into `STATUSES`.
    row, sigma_rows
        The gauge's row of the needle's axis, with its uncertainty.
    score
        In [-1, 1].
    """

    status: Indices
    row: Floats
    sigma_rows: Floats
    score: Floats

    @classmethod
    def missing(cls, shape: tuple[int, ...]) -> Found:
        """Return needles of which nothing is known."""
        return cls(np.full(shape, MISSING), np.full(shape, np.nan), np.full(shape, np.inf), np.zeros(shape))

    @classmethod
    def beside(cls, others: Sequence[Found]) -> Found:
        """Concatenate the needles of several gauges."""
        return cls(*(np.concatenate([getattr(own, name) for own in others], axis=1) for name in _COLUMNS))

    def part(self, which: Which) -> Found:
        """Return a copy of some of them."""
        return Found(*(getattr(self, name)[which].copy() for name in _COLUMNS))

    def put(self, which: Which, others: Found) -> None:
        """Overwrite some of them with others, in place."""
        for name in _COLUMNS:
            getattr(self, name)[which] = getattr(others, name)

    def instead(self, where: Mask, others: Found) -> Found:
        """Return them with others, of the same shape, where the mask is true."""
        return Found(*(np.where(where, getattr(others, name), getattr(self, name)) for name in _COLUMNS))

    def as_missing(self) -> Found:
        """Return the same with status MISSING."""
        return Found(np.full(self.status.shape, MISSING), self.row, self.sigma_rows, self.score)


@dataclass(frozen=True, slots=True)
class Needle:
    """A needle to search for: its place in the panel, its dial without needles, and what it looks like.

    One that `is_doubted` was found in only a few of the sampled frames.
    """

    name: str
    gauge_index: int
    gauge: Gauge
    grid: PolarGrid
    face: UnwrappedGauge
    template: NeedleTemplate
    is_doubted: bool = False

    @property
    def axis(self) -> int:
        """The template's middle row."""
        return (self.template.rows - 1) // 2

    @property
    def half_width_rows(self) -> float:
        """Half of the needle's width."""
        return self.template.half_width_deg / self.template.step_deg

    @property
    def turn_rows(self) -> float | None:
        """How many rows are a full turn, if the dial is read all the way round."""
        return turn_rows(self.gauge, self.grid)

    @property
    def allowed(self) -> Mask:
        """(R,): the rows on which its axis may lie."""
        return rows_in_sweep(self.gauge, self.grid)

    @property
    def covered_by(self) -> str | None:
        """The needle above it."""
        return next(needle.covered_by for needle in self.gauge.needles if needle.name == self.name)


def all_above(needles: Sequence[Needle], names: Sequence[str], index: int) -> tuple[int, ...]:
    """Return the needles above one, the nearest first."""
    above: list[int] = []
    cover = needles[index].covered_by
    while cover is not None:
        above.append(names.index(cover))
        cover = needles[above[-1]].covered_by
    return tuple(above)


def readings_of(found: Found, needles: list[Needle], place_sigmas_deg: Floats) -> list[dict[str, Reading]]:
    """Convert what was found to readings, by frame and needle.

    Parameters
    ----------
    found
        (F, K).
    place_sigmas_deg
        (F, K): the uncertainty of the readings due to the positions of their dials.
    """
    steps_deg = np.array([needle.grid.step_deg for needle in needles])
    starts_deg = np.array([needle.grid.start_deg for needle in needles])
    firsts_deg = np.array([needle.gauge.sweep[0] for needle in needles])
    is_round = np.array([needle.gauge.is_round for needle in needles])
    angles_deg = starts_deg + found.row * steps_deg
    angles_deg = np.where(is_round, firsts_deg + (angles_deg - firsts_deg) % FULL_CIRCLE_DEG, angles_deg)
    sigmas_deg = np.hypot(found.sigma_rows * steps_deg, place_sigmas_deg)
    names = [needle.name for needle in needles]
    columns = (found.status.tolist(), angles_deg.tolist(), sigmas_deg.tolist(), found.score.tolist())
    return [
        {
            name: Reading(STATUSES[status], angle_deg, sigma_deg, score)
            for name, status, angle_deg, sigma_deg, score in zip(names, *own, strict=True)
        }
        for own in zip(*columns, strict=True)
    ]
