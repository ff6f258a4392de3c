"""The gauge reader: all needles of one unwrapped gauge, the covering ones before those they cover."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from decoder.matching import Match, Matcher
from decoder.needle_template import NeedleTemplate
from decoder.occlusion import MIN_VISIBLE, WHOLE_VISIBLE, covered_mask, uncovered_scores
from decoder.panel import Gauge
from decoder.reading import Reading, Status
from decoder.unwrapping import PolarGrid, UnwrappedGauge, polar_grid

# Found by trial in the thesis (3.2.3), and by others for infrared targets.
SCORE_THRESHOLD = 0.8
# A needle may stand a little beyond the last mark.
BEYOND_SWEEP_DEG = 4.0
MASK_MARGIN_ROWS = 1


class Method(StrEnum):
    """How the best row is found."""

    NORMXCORR = "normxcorr"
    XCORR = "xcorr"


def gauge_grid(gauge: Gauge) -> PolarGrid:
    """The unwrapped gauge's sample points: its sweep, and as much beyond as the widest template needs."""
    widest_deg = max(needle.template.span or 0.0 for needle in gauge.needles)
    beyond_deg = min(BEYOND_SWEEP_DEG, (360.0 - (gauge.sweep[1] - gauge.sweep[0])) / 2) + widest_deg / 2 + 1.0
    return polar_grid(gauge.centre, gauge.radius, gauge.sweep[0] - beyond_deg, gauge.sweep[1] + beyond_deg)


@dataclass(frozen=True, slots=True)
class _Found:
    """One needle's reading with what those below it need of it."""

    reading: Reading
    match: Match


class GaugeReader:
    """Reads the needles of one gauge.

    Parameters
    ----------
    gauge
        From the panel.
    grid
        Of its unwrapped form, see `gauge_grid`.
    templates
        One for each needle of the gauge, by name.
    """

    def __init__(self, gauge: Gauge, grid: PolarGrid, templates: Mapping[str, NeedleTemplate], method: Method) -> None:
        self._grid = grid
        self._matchers = {name: Matcher(template, grid.pixels_per_sample) for name, template in templates.items()}
        self._covers = {needle.name: needle.covered_by for needle in gauge.needles}
        self._order = _covering_first(self._covers)
        self._allowed = self._allowed_rows(gauge)
        self._method = method

    def read(self, unwrapped: UnwrappedGauge) -> dict[str, Reading]:
        """The readings by needle; `unwrapped` is (rows, columns) float32 of the gauge's grid."""
        found: dict[str, _Found] = {}
        for name in self._order:
            cover = self._covers[name]
            above = found.get(cover) if cover is not None else None
            if above is None or above.reading.status is Status.MISSING or self._method is Method.XCORR:
                found[name] = self._read_free(unwrapped, self._matchers[name])
            else:
                found[name] = self._read_below(unwrapped, self._matchers[name], above, self._matchers[str(cover)])
        return {name: found[name].reading for name in self._covers}

    def _read_free(self, unwrapped: UnwrappedGauge, matcher: Matcher) -> _Found:
        scores = matcher.scores(unwrapped)
        curve = scores if self._method is Method.NORMXCORR else matcher.products(unwrapped)
        match = matcher.best(unwrapped, np.where(self._allowed, curve, -np.inf), scores)
        return self._found(match, Status.READ if match.score >= SCORE_THRESHOLD else Status.MISSING)

    def _read_below(self, unwrapped: UnwrappedGauge, matcher: Matcher, above: _Found, cover: Matcher) -> _Found:
        """The cascade for a needle whose covering needle has been read."""
        mask = covered_mask(len(unwrapped), cover.template, above.match.row, margin_rows=MASK_MARGIN_ROWS)
        seen = uncovered_scores(unwrapped, mask, matcher.template)
        for status, visible in ((Status.READ, WHOLE_VISIBLE), (Status.EDGE, MIN_VISIBLE)):
            curve = np.where((seen.visible >= visible) & self._allowed, seen.scores, -np.inf)
            match = matcher.best(unwrapped, curve, seen.scores, mask)
            if match.score >= SCORE_THRESHOLD:
                return self._found(match, status)
        return self._hidden(matcher, above, cover)

    def _hidden(self, matcher: Matcher, above: _Found, cover: Matcher) -> _Found:
        """At the covering needle's place, give or take what its outline can hide."""
        slack_deg = max(cover.template.half_width_deg - matcher.template.half_width_deg, 0.0) + self._grid.step_deg
        sigma_deg = float(np.hypot(above.reading.sigma_deg, slack_deg / np.sqrt(3.0)))
        reading = Reading(Status.HIDDEN, above.reading.angle_deg, sigma_deg, above.reading.score)
        return _Found(reading, above.match)

    def _found(self, match: Match, status: Status) -> _Found:
        angle_deg = self._grid.angle_deg(match.row)
        return _Found(Reading(status, angle_deg, match.sigma_rows * self._grid.step_deg, match.score), match)

    def _allowed_rows(self, gauge: Gauge) -> NDArray[np.bool_]:
        start_deg, end_deg = gauge.sweep
        beyond_deg = min(BEYOND_SWEEP_DEG, (360.0 - (end_deg - start_deg)) / 2)
        angles_deg = self._grid.angle_deg(0) + self._grid.step_deg * np.arange(self._grid.rows)
        return (angles_deg >= start_deg - beyond_deg) & (angles_deg <= end_deg + beyond_deg)


def _covering_first(covers: Mapping[str, str | None]) -> Sequence[str]:
    def depth(name: str) -> int:
        cover = covers[name]
        return 0 if cover is None else 1 + depth(cover)

    return sorted(covers, key=depth)
