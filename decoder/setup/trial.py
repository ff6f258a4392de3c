"""The trial: one gauge of a draft read in some frames spread over the flight, exactly as `decode` would read it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from decoder.imaging.alignment import Alignment
from decoder.imaging.pictures import FramePicture
from decoder.imaging.unwrapping import PolarGrid
from decoder.instruments.panel_reader import PanelReader, read_frame
from decoder.instruments.reading import Reading, Status
from decoder.learning.fit import fit_to_flight, mistakes, reader_from_panel
from decoder.panel.errors import PictureError
from decoder.panel.scale import Quantity, Scale, in_turn
from decoder.panel.vocabulary import Method
from decoder.setup.drafts import RememberedPanel, Stale, Superseded
from decoder.setup.proposals import axis_deg
from flight_file.reader import spread


@dataclass(frozen=True, slots=True)
class NeedleTrial:
    """One value in one frame, None if there is none; `text` is how it is written, if it is not measured.

    A value that several pointers show together has no line of its own.
    """

    name: str
    status: Status
    value: float | None
    angle_deg: float | None
    score: float
    text: str = ""
    is_together: bool = False


@dataclass(frozen=True, slots=True)
class FrameTrial:
    """One frame: where the panel lies in it, or why it was not found."""

    index: int
    alignment: Alignment | None
    reason: str
    readings: tuple[NeedleTrial, ...]


@dataclass(frozen=True, slots=True)
class Trial:
    """A gauge read in all frames.

    Attributes
    ----------
    moved_px
        How far from its drawn centre its needles really turn.
    findings
        What the gauge's health line would say if this were the flight; empty if it is drawn well.
    axes_deg
        How far the axis of each needle, from all frames together, is from where it is drawn.
    are_points
        Whether its marks were probably drawn as places in the picture rather than as angles.
    mistakes
        Those findings that no better place of anything would mend.
    """

    frames: tuple[FrameTrial, ...]
    moved_px: tuple[float, float] | None
    findings: tuple[str, ...]
    axes_deg: Mapping[str, float]
    are_points: bool = True
    mistakes: tuple[str, ...] = ()


def tried(source: RememberedPanel, frames: Sequence[tuple[int, FramePicture]], stale: Stale) -> Trial:
    """Read the only gauge of a panel in some frames.

    Parameters
    ----------
    frames : with their numbers in the flight
    stale : called between frames; whether nobody waits for the answer any more

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

    fitted = fit_to_flight(reader_from_panel(source, Method.NORMXCORR, source.aligner()), sample)
    (gauge,) = fitted.panel.gauges
    together = [] if gauge.combination is None else [gauge.combination.quantity]
    shown = [(each, each in together) for each in (*together, *gauge.quantities)]
    found = []
    for index, frame in frames:
        if stale():
            raise Superseded
        found.append(_frame(fitted.reader, index, frame, shown))
    axes_deg = _axes_deg(fitted.reader) if len(frames) > 1 else {}
    moved_px, findings = fitted.moved_px.get(gauge.name), fitted.findings[gauge.name]
    return Trial(tuple(found), moved_px, findings, axes_deg, fitted.has_points, tuple(mistakes(gauge)))


def _axes_deg(reader: PanelReader) -> dict[str, float]:
    """Measure the axes of the needles learned from the flight, relative to their nominal angles."""
    (grid,), (face,) = reader.grids, reader.appearance.faces
    if not isinstance(grid, PolarGrid):
        return {}
    dial = np.median(face, axis=0)
    found = {}
    for name, learned in reader.appearance.templates.items():
        added = learned.light + (learned.transparency - 1.0) * dial
        around = replace(grid, start_deg=-(learned.rows - 1) / 2 * learned.step_deg, rows=learned.rows)
        found[name] = axis_deg(added, around, 0.0)
    return found


def _frame(reader: PanelReader, index: int, frame: FramePicture, shown: Sequence[tuple[Quantity, bool]]) -> FrameTrial:
    try:
        read = read_frame(reader, frame)
    except PictureError as error:
        return FrameTrial(index, None, str(error), ())
    readings = tuple(
        replace(_value(quantity, read.readings[quantity.name]), is_together=is_together)
        for quantity, is_together in shown
        if quantity.name in read.readings
    )
    return FrameTrial(index, read.alignment, "", readings)


def _value(quantity: Quantity, reading: Reading) -> NeedleTrial:
    name = quantity.name
    if reading.status is Status.MISSING or not math.isfinite(reading.angle_deg):
        return NeedleTrial(name, Status.MISSING, None, None, reading.score)
    values = Scale.of(quantity.marks, quantity.wraps).values_at(np.array([reading.angle_deg]))
    value = float(values[0] if quantity.wraps is None else in_turn(values, quantity.wraps, quantity.lowest)[0])
    text = "" if quantity.written is None else quantity.written.text_of(value)
    return NeedleTrial(name, reading.status, value, reading.angle_deg, reading.score, text)
