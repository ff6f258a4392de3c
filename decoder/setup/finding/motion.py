"""What moves between frames: how far a ring of a dial is turned in each of them, and whether hands turn on it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from decoder.imaging.pictures import GreyPicture
from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import Unwrapper
from decoder.setup.dial_edges import Rim
from decoder.setup.drawn_plane import away
from decoder.setup.finding.strokes import strokes_in
from decoder.setup.finding.thresholds import LONG_PART, NEAR_PART
from decoder.setup.proposals import Dial, Pictures


def hands_turn(laid: Sequence[GreyPicture], still: GreyPicture, rim: Rim, radius_px: float) -> bool:
    """Whether what moves on a dial points at its pivot, as a hand does, rather than being a bar from elsewhere.

    Parameters
    ----------
    laid : (H, W) each: frames aligned with the panel picture
    still : (H, W): what does not move
    """
    (x, y), reach = rim.centre, round(radius_px)
    left, top = max(round(x) - reach, 0), max(round(y) - reach, 0)
    window = slice(top, round(y) + reach + 1), slice(left, round(x) + reach + 1)
    aiming, all_of_them = 0.0, 0.0
    for frame in laid:
        changed = np.abs(frame[window].astype(np.int16) - still[window]).astype(np.uint8)
        strokes = strokes_in(changed)
        far, miss = strokes.seen_from((x - left, y - top))
        hands = (strokes.length_px > LONG_PART * radius_px) & (far < radius_px)
        all_of_them += float(strokes.length_px[hands].sum())
        aiming += float(strokes.length_px[hands & (miss < NEAR_PART * radius_px)].sum())
    return aiming > HALF * all_of_them and not math.isclose(all_of_them, 0.0)


def turned_deg(seen: Pictures, rim: Rim, ring_px: tuple[float, float]) -> list[tuple[float, float]]:
    """Measure the turn of a ring in each frame, clockwise from the panel picture, and how well it then matches.

    Parameters
    ----------
    ring_px : its inner and outer radius
    """
    dial = Dial(rim.centre, ring_px, (0.0, 360.0), rim.drawn.plane)
    grid = dial.grid(0.0)
    unwrapper = Unwrapper([grid])
    rows = round(360.0 / grid.step_deg)
    own = unwrapper.unwrap(seen.picture, seen.own)[0][:rows]
    spectrum = np.conj(np.fft.rfft(own - own.mean(axis=0), axis=0))
    found = []
    for frame, alignment in seen.frames:
        there = unwrapper.unwrap(frame, alignment)[0][:rows]
        there = there - there.mean(axis=0)
        alike = np.fft.irfft((np.fft.rfft(there, axis=0) * spectrum).sum(axis=1), rows)
        alike /= max(float(np.linalg.norm(there) * np.linalg.norm(own - own.mean(axis=0))), 1e-9)
        best = int(alike.argmax())
        found.append((away(best * grid.step_deg, 0.0), float(alike[best])))
    return found
