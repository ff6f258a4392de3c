"""Tilts: how far a needle is turned out of the radius, which tells of the point around which it really turns."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from decoder.arrays import Floats
from decoder.fitting import PHASE_REACH, phases_of
from decoder.gauge import Gauge
from decoder.needle_template import NeedleTemplate
from decoder.reading import Reading, Status
from decoder.unwrapping import PolarGrid, UnwrappedGauge, rows_at, rows_of_each

# A needle too short to have a direction.
MAX_CONDITION = 1e12


@dataclass(frozen=True, slots=True)
class Tilt:
    """How far one needle in one frame is turned out of the radius, and where its dial stood against the anchors.

    A needle `kappa_px` beside the point around which the dial is unwrapped appears `kappa_px / r` radians further on
    at radius r. It is relative to the needle's template.
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
    frames: Sequence[tuple[UnwrappedGauge, Mapping[str, Reading], tuple[float, float]]],
) -> list[Tilt]:
    """Of a gauge's needles that stand alone; a frame is the unwrapped gauge, its readings and its dial's shift."""
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


def tilt_of(
    name: str,
    strip: UnwrappedGauge,
    readings: Mapping[str, Reading],
    gauge: Gauge,
    grid: PolarGrid,
    *,
    face: UnwrappedGauge,
    templates: Mapping[str, NeedleTemplate],
) -> Tilt | None:
    """One needle's in one frame; None where it does not stand alone, or has no direction."""
    if not _stands_alone(name, gauge, readings, templates):
        return None
    angle_deg = readings[name].angle_deg
    window = _window(angle_deg, grid, templates[name])
    if window[0] < 0 or window[-1] > grid.rows - 1:
        return None
    (tilt,) = _tilts(rows_at(strip, window)[None], window[None], face, grid, templates[name])
    return None if tilt is None else Tilt(name, angle_deg, *tilt)


def across(angles_deg: Floats) -> Floats:
    """(N, 2): the unit vectors across needles at angles, in the direction in which angles grow."""
    angles = np.radians(angles_deg)
    return np.stack([-np.sin(angles), np.cos(angles)], axis=1)


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
    """Kappa and its spread by least squares of the pixels around M readings for gain, offset, shift and tilt.

    `cuts` are (M, H, C), from the gauge's fractional rows `windows`, (M, H).
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
    """Kappa and its spread from the weighted moments of the four unknowns' columns and the pixels, (M, 5, 5)."""
    normal, right = moments[:, :4, :4], moments[:, :4, 4]
    tells = np.linalg.cond(normal) <= MAX_CONDITION
    inverse = np.linalg.inv(np.where(tells[:, None, None], normal, np.eye(4)))
    solution = (inverse @ right[..., None])[..., 0]
    gain = solution[:, 0]
    tells &= gain > 0
    noise = np.maximum(moments[:, 4, 4] - (solution * right).sum(axis=1), 0.0) / total
    gain = np.where(tells, gain, 1.0)
    sigma = np.sqrt(noise * np.maximum(inverse[:, 3, 3], 0.0) / pixels_per_sample) / gain
    found = zip((solution[:, 3] / gain).tolist(), sigma.tolist(), tells.tolist(), strict=True)
    return [(kappa_px, sigma_px) if known else None for kappa_px, sigma_px, known in found]
