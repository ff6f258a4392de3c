"""The colour of each status, the same in every output: told apart by colour-blind eyes, on dark and light dials."""

from __future__ import annotations

from decoder.reading import Status

Colour = tuple[int, int, int]
"""Red, green, blue, 0 to 255."""

STATUS_COLOURS: dict[Status, Colour] = {
    Status.READ: (38, 210, 150),
    Status.EDGE: (86, 190, 245),
    Status.HIDDEN: (222, 150, 216),
    Status.INTERPOLATED: (245, 180, 40),
    Status.MISSING: (250, 100, 70),
}
