"""Proposed gauges tried on the flight, and drawn as it shows them: moved and turned to where needles really are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from decoder.instruments.reading import Status
from decoder.panel.errors import PanelError
from decoder.setup.drafts import Stale, panel_of_gauge
from decoder.setup.finding.proposal import ProposedGauge
from decoder.setup.proposals import Dial, Pictures, needle_at
from decoder.setup.proposing.search import Anchors, Step, search
from decoder.setup.session import SetupSession
from decoder.setup.trial import Trial, tried

NEEDLES = "needles"
AROUND_DEG = 60.0


def tried_search(session: SetupSession, document: Mapping[str, Any], key: str, stale: Stale) -> Iterator[Step]:
    """Search, each gauge that is whole read on the flight: one that hardly reads is no longer whole.

    Parameters
    ----------
    document, key, stale : as of a search
    """
    draft = dict(document)
    for step in search(session, document, key, stale):
        if isinstance(step, Anchors):
            draft["anchors"] = list(step.anchors)
        yield _on_the_flight(session, draft, step, key, stale) if isinstance(step, ProposedGauge) else step


def _on_the_flight(
    session: SetupSession, draft: dict[str, Any], each: ProposedGauge, key: str, stale: Stale
) -> ProposedGauge:
    """Read a gauge on the flight's sample as `decode` would; move it to where its needles really turn."""
    if each.gauge is None or len(session.source.sample) < 2:  # noqa: PLR2004 - nothing to try it on
        return each
    try:
        trial = _trial(session, draft, each.gauge, key, stale)
        gauge = each.gauge
        if trial.moved_px is not None:
            gauge = _pointed(session, draft, _moved(gauge, trial.moved_px), key, stale)
            trial = _trial(session, draft, gauge, key, stale)
    except PanelError as error:
        return replace(each, gauge=None, lacking=(*each.lacking, error.problem))
    readings = [reading for frame in trial.frames for reading in frame.readings]
    read = sum(reading.status is Status.READ for reading in readings)
    columns = max((len(frame.readings) for frame in trial.frames), default=0)
    asked = len(trial.frames) * columns  # where the panel is not found nothing is read
    said = f"tried on {len(trial.frames)} frames, {read} of {asked} values are read"
    if 2 * read < asked or not asked:
        return replace(each, gauge=None, lacking=(*each.lacking, said, *trial.findings), read=(read, asked))
    gauge = _turned(gauge, trial.axes_deg)
    evidence, lacking = (*each.evidence, said), (*each.lacking, *trial.findings)
    return replace(each, gauge=gauge, evidence=evidence, lacking=lacking, read=(read, asked))


def _turned(gauge: dict[str, Any], axes_deg: Mapping[str, float]) -> dict[str, Any]:
    """Turn each needle to its axis, as all frames together show it."""
    turned = [
        {
            **part,
            "template": {**part["template"], "at": round(part["template"]["at"] + axes_deg.get(part["name"], 0.0), 2)},
        }
        for part in gauge.get(NEEDLES, ())
    ]
    return {**gauge, NEEDLES: turned} if turned else gauge


def _trial(session: SetupSession, draft: dict[str, Any], gauge: Mapping[str, Any], key: str, stale: Stale) -> Trial:
    document = {**draft, "gauges": [gauge]}
    pictures, encoded = session.pictures(document, key), session.encoded(document, key)
    source = panel_of_gauge(document, 0, pictures, session.camera, encoded)
    return tried(session.remembered(source, document, key), session.frames(), stale)


def _pointed(
    session: SetupSession, draft: dict[str, Any], gauge: dict[str, Any], key: str, stale: Stale
) -> dict[str, Any]:
    """Measure anew where the needles of a dial point, from where they turn."""
    planes = session.planes(draft, key)
    seen = Pictures(session.store.grey(key), session.aligned(draft, key, stale), planes.optics.own)
    (x, y), (inner, outer) = gauge["centre"], gauge["radius"]
    plane = planes.drawn((x, y), gauge.get("rim")).plane
    turned = []
    for part in gauge.get(NEEDLES, ()):
        near = part["template"]["at"]
        found = needle_at(seen, Dial((x, y), (inner, outer), (near - AROUND_DEG, near + AROUND_DEG), plane), near)
        turned.append({**part, "template": {"at": round(found.at_deg, 2), "span": found.span_deg}})
    return {**gauge, NEEDLES: turned} if turned else gauge


def _moved(gauge: Mapping[str, Any], moved_px: tuple[float, float]) -> dict[str, Any]:
    """Move a dial to where its needles turn; they turn above it, so the angles of its marks stay as they are."""
    places = {"centre": [gauge["centre"]], "rim": gauge.get("rim") or []}
    there = {
        key: [[round(at + by, 2) for at, by in zip(point, moved_px, strict=True)] for point in points]
        for key, points in places.items()
    }
    return {**gauge, "centre": there["centre"][0], **({"rim": there["rim"]} if there["rim"] else {})}
