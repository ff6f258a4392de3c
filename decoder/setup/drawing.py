"""What the page asks while somebody draws: planes of dials, rims, marks, and dials unwrapped."""

from __future__ import annotations

from typing import Any

from decoder.setup.marks import mark_angle_deg
from decoder.setup.requests import MarkQuestion, PlaneQuestion, RimQuestion, UnwrapQuestion
from decoder.setup.rim_choice import Rim, begun, refined
from decoder.setup.rims import Ring
from decoder.setup.session import SetupSession
from decoder.setup.views import unwrapped_view
from decoder.unwrapping import Unwrapper

Answer = dict[str, Any]

# The unwrapped gauge is shown with a little of what lies outside it, where the marks often are.
SHOWN_BEYOND = 1.12
SHOWN_MARGIN_DEG = 12.0
PLACES = 4


def unwrap_answer(session: SetupSession, asked: UnwrapQuestion) -> Answer:
    """A dial unwrapped, and how its picture is to be read."""
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
    """How dials are to be drawn on the picture: for each the matrix that carries its own points there."""
    planes = session.planes(asked.seen, asked.picture)
    return {"planes": [planes.drawn(dial.centre, dial.rim).matrix(dial.radius) for dial in asked.dials]}


def rim_answer(session: SetupSession, asked: RimQuestion) -> Answer:
    """The rim that clicks mean."""
    picture, planes = session.store.grey(asked.picture), session.planes(asked.seen, asked.picture)
    if asked.ring is None:
        return _rim(begun(picture, planes, asked.points))
    ring = Ring(planes.drawn(asked.ring.centre, asked.ring.rim), asked.ring.radius)
    return _rim(refined(picture, planes, ring, asked.points))


def mark_answer(session: SetupSession, asked: MarkQuestion) -> Answer:
    """The angle of a tick mark."""
    drawn = session.planes(asked.seen, asked.picture).drawn(asked.centre, asked.rim)
    return {"angle": round(mark_angle_deg(session.store.grey(asked.picture), drawn, asked.click), PLACES)}


def _rim(rim: Rim) -> Answer:
    return {
        "centre": [round(at, 3) for at in rim.centre],
        "radius": round(rim.radius_px, 3),
        "rim": rim.points,
        "matrix": rim.drawn.matrix(rim.radius_px),
    }
