"""The zoom: to one of its ends, or to a focal length.

The camera knows only `in` and `out`, until told to stop or by one step. It reports its position in percent, which no
source converts to a focal length; the pictures' EXIF gives it. So a focal length is reached with the pictures that are
taken anyway:

    picture ──▶ focal length near enough? ──yes──▶ settled
                     │no
                     ▼
                guess the position, go there step by step ──▶ next picture

Steps overshoot by unknown amounts; after going to and fro across the goal, the nearest position is taken.
"""

from __future__ import annotations

import math
from itertools import pairwise

from camera_drivers.errors import CameraRefusedError, CameraSilentError
from camera_drivers.qx10.events import Events
from camera_drivers.qx10.remote_api import RemoteApi
from camera_drivers.thresholds import (
    LOOK_S,
    ZOOM_MAX_PICTURES,
    ZOOM_MAX_STEPS,
    ZOOM_MAX_TURNS,
    ZOOM_MOVED_PERCENT,
    ZOOM_NEAR,
    ZOOM_STILL_LOOKS,
)
from camera_drivers.waiting import Notes

STATE = "zoom"
IN, OUT = "in", "out"

WIDE_MM, TELE_MM = 4.45, 44.5  # of the lens; only the first guess depends on it

_ENDS = {"wide": (OUT, 0.0), "tele": (IN, 100.0)}


class Zoom:
    """Moves the lens of one camera.

    Parameters
    ----------
    goal
        wide, tele, leave, or a focal length in mm.
    """

    def __init__(self, api: RemoteApi, events: Events, notes: Notes, goal: str | float) -> None:
        self._api = api
        self._events = events
        self._notes = notes
        self._goal_mm = goal if isinstance(goal, float | int) else None
        self._end = _ENDS.get(goal) if isinstance(goal, str) else None
        self._seen: list[tuple[float, float]] = []  # position in percent, focal length in mm
        self._pictures = 0
        self._turns = 0
        self._last_error = 0.0
        self._left_at: float | None = None
        self.settled = self._goal_mm is None

    def start(self) -> None:
        """Go to the wanted end, or to where the focal length might be; raises CameraUnreachableError."""
        if self._end is not None:
            self._run(*self._end)
        elif self._goal_mm is not None:
            position = self._position()
            if position is not None:
                self._step_to(_guess(self._goal_mm), position)
        self._left_at = self._events.state.zoom_position

    def take_notice(self, focal_length_mm: float | None) -> None:
        """Compare a picture's focal length with the wanted one, and move the lens; raises CameraUnreachableError."""
        if self._has_been_moved():
            self._notes.say(STATE, "the lens has moved by itself, or somebody moved it; it is set again")
            self.settled = self._goal_mm is None
            self._pictures = self._turns = 0
            self.start()
            return
        if self._goal_mm is None:
            if focal_length_mm is not None:
                self._notes.say_once(STATE, f"pictures are taken at {focal_length_mm:g} mm")
            return
        if self.settled:
            return
        if focal_length_mm is None:
            self._settle("the pictures do not tell their focal length; it is where it is guessed to be")
            return
        self._approach(focal_length_mm, self._goal_mm)

    def _approach(self, focal_length_mm: float, goal_mm: float) -> None:
        error = math.log(goal_mm / focal_length_mm)
        self._pictures += 1
        self._turns += error * self._last_error < 0
        self._last_error = error
        position = self._events.state.zoom_position
        if position is not None:
            self._seen.append((position, focal_length_mm))
        best = min((abs(math.log(goal_mm / mm)) for _, mm in self._seen), default=abs(error))
        nearest = self._turns >= ZOOM_MAX_TURNS and abs(error) <= best
        if abs(error) <= ZOOM_NEAR:
            self._settle(f"{focal_length_mm:g} mm is reached")
        elif nearest or self._pictures >= ZOOM_MAX_PICTURES:
            self._settle(f"{focal_length_mm:g} mm is as near as it comes to {goal_mm:g} mm")
        elif position is None:
            self._step(IN if error > 0 else OUT)
        else:
            self._step_to(self._place(position, error, goal_mm), position)

    def _has_been_moved(self) -> bool:
        position = self._events.state.zoom_position
        wanted = self._end is not None or self._goal_mm is not None
        if not wanted or not self.settled or position is None or self._left_at is None:
            return False
        return abs(position - self._left_at) > ZOOM_MOVED_PERCENT

    def _settle(self, reason: str) -> None:
        self.settled = True
        self._left_at = self._events.state.zoom_position
        self._notes.say(STATE, reason)

    def _place(self, position: float, error: float, goal_mm: float) -> float:
        """Interpolate the goal's position between the nearest pictures seen, or over the lens's whole range."""
        for (low, low_mm), (high, high_mm) in pairwise(sorted(self._seen)):
            if low < high and low_mm < goal_mm < high_mm:
                return low + (high - low) * math.log(goal_mm / low_mm) / math.log(high_mm / low_mm)
        return position + error * _guess(TELE_MM) / math.log(TELE_MM / WIDE_MM)

    def _step_to(self, goal: float, position: float) -> None:
        direction = IN if goal > position else OUT
        for _ in range(ZOOM_MAX_STEPS):
            if not self._step(direction):
                return
            reached = self._position()
            if reached is None or reached == position:
                return
            left = goal - reached if direction == IN else reached - goal
            if left <= abs(reached - position) / 2:  # another step would lead further away
                return
            position = reached

    def _step(self, direction: str) -> bool:
        done = self._move(direction, "1shot")
        if done:
            self._wait_until_still()
        return done

    def _run(self, direction: str, end: float) -> None:
        if self._position() == end:
            return
        if not self._move(direction, "start"):
            return
        self._wait_until_still(end)
        self._move(direction, "stop")
        position = self._position()
        if position is not None and position != end:
            self._notes.say(STATE, f"the lens stands at {position:g} percent, not at its end")

    def _wait_until_still(self, end: float | None = None) -> None:
        looks: list[float | None] = []

        def still() -> bool:
            looks.append(self._position())
            last = looks[-ZOOM_STILL_LOOKS:]
            return (end is not None and looks[-1] == end) or (len(last) == ZOOM_STILL_LOOKS and len(set(last)) == 1)

        self._api.link.waiter.poll("zoom", still, every_s=LOOK_S, limit_s=self._api.link.limits.zoom_s)

    def _position(self) -> float | None:
        try:
            return self._events.ask(self._api).zoom_position
        except (CameraRefusedError, CameraSilentError):
            return None

    def _move(self, direction: str, movement: str) -> bool:
        try:
            self._api.call("actZoom", direction, movement)
        except CameraRefusedError as error:
            self._notes.say_once(STATE, f"the camera does not zoom {direction} (error {error.code})")
            return False
        except CameraSilentError as error:
            self._notes.say_once(STATE, f"whether the camera zooms is not known: {error.problem}")
            return movement != "1shot"
        return True


def _guess(focal_length_mm: float) -> float:
    """Guess the position in percent, assuming that the focal length's logarithm grows linearly."""
    share = math.log(focal_length_mm / WIDE_MM) / math.log(TELE_MM / WIDE_MM)
    return 100 * min(max(share, 0.0), 1.0)
