"""Signs of life of the camera's and the writer's thread, for the watchdog."""

from __future__ import annotations

import threading

from camera_drivers.clock import Clock

SILENCE_S = 20.0  # a driver speaks up every few seconds; a disk that takes longer than this for one sync hangs

_NS_PER_S = 1_000_000_000


class SignsOfLife:
    """When each thread last got on, or said that it waits with good reason.

    Parameters
    ----------
    clock
        Its monotonic side counts.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        now_ns = clock.read().monotonic_ns
        self._last_ns = {"camera": now_ns, "disk": now_ns}

    def camera(self) -> None:
        """A picture came, or something was said about the camera, or it waits."""
        self._note("camera")

    def disk(self) -> None:
        """The writer's thread is not held up by the disk: it answers, if only with an error."""
        self._note("disk")

    def silent(self) -> str:
        """Who has not been heard for too long, in words; empty if nobody."""
        now_ns = self._clock.read().monotonic_ns
        with self._lock:
            late = [name for name, last_ns in self._last_ns.items() if now_ns - last_ns > SILENCE_S * _NS_PER_S]
        return " and ".join(late)

    def _note(self, name: str) -> None:
        now_ns = self._clock.read().monotonic_ns
        with self._lock:
            self._last_ns[name] = now_ns
