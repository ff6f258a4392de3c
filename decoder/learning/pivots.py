"""Pivots: where the needles of a flight really turn, told by the needles themselves, dial by dial and together.

A needle lies on a line through its pivot. If the dial is unwrapped around a point beside the pivot, the needle's inner
end is turned further than its tip, and how far changes as the needle goes round: over a flight that gives the pivot to
some hundredths of a pixel, whatever the needle looks like. A pivot that is off by one pixel on a dial 100 pixels wide
moves readings by a degree and a half to and fro.

The panel picture is one more frame in which all needles' angles are known: by how much a needle's line was turned there
tells the pivot even if the needle hardly moves in flight. Where it tells little all the same, half a pixel is to be
feared; but where the other gauges of the panel turn within hundredths of a pixel of where they are drawn, so will it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from decoder.imaging.sorting import median
from decoder.imaging.unwrapping import PolarGrid, row_of_angle
from decoder.instruments.appearance import Instrument
from decoder.instruments.panel_reader import PanelReader
from decoder.instruments.readers import kind_of
from decoder.instruments.reading import Reading, Status
from decoder.learning.pivot_path import PivotPath
from decoder.learning.thresholds import DRAWN_PX, SETTLED_PX
from decoder.matching.thresholds import REACH_PART
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.registration.frame_placer import UnwrappedFrame
from decoder.registration.pivot import PRIOR_PX, Pivot

# How carefully a panel may be drawn, pixels, and how likely that is before any needle is seen: each as the next, but a
# careless hand the less, the more it would leave in doubt.
CARES_PX = {
    0.005: 1,
    0.01: 1,
    0.02: 1,
    0.04: 1,
    0.08: 1,
    0.16: 1,
    0.32: 1,
    0.64: 1 / 2,
    1.28: 1 / 8,
    2.56: 1 / 32,
    5.12: 1 / 128,
}
# So many gauges of a panel are drawn with less care than the others, whatever these tell.
CARELESS_PART = 0.1


def estimate_pivots(
    reader: PanelReader,
    samples: Sequence[UnwrappedFrame],
    found: Sequence[Mapping[str, Reading]],
    paths: Sequence[PivotPath],
) -> tuple[Pivot, ...]:
    """Estimate each gauge's pivot, relative to where it was unwrapped, in the panel's order.

    Parameters
    ----------
    samples, found
        Frames, and by frame the readings of their needles.
    paths
        By gauge: how far its pivot was moved already from where it is drawn.
    """
    pivots = []
    parts = zip(reader.source.panel.gauges, reader.grids, reader.appearance.faces, paths, strict=True)
    for index, (gauge, grid, face, path) in enumerate(parts):
        frames = [
            (sample.gauges[index], readings, sample.dial_shifts_px[index] if sample.dial_shifts_px else (0.0, 0.0))
            for sample, readings in zip(samples, found, strict=True)
        ]
        if (
            isinstance(grid, PolarGrid) and not reader.placement.dials_move
        ):  # else the panel picture shows the dial from another side
            frames.append((reader.own_gauges[index], _drawn_readings(gauge, grid), (0.0, 0.0)))
        pivot = kind_of(gauge).pivot(Instrument(index, gauge, grid, face), reader.appearance, frames)
        pivots.append(path.within_reach(path.with_search(pivot, gauge.radius[1]), REACH_PART * gauge.radius[1]))
    reaches_px = [REACH_PART * gauge.radius[1] for gauge in reader.source.panel.gauges]
    return empirical_bayes(pivots, [path.beside_px for path in paths], reaches_px)


def _drawn_readings(gauge: Gauge, grid: PolarGrid) -> dict[str, Reading]:
    """Needles as the panel has them in its picture; one that was cut elsewhere is missing there."""
    return {
        needle.name: Reading(Status.MISSING, math.nan, math.inf, 0.0)
        if needle.at_deg is None or needle.hides_deg is None
        else Reading(Status.READ, grid.angle_deg(row_of_angle(grid, needle.at_deg)), 0.0, 1.0)
        for needle in gauge.turning
    }


def empirical_bayes(
    pivots: Sequence[Pivot], moved_px: Sequence[tuple[float, float]], reaches_px: Sequence[float]
) -> tuple[Pivot, ...]:
    """Each pivot by its own needles and by how far the others are from where they were drawn.

    The offsets of a panel come from one normal distribution of unknown spread or, one in ten, from the one that is
    feared of every panel: empirical Bayes, with the spread averaged over, not chosen (Efron, Large-Scale Inference,
    2010, chapter 1).

    Parameters
    ----------
    pivots
        Each with the prior that knows of no other gauge.
    moved_px
        By the same order: how far each was moved from where it is drawn.
    reaches_px
        By the same order: no hand draws it further off. A spread is half as much at most.
    """
    told = [_Told.of(pivot, moved) for pivot, moved in zip(pivots, moved_px, strict=True)]
    any_px = np.array([*CARES_PX, PRIOR_PX])
    spreads_px = np.minimum(any_px, np.array(reaches_px)[:, None] / 2)
    evidence = np.array([one.log_evidence(own_px) for one, own_px in zip(told, spreads_px, strict=True)])
    careful = evidence[:, :-1] + np.log1p(-CARELESS_PART)
    either = np.logaddexp(careful, evidence[:, -1:] + np.log(CARELESS_PART))
    panel = either.sum(axis=0) + np.log(list(CARES_PX.values()))
    by_care = np.exp(panel - np.logaddexp.reduce(panel)) * np.exp(careful - either)
    weights = np.concatenate([by_care, 1.0 - by_care.sum(axis=1, keepdims=True)], axis=1)
    return tuple(
        _replaced(pivot, moved, *one.mixed(own_px, own))
        for pivot, moved, one, own_px, own in zip(pivots, moved_px, told, spreads_px, weights, strict=True)
    )


@dataclass(frozen=True, slots=True)
class _Told:
    """What a gauge's own needles tell of its pivot's offset from where it is drawn, as if nothing were known before.

    `information` (2, 2) is the inverse of its covariance, `product` (2,) the information times the offset.
    """

    information: Floats
    product: Floats

    @classmethod
    def of(cls, pivot: Pivot, moved_px: tuple[float, float]) -> Self:
        """Return a pivot without its prior."""
        inverse = np.linalg.inv(pivot.covariance_px2)
        values, vectors = np.linalg.eigh(inverse - np.eye(2) / PRIOR_PX**2)
        information = (vectors * np.maximum(values, 0.0)) @ vectors.T
        return cls(information, inverse @ np.array(pivot.offset_px) + information @ np.array(moved_px))

    def log_evidence(self, spreads_px: Floats) -> Floats:
        """(S,): how likely that is if offsets have each of these spreads; up to a constant."""
        variances_px2 = spreads_px[:, None, None] ** 2
        fit = np.linalg.inv(self.information + np.eye(2) / variances_px2) @ self.product @ self.product
        _, size = np.linalg.slogdet(np.eye(2) + variances_px2 * self.information)
        evidence: Floats = (fit - size) / 2
        return evidence

    def mixed(self, spreads_px: Floats, weights: Floats) -> tuple[Floats, Floats]:
        """Mean (2,) and covariance (2, 2) of the offset, over spreads (S,) with these weights."""
        covariances = np.linalg.inv(self.information + np.eye(2) / spreads_px[:, None, None] ** 2)
        means = covariances @ self.product
        mean = weights @ means
        beside = means - mean
        covariance = np.einsum("s,sij->ij", weights, covariances) + np.einsum("s,si,sj->ij", weights, beside, beside)
        return mean, covariance


def _replaced(pivot: Pivot, moved_px: tuple[float, float], mean_px: Floats, covariance_px2: Floats) -> Pivot:
    x, y = (mean_px - moved_px).tolist()
    return replace(pivot, offset_px=(x, y), covariance_px2=covariance_px2)


def care_part(paths: Sequence[PivotPath], pivots: Sequence[Pivot], gauges: Sequence[Gauge]) -> float:
    """Tell how far beside their pivots a panel's centres are drawn, to each side, by those whose needles tell.

    Of the radius: on a larger dial a hand misses by more. It is the spread of a normal distribution with the same
    median.
    """
    told = [
        math.hypot(*path.beside_px) / gauge.radius[1]
        for path, pivot, gauge in zip(paths, pivots, gauges, strict=True)
        if path.was_moved or pivot.sigma_px <= DRAWN_PX
    ]
    return float(median(np.array(told))) / math.sqrt(2 * math.log(2)) if told else 0.0


def lifts_missing(lifts: Sequence[float], pivots: Sequence[Pivot]) -> list[float]:
    """How far needles go beyond their dials besides `lifts`; nothing where that is not sure yet."""
    return [pivot.shrunk_lift if lift or pivot.is_lifted else 0.0 for lift, pivot in zip(lifts, pivots, strict=True)]


def any_lift_is_off(missing: Sequence[float]) -> bool:
    """Whether some needle goes another way than it was thought to, by more than lifts settle to."""
    return any(abs(lift) > SETTLED_PX for lift in missing)
