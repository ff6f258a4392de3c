"""A draft without a browser: what was found and reads on the flight is written as far as complete, and reported."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

from decoder.setup.finding.proposal import Document, ProposedGauge
from decoder.setup.proposing.search import Anchors, Note, Withdrawn
from decoder.setup.proposing.trying import tried_search
from decoder.setup.saving import free_picture
from decoder.setup.session import SetupSession


@dataclass(frozen=True, slots=True)
class Drafted:
    """A draft that was written, or could not be, with a report for people and for programs."""

    text: str
    json: str


def drafted(session: SetupSession) -> Drafted:
    """Find what there is, try it on the flight, and write what is complete to the session's target.

    Raises
    ------
    OutputError
        If it cannot be written.
    WouldReplace
        If other files exist there.
    """
    number = session.source.sample[len(session.source.sample) // 2]
    key = f"frame-{number}"
    document = {name: part for name, part in session.document.items() if name != "focal_length_mm"}
    document["picture"] = free_picture(session.target.parent, str(document["picture"]))
    session.store.grey(key)
    if (zoom := session.source.focal_length_mm(number)) is not None:
        document["focal_length_mm"] = zoom
    found = _found(session, document, key)
    whole = [each.gauge for each in found.gauges if each.gauge is not None]
    is_written = bool(whole and found.anchors)
    if is_written:
        session.save({**document, "anchors": list(found.anchors), "gauges": whole}, key, session.revision)
        written = f"{session.target} has {len(whole)} of {len(found.gauges)} dials found"
    else:
        written = f"nothing was written to {session.target}: " + (
            "no dial is complete" if found.anchors else "no anchor was found"
        )
    content = {**_content(session, found), "written": is_written}
    return Drafted(_said(written, found), json.dumps(content, indent=2, ensure_ascii=False))


@dataclass(frozen=True, slots=True)
class _Found:
    """All that is proposed: anchors as for `panel.yaml`, and gauges, complete or not."""

    anchors: tuple[Document, ...]
    gauges: tuple[ProposedGauge, ...]
    notes: tuple[str, ...]


def _found(session: SetupSession, document: Document, key: str) -> _Found:
    steps = list(tried_search(session, document, key, lambda: False))
    gone = {step.place for step in steps if isinstance(step, Withdrawn)}
    gauges = [step for step in steps if isinstance(step, ProposedGauge)]
    return _Found(
        next((step.anchors for step in steps if isinstance(step, Anchors)), tuple(document.get("anchors") or ())),
        tuple(each for place, each in enumerate(gauges) if place not in gone),
        tuple(step.said for step in steps if isinstance(step, Anchors | Note)),
    )


def _said(written: str, found: _Found) -> str:
    lines = [f"{written}.", *(f"{note[0].upper()}{note[1:]}." for note in found.notes)]
    for each in found.gauges:
        where = ", ".join(f"{at:.0f}" for at in each.centre)
        lines += ["", f"{each.name} at ({where}): {'in the draft' if each.gauge is not None else 'NOT in the draft'}"]
        lines += [f"  + {sentence}" for sentence in each.evidence]
        lines += [f"  - {sentence}" for sentence in each.lacking]
    return "\n".join(lines)


def _content(session: SetupSession, found: _Found) -> dict[str, Any]:
    return {
        "panel": str(session.target),
        "notes": list(found.notes),
        "anchors": list(found.anchors),
        "dials": [asdict(each) for each in found.gauges],
    }
