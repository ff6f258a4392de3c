"""Tuning: fits the panel's description to one flight, from a sample of its own frames.

A template cut from one picture carries that picture's noise, and whatever happens to lie behind the needle there,
into every reading. The median of the same needle in many frames, each turned back by its own reading, is free of
both; where the frames disagree (marks and numerals passing behind the needle) a pixel loses its weight. Searches
start where the camera mostly was.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decoder.alignment import Alignment
from decoder.errors import PictureError
from decoder.needle_template import NeedleTemplate
from decoder.panel import Gauge
from decoder.panel_reader import FrameReadings, PanelReader
from decoder.pictures import GreyPicture
from decoder.reading import Status
from decoder.unwrapping import PolarGrid, Unwrapper

Floats = NDArray[np.float32]

SAMPLE_FRAMES = 32
ROUNDS = 2
MIN_CUTS = 5
MAD_TO_SIGMA = 1.4826
# Spread of a pixel over the frames that is plain sensor and JPEG noise, in grey levels at the panel picture's contrast.
NOISE_LEVELS = 4.0


@dataclass(frozen=True, slots=True)
class _Sample:
    frame: GreyPicture
    found: FrameReadings


def tune(reader: PanelReader, frames: Iterable[GreyPicture]) -> PanelReader:
    """The reader fitted to the flight that the frames are a sample of; with too few usable frames, as it was."""
    pictures = list(frames)
    for _ in range(ROUNDS):
        samples = _read(reader, pictures)
        if not samples:
            break
        templates = dict(reader.templates)
        for gauge, grid in zip(reader.source.panel.gauges, reader.grids, strict=True):
            for needle in gauge.needles:
                cuts = _cuts(gauge, needle.name, grid, templates, samples)
                if len(cuts) >= MIN_CUTS:
                    templates[needle.name] = _refined(templates[needle.name], cuts)
        reader = reader.tuned(templates, _usual([sample.found.alignment for sample in samples]))
    return reader


def _read(reader: PanelReader, frames: Sequence[GreyPicture]) -> list[_Sample]:
    samples = []
    for frame in frames:
        try:
            samples.append(_Sample(frame, reader.read(frame)))
        except PictureError:
            continue  # the frame itself is reported when the flight is read
    return samples


def _usual(alignments: Sequence[Alignment]) -> Alignment:
    """The median alignment."""
    columns = np.array([[a.roll_deg, *a.offset_px, a.score] for a in alignments])
    roll_deg, x, y, score = (float(value) for value in np.median(columns, axis=0))
    return Alignment(roll_deg, (x, y), score)


def _cuts(
    gauge: Gauge,
    name: str,
    grid: PolarGrid,
    templates: Mapping[str, NeedleTemplate],
    samples: Sequence[_Sample],
) -> list[Floats]:
    """The needle as the frames show it, each with its axis in the middle row, free of the gauge's other needles."""
    template = templates[name]
    others = [needle.name for needle in gauge.needles if needle.name != name]
    cuts = []
    for sample in samples:
        reading = sample.found.readings[name]
        if reading.status is not Status.READ:
            continue
        reach_deg = template.rows * template.step_deg / 2
        if any(
            abs(sample.found.readings[other].angle_deg - reading.angle_deg)
            < reach_deg + templates[other].half_width_deg
            for other in others
        ):
            continue
        window = grid.at(reading.angle_deg, template.rows)
        cuts.append(_like(template, Unwrapper([window]).unwrap(sample.frame, sample.found.alignment)[0]))
    return cuts


def _like(template: NeedleTemplate, cut: Floats) -> Floats:
    """A cut brought to the template's contrast and brightness."""
    weights = template.weights
    total = weights.sum()
    pixels = template.pixels - (weights * template.pixels).sum() / total
    mean = (weights * cut).sum() / total
    gain = (weights * pixels * (cut - mean)).sum() / (weights * pixels * pixels).sum()
    like: Floats = (cut - mean) / max(gain, 0.1) + (template.pixels - pixels)
    return like


def _refined(template: NeedleTemplate, cuts: Sequence[Floats]) -> NeedleTemplate:
    stack = np.stack(cuts)
    pixels = np.median(stack, axis=0)
    spread = MAD_TO_SIGMA * np.median(np.abs(stack - pixels), axis=0)
    weights = NOISE_LEVELS**2 / (NOISE_LEVELS**2 + spread**2)
    return NeedleTemplate(pixels.astype(np.float32), weights.astype(np.float32), template.step_deg)
