"""Fitting a reader to a flight: needles and dials as its own frames show them, and pivots where its needles turn.

Also what is left of both: how far all readings of a needle may be off together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from decoder.alignment import Alignment
from decoder.arrays import Floats
from decoder.dial_plane import DialPlane
from decoder.flight_tuning import tune_on, unwrapped
from decoder.gauge import Gauge
from decoder.panel_reader import PanelReader, UnwrappedFrame
from decoder.pictures import FramePicture, GreyPicture
from decoder.pivots import Pivot, pivot_of

# A panel drawn on a picture is good to about a tenth of a pixel, at the needle's mean radius.
PANEL_PRECISION_PX = 0.1
ROUNDS = 4
# A pivot that had to be moved is moved again until it is right to this: the first step falls a little short.
SETTLED_PX = 0.03

Sample = Callable[[], Iterable[GreyPicture | FramePicture]]


@dataclass(frozen=True, slots=True)
class FittedReader:
    """A reader fitted to a flight.

    Attributes
    ----------
    pivots
        By the gauges' order in the panel: what is still to be thought of each pivot.
    moved_px
        By gauge, for those whose needles turn elsewhere than the panel says: (x, y).
    """

    reader: PanelReader
    pivots: tuple[Pivot, ...]
    moved_px: Mapping[str, tuple[float, float]]

    def systematic_deg(self, name: str, angles_deg: Floats) -> Floats:
        """(N,): what all readings of a needle at these angles may be off by together, a standard uncertainty."""
        ((gauge, pivot),) = (
            (gauge, pivot)
            for gauge, pivot in zip(self.reader.source.panel.gauges, self.pivots, strict=True)
            if name in [quantity.name for quantity in gauge.quantities]
        )
        radius_px = sum(gauge.radius) / 2
        drawn_deg = math.degrees(PANEL_PRECISION_PX / radius_px)
        needles = [needle for needle in gauge.needles if needle.name == name]
        if not needles:  # a card is read all round: beside its pivot one half makes up for the other
            return np.full_like(angles_deg, drawn_deg)
        at = needles[0].template.at
        zero_deg = sum(gauge.sweep) / 2 if at is None else at
        off: Floats = np.hypot(drawn_deg, pivot.sigma_deg(angles_deg, zero_deg, radius_px))
        return off


def fit_to_flight(reader: PanelReader, sample: Sample) -> FittedReader:
    """The reader fitted to the flight of which `sample` gives some frames, the same each time it is called."""
    drawn = reader.source.panel.gauges
    for _ in range(ROUNDS):
        samples = unwrapped(reader, sample())
        tuned = tune_on(reader, samples)
        pivots = _pivots(tuned, samples)
        gauges = _moved(tuned, drawn, pivots)
        if gauges == reader.source.panel.gauges:
            break
        planes = tuple(
            plane if plane is None or gauge == before else plane.around(pivot.offset_px)
            for gauge, before, plane, pivot in zip(
                gauges, tuned.source.panel.gauges, _planes(tuned), pivots, strict=True
            )
        )
        panel = reader.source.panel.model_copy(update={"gauges": gauges})
        reader = PanelReader.from_panel(replace(reader.source, panel=panel, planes=planes), reader.method)
    now = tuned.source.panel.gauges
    moved = {
        gauge.name: (gauge.centre[0] - before.centre[0], gauge.centre[1] - before.centre[1])
        for gauge, before in zip(now, drawn, strict=True)
        if gauge.centre != before.centre
    }
    return FittedReader(tuned, pivots, moved)


def _pivots(reader: PanelReader, samples: Sequence[UnwrappedFrame]) -> tuple[Pivot, ...]:
    found = [reader.read_unwrapped(sample).readings for sample in samples]
    return tuple(
        pivot_of(
            gauge,
            grid,
            face,
            reader.tuning.templates,
            [(sample.gauges[index], readings) for sample, readings in zip(samples, found, strict=True)],
        )
        for index, (gauge, grid, face) in enumerate(
            zip(reader.source.panel.gauges, reader.grids, reader.tuning.faces, strict=True)
        )
    )


def _planes(reader: PanelReader) -> Sequence[DialPlane | None]:
    return reader.source.planes or (None,) * len(reader.grids)


def _moved(reader: PanelReader, drawn: Sequence[Gauge], pivots: Sequence[Pivot]) -> tuple[Gauge, ...]:
    """The gauges with their pivots where needles turn; one that is right to what can be drawn stays as it is drawn."""
    own = reader.source.optics.own
    return tuple(
        _around(gauge, plane, own, pivot) if _is_off(pivot, was_moved=gauge != before) else gauge
        for gauge, before, plane, pivot in zip(reader.source.panel.gauges, drawn, _planes(reader), pivots, strict=True)
    )


def _is_off(pivot: Pivot, *, was_moved: bool) -> bool:
    distance_px = math.hypot(*pivot.offset_px)
    return distance_px > SETTLED_PX if was_moved else distance_px > PANEL_PRECISION_PX and pivot.is_certain


def _around(gauge: Gauge, plane: DialPlane | None, own: Alignment, pivot: Pivot) -> Gauge:
    """The gauge around its true pivot, which is told in the dial's own plane."""
    if plane is None:
        (x, y), (right, down) = gauge.centre, pivot.offset_px
        return gauge.model_copy(update={"centre": (x + right, y + down)})
    there = plane.to_panel(np.array(pivot.offset_px)[:, None])[:, 0]
    return gauge.model_copy(update={"centre": own.to_frame((float(there[0]), float(there[1])))})
