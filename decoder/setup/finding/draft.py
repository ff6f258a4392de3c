"""A draft without a browser: what was found is tried on the flight, written as far as it is whole, and said."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from decoder.instruments.reading import Status
from decoder.panel.errors import PanelError
from decoder.setup.drafts import panel_of_gauge
from decoder.setup.finding.proposal import Found, ProposedGauge, found_on
from decoder.setup.proposals import Dial, Pictures, needle_at
from decoder.setup.session import SetupSession
from decoder.setup.trial import Trial, tried

NEEDLES = "needles"
AROUND_DEG = 60.0


@dataclass(frozen=True, slots=True)
class Drafted:
    """A draft that was written, or could not be; what is said of it, for people and for programs."""

    text: str
    json: str


def drafted(session: SetupSession) -> Drafted:
    """Find what there is, try it on the flight, write what is whole to the session's target.

    Raises
    ------
    OutputError
        If the disk does not take it.
    WouldReplace
        If files of somebody else lie there.
    """
    number = session.source.sample[len(session.source.sample) // 2]
    key = f"frame-{number}"
    document = {name: part for name, part in session.document.items() if name != "focal_length_mm"}
    session.store.grey(key)
    if (zoom := session.source.focal_length_mm(number)) is not None:
        document["focal_length_mm"] = zoom
    found = found_on(session, document, key, _never)
    draft: dict[str, Any] = {**document, "anchors": list(found.anchors)}
    gauges = [_tried(session, draft, each, key) for each in found.gauges]
    whole = [each.gauge for each in gauges if each.gauge is not None]
    draft["gauges"] = whole
    is_written = bool(whole and found.anchors)
    if is_written:
        session.save(draft, key, session.revision)
        written = f"{session.target} has {len(whole)} of {len(gauges)} dials that were found"
    else:
        written = f"nothing was written to {session.target}: " + (
            "no dial is whole" if found.anchors else "no anchor was found"
        )
    content = {**_content(session, found, gauges), "written": is_written}
    return Drafted(_said(written, found, gauges), json.dumps(content, indent=2, ensure_ascii=False))


def _never() -> bool:
    return False


def _tried(session: SetupSession, draft: dict[str, Any], each: ProposedGauge, key: str) -> ProposedGauge:
    """Read a gauge on the flight's sample as `decode` would; move it to where its needles really turn."""
    if each.gauge is None or len(session.source.sample) < 2:  # noqa: PLR2004 - nothing to try it on
        return each
    try:
        trial = _trial(session, draft, each.gauge, key)
        gauge = each.gauge
        if trial.moved_px is not None:
            gauge = _pointed(session, draft, _moved(gauge, trial.moved_px), key)
            trial = _trial(session, draft, gauge, key)
    except PanelError as error:
        return replace(each, gauge=None, lacking=(*each.lacking, error.problem))
    readings = [reading for frame in trial.frames for reading in frame.readings]
    read = sum(reading.status is Status.READ for reading in readings)
    columns = max((len(frame.readings) for frame in trial.frames), default=0)
    asked = len(trial.frames) * columns  # where the panel is not found nothing is read
    said = f"tried on {len(trial.frames)} frames, {read} of {asked} values are read"
    if 2 * read < asked or not asked:
        return replace(each, gauge=None, lacking=(*each.lacking, said, *trial.findings))
    gauge = _turned(gauge, trial.axes_deg)
    return replace(each, gauge=gauge, evidence=(*each.evidence, said), lacking=(*each.lacking, *trial.findings))


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


def _trial(session: SetupSession, draft: dict[str, Any], gauge: Mapping[str, Any], key: str) -> Trial:
    document = {**draft, "gauges": [gauge]}
    pictures, encoded = session.pictures(document, key), session.encoded(document, key)
    source = panel_of_gauge(document, 0, pictures, session.camera, encoded)
    return tried(session.remembered(source, document, key), session.frames(), _never)


def _pointed(session: SetupSession, draft: dict[str, Any], gauge: dict[str, Any], key: str) -> dict[str, Any]:
    """Measure anew where the needles of a dial point, from where they turn."""
    planes = session.planes(draft, key)
    seen = Pictures(session.store.grey(key), session.aligned(draft, key, _never), planes.optics.own)
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


def _said(written: str, found: Found, gauges: Sequence[ProposedGauge]) -> str:
    lines = [f"{written}.", *(f"{note[0].upper()}{note[1:]}." for note in found.notes)]
    for each in gauges:
        where = ", ".join(f"{at:.0f}" for at in each.centre)
        lines += ["", f"{each.name} at ({where}): {'in the draft' if each.gauge is not None else 'NOT in the draft'}"]
        lines += [f"  + {sentence}" for sentence in each.evidence]
        lines += [f"  - {sentence}" for sentence in each.lacking]
    return "\n".join(lines)


def _content(session: SetupSession, found: Found, gauges: Sequence[ProposedGauge]) -> dict[str, Any]:
    return {
        "panel": str(session.target),
        "notes": list(found.notes),
        "anchors": list(found.anchors),
        "dials": [asdict(each) for each in gauges],
    }
