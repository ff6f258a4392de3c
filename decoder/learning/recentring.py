"""A reader around other pivots than those that its panel gives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from decoder.imaging.alignment import Alignment, Point
from decoder.imaging.planes import DialPlane
from decoder.instruments.panel_reader import PanelReader
from decoder.learning.panel_appearance import appearance_from_panel
from decoder.panel.gauge import Gauge
from decoder.registration.frame_placer import UnwrappedPanel
from decoder.registration.placement import Placement

Vector = tuple[float, float]


def around_pivots(
    reader: PanelReader,
    steps_px: Sequence[Vector | None],
    *,
    drawn: Sequence[Gauge],
    lifts_missing: Sequence[float] = (),
) -> PanelReader:
    """Return a reader of the panel with its pivots some steps on, which has learned nothing around them yet.

    Parameters
    ----------
    steps_px
        By gauge, in its dial's own plane; None for a pivot that stays.
    drawn
        The gauges, with angles as they are seen from their pivots; their centres are not looked at.
    lifts_missing
        By gauge how far its needles go beyond its dial, besides what is known; none if nothing is missing.
    """
    source, placed, own = reader.source, reader.placement, reader.source.optics.own
    lifts = placed.lifts or (0.0,) * len(steps_px)
    planes = source.planes or (None,) * len(steps_px)
    gauges = [
        each.model_copy(update={"centre": gauge.centre if step is None else _moved(gauge.centre, plane, own, step)})
        for each, gauge, plane, step in zip(drawn, source.panel.gauges, planes, steps_px, strict=True)
    ]
    placement = Placement(
        usual=placed.usual,
        dials_move=placed.dials_move,
        anchors_agree=placed.anchors_agree,
        lifts=tuple(lift + more for lift, more in zip(lifts, lifts_missing, strict=False)),
    )
    moved = replace(
        source,
        panel=source.panel.model_copy(update={"gauges": tuple(gauges)}),
        planes=tuple(
            plane if plane is None or step is None else plane.around(step)
            for plane, step in zip(planes, steps_px, strict=True)
        ),
    )
    unwrapped = UnwrappedPanel(moved)
    return PanelReader.of(moved, reader.method, appearance_from_panel(unwrapped), placement, unwrapped)


def _moved(centre: Point, plane: DialPlane | None, own: Alignment, step_px: Vector) -> Point:
    """Move a gauge's centre by a step that is told in the dial's own plane."""
    if plane is None:
        return centre[0] + step_px[0], centre[1] + step_px[1]
    there = plane.to_panel(np.array(step_px)[:, None])[:, 0]
    return own.to_frame((float(there[0]), float(there[1])))
