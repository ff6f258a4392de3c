"""Needle lines: how far needles are tilted from the radius; their pivot is estimated from these tilts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from decoder.imaging.sorting import MAD_TO_SIGMA, median
from decoder.imaging.unwrapping import PolarGrid, UnwrappedGauge
from decoder.instruments.reading import Reading, Status
from decoder.instruments.sampling import SeenGauge
from decoder.instruments.thresholds import APART_DEG, FRAMES_TO_LEARN, HUBER_SPREADS, MIN_PLACES
from decoder.matching.correlation import is_singular
from decoder.matching.needle_fit import PHASE_REACH, phases_of
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.strips import rows_of_each
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.registration.pivot import PRIOR_LIFT, PRIOR_PX, UNKNOWN, Pivot, across

# Passes of robust least squares.
ROBUST_PASSES = 4
# The prior weight of the tilts' own claimed scatter, in tilts.
CLAIM_COUNTS = 2
# Where each dial is located by itself, the scatter does not show errors of its position that all frames share.
PLACED_SCALE = 0.8
# Tilt of a needle due to uneven light and imperfectly known marks, pixels.
TILT_FLOOR_PX = 0.03


@dataclass(frozen=True, slots=True)
class Tilt:
    """How far one needle in one frame is tilted from the radius, and its dial's shift relative to the anchors.

    A needle that passes `kappa_px` beside the point around which the dial is unwrapped appears `kappa_px / r` radians
    further on at radius r. The tilt is relative to the needle's template.
    """

    needle: str
    angle_deg: float
    kappa_px: float
    sigma_px: float
    dial_shift_px: tuple[float, float] = (0.0, 0.0)


def tilts_of(
    gauge: Gauge,
    grid: PolarGrid,
    face: UnwrappedGauge,
    templates: Mapping[str, NeedleTemplate],
    frames: Sequence[SeenGauge],
) -> list[Tilt]:
    """Measure the tilts of a gauge's needles where they stand alone."""
    tilts = []
    for needle in gauge.needles:
        alone = [
            (strip, readings[needle.name].angle_deg, shift)
            for strip, readings, shift in frames
            if _stands_alone(needle.name, gauge, readings, templates)
        ]
        template = templates[needle.name]
        rows = [_window(angle_deg, grid, template) for _, angle_deg, _ in alone]
        whole = [index for index, own in enumerate(rows) if own[0] >= 0 and own[-1] <= grid.rows - 1]
        if whole:
            windows = np.stack([rows[index] for index in whole])
            cuts = rows_of_each([alone[index][0] for index in whole], windows)
            found = _tilts(cuts, windows, face, grid, template)
            tilts += [
                Tilt(needle.name, alone[index][1], *tilt, alone[index][2])
                for index, tilt in zip(whole, found, strict=True)
                if tilt is not None
            ]
    return tilts


def pivot_of_tilts(tilts: Sequence[Tilt]) -> Pivot:
    """Fit the pivot to the tilts by robust least squares; each needle has a constant tilt of its own."""
    names = sorted({tilt.needle for tilt in tilts})
    names = [name for name in names if sum(tilt.needle == name for tilt in tilts) >= FRAMES_TO_LEARN]
    tilts = [tilt for tilt in tilts if tilt.needle in names]
    if not tilts:
        return UNKNOWN
    own = np.array([[tilt.needle == name for name in names] for tilt in tilts], np.float64)
    beside = across(np.array([tilt.angle_deg for tilt in tilts]))
    shifts = np.array([tilt.dial_shift_px for tilt in tilts])
    lifted = (beside * (shifts - shifts.mean(axis=0))).sum(axis=1, keepdims=True)
    rows = np.concatenate([beside, own, lifted], axis=1)
    seen = np.array([tilt.kappa_px for tilt in tilts])
    sigma = np.hypot([tilt.sigma_px for tilt in tilts], TILT_FLOOR_PX)
    prior = np.diag([1 / PRIOR_PX**2] * 2 + [1e-6] * len(names) + [1 / PRIOR_LIFT**2])
    weights = 1 / sigma**2
    for _ in range(ROBUST_PASSES):
        normal = rows.T @ (weights[:, None] * rows) + prior
        solution = np.linalg.solve(normal, rows.T @ (weights * seen))
        spreads = np.abs(seen - rows @ solution) / sigma
        scale = _scale(spreads, len(seen) - len(solution), least=PLACED_SCALE if shifts.any() else 0.0)
        weights = np.minimum(1.0, HUBER_SPREADS * scale / np.maximum(spreads, 1e-9)) / (scale * sigma) ** 2
    covariances = np.linalg.inv(rows.T @ (weights[:, None] * rows) + prior)
    places = sum(places_of(tilt.angle_deg for tilt in tilts if tilt.needle == name) for name in names)
    left = seen - rows @ solution
    scatter_px2 = (MAD_TO_SIGMA * float(median(np.abs(left)))) ** 2 * len(left) / max(len(left) - rows.shape[1], 1)
    own_px2 = float(median(np.array([tilt.sigma_px for tilt in tilts]))) ** 2
    pivot = Pivot(
        offset_px=(float(solution[0]), float(solution[1])),
        covariance_px2=covariances[:2, :2],
        lift=float(solution[-1]),
        lift_sigma=math.sqrt(float(covariances[-1, -1])),
        scatter_px2=scatter_px2 - own_px2,
        tilts=len(left),
    )
    return pivot.doubted() if places < MIN_PLACES + len(names) else pivot  # at least as many places as unknowns


def places_of(angles_deg: Iterable[float]) -> int:
    """Count the places, well apart, at which something stood."""
    count, last_deg = 0, -math.inf
    for angle_deg in sorted(angles_deg):
        if angle_deg - last_deg > APART_DEG:
            count, last_deg = count + 1, angle_deg
    return count


def _scale(spreads: Floats, freedoms: int, *, least: float) -> float:
    """Return the scatter of tilts relative to what they claim; if smaller, the claim counts as well."""
    scale = MAD_TO_SIGMA * float(median(spreads))
    if scale < 1.0:
        known = max(freedoms, 0)
        fitted = len(spreads) / max(known, 1)  # fitting makes the residuals smaller
        scale = math.sqrt((CLAIM_COUNTS + known * fitted * scale**2) / (CLAIM_COUNTS + known))
    return max(scale, least)


def _stands_alone(
    name: str, gauge: Gauge, readings: Mapping[str, Reading], templates: Mapping[str, NeedleTemplate]
) -> bool:
    """Whether a needle was read whole, with no other near enough to reach into its template."""
    own = readings[name]
    reach_deg = templates[name].rows * templates[name].step_deg / 2
    return own.status is Status.READ and all(
        readings[other.name].status is not Status.MISSING
        and abs(readings[other.name].angle_deg - own.angle_deg) > reach_deg + templates[other.name].half_width_deg
        for other in gauge.needles
        if other.name != name
    )


def _window(angle_deg: float, grid: PolarGrid, template: NeedleTemplate) -> Floats:
    """(H,): the fractional rows of a template with its axis at an angle."""
    rows: Floats = (angle_deg - grid.start_deg) / grid.step_deg + np.arange(template.rows) - (template.rows - 1) / 2
    return rows


def _tilts(
    cuts: Floats, windows: Floats, face: UnwrappedGauge, grid: PolarGrid, template: NeedleTemplate
) -> list[tuple[float, float] | None]:
    """Fit gain, offset, shift and tilt to the pixels around M readings by least squares; return kappa and sigma.

    `cuts` (M, H, C) are from the gauge's fractional rows `windows` (M, H).
    """
    behind = rows_of_each([face] * len(cuts), windows)
    phases = phases_of(template)
    (light, light_slope), (transparency, transparency_slope) = (
        phases.light[PHASE_REACH],
        phases.transparency[PHASE_REACH],
    )
    rows = np.empty((len(cuts), 5, *template.pixels.shape))
    rows[:, 0] = light + transparency * behind
    rows[:, 1] = 1.0
    rows[:, 2] = light_slope + transparency_slope * behind
    np.multiply(rows[:, 2], math.degrees(1.0) / grid.step_deg / grid.radii_px, out=rows[:, 3])
    rows[:, 4] = cuts
    weights = template.trust.ravel().astype(np.float64)
    flat = rows.reshape(len(cuts), 5, -1)
    moments = (flat * weights) @ flat.transpose(0, 2, 1)
    return _solved(moments, float(weights.sum()), grid.pixels_per_sample)


def _solved(moments: Floats, total: float, pixels_per_sample: float) -> list[tuple[float, float] | None]:
    """Solve for kappa and sigma from the weighted moments of the four unknowns' columns and the pixels, (M, 5, 5)."""
    normal, right = moments[:, :4, :4], moments[:, :4, 4]
    tells = ~is_singular(normal)
    inverse = np.linalg.inv(np.where(tells[:, None, None], normal, np.eye(4)))
    solution = (inverse @ right[..., None])[..., 0]
    gain = solution[:, 0]
    tells &= gain > 0
    noise = np.maximum(moments[:, 4, 4] - (solution * right).sum(axis=1), 0.0) / total
    gain = np.where(tells, gain, 1.0)
    sigma = np.sqrt(noise * np.maximum(inverse[:, 3, 3], 0.0) / pixels_per_sample) / gain
    found = zip((solution[:, 3] / gain).tolist(), sigma.tolist(), tells.tolist(), strict=True)
    return [(kappa_px, sigma_px) if known else None for kappa_px, sigma_px, known in found]
