"""What the replay expects of whatever it replays: pictures in order, each with the time at which it was taken."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol

from camera_drivers.camera import CameraIdentity
from camera_drivers.clock import Clock
from flight_file.frame import Frame


@dataclass(frozen=True, slots=True)
class Upcoming:
    """The next picture: when it was taken (realtime, ns), and how to take it when that time has come."""

    captured_ns: int
    take: Callable[[Clock], Frame]


class ReplaySource(Protocol):
    """Pictures that were taken before.

    Attributes
    ----------
    identity
        Of the camera they were taken with, as far as known.
    start_ns
        When the first was taken, realtime.
    attachments
        What the pictures bring along: a recorded flight's panel, camera and so on.
    """

    identity: CameraIdentity
    start_ns: int
    attachments: Mapping[str, bytes]

    def pictures(self) -> Iterator[Upcoming]:
        """Iterate over the pictures in order; raises ReplayError where one cannot be read."""
        ...
