"""Focus: how much less sharp a flight's frames are than the panel picture, which is then blurred to match.

A needle cut from a sharper picture matches a blurred one badly, and a thin one not at all. The panel picture may be
taken on the ground with another camera, and the flight through a lens out of focus, a dusty glass, or with fewer
pixels. The blur is measured by how much of each spatial frequency of a dial reaches the frames: over a few frequencies,
any lens blurs like a Gaussian. Noise, light and needles that moved change all frequencies alike. Cards and horizons do
not, and are left out. A dial slightly off its place only shifts the phases within each sector, which are ignored.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from decoder.imaging.sorting import MAD_TO_SIGMA
from decoder.imaging.unwrapping import PolarGrid, UnwrappedGauge
from decoder.instruments.panel_reader import PanelReader, appearance_from_panel
from decoder.matching.correlation import Spectrum
from decoder.matching.thresholds import FADED_PART, MIN_VIEWS
from decoder.panel.arrays import Floats
from decoder.registration.frame_placer import UnwrappedFrame, UnwrappedPanel
from decoder.registration.thresholds import NOISE_LEVELS, SIGNIFICANT_SIGMAS

SLOWEST_WAVES = 2
"""Waves over a dial's radius; slower ones are light."""


SECTOR_DEG = 60.0
"""A part of a dial in which it lies beside its place in about the same direction."""


def as_sharp_as_frames(reader: PanelReader, samples: Sequence[UnwrappedFrame]) -> PanelReader:
    """Blur the panel's dials as much as the samples are blurred; return the same reader if these are as sharp."""
    gauges = reader.source.panel.gauges
    found = [
        blurs_px2(grid, own, [sample.gauges[index] for sample in samples if sample.whole[index]])
        for index, (grid, own) in enumerate(zip(reader.grids, reader.own_gauges, strict=True))
        if isinstance(grid, PolarGrid) and gauges[index].kind.has_still_face
    ]
    told = [own for own in found if len(own) >= MIN_VIEWS]
    if not told:
        return reader
    each = np.concatenate(told)
    blur_px2 = float(np.median([np.median(own) for own in told]))
    sigma_px2 = MAD_TO_SIGMA * float(np.median(np.abs(each - np.median(each)))) / math.sqrt(len(told))
    # A blur of less than a pixel does not hide a needle, and the panel picture's own noise looks like a little blur.
    if blur_px2 <= max(SIGNIFICANT_SIGMAS * sigma_px2, 1.0):
        return reader
    source = reader.source.as_sharp_as_frames(math.sqrt(blur_px2))
    panel = UnwrappedPanel(source, reader.drawn.aligner)
    return PanelReader.of(
        panel.source, reader.method, appearance_from_panel(panel, reader.appearance), reader.placement, panel
    )


def blurs_px2(grid: PolarGrid, own: UnwrappedGauge, seen: Sequence[UnwrappedGauge]) -> list[float]:
    """Return for each frame the variance of the Gaussian that blurs a dial (R, C) as much; negative if it is sharper.

    It is the slope of the logarithm of the modulation transfer over the square of the frequency, along the radius.
    Frames that show too few frequencies are left out.
    """
    known = _waves(grid, own)
    power = (np.abs(known) ** 2).sum(axis=0)
    per_px = np.fft.rfftfreq(grid.columns - grid.tail_columns, grid.column_px)
    is_seen = power > 2.0 * NOISE_LEVELS**2 * len(own) * (_window(grid) ** 2).sum()
    is_seen[:SLOWEST_WAVES] = False
    count = 1 + int(grid.rows * grid.step_deg / SECTOR_DEG)
    found = []
    for strip in seen:
        sectors = np.array_split(known.conj() * _waves(grid, strip), count)
        transfer = sum(np.abs(sector.sum(axis=0)) for sector in sectors) / np.maximum(power, 1.0)
        usable = is_seen & (transfer > FADED_PART)
        if usable.sum() > 2:  # noqa: PLR2004 - a line through two points fits any
            weights = np.sqrt(power[usable]) * transfer[usable]
            slope, _ = np.polyfit(per_px[usable] ** 2, np.log(transfer[usable]), 1, w=weights)
            found.append(-float(slope) / (2.0 * math.pi**2))
    return found


def _waves(grid: PolarGrid, strip: UnwrappedGauge) -> Spectrum:
    """(R, N) complex: a dial's waves along each radius, from the slowest."""
    outward = strip[:, grid.tail_columns :]
    return np.fft.rfft((outward - outward.mean(axis=1, keepdims=True)) * _window(grid), axis=1)


def _window(grid: PolarGrid) -> Floats:
    """(C,): fades a radius out at both of its ends."""
    return np.hanning(grid.columns - grid.tail_columns + 2)[1:-1]
