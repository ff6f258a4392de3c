"""The PyPI package ppf.angauge on the dials of a panel: what a user would get with it, set up as well as we can.

It thresholds the dial's brightness, floods from an inner ring outward, and takes the mean angle of what it reached. It
knows no alignment, so it sees each dial where the panel has it; the threshold lies midway between needle and dial in
the panel picture. Our scale turns its angle into a value.
"""

from __future__ import annotations

import io
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from ppf.angauge import read_single_gauge

from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.pictures import GreyPicture
from decoder.panel.gauge import Gauge
from decoder.panel.scale import FULL_CIRCLE_DEG, Scale

Floats = NDArray[np.float64]


def values_by_needle(source: PanelPictures, jpegs: Iterable[bytes]) -> dict[str, Floats]:
    """By needle (frames,) values, NaN where nothing was found; of the gauges with one needle."""
    gauges = [gauge for gauge in source.panel.gauges if len(gauge.needles) == 1]
    settings = [_threshold(gauge, source.picture) for gauge in gauges]
    rows = []
    for jpeg in jpegs:
        picture = np.asarray(Image.open(io.BytesIO(jpeg)).convert("RGB"))
        rows.append([_value(gauge, picture, setting) for gauge, setting in zip(gauges, settings, strict=True)])
    return {gauge.needles[0].name: column for gauge, column in zip(gauges, np.array(rows).T, strict=True)}


def _threshold(gauge: Gauge, picture: GreyPicture) -> dict[str, object]:
    """Midway between the needle and the median of its dial, and which of them is brighter."""
    at_deg = gauge.needles[0].template.at
    if at_deg is None:
        raise SystemExit(f"{gauge.name}: ppf.angauge is set up with `template.at`, which this panel does not give")
    inner, outer = gauge.radius
    radii = np.linspace(inner + 0.2 * (outer - inner), inner + 0.7 * (outer - inner), 30)
    needle = float(np.median(_levels(picture, gauge, np.radians([at_deg]), radii)))
    start, end = np.radians(gauge.sweep)
    dial = float(np.median(_levels(picture, gauge, np.linspace(start, end, 181), radii)))
    return {"method": "global", "offset": (needle + dial) / 2, "invert": needle < dial}


def _levels(picture: GreyPicture, gauge: Gauge, angles: Floats, radii: Floats) -> NDArray[np.uint8]:
    x = np.rint(gauge.centre[0] + np.cos(angles)[:, None] * radii).astype(int)
    y = np.rint(gauge.centre[1] + np.sin(angles)[:, None] * radii).astype(int)
    levels: NDArray[np.uint8] = picture[y, x]
    return levels


def _value(gauge: Gauge, picture: NDArray[np.uint8], threshold: dict[str, object]) -> float:
    """In its angles 0 is up; NaN where it finds no needle, or one outside the sweep."""
    half = round(gauge.radius[1])
    left, top = round(gauge.centre[0]) - half, round(gauge.centre[1]) - half
    try:
        up_deg = read_single_gauge(
            picture, left, top, 2 * half, gray_to_bw=threshold, theta_range=FULL_CIRCLE_DEG, value_max=FULL_CIRCLE_DEG
        )["value"]
    except ValueError:
        return float("nan")
    first = gauge.sweep[0]
    angle_deg = first + (up_deg - 90.0 - first) % FULL_CIRCLE_DEG
    if angle_deg > gauge.sweep[1]:
        return float("nan")
    return float(Scale.of(gauge.scale, gauge.wraps).values_at(np.array([angle_deg]))[0])
