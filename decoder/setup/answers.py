"""The answers of the page's server: one function for each question, run in a worker thread."""

from __future__ import annotations

import math
import statistics
from collections import Counter
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from decoder.imaging.alignment import Alignment
from decoder.imaging.motion import carried
from decoder.imaging.pictures import FramePicture
from decoder.imaging.unwrapping import Grid, PolarGrid, Unwrapper
from decoder.instruments.panel_reader import read_frame
from decoder.instruments.reading import Status
from decoder.learning.fit import reader_from_panel
from decoder.panel.errors import PanelError, PictureError
from decoder.panel.gauge import KINDS, Gauge
from decoder.panel.vocabulary import Method
from decoder.setup.dial_edges import Rim, Ring, around_hub, begun, centre_doubt_px, mark_angle_deg, refined
from decoder.setup.drafts import Stale
from decoder.setup.drawn_plane import height_inches
from decoder.setup.finding.proposal import ProposedGauge
from decoder.setup.pasting import pasted
from decoder.setup.proposals import AROUND_DEG, Proposal, needle_at, proposed, turning_px
from decoder.setup.proposing.search import Anchors, Looking, Note, Step, Withdrawn
from decoder.setup.requests import (
    DraftQuestion,
    FoundQuestion,
    MarkQuestion,
    NeedlesQuestion,
    PasteQuestion,
    PlaneQuestion,
    RimQuestion,
    TrialQuestion,
    TurningQuestion,
    UnwrapQuestion,
)
from decoder.setup.session import SetupSession
from decoder.setup.sources import PANEL_KEY
from decoder.setup.thresholds import MAX_MOVE_PX
from decoder.setup.trial import FrameTrial, Trial, tried
from decoder.setup.views import DIAL_MARGIN, DIAL_PX, film_view, unwrapped_view

Answer = dict[str, Any]

# The unwrapped gauge is shown with some of its surroundings, where the marks often are.
SHOWN_BEYOND = 1.12
SHOWN_MARGIN_DEG = 12.0
PLACES = 4


def unwrap_answer(session: SetupSession, asked: UnwrapQuestion) -> Answer:
    """Unwrap a dial, with the geometry that is needed to read its picture."""
    planes = session.planes(asked.seen, asked.picture)
    plane = planes.drawn(asked.centre, asked.rim).plane
    inner, outer = asked.dial(plane).radius_px
    shown = asked.model_copy(update={"radius": (inner, outer * SHOWN_BEYOND)}).dial(plane)
    grid = shown.grid(SHOWN_MARGIN_DEG)
    strip = Unwrapper([grid]).unwrap(session.store.grey(asked.picture), planes.optics.own)[0]
    return {
        "image": unwrapped_view(strip),
        "start": grid.start_deg,
        "end": grid.angle_deg(grid.rows - 1),
        "inner": inner,
        "outer": outer * SHOWN_BEYOND,
    }


def planes_answer(session: SetupSession, asked: PlaneQuestion) -> Answer:
    """Return how to draw dials on the picture: for each the matrix that carries its own points there."""
    planes = session.planes(asked.seen, asked.picture)
    return {"planes": [planes.drawn(dial.centre, dial.rim).matrix(dial.radius) for dial in asked.dials]}


def rim_answer(session: SetupSession, asked: RimQuestion) -> Answer:
    """Find the rim meant by clicks; if they leave a new one's centre very uncertain, only say how uncertain."""
    picture, planes = session.store.grey(asked.picture), session.planes(asked.seen, asked.picture)
    if asked.ring is None:
        clicks, hub = asked.points[:3], asked.points[3:]
        if hub:
            return _rim(around_hub(planes, clicks, hub[0]))
        doubt_px = centre_doubt_px(picture, planes, clicks)
        return {"doubt_px": round(doubt_px)} if doubt_px > MAX_MOVE_PX else _rim(begun(picture, planes, clicks))
    ring = Ring(planes.drawn(asked.ring.centre, asked.ring.rim), asked.ring.radius)
    return _rim(refined(picture, planes, ring, asked.points))


def mark_answer(session: SetupSession, asked: MarkQuestion) -> Answer:
    """Find the angle of a tick mark."""
    drawn = session.planes(asked.seen, asked.picture).drawn(asked.centre, asked.rim)
    return {"angle": round(mark_angle_deg(session.store.grey(asked.picture), drawn, asked.click), PLACES)}


def _rim(rim: Rim) -> Answer:
    return {
        "centre": [round(at, 3) for at in rim.centre],
        "radius": round(rim.radius_px, 3),
        "rim": rim.points,
        "matrix": rim.drawn.matrix(rim.radius_px),
    }


def session_answer(session: SetupSession) -> Answer:
    """Collect everything that the page starts with."""
    height, width = session.store.grey(session.picture_key).shape
    return {
        "name": session.source.name,
        "frames": session.source.count,
        "sample": list(session.source.sample),
        "document": session.document,
        "draft": _draft(session),
        "picture": session.picture_key,
        "size": [width, height],
        "revision": session.revision,
        "opened_from": session.opened_from,
        "target": str(session.target),
        "has_panel_picture": session.picture_key == PANEL_KEY,
        "kinds": [asdict(kind.form) | {"in_window": kind.in_window} for kind in KINDS],
        "lens": session.camera is not None and session.camera.distortion is not None,
    }


def _draft(session: SetupSession) -> Answer | None:
    draft = session.draft
    if draft is None:
        return None
    height, width = session.store.grey(draft.picture).shape
    return {"document": draft.document, "picture": draft.picture, "size": [width, height]}


def picture_answer(session: SetupSession, key: str) -> Answer:
    """Return the size of a picture."""
    height, width = session.store.grey(key).shape
    return {"picture": key, "size": [width, height]}


def needles_answer(session: SetupSession, asked: NeedlesQuestion, stale: Stale) -> Answer:
    """Find needles as what moves between frames."""
    planes, seen = session.planes(asked.document, asked.picture), session.seen(asked.document, asked.picture, stale)
    plane = planes.drawn(asked.centre, asked.rim).plane
    dial = replace(asked.dial(plane), raised=planes.raised(asked.needle_height_inches))
    if asked.near is not None:
        around = replace(dial, sweep_deg=(asked.near - AROUND_DEG, asked.near + AROUND_DEG))
        found = needle_at(seen, around, asked.near)
        return _proposal(found)
    moving = proposed(seen, dial) if len(seen.frames) > 1 else []
    return {"needles": [_proposal(each) for each in moving], "frames": len(seen.frames)}


def turning_answer(session: SetupSession, asked: TurningQuestion, stale: Stale) -> Answer:
    """Find between which radii a whole dial turns."""
    planes, seen = session.planes(asked.document, asked.picture), session.seen(asked.document, asked.picture, stale)
    found = turning_px(seen, asked.dial(planes.drawn(asked.centre, asked.rim).plane))
    return {"turns": None if found is None else [round(each, 1) for each in found]}


def _proposal(found: Proposal) -> Answer:
    return {"at": round(found.at_deg, PLACES), "span": found.span_deg, "reach": round(found.reach_px, 1)}


def check_answer(session: SetupSession, asked: DraftQuestion) -> Answer:
    """List what is wrong with a draft, and keep it."""
    session.keep(asked.document if asked.drawn is None else asked.drawn, asked.picture)
    found = session.problems(asked.document, asked.picture)
    return {"problems": [{"path": each.path, "problem": each.problem} for each in found]}


def found_answer(session: SetupSession, asked: FoundQuestion, step: Step) -> Answer:
    """Describe a step of the search for dials."""
    match step:
        case Looking():
            return {"looking": step.said, "box": step.box}
        case Note():
            return {"note": step.said}
        case Anchors():
            return {"anchors": list(step.anchors), "note": step.said}
        case Withdrawn():
            return {"withdrawn": step.place}
        case ProposedGauge():
            return {"proposed": _proposed(session, asked, step)}


def _proposed(session: SetupSession, asked: FoundQuestion, found: ProposedGauge) -> Answer:
    gauge = found.drawn if found.gauge is None else found.gauge
    drawn = session.planes(asked.document, asked.picture).drawn(tuple(gauge["centre"]), gauge.get("rim"))
    return {
        "gauge": gauge,
        "is_whole": found.gauge is not None,
        "matrix": drawn.matrix(gauge["radius"][1]),
        "name": found.name,
        "centre": found.centre,
        "rim": found.rim,
        "marks": [asdict(mark) for mark in found.marks],
        "evidence": found.evidence,
        "lacking": found.lacking,
        "read": found.read,
    }


def trial_answer(session: SetupSession, asked: TrialQuestion, stale: Stale) -> Answer:
    """Read a gauge in the sample's frames, and show its dial in each of them."""
    frames = session.frames()
    try:
        source = session.panel_of_gauge(asked.document, asked.picture, asked.gauge)
        trial = tried(source, frames, stale)
    except PanelError as error:  # a half-drawn gauge is not a failure but the answer
        return {"frames": [], "error": error.problem, "problems": [{"path": error.path, "problem": error.problem}]}
    (gauge,) = source.panel.gauges
    grid = source.grid(0)
    seen = [(taken.pixels, each.alignment) for (_, taken), each in zip(frames, trial.frames, strict=True)]
    return {
        "frames": [_frame(each, gauge, grid) for each in trial.frames],
        "moved": None if trial.moved_px is None else [round(at, PLACES) for at in trial.moved_px],
        "findings": trial.findings,
        "mistakes": trial.mistakes,
        "anchors": _anchors(trial),
        "axes": {name: round(off_deg, PLACES) for name, off_deg in trial.axes_deg.items()},
        "height": height_inches(source, trial.moved_px),
        "offset": _offset(trial, gauge.centre),
        "film": film_view(seen, gauge.centre, gauge.radius[1]),
        "dial": {"size": DIAL_PX, "half": gauge.radius[1] * DIAL_MARGIN},
    }


def paste_answer(session: SetupSession, asked: PasteQuestion) -> Answer:
    """Carry a draft to another picture."""
    picture, target = session.store.grey(asked.picture), session.frame(asked.to)
    height, width = target.pixels.shape
    if not asked.document.get("anchors"):
        if asked.document.get("gauges"):
            raise PanelError(
                "anchors", "draw one first: without it nothing tells where the panel lies in another picture"
            )
        zoom = {} if target.focal_length_mm is None else {"focal_length_mm": target.focal_length_mm}
        return {"document": asked.document | zoom, "picture": asked.to, "size": [width, height], "moved": None}
    if picture.shape != target.pixels.shape:
        raise PictureError(f"that picture is {width} x {height}, the panel's {picture.shape[1]} x {picture.shape[0]}")
    aligner = session.aligner(asked.document, asked.picture)
    if aligner is None:
        raise PanelError("anchors", "cannot be used yet; correct what is marked first")
    done = pasted(asked.document, aligner, target, _angles(session, asked, target), session.camera)
    return {
        "document": done.document,
        "picture": asked.to,
        "size": [width, height],
        "moved": {
            "offset": [round(at, 2) for at in done.offset_px],
            "roll": round(done.roll_deg, 3),
            "score": round(done.score, 3),
        },
    }


def _angles(session: SetupSession, asked: PasteQuestion, target: FramePicture) -> dict[str, float]:
    """Return where needles point in the picture to which a draft is carried, for those gauges that are complete."""
    angles: dict[str, float] = {}
    gauges = asked.document.get("gauges")
    for index in range(len(gauges) if isinstance(gauges, list) else 0):
        try:
            source = session.panel_of_gauge(asked.document, asked.picture, index)
            reader = reader_from_panel(source, Method.NORMXCORR)
            read = read_frame(reader, target)
        except (PanelError, PictureError):
            continue  # it keeps the angle it has
        angles |= {name: each.angle_deg for name, each in read.readings.items() if each.status is Status.READ}
    return angles


def _frame(trial: FrameTrial, gauge: Gauge, grid: Grid) -> Answer:
    return {
        "index": trial.index,
        "reason": trial.reason,
        "needles": [
            {
                "name": needle.name,
                "status": needle.status.value,
                "value": needle.value,
                "text": needle.text,
                "together": needle.is_together,
                "line": (
                    _line(gauge, grid, trial.alignment, needle.angle_deg)
                    if isinstance(grid, PolarGrid) and needle.angle_deg is not None and not needle.is_together
                    else None
                ),
                "score": round(needle.score, 3) if math.isfinite(needle.score) else 0.0,
            }
            for needle in trial.readings
        ],
    }


def _line(gauge: Gauge, grid: PolarGrid, alignment: Alignment | None, angle_deg: float) -> list[list[float]]:
    """Return both ends of a needle's axis in a frame, relative to the gauge's centre in the panel picture, pixels."""
    ends = grid.at(angle_deg, 1).points()[:, 0, [grid.tail_columns, -1]].astype(np.float64)
    if grid.raised is not None and alignment is not None:
        ends = carried(grid.raised.seen_in(alignment), ends)
    return [[round(float(x), 2), round(float(y), 2)] for x, y in (ends - np.array(gauge.centre)[:, None]).T]


def _anchors(trial: Trial) -> dict[str, int]:
    """Count, for each anchor and the level edge, the frames with the panel in which it was not found."""
    return dict(Counter(name for each in trial.frames if each.alignment is not None for name in each.alignment.failed))


def _offset(trial: Trial, at: tuple[float, float]) -> Answer | None:
    """Return the gauge's usual offset in the frames from its place in the panel picture."""
    found = [each.alignment for each in trial.frames if each.alignment is not None]
    if not found:
        return None
    places = [alignment.to_frame(at) for alignment in found]
    shift = [statistics.median(place[axis] for place in places) - at[axis] for axis in (0, 1)]
    return {
        "shift": [round(each, 2) for each in shift],
        "roll": round(statistics.median(_roll_deg(alignment, at) for alignment in found), 3),
        "found": len(found),
    }


def _roll_deg(alignment: Alignment, at: tuple[float, float]) -> float:
    (x, y), (u, v) = alignment.to_frame(at), alignment.to_frame((at[0] + 100.0, at[1]))
    return math.degrees(math.atan2(v - y, u - x))
