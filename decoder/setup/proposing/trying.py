"""Proposed gauges tried on the flight, and adjusted to it: moved and turned to where needles really are."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from decoder.imaging.thresholds import HALF
from decoder.instruments.reading import Status
from decoder.panel.errors import PanelError
from decoder.setup.drafts import Stale
from decoder.setup.drawn_plane import XY
from decoder.setup.finding.proposal import ProposedGauge
from decoder.setup.finding.thresholds import ALIKE
from decoder.setup.proposals import AROUND_DEG, Dial, needle_at
from decoder.setup.proposing.search import Anchors, Step, search
from decoder.setup.session import SetupSession
from decoder.setup.trial import Trial, tried

NEEDLES = "needles"
# The uncertainty of marks measured on a dial that nobody checked, one sigma.
DRAWN_DEG = 1.0


def tried_search(session: SetupSession, document: Mapping[str, Any], key: str, stale: Stale) -> Iterator[Step]:
    """Search, and read each complete gauge on the flight: one that hardly reads no longer counts as complete.

    Parameters
    ----------
    document, key, stale : as of a search
    """
    draft = dict(document)
    for step in search(session, document, key, stale):
        if isinstance(step, Anchors):
            draft["anchors"] = list(step.anchors)
        yield _Flight(session, draft, key, stale).shows(step) if isinstance(step, ProposedGauge) else step


@dataclass(frozen=True, slots=True)
class _Flight:
    """The sample of a session's flight, with a draft on the picture `key`, for as long as somebody waits."""

    session: SetupSession
    draft: Mapping[str, Any]
    key: str
    stale: Stale

    def shows(self, each: ProposedGauge) -> ProposedGauge:
        """Read a gauge on the sample as `decode` would, and with fewer of its hands if that fails."""
        if each.gauge is None or len(self.session.source.sample) < 2:  # noqa: PLR2004 - nothing to try it on
            return replace(each, otherwise=())
        ways = [_read(self, each)]
        for other in each.otherwise:
            if ways[-1].gauge is not None:
                break
            ways.append(_read(self, other))
        return replace(next((way for way in ways if way.gauge is not None), ways[0]), otherwise=())

    def trial(self, gauge: Mapping[str, Any]) -> Trial:
        """Try a gauge."""
        document = {**self.draft, "gauges": [gauge]}
        return tried(self.session.panel_of_gauge(document, self.key, 0), self.session.frames(), self.stale)

    def pointed(self, gauge: dict[str, Any], measured_px: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
        """Measure again where the needles of a dial point, around where they turn, between the given distances."""
        seen, planes = self.session.seen(self.draft, self.key, self.stale), self.session.planes(self.draft, self.key)
        (x, y), (inner, outer) = gauge["centre"], gauge["radius"]
        whole_px = float(inner), float(outer)
        plane = planes.drawn((x, y), gauge.get("rim")).plane
        turned = []
        for part in gauge.get(NEEDLES, ()):
            near = part["template"]["at"]
            between_px = measured_px.get(part["name"], whole_px)
            found = needle_at(seen, Dial((x, y), between_px, (near - AROUND_DEG, near + AROUND_DEG), plane), near)
            turned.append({**part, "template": {"at": round(found.at_deg, 2), "span": found.span_deg}})
        return {**gauge, NEEDLES: turned} if turned else gauge


def _read(flight: _Flight, each: ProposedGauge) -> ProposedGauge:
    """Read a gauge as proposed; move it to where its needles really turn."""
    assert each.gauge is not None  # noqa: S101 - only complete gauges are tried
    try:
        trial, gauge = flight.trial(each.gauge), each.gauge
        if trial.moved_px is not None:
            gauge = flight.pointed(_moved(gauge, trial.moved_px), each.measured_px)
            trial = flight.trial(gauge)
    except PanelError as error:
        return replace(each, gauge=None, lacking=(*each.lacking, error.problem))
    readings = [reading for frame in trial.frames for reading in frame.readings]
    read = sum(reading.status is Status.READ for reading in readings)
    columns = max((len(frame.readings) for frame in trial.frames), default=0)
    asked = len(trial.frames) * columns  # includes frames in which the panel is not found
    said = f"tried on {len(trial.frames)} frames, {read} of {asked} values were read"
    together = [reading.status is Status.READ for reading in readings if reading.is_together]
    if 2 * read < asked or not asked or (together and sum(together) < ALIKE * len(trial.frames)):
        return replace(each, gauge=None, lacking=(*each.lacking, said, *trial.findings), read=(read, asked))
    gauge = _doubted(_turned(gauge, trial.axes_deg), each.centre)
    evidence, lacking = (*each.evidence, said), (*each.lacking, *trial.findings)
    return replace(each, gauge=gauge, evidence=evidence, lacking=lacking, read=(read, asked))


def _doubted(gauge: dict[str, Any], printed: XY) -> dict[str, Any]:
    """Say how far marks may be off, if they are printed around another point than the one needles turn about.

    The tip of a needle above its dial, seen obliquely, shifts with its pivot, and its marks are right as they are; a
    needle that turns beside the middle of its dial points at marks as seen from there. Nothing tells which it is.
    """
    if NEEDLES not in gauge:
        return gauge
    beside_deg = math.degrees(HALF * math.dist(gauge["centre"], printed) / gauge["radius"][1])
    return {**gauge, "doubt_deg": round(math.hypot(beside_deg, DRAWN_DEG), 2)}


def _turned(gauge: dict[str, Any], axes_deg: Mapping[str, float]) -> dict[str, Any]:
    """Turn each needle to its axis as all frames together show it."""
    turned = [
        {
            **part,
            "template": {**part["template"], "at": round(part["template"]["at"] + axes_deg.get(part["name"], 0.0), 2)},
        }
        for part in gauge.get(NEEDLES, ())
    ]
    return {**gauge, NEEDLES: turned} if turned else gauge


def _moved(gauge: Mapping[str, Any], moved_px: tuple[float, float]) -> dict[str, Any]:
    """Move a dial to where its needles turn; they turn above it, so the angles of its marks stay as they are."""
    places = {"centre": [gauge["centre"]], "rim": gauge.get("rim") or []}
    there = {
        key: [[round(at + by, 2) for at, by in zip(point, moved_px, strict=True)] for point in points]
        for key, points in places.items()
    }
    return {**gauge, "centre": there["centre"][0], **({"rim": there["rim"]} if there["rim"] else {})}
