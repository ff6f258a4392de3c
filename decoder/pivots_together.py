"""Pivots together: who drew one dial with care drew the others with as much.

Where the needles of a gauge hardly turn they tell little of their own pivot, and half a pixel is to be feared. But
where all those of the panel that do tell turn within hundredths of a pixel of where they are drawn, so will these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from decoder.arrays import Floats
from decoder.pivots import PRIOR_PX, Pivot

# How carefully a panel may be drawn, pixels; each is as likely as the next before any needle is seen.
CARES_PX = (0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32)
# So many gauges of a panel are drawn with less care than the others, whatever these tell.
CARELESS_PART = 0.1


def pooled(pivots: Sequence[Pivot], moved_px: Sequence[tuple[float, float]]) -> tuple[Pivot, ...]:
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
    """
    told = [_Told.of(pivot, moved) for pivot, moved in zip(pivots, moved_px, strict=True)]
    spreads_px = np.array([*CARES_PX, PRIOR_PX])
    evidence = np.array([one.log_evidence(spreads_px) for one in told])
    careful = evidence[:, :-1] + np.log1p(-CARELESS_PART)
    either = np.logaddexp(careful, evidence[:, -1:] + np.log(CARELESS_PART))
    panel = either.sum(axis=0)
    by_care = np.exp(panel - np.logaddexp.reduce(panel)) * np.exp(careful - either)
    weights = np.concatenate([by_care, 1.0 - by_care.sum(axis=1, keepdims=True)], axis=1)
    return tuple(
        _replaced(pivot, moved, *one.mixed(spreads_px, own))
        for pivot, moved, one, own in zip(pivots, moved_px, told, weights, strict=True)
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
        """A pivot without its prior."""
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
