"""The alignment over the flight: where the panel lay, how well it was found, and which anchors failed how often."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decoder.arrays import Floats
from decoder.flight_data import FlightData


@dataclass(frozen=True, slots=True)
class AlignmentTrack:
    """One curve: its name, its unit, a size below which a change is none, and (N,) values, NaN where lost."""

    name: str
    unit: str
    least: float
    values: Floats


TRACKS = (
    ("score", "NCC", 0.01),
    ("shift right", "px", 0.2),
    ("shift down", "px", 0.2),
    ("roll", "deg", 0.02),
    ("scale", "", 0.0005),
)


def alignment_tracks(data: FlightData, size_px: tuple[int, int]) -> list[AlignmentTrack]:
    """The curves; none if nobody kept the alignments.

    Parameters
    ----------
    size_px : width and height of the panel picture, at whose middle they are taken
    """
    if not data.alignments:
        return []
    middle = ((size_px[0] - 1) / 2, (size_px[1] - 1) / 2)
    values = np.full((len(TRACKS), len(data.frame)), np.nan)
    for row in range(len(data.frame)):
        alignment = data.alignments[row]
        if alignment is not None:
            motion = alignment.motion_at(middle)
            values[:, row] = alignment.score, *motion.shift_px, motion.roll_deg, motion.scale
    return [AlignmentTrack(name, unit, least, own) for (name, unit, least), own in zip(TRACKS, values, strict=True)]
