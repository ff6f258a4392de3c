"""The trial: one gauge of a draft read in some frames spread over the flight, exactly as `decode` would read it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from decoder.alignment import Alignment
from decoder.errors import PictureError
from decoder.flight_fitting import fit_to_flight
from decoder.method import Method
from decoder.panel_pictures import PanelPictures
from decoder.panel_reader import PanelReader
from decoder.pictures import FramePicture
from decoder.reading import Reading, Status
from decoder.scale import Scale
from decoder.setup.needle_axis import axis_deg
from flight_file.sampling import spread

Stale = Callable[[], bool]
# Fewer frames tell no more of a needle than the panel picture does.
MIN_LEARNED_FROM = 8


class Superseded(Exception):
    """A later change made this trial pointless."""


@dataclass(frozen=True, slots=True)
class NeedleTrial:
    """One needle in one frame; `value` is None where it has none."""

    name: str
    status: Status
    value: float | None
    angle_deg: float | None
    score: float


@dataclass(frozen=True, slots=True)
class FrameTrial:
    """One frame: where the panel lies in it, or why it was not found."""

    index: int
    alignment: Alignment | None
    reason: str
    needles: tuple[NeedleTrial, ...]


@dataclass(frozen=True, slots=True)
class Trial:
    """A gauge read in all frames.

    Attributes
    ----------
    moved_px
        How far from its drawn centre its needles really turn.
    axes_deg
        How far the axis of each needle, as all frames together show it, lies from where it is drawn.
    """

    frames: tuple[FrameTrial, ...]
    moved_px: tuple[float, float] | None
    axes_deg: Mapping[str, float]


def tried(source: PanelPictures, frames: Sequence[tuple[int, FramePicture]], stale: Stale) -> Trial:
    """Reads the only gauge of a panel in some frames.

    Parameters
    ----------
    frames : with their numbers in the flight
    stale : asked between frames; whether nobody waits for the answer any more

    Raises
    ------
    PanelError
        If the panel does not fit its picture.
    Superseded
        If nobody waits for the answer.
    """

    def sample(count: int) -> Iterator[FramePicture]:
        for index in sorted(spread(len(frames), count)):
            if stale():
                raise Superseded
            yield frames[index][1]

    (gauge,) = source.panel.gauges
    fitted = fit_to_flight(PanelReader.from_panel(source, Method.NORMXCORR), sample)
    scales = {each.name: Scale.of(each.marks, each.wraps) for each in gauge.quantities}
    found = []
    for index, frame in frames:
        if stale():
            raise Superseded
        found.append(_frame(fitted.reader, index, frame, scales))
    axes_deg = _axes_deg(fitted.reader) if len(frames) >= MIN_LEARNED_FROM else {}
    return Trial(tuple(found), fitted.moved_px.get(gauge.name), axes_deg)


def _axes_deg(reader: PanelReader) -> dict[str, float]:
    """The axes of the needles that were learned from the flight, from the angles that count as theirs."""
    (gauge,), (grid,), (face,) = reader.source.panel.gauges, reader.grids, reader.tuning.faces
    dial = np.median(face, axis=0)
    found = {}
    for needle in gauge.needles:
        learned = reader.tuning.templates[needle.name]
        added = learned.light + (learned.transparency - 1.0) * dial
        around = replace(grid, start_deg=-(learned.rows - 1) / 2 * learned.step_deg, rows=learned.rows)
        found[needle.name] = axis_deg(added, around, 0.0)
    return found


def _frame(reader: PanelReader, index: int, frame: FramePicture, scales: dict[str, Scale]) -> FrameTrial:
    try:
        read = reader.read(frame.pixels, frame.focal_length_mm)
    except PictureError as error:
        return FrameTrial(index, None, str(error), ())
    needles = tuple(_needle(name, reading, scales[name]) for name, reading in read.readings.items())
    return FrameTrial(index, read.alignment, "", needles)


def _needle(name: str, reading: Reading, scale: Scale) -> NeedleTrial:
    if reading.status is Status.MISSING or not math.isfinite(reading.angle_deg):
        return NeedleTrial(name, Status.MISSING, None, None, reading.score)
    value = float(scale.values_at(np.array([reading.angle_deg]))[0])
    return NeedleTrial(name, reading.status, value, reading.angle_deg, reading.score)
