"""The interface of a replay's source: pictures in order, each with the time it was taken."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol

from camera_drivers.camera import CameraIdentity
from camera_drivers.clock import Clock
from flight_file.frame import NS_PER_S, Frame, Sound


@dataclass(frozen=True, slots=True)
class Upcoming:
    """The next picture: when it was taken (realtime, ns), and how to get it when that time has come."""

    captured_ns: int
    take: Callable[[Clock], Frame]


class ReplaySource(Protocol):
    """Pictures that were taken before.

    Attributes
    ----------
    identity
        Of the camera, as far as known.
    start_ns
        When the first was taken, realtime.
    attachments
        Attachments of the pictures: a recorded flight's panel, camera and so on.
    """

    identity: CameraIdentity
    start_ns: int
    attachments: Mapping[str, bytes]

    def pictures(self) -> Iterator[Upcoming]:
        """Iterate over the pictures in order; raises ReplayError where one cannot be read."""
        ...


class Alongside:
    """The sound beside the pictures: each takes along up to a second ahead, so that none is left at the end."""

    def __init__(self, sounds: Iterable[Sound]) -> None:
        self._rest = iter(sounds)
        self._next = next(self._rest, None)

    def with_picture(self, captured_ns: int) -> tuple[Sound, ...]:
        """Take what goes with the picture of this time."""
        came: list[Sound] = []
        while self._next is not None and self._next.time_ns <= captured_ns + NS_PER_S:
            came.append(self._next)
            self._next = next(self._rest, None)
        return tuple(came)
