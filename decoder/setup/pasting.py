"""Pasting: a panel drawn on one picture carried over to another of the same type of cockpit.

The aligner finds the anchors again; every place of the drawing goes with them, and angles and radii as the places
around them do.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from decoder.aligner import Aligner
from decoder.alignment import Alignment
from decoder.errors import PanelError
from decoder.pictures import GreyPicture

XY = tuple[float, float]
# Angles are carried by a point this far out, in pixels of the panel picture.
ARM_PX = 100.0


@dataclass(frozen=True, slots=True)
class Pasted:
    """A draft on another picture, and how far everything moved: the picture's middle in pixels, and the roll."""

    document: dict[str, Any]
    offset_px: XY
    roll_deg: float
    score: float


def pasted(
    document: Mapping[str, Any], aligner: Aligner, target: GreyPicture, angles_deg: Mapping[str, float]
) -> Pasted:
    """A draft carried to another picture.

    Parameters
    ----------
    document
        The content of a `panel.yaml`, in pixels of the picture the aligner was made with.
    target
        The other picture, of the same size.
    angles_deg
        Where needles point there, by name, in the draft's own angles; others keep the angles of their templates.

    Raises
    ------
    AlignmentLost
        If the panel is not found there.
    """
    alignment = aligner.align(target)
    height, width = target.shape
    middle = (width / 2, height / 2)
    moved = alignment.to_frame(middle)
    carried = _Carried(alignment)
    return Pasted(
        document=carried.draft(document, angles_deg),
        offset_px=(moved[0] - middle[0], moved[1] - middle[1]),
        roll_deg=carried.turned(middle, 0.0),
        score=alignment.score,
    )


class _Carried:
    def __init__(self, alignment: Alignment) -> None:
        self._alignment = alignment

    def point(self, at: Sequence[float]) -> list[float]:
        x, y = self._alignment.to_frame((float(at[0]), float(at[1])))
        return [round(x, 3), round(y, 3)]

    def turned(self, centre: Sequence[float], angle_deg: float) -> float:
        """By how much an angle about a point turns, degrees."""
        x, y = float(centre[0]), float(centre[1])
        angle = math.radians(angle_deg)
        here = self._alignment.to_frame((x, y))
        there = self._alignment.to_frame((x + ARM_PX * math.cos(angle), y + ARM_PX * math.sin(angle)))
        found = math.degrees(math.atan2(there[1] - here[1], there[0] - here[0]))
        return (found - angle_deg + 180.0) % 360.0 - 180.0

    def longer(self, centre: Sequence[float]) -> float:
        """By what factor lengths about a point grow."""
        x, y = float(centre[0]), float(centre[1])
        here = self._alignment.to_frame((x, y))
        return (
            sum(
                math.dist(here, self._alignment.to_frame((x + right, y + down)))
                for right, down in ((ARM_PX, 0.0), (-ARM_PX, 0.0), (0.0, ARM_PX), (0.0, -ARM_PX))
            )
            / 4
            / ARM_PX
        )

    def draft(self, document: Mapping[str, Any], angles_deg: Mapping[str, float]) -> dict[str, Any]:
        carried = copy.deepcopy(dict(document))
        try:
            for anchor in carried.get("anchors") or []:
                left, top, width, height = anchor["box"]
                x, y = self.point((left + width / 2, top + height / 2))
                anchor["box"] = [round(x - width / 2), round(y - height / 2), width, height]
            if carried.get("level"):
                carried["level"] = [self.point(end) for end in carried["level"]]
            for reference in carried.get("reference_points") or []:
                reference["at"] = self.point(reference["at"])
            for gauge in carried.get("gauges") or []:
                self._gauge(gauge, angles_deg)
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise PanelError("", "is not whole yet; complete what is marked before it is carried over") from error
        return carried

    def _gauge(self, gauge: dict[str, Any], angles_deg: Mapping[str, float]) -> None:
        centre = gauge["centre"]
        turn = self.turned(centre, sum(gauge["sweep"]) / 2)
        size = self.longer(centre)
        gauge["centre"] = self.point(centre)
        gauge["radius"] = [round(radius * size, 3) for radius in gauge["radius"]]
        for key in ("sweep", "stops"):
            if gauge.get(key):
                gauge[key] = [round(angle + turn, 4) for angle in gauge[key]]
        if "rim" in gauge:
            gauge["rim"] = [self.point(at) for at in gauge["rim"]]
        gauge["scale"] = _turned(gauge["scale"], turn)
        for needle in gauge["needles"]:
            template = needle["template"]
            if template.get("at") is not None:
                at = angles_deg.get(needle["name"], template["at"])
                template["at"] = round(at + turn, 4)
            if needle.get("scale"):
                needle["scale"] = _turned(needle["scale"], turn)


def _turned(scale: list[list[float]], turn: float) -> list[list[float]]:
    return [[round(angle + turn, 4), value] for angle, value in scale]
