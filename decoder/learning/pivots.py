"""Pivots: where a flight's needles really turn, estimated from the needles, per dial and over the whole panel.

A needle lies on a line through its pivot. If the dial is unwrapped around a point beside the pivot, the needle's inner
end appears rotated by more than its tip, by an amount that varies as the needle turns. Over a flight this gives the
pivot to a few hundredths of a pixel, whatever the needle looks like. A pivot that is off by one pixel on a dial 100
pixels wide makes readings swing by a degree and a half either way.

The panel picture is one more frame, in which all needles' angles are known: the tilt of a needle there gives its pivot
even if it hardly moves in flight. If a needle gives little information, an error of half a pixel must be assumed; but
if the other gauges' pivots are within hundredths of a pixel of where they are drawn, so is this one.
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
from decoder.instruments.kind_table import kind_of
from decoder.instruments.panel_reader import PanelReader
from decoder.instruments.reading import Reading, Status
from decoder.learning.pivot_path import PivotPath
from decoder.learning.thresholds import DRAWN_PX, SETTLED_PX
from decoder.matching.thresholds import REACH_PART
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.registration.frame_placer import UnwrappedFrame
from decoder.registration.pivot import PRIOR_PX, Pivot

# How carefully a panel may be drawn (spread of offsets, pixels), with prior weights. All spreads are equally likely,
# except that careless ones count less the more they would leave uncertain.
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
# Prior probability that a gauge is drawn with less care than the rest of its panel.
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
        Frames, and for each the readings of its needles.
    paths
        For each gauge, how far its pivot has been moved already from where it is drawn.
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
        ):  # else the panel picture shows the dial from a different side
            frames.append((reader.own_gauges[index], _drawn_readings(gauge, grid), (0.0, 0.0)))
        pivot = kind_of(gauge).pivot(Instrument(index, gauge, grid, face), reader.appearance, frames)
        pivots.append(path.within_reach(path.with_search(pivot, gauge.radius[1]), REACH_PART * gauge.radius[1]))
    reaches_px = [REACH_PART * gauge.radius[1] for gauge in reader.source.panel.gauges]
    return empirical_bayes(pivots, [path.beside_px for path in paths], reaches_px)


def _drawn_readings(gauge: Gauge, grid: PolarGrid) -> dict[str, Reading]:
    """Return the needles' angles in the panel picture; a needle cut from another picture is missing."""
    return {
        needle.name: Reading(Status.MISSING, math.nan, math.inf, 0.0)
        if needle.at_deg is None or needle.hides_deg is None
        else Reading(Status.READ, grid.angle_deg(row_of_angle(grid, needle.at_deg)), 0.0, 1.0)
        for needle in gauge.turning
    }


def empirical_bayes(
    pivots: Sequence[Pivot], moved_px: Sequence[tuple[float, float]], reaches_px: Sequence[float]
) -> tuple[Pivot, ...]:
    """Combine each pivot's own estimate with how far the other gauges' pivots are from where they were drawn.

    The offsets of a panel come from one normal distribution of unknown spread or, with a probability of one in ten,
    from the wide one assumed for any panel. This is empirical Bayes, with the spread averaged over, not chosen (Efron,
    Large-Scale Inference, 2010, chapter 1).

    Parameters
    ----------
    pivots
        Each estimated with the prior that ignores the other gauges.
    moved_px
        In the same order: how far each was moved from where it is drawn.
    reaches_px
        In the same order: the furthest anybody would draw it off. Spreads are limited to half of it.
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
    """The information of a gauge's own needles on its pivot's offset from where it is drawn, without a prior.

    `information` (2, 2) is the inverse covariance, `product` (2,) the information times the offset.
    """

    information: Floats
    product: Floats

    @classmethod
    def of(cls, pivot: Pivot, moved_px: tuple[float, float]) -> Self:
        """Remove the prior from a pivot."""
        inverse = np.linalg.inv(pivot.covariance_px2)
        values, vectors = np.linalg.eigh(inverse - np.eye(2) / PRIOR_PX**2)
        information = (vectors * np.maximum(values, 0.0)) @ vectors.T
        return cls(information, inverse @ np.array(pivot.offset_px) + information @ np.array(moved_px))

    def log_evidence(self, spreads_px: Floats) -> Floats:
        """(S,): the log marginal likelihood for each of these spreads of offsets, up to a constant."""
        variances_px2 = spreads_px[:, None, None] ** 2
        fit = np.linalg.inv(self.information + np.eye(2) / variances_px2) @ self.product @ self.product
        _, size = np.linalg.slogdet(np.eye(2) + variances_px2 * self.information)
        evidence: Floats = (fit - size) / 2
        return evidence

    def mixed(self, spreads_px: Floats, weights: Floats) -> tuple[Floats, Floats]:
        """Mean (2,) and covariance (2, 2) of the offset, averaged over spreads (S,) with these weights."""
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
    """Estimate how far a panel's centres are drawn from their pivots, per axis, from gauges whose needles show it.

    The result is a part of the radius, since people miss by more on a larger dial. It is the standard deviation of the
    normal distribution with the same median.
    """
    told = [
        math.hypot(*path.beside_px) / gauge.radius[1]
        for path, pivot, gauge in zip(paths, pivots, gauges, strict=True)
        if path.was_moved or pivot.sigma_px <= DRAWN_PX
    ]
    return float(median(np.array(told))) / math.sqrt(2 * math.log(2)) if told else 0.0


def lifts_missing(lifts: Sequence[float], pivots: Sequence[Pivot]) -> list[float]:
    """How much each needle's lift differs from `lifts`; zero where that is not significant yet."""
    return [pivot.shrunk_lift if lift or pivot.is_lifted else 0.0 for lift, pivot in zip(lifts, pivots, strict=True)]


def any_lift_is_off(missing: Sequence[float]) -> bool:
    """Whether some needle's lift has not converged."""
    return any(abs(lift) > SETTLED_PX for lift in missing)
