"""Printed digits on drums, wheels or dot matrices, read by the print that the panel's pictures show.

Each cell is compared with everything that it may show. It is read if it matches one place clearly better than any
other, and no residual is left that may be a stroke of an unknown digit. On drums that roll, each higher drum must stand
where the next lower one puts it: it moves only while the lower one turns from 9 to 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from decoder.imaging.alignment import IDENTITY, Alignment
from decoder.imaging.resampling import inside
from decoder.imaging.thresholds import HALF, TRUSTED_SIGMAS
from decoder.imaging.unwrapping import UnwrappedGauge, Unwrapper, WindowGrid
from decoder.instruments.appearance import DrawnInstrument, Look
from decoder.instruments.kinds.windows.printed_strips import DIGITS, Cells, Compared, Print, first_print
from decoder.instruments.kinds.windows.window import UNIFORM_SIGMA, WindowKind
from decoder.instruments.reading import Reading, Status
from decoder.instruments.thresholds import CLEAR_PART, CLEARLY_WORSE, HALF_LIT, LEAST_SHARPNESS
from decoder.matching.thresholds import MIN_LIGHT_GAIN
from decoder.panel.arrays import Floats, Mask
from decoder.panel.errors import PanelError
from decoder.panel.gauge import Gauge
from decoder.panel.kinds.printed import Printed, drums_at
from decoder.panel.kinds.straight import Corners
from decoder.panel.thresholds import LEAST_VALUE
from decoder.panel.window import check_corners
from decoder.registration.thresholds import SCORE_THRESHOLD

MARK_PX = 0.5
TOGETHER = 6.0


class PrintedReader:
    """Reads one row of printed digits; a row of its window is `row_px` pixels of the panel picture."""

    def __init__(self, printed: Printed, known: Print, row_px: float) -> None:
        self._printed, self._print, self._row_px = printed, known, row_px
        self._least = np.where(known.is_complete, HALF_LIT, CLEAR_PART)
        self._is_told = known.whole.all(axis=1) | (known.sharpness >= LEAST_SHARPNESS)

    def read(self, windows: Floats, place_sigmas_px: Floats) -> list[dict[str, Reading]]:
        """Read F frames of its window, (F, R, C)."""
        seen = self._print.compared(windows)
        places, scores, is_sure = self._places(seen)
        own = self._printed
        counts, agrees = counted(places)
        statuses: Mask = np.asarray(is_sure.all(axis=1))
        if own.rolls is None:
            values: Floats = np.rint(counts) * own.step
            sigmas: Floats = np.full(len(values), 0.0 if own.text else UNIFORM_SIGMA * own.step)
        else:
            statuses, values = statuses & agrees, counts
            sigmas = np.hypot(self._sigmas_px(scores[:, -1]), place_sigmas_px) / (self._print.pitch * self._row_px)
            sigmas = np.hypot(sigmas, UNIFORM_SIGMA / DIGITS)  # pictures' counts are given to a tenth of a digit
            # Drums at zero are found slightly below it as often as above, which must not become the highest count.
            turn = float(DIGITS) ** places.shape[1]
            values = np.where(counts + TRUSTED_SIGMAS * sigmas >= turn, 0.0, counts)
        return [
            {own.name: Reading(Status.READ if sure else Status.MISSING, value, sigma, score)}
            for sure, value, sigma, score in zip(
                statuses.tolist(), values.tolist(), sigmas.tolist(), scores.min(axis=1).tolist(), strict=True
            )
        ]

    def _places(self, seen: Compared) -> tuple[Floats, Floats, Mask]:
        """(F, D) each: where cells stand, in digits, how well they match there, and whether that is certain."""
        places = self._print.looks.places
        step = places[1] - places[0]
        best = seen.scores.argmax(axis=2)
        scores = np.take_along_axis(seen.scores, best[..., None], axis=2)[..., 0]
        apart = np.abs(places[:, None] - places)
        is_other = np.minimum(apart, DIGITS - apart) > HALF
        rivals = np.where(is_other[best], seen.scores, 0.0).max(axis=2)
        sure = (scores >= SCORE_THRESHOLD) & (1 - rivals**2 >= CLEARLY_WORSE * (1 - scores**2))
        sure &= (seen.strays <= self._least) & self._is_told
        sure &= seen.gains >= MIN_LIGHT_GAIN * np.abs(self._print.contrast)
        found = places[best]
        if self._printed.rolls is not None:
            before, after = (
                np.take_along_axis(seen.scores, ((best + side) % len(places))[..., None], axis=2)[..., 0]
                for side in (-1, 1)
            )
            bend = 2 * scores - before - after
            is_between = (before > 0) & (after > 0) & (bend > LEAST_VALUE)
            found = (
                found + np.where(is_between, step * (after - before) / (2 * np.where(bend > 0, bend, 1.0)), 0.0)
            ) % DIGITS
        return found, scores, sure

    def _sigmas_px(self, scores: Floats) -> Floats:
        """(F,): the uncertainty of how far a drum with this score has rolled."""
        rows, columns = self._print.cells.size
        steep = self._print.steepness
        left = np.sqrt(np.maximum(1 - scores**2, 0.0)) / np.maximum(scores, LEAST_VALUE)
        return np.hypot(left * math.sqrt(TOGETHER / (rows * columns)) / steep * self._row_px, MARK_PX)


def counted(places: Floats) -> tuple[Floats, Mask]:
    """(F,) each: the count that drums at places (F, D) show, and whether each is where the next lower one puts it."""
    counts, agrees = places[:, -1].copy(), np.ones(len(places), bool)
    moved = np.maximum(places[:, -1] - (DIGITS - 1), 0.0)
    for power, place in enumerate(places[:, -2::-1].T, 1):
        digit = np.rint(place - moved)
        # half of half a digit: beyond half a digit, a drum is nearer to the next one
        agrees &= np.abs(place - moved - digit) <= HALF / 2
        digit %= DIGITS
        counts += digit * DIGITS**power
        moved = np.where(digit == DIGITS - 1, moved, 0.0)
    return counts, agrees


class PrintedKind(WindowKind):
    """Printed digits, on drums or not."""

    def owns(self, gauge: Gauge) -> bool:
        return gauge.printed is not None

    def first_look(self, drawn: DrawnInstrument) -> Look:
        own = _printed(drawn.gauge)
        windows = [drawn.strip, *(_taught_by(drawn, place) for place in range(len(own.also)))]
        return Look(drawn.strip, pictures={own.name: print_of(own, drawn.window, windows)})

    def first(self, gauge: Gauge, grid: WindowGrid, drawn: UnwrappedGauge) -> Print:
        return print_of(_printed(gauge), grid, [drawn])

    def learned(self, _: Gauge, __: WindowGrid, ___: Sequence[UnwrappedGauge], known: Print) -> Print:
        return known  # frames do not come with the digits they show

    def window_reader(self, gauge: Gauge, grid: WindowGrid, picture: Print) -> PrintedReader:
        return PrintedReader(_printed(gauge), picture, grid.cell_px[1])


def print_of(own: Printed, grid: WindowGrid, windows: Sequence[UnwrappedGauge]) -> Print:
    """Build the print from windows in pictures, the panel picture's first."""
    cells = Cells.within(windows[0], own.before, own.gap, is_turned=own.rolls == "down")
    given = grid.rows if own.pitch is None else own.pitch / grid.cell_px[1]
    places = drums_at(np.array(own.shown_counts()[: len(windows)]), len(own.before))
    return first_print(cells, np.stack(windows), places, None if own.rolls is None else given)


def _taught_by(drawn: DrawnInstrument, place: int) -> UnwrappedGauge:
    """Return the window in another picture of the panel, on the same samples.

    Raises
    ------
    PanelError
        If that picture does not show the window.
    """
    taught, source, path = (
        _printed(drawn.gauge).also[place],
        drawn.source,
        f"gauges[{drawn.index}].printed.also[{place}]",
    )
    picture = source.pictures[taught.picture]
    height, width = picture.shape
    is_alike = picture.shape == source.picture.shape
    if taught.window is None and not is_alike:
        raise PanelError(path, "is a picture of another size than the panel picture: give its `window`")
    corners, optics = taught.window or drawn.window.corners, source.optics.own if is_alike else IDENTITY
    found = source.places.get(taught.picture)
    is_near = found is not None and (taught.window is None or _is_near(corners, found, drawn.window))
    if found is not None and is_near and inside(drawn.window.rim(), found, width, height):
        corners, optics = drawn.window.corners, found
    try:
        grid = replace(drawn.window, corners=check_corners(corners))
    except ValueError as error:
        raise PanelError(f"{path}.window", str(error)) from error
    if not inside(grid.rim(), optics, width, height):
        raise PanelError(path, f"has a window outside its {width} x {height} picture; check where it is drawn")
    return Unwrapper([grid]).unwrap(picture, optics, partial(source.in_colour, taught.picture))[0]


def _is_near(corners: Corners, found: Alignment, window: WindowGrid) -> bool:
    """Whether a window drawn by hand is near the panel's window in a picture: then the latter is more exact."""
    there = np.array([found.to_frame(corner) for corner in window.corners])
    height_px = math.dist(there[0], there[-1])
    return float(np.abs(np.array(corners) - there).max()) <= HALF * height_px


def _printed(gauge: Gauge) -> Printed:
    if gauge.printed is None:
        raise AssertionError(f"{gauge.name} has no printed digits")
    return gauge.printed
