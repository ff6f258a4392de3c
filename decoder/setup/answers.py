"""What the page's server answers: one function for each question, run in a worker thread."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable
from typing import Any

import numpy as np

from decoder.alignment import IDENTITY, Alignment
from decoder.dial_plane import DialPlane
from decoder.errors import PanelError, PictureError
from decoder.gauge import Gauge
from decoder.method import Method
from decoder.panel_reader import PanelReader
from decoder.reading import Status
from decoder.setup.drafts import panel_of_gauge
from decoder.setup.marks import mark_angle_deg
from decoder.setup.pasting import pasted
from decoder.setup.picture_store import PANEL_KEY
from decoder.setup.proposals import Dial, needle_at, proposed
from decoder.setup.requests import (
    DialQuestion,
    DraftQuestion,
    MarkQuestion,
    NeedlesQuestion,
    PasteQuestion,
    RimQuestion,
    TrialQuestion,
)
from decoder.setup.rims import circle_through, fitted_rim
from decoder.setup.session import SetupSession
from decoder.setup.trial import FrameTrial, Trial, tried
from decoder.setup.views import DIAL_MARGIN, DIAL_PX, film_view, unwrapped_view
from decoder.unwrapping import Unwrapper

Answer = dict[str, Any]
Stale = Callable[[], bool]

# The unwrapped gauge is shown with a little of what lies outside it, where the marks often are.
SHOWN_BEYOND = 1.12
SHOWN_MARGIN_DEG = 12.0
PLACES = 4


def session_answer(session: SetupSession) -> Answer:
    """All that the page begins with."""
    height, width = session.store.grey(session.picture_key).shape
    return {
        "name": session.source.name,
        "frames": session.source.count,
        "sample": list(session.source.sample),
        "document": session.document,
        "picture": session.picture_key,
        "size": [width, height],
        "revision": session.revision,
        "opened_from": session.opened_from,
        "target": str(session.target),
        "has_panel_picture": session.picture_key == PANEL_KEY,
    }


def picture_answer(session: SetupSession, key: str) -> Answer:
    """The size of a picture."""
    height, width = session.store.grey(key).shape
    return {"picture": key, "size": [width, height]}


def unwrap_answer(session: SetupSession, asked: DialQuestion) -> Answer:
    """A dial unwrapped, and how its picture is to be read."""
    drawn = asked.dial
    inner, outer = drawn.radius_px
    shown = Dial(drawn.centre, (inner, outer * SHOWN_BEYOND), drawn.sweep_deg)
    grid = shown.grid(SHOWN_MARGIN_DEG)
    strip = Unwrapper([grid]).unwrap(session.store.grey(asked.picture), IDENTITY)[0]
    return {
        "image": unwrapped_view(strip),
        "start": grid.start_deg,
        "end": grid.angle_deg(grid.rows - 1),
        "inner": inner,
        "outer": outer * SHOWN_BEYOND,
    }


def rim_answer(session: SetupSession, asked: RimQuestion) -> Answer:
    """The circle through three clicks, at the ring they mean."""
    picture = session.store.grey(asked.picture)
    rim = fitted_rim(picture, circle_through(asked.points))
    return {"centre": [round(at, 3) for at in rim.centre], "radius": round(rim.radius_px, 3)}


def mark_answer(session: SetupSession, asked: MarkQuestion) -> Answer:
    """The angle of a tick mark."""
    angle_deg = mark_angle_deg(session.store.grey(asked.picture), asked.centre, asked.click)
    return {"angle": round(angle_deg, PLACES)}


def needles_answer(session: SetupSession, asked: NeedlesQuestion, stale: Stale) -> Answer:
    """Needles, found as what moves between frames."""
    picture = session.store.grey(asked.picture)
    frames = session.aligned(asked.document, asked.picture, stale)
    if asked.near is not None:
        return {"at": round(needle_at(picture, asked.dial, frames, asked.near), PLACES)}
    found = proposed(picture, asked.dial, frames) if len(frames) > 1 else []
    return {
        "needles": [{"at": round(each.at_deg, PLACES), "span": each.span_deg} for each in found],
        "frames": len(frames),
    }


def check_answer(session: SetupSession, asked: DraftQuestion) -> Answer:
    """What is wrong with a draft."""
    found = session.problems(asked.document, asked.picture)
    return {"problems": [{"path": each.path, "problem": each.problem} for each in found]}


def trial_answer(session: SetupSession, asked: TrialQuestion, stale: Stale) -> Answer:
    """A gauge read in the sample's frames, with its dial in each of them."""
    frames = session.frames()
    try:
        source = panel_of_gauge(
            asked.document, asked.gauge, session.pictures(asked.document, asked.picture), session.camera
        )
        trial = tried(source, frames, stale)
    except PanelError as error:  # a gauge half drawn is no failure: this is what there is to say of it
        return {"frames": [], "error": error.problem, "problems": [{"path": error.path, "problem": error.problem}]}
    (gauge,) = source.panel.gauges
    (plane,) = source.with_planes().planes or (None,)
    seen = [(taken.pixels, each.alignment) for (_, taken), each in zip(frames, trial.frames, strict=True)]
    return {
        "frames": [_frame(each, gauge, plane) for each in trial.frames],
        "moved": None if trial.moved_px is None else [round(at, PLACES) for at in trial.moved_px],
        "offset": _offset(trial, gauge.centre),
        "film": film_view(seen, gauge.centre, gauge.radius[1]),
        "dial": {"size": DIAL_PX, "half": gauge.radius[1] * DIAL_MARGIN},
    }


def paste_answer(session: SetupSession, asked: PasteQuestion) -> Answer:
    """A draft carried to another picture."""
    picture, target = session.store.grey(asked.picture), session.store.grey(asked.to)
    height, width = target.shape
    if not asked.document.get("anchors"):
        if asked.document.get("gauges"):
            raise PanelError(
                "anchors", "draw one first: without it nothing tells where the panel lies in another picture"
            )
        return {"document": asked.document, "picture": asked.to, "size": [width, height], "moved": None}
    if picture.shape != target.shape:
        raise PictureError(f"that picture is {width} x {height}, the panel's {picture.shape[1]} x {picture.shape[0]}")
    aligner = session.aligner(asked.document, asked.picture)
    if aligner is None:
        raise PanelError("anchors", "cannot be used yet; put right what is marked first")
    done = pasted(asked.document, aligner, target, _angles(session, asked))
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


def _angles(session: SetupSession, asked: PasteQuestion) -> dict[str, float]:
    """Where needles point in the picture to which a draft is carried, of those gauges that are whole."""
    target = session.store.grey(asked.to)
    pictures = session.pictures(asked.document, asked.picture)
    angles: dict[str, float] = {}
    for index in range(len(asked.document.get("gauges") or [])):
        try:
            source = panel_of_gauge(asked.document, index, pictures, session.camera)
            read = PanelReader.from_panel(source, Method.NORMXCORR).read(target)
        except (PanelError, PictureError):
            continue  # it keeps the angle it has
        angles |= {name: each.angle_deg for name, each in read.readings.items() if each.status is Status.READ}
    return angles


def _frame(trial: FrameTrial, gauge: Gauge, plane: DialPlane | None) -> Answer:
    return {
        "index": trial.index,
        "reason": trial.reason,
        "needles": [
            {
                "name": needle.name,
                "status": needle.status.value,
                "value": needle.value,
                "line": None if needle.angle_deg is None else _line(gauge, plane, needle.angle_deg),
                "score": round(needle.score, 3) if math.isfinite(needle.score) else 0.0,
            }
            for needle in trial.needles
        ],
    }


def _line(gauge: Gauge, plane: DialPlane | None, angle_deg: float) -> list[list[float]]:
    """Both ends of a needle's axis, from the gauge's centre in the panel picture, pixels."""
    angle = math.radians(angle_deg)
    ends = np.array(gauge.radius) * np.array([[math.cos(angle)], [math.sin(angle)]])
    if plane is not None:
        ends = plane.to_panel(ends) - np.array(gauge.centre)[:, None]
    return [[round(float(x), 2), round(float(y), 2)] for x, y in ends.T]


def _offset(trial: Trial, at: tuple[float, float]) -> Answer | None:
    """Where the gauge mostly lies in the frames, from where it lies in the panel picture."""
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
