"""Robust least squares: what lies far from the rest counts for little."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decoder.panel.arrays import Floats

PASSES = 6


@dataclass(frozen=True, slots=True)
class Trust:
    """How far off counts half: `least`, and so many `medians` of how far all are off; `power` makes it steeper."""

    least: float
    medians: float = 1.0
    power: int = 1

    def weights(self, off: Floats) -> Floats:
        """(N,): how much each counts that is so far off."""
        weights: Floats = (1.0 + (off / (self.least + self.medians * float(np.median(off)))) ** 2) ** -self.power
        return weights


def robust(
    design: Floats, wanted: Floats, trust: Trust, *, base: Floats | None = None, held: Floats | None = None
) -> tuple[Floats, Floats, Floats]:
    """Fit `design` (N, P) times parameters to `wanted` (N,); return the parameters, how far each is off, and weights.

    Parameters
    ----------
    base : (N,) the weights to begin with
    held : (P, P) is added to the normal equations, so that parameters that nothing tells stay near 0
    """
    base = np.ones_like(wanted) if base is None else base
    weights = base
    for _ in range(PASSES):
        weighted = design * weights[:, None]
        normal = weighted.T @ design if held is None else weighted.T @ design + held
        found: Floats = np.linalg.lstsq(normal, weighted.T @ wanted, rcond=None)[0]
        off = np.abs(design @ found - wanted)
        weights = base * trust.weights(off)
    return found, off, weights


def meeting(points: Floats, along: Floats, lengths: Floats, trust: Trust, *, held: Floats | None = None) -> Floats:
    """(2,): where lines through points (N, 2) in directions (N, 2) meet; long ones tell more."""
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    return robust(normal, (normal * points).sum(axis=1), trust, base=lengths, held=held)[0]
