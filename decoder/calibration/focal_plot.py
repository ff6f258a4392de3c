"""Pixels per radian over focal length, as thesis figure 3.3 shows it: an SVG, the same bytes every time."""

from __future__ import annotations

import math

import numpy as np

from decoder.calibration.focal_fit import FocalFit
from decoder.calibration.profile import Array

WIDTH, HEIGHT = 640, 420
LEFT, RIGHT, TOP, BOTTOM = 70, 620, 30, 370
_STYLE = "font-family='sans-serif' font-size='12' fill='#333'"


def focal_svg(focal_lengths_mm: Array, pixels_per_radian: Array, fit: FocalFit) -> str:
    """Draw the measurements as dots, the quadratic as a line.

    Parameters
    ----------
    focal_lengths_mm, pixels_per_radian : (N,)
    """
    lengths = np.linspace(focal_lengths_mm.min(), focal_lengths_mm.max(), 61)
    curve = np.polynomial.polynomial.polyval(lengths, fit.coefficients)
    across, up = _ticks(0.0, float(lengths.max())), _ticks(0.0, float(max(curve.max(), pixels_per_radian.max())))

    def place(length: float, value: float) -> str:
        x = LEFT + (RIGHT - LEFT) * length / across[-1]
        y = BOTTOM - (BOTTOM - TOP) * value / up[-1]
        return f"{x:.2f},{y:.2f}"

    parts = [
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {WIDTH} {HEIGHT}' width='{WIDTH}' height='{HEIGHT}'>",
        f"<rect width='{WIDTH}' height='{HEIGHT}' fill='white'/>",
    ]
    for length in across:
        x, y = place(length, 0).split(",")
        parts.append(f"<line x1='{x}' y1='{y}' x2='{x}' y2='{TOP}' stroke='#ddd'/>")
        parts.append(f"<text x='{x}' y='{BOTTOM + 18}' text-anchor='middle' {_STYLE}>{length:g}</text>")
    for value in up:
        x, y = place(0, value).split(",")
        parts.append(f"<line x1='{x}' y1='{y}' x2='{RIGHT}' y2='{y}' stroke='#ddd'/>")
        parts.append(f"<text x='{LEFT - 8}' y='{float(y) + 4:.2f}' text-anchor='end' {_STYLE}>{value:g}</text>")
    line = " ".join(place(length, value) for length, value in zip(lengths, curve, strict=True))
    parts.append(f"<polyline points='{line}' fill='none' stroke='#1f6fb2' stroke-width='1.5'/>")
    for length, value in zip(focal_lengths_mm, pixels_per_radian, strict=True):
        x, y = place(length, value).split(",")
        parts.append(f"<circle cx='{x}' cy='{y}' r='3.5' fill='#c0392b'/>")
    c0, c1, c2 = fit.coefficients
    equation = f"{c0:.4g} {c1:+.5g} f {c2:+.4g} f\N{SUPERSCRIPT TWO}"
    middle = (LEFT + RIGHT) // 2
    parts += [
        f"<text x='{middle}' y='{HEIGHT - 10}' text-anchor='middle' {_STYLE}>focal length f, mm</text>",
        f"<text x='{LEFT}' y='{TOP - 10}' {_STYLE}>pixels per radian = {equation}</text>",
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _ticks(low: float, high: float) -> list[float]:
    """Round numbers from low to at least high, four to ten of them."""
    rough = (high - low) / 6
    power = 10 ** math.floor(math.log10(rough))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= rough)
    return [low + step * number for number in range(math.ceil((high - low) / step) + 1)]
