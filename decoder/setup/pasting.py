"""Pasting: a panel drawn on one picture carried over to another of the same type of cockpit.

The aligner finds the anchors again; every place of the drawing moves with them, and angles and radii move as each
dial's plane does.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from decoder.imaging.alignment import Alignment
from decoder.imaging.pictures import FramePicture
from decoder.panel.camera import Camera
from decoder.panel.errors import PanelError
from decoder.panel.gauge import KINDS
from decoder.panel.kinds.straight import ACROSS
from decoder.panel.scale import turned
from decoder.registration.aligner import Aligner
from decoder.setup.drawn_plane import XY, DrawnPlane, Planes, away, mean_radius_px


@dataclass(frozen=True, slots=True)
class Pasted:
    """A draft on another picture, and how far everything moved: the picture's middle in pixels, and the roll."""

    document: dict[str, Any]
    offset_px: XY
    roll_deg: float
    score: float


def pasted(
    document: Mapping[str, Any],
    aligner: Aligner,
    target: FramePicture,
    angles_deg: Mapping[str, float],
    camera: Camera | None = None,
) -> Pasted:
    """Carry a draft to another picture.

    Parameters
    ----------
    document
        The content of a `panel.yaml`, in pixels of the picture the aligner was made with.
    target
        The other picture, of the same size.
    angles_deg
        What is read there, by name, in the draft's own angles; what is not read keeps its angle.
    camera
        That took both pictures, if known.

    Raises
    ------
    AlignmentLost
        If the panel is not found there.
    """
    alignment = aligner.align(target.pixels, target.focal_length_mm)
    height, width = target.pixels.shape
    carried = copy.deepcopy(dict(document))
    if target.focal_length_mm is not None and carried.get("focal_length_mm") is not None:
        carried["focal_length_mm"] = target.focal_length_mm
    try:
        before = Planes.of(document, (width, height), camera)
        _carry(carried, before, _Places(alignment, before), angles_deg)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise PanelError("", "is not whole yet; complete what is marked before it is carried over") from error
    motion = alignment.motion_at((width / 2, height / 2))
    return Pasted(carried, motion.shift_px, motion.roll_deg, alignment.score)


def _carry(carried: dict[str, Any], before: Planes, places: _Places, angles_deg: Mapping[str, float]) -> None:
    for anchor in carried.get("anchors") or []:
        left, top, width, height = anchor["box"]
        x, y = places.point((left + width / 2, top + height / 2))
        anchor["box"] = [round(x - width / 2), round(y - height / 2), width, height]
    if carried.get("level"):
        carried["level"] = [places.point(end) for end in carried["level"]]
    for reference in carried.get("reference_points") or []:
        reference["at"] = places.point(reference["at"])
    after = Planes.of(carried, before.optics.size_px, before.optics.camera)
    for gauge in carried.get("gauges") or []:
        carry_typed(gauge, places.point)
        if gauge.get("window"):
            gauge["window"] = [places.point(corner) for corner in gauge["window"]]
        if gauge.get("window") or "centre" not in gauge:  # its points determine all of it
            continue
        here = before.drawn(tuple(gauge["centre"]), gauge.get("rim"))
        gauge["centre"] = places.point(gauge["centre"])
        if gauge.get("rim"):
            gauge["rim"] = [places.point(at) for at in gauge["rim"]]
        there = after.drawn(tuple(gauge["centre"]), gauge.get("rim"))
        _carry_dial(gauge, here, there, places, angles_deg)


def carry_typed(gauge: dict[str, Any], point: Callable[[Sequence[float]], list[float]]) -> None:
    """Carry the places that were typed for a gauge's kind; values that it showed have to be typed again."""
    for form in (kind.form for kind in KINDS if gauge.get(kind.form.key)):
        for control in form.controls:
            own = gauge[form.key]
            if control.key not in own or control.reads not in ("place", "places", "points", "text"):
                continue
            if control.is_of_moment:
                del own[control.key]
            elif control.reads == "place":
                own[control.key] = _carried(own[control.key], gauge, point)
            elif control.reads == "places":
                own[control.key] = [[_carried(at, gauge, point), value] for at, value in own[control.key]]
            elif control.reads == "points":
                own[control.key] = [[*point((x, y)), value] for x, y, value in own[control.key]]


def _carried(
    at: float | Sequence[float], gauge: Mapping[str, Any], point: Callable[[Sequence[float]], list[float]]
) -> float | list[float]:
    """Carry a point, or the x or y of one in the middle of its window."""
    if not isinstance(at, int | float):
        return point(at)
    kind = next(gauge[each.form.key] for each in KINDS if gauge.get(each.form.key))
    axis = 0 if kind.get("moves") == ACROSS else 1
    middle = [sum(corner[other] for corner in gauge["window"]) / len(gauge["window"]) for other in (0, 1)]
    middle[axis] = at
    return point(middle)[axis]


class _Places:
    """Places of the one picture in the other, both as taken."""

    def __init__(self, alignment: Alignment, before: Planes) -> None:
        self._alignment, self._optics = alignment, before.optics

    def point(self, at: Sequence[float]) -> list[float]:
        x, y = self.place(at)
        return [round(x, 3), round(y, 3)]

    def place(self, at: Sequence[float]) -> XY:
        x, y = self._optics.straight(np.array([[at[0]], [at[1]]], np.float64))[:, 0]
        return self._alignment.to_frame((float(x), float(y)))


def _carry_dial(
    gauge: dict[str, Any], here: DrawnPlane, there: DrawnPlane, places: _Places, angles_deg: Mapping[str, float]
) -> None:
    """Carry a gauge's description of its dial, in the dial's plane; 0 degrees turns unless reference points fix it."""
    outer = gauge["radius"][1]
    middle_deg = sum(gauge["sweep"]) / 2
    ring = np.array([places.place(at) for at in here.ring(outer).T.tolist()]).T
    size = mean_radius_px(there, ring) / outer
    turn = away(there.polar(places.place(here.place(middle_deg, outer)))[0], middle_deg)
    gauge["radius"] = [round(radius * size, 3) for radius in gauge["radius"]]
    for key in ("sweep", "stops"):
        if gauge.get(key):
            gauge[key] = [round(angle + turn, 4) for angle in gauge[key]]
    besides = sum(kind.carry(gauge, turn, size, angles_deg) for kind in KINDS if gauge.get(kind.form.key))
    gauge["scale"] = turned(gauge["scale"], turn + besides)
