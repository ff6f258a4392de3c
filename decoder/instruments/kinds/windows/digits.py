"""Digits: the value that a seven-segment display shows, read cell by cell.

A reading is certain or missing: each cell must match one digit clearly better than any other, and no segment may be
half lit. If a segment is broken, a digit that may be another one without that segment is not read.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from decoder.imaging.unwrapping import UnwrappedGauge, WindowGrid
from decoder.instruments.kinds.windows.display import Display, Row, in_picture
from decoder.instruments.kinds.windows.window import UNIFORM_SIGMA, WindowKind
from decoder.instruments.reading import Reading, Status
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.panel.kinds.digits import Digits

UNREAD = Reading(Status.MISSING, np.nan, np.inf, 0.0)


class DigitsReader:
    """Reads one display; `display` is None if the panel picture does not show it."""

    def __init__(self, digits: Digits, display: Display | None) -> None:
        self._digits, self._display = digits, display

    def read(self, strips: Floats, _: Floats) -> list[dict[str, Reading]]:
        """Read F frames of the window and its surroundings, (F, R, C)."""
        if self._display is None:
            return [{self._digits.name: UNREAD} for _ in strips]
        cells, scores, sure = self._display.read(strips)
        places = 10.0 ** np.arange(cells.shape[1])[::-1]
        resolution = self._digits.written.resolution
        values = np.maximum(cells, 0) @ places * resolution
        statuses = [Status.READ if one else Status.MISSING for one in sure.tolist()]
        # A value is rounded or truncated to its last digit; text is exact.
        sigma = 0.0 if self._digits.text else UNIFORM_SIGMA * resolution
        return [
            {self._digits.name: Reading(status, value, sigma, score)}
            for status, value, score in zip(statuses, values.tolist(), scores.tolist(), strict=True)
        ]


class DigitsKind(WindowKind):
    """A seven-segment display."""

    def owns(self, gauge: Gauge) -> bool:
        return gauge.digits is not None

    def first(self, gauge: Gauge, grid: WindowGrid, drawn: UnwrappedGauge) -> Display | None:
        own = _digits(gauge)
        row = Row(own.symbols, np.array(own.before, float), own.points, np.array(own.may_be_blank))
        return in_picture(drawn, row, grid.margin)

    def learned(
        self, _: Gauge, __: WindowGrid, strips: Sequence[UnwrappedGauge], known: Display | None
    ) -> Display | None:
        return known.taught(np.stack(strips)) if known is not None and strips else known

    def window_reader(self, gauge: Gauge, _: WindowGrid, picture: Display | None) -> DigitsReader:
        return DigitsReader(_digits(gauge), picture)


def _digits(gauge: Gauge) -> Digits:
    if gauge.digits is None:
        raise AssertionError(f"{gauge.name} shows no digits")
    return gauge.digits
