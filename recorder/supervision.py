"""The main thread while the others work: it feeds the watchdog as long as both make progress, and enforces the end.

systemd restarts a service that does not say `WATCHDOG=1` in time. It is said only while the writer's thread runs (the
disk answers, if only with an error) and the camera's thread gets pictures or has a good reason to wait.

What the threads share is here too: `Stop`, the request to end; `Heartbeats`; and `BackOff`, the waits before a retry.
With one camera and one disk per box, random waits would gain nothing.
"""

from __future__ import annotations

import signal
import socket
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress

from camera_drivers.clock import Clock
from flight_file.frame import NS_PER_S
from flight_file.untrusted import shown
from recorder.errors import RecorderError
from recorder.journal import Journal
from recorder.thresholds import END_S, LOOK_S, SILENCE_S

_ENDING = (signal.SIGTERM, signal.SIGINT)
SOCKET_VARIABLE = "NOTIFY_SOCKET"
LINE_CHARACTERS = 1000  # systemd takes 4096 bytes at once, and a character has up to four


class Stop:
    """A request to stop; may be made from any thread or signal handler. The first reason counts."""

    def __init__(self) -> None:
        self.event = threading.Event()
        self.reason = ""

    def request(self, reason: str) -> None:
        """Ask to stop."""
        if not self.event.is_set():
            self.reason = reason
            self.event.set()

    @property
    def is_requested(self) -> bool:
        """Whether a stop was requested."""
        return self.event.is_set()


def stop_on_signals(stop: Stop) -> None:
    """Let signals that would end the process request `stop` instead."""
    # A separate thread waits for them: a handler would interrupt the main thread anywhere, and might find a lock taken.
    # The other threads inherit the mask.
    signal.pthread_sigmask(signal.SIG_BLOCK, _ENDING)
    # A terminal that goes away must not end a recording.
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    threading.Thread(target=_wait_for_signals, args=(stop,), name="signals", daemon=True).start()


def _wait_for_signals(stop: Stop) -> None:
    while True:
        stop.request(f"stopped by {signal.Signals(signal.sigwait(_ENDING)).name}")


class Heartbeats:
    """Notes when each thread last made progress, or said that it waits with good reason.

    Parameters
    ----------
    clock
        Its monotonic time is used.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        now_ns = clock.read().monotonic_ns
        self._last_ns = {"camera": now_ns, "disk": now_ns}

    def camera(self) -> None:
        """Note that a picture came, that the camera was heard of, or that it waits."""
        self._note("camera")

    def disk(self) -> None:
        """Note that the disk answers the writer's thread, if only with an error."""
        self._note("disk")

    def silent(self) -> str:
        """Name who has not been heard for too long; empty if nobody."""
        now_ns = self._clock.read().monotonic_ns
        with self._lock:
            late = [name for name, last_ns in self._last_ns.items() if now_ns - last_ns > SILENCE_S * NS_PER_S]
        return " and ".join(late)

    def _note(self, name: str) -> None:
        now_ns = self._clock.read().monotonic_ns
        with self._lock:
            self._last_ns[name] = now_ns


class BackOff:
    """Waits that grow with each failure until the next success."""

    def __init__(self) -> None:
        self.failures = 0

    def next_ns(self, first_and_longest_s: tuple[float, float]) -> int:
        """Count one more failure; return how long to wait now, ns: each time twice as long, up to the longest."""
        first_s, longest_s = first_and_longest_s
        wait_s = min(first_s * 2.0 ** min(self.failures, 30), longest_s)
        self.failures += 1
        return round(wait_s * NS_PER_S)

    def reset(self) -> None:
        """Start again from the shortest wait."""
        self.failures = 0


class ServiceManager:
    """The service manager, systemd, that started us; none if the address is empty.

    Parameters
    ----------
    address
        Of a unix datagram socket: a path, or a name in the abstract namespace after an `@`.
    """

    def __init__(self, address: str = "") -> None:
        self._address = "\0" + address[1:] if address.startswith("@") else address

    @classmethod
    def from_environment(cls, environment: Mapping[str, str]) -> ServiceManager:
        """Find the service manager that the environment names."""
        return cls(environment.get(SOCKET_VARIABLE, ""))

    def say(self, *lines: str) -> None:
        """Send assignments such as `READY=1`, each as one line in a datagram of its own.

        So no text can be taken for another assignment, and if one is refused, the others still arrive. It never waits,
        and a manager that does not listen is ignored.
        """
        if not self._address:
            return
        for line in lines:
            with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as sender:
                sender.sendto(shown(line, most=LINE_CHARACTERS).encode(), self._address)


class Supervision:
    """Waits for the writer's thread and feeds the watchdog meanwhile.

    Parameters
    ----------
    describe
        One line for `systemctl status`.
    """

    def __init__(
        self,
        *,
        stop: Stop,
        heartbeats: Heartbeats,
        service: ServiceManager,
        journal: Journal,
        describe: Callable[[], str],
    ) -> None:
        self._stop = stop
        self._heartbeats = heartbeats
        self._service = service
        self._journal = journal
        self._describe = describe
        self._silent = ""

    def wait_for(self, done: threading.Event, *, limited: bool) -> None:
        """Return when the writer's thread is done.

        Parameters
        ----------
        limited
            Whether it has to be done a few seconds after stopping was asked for.

        Raises
        ------
        RecorderError
            It was not.
        """
        self._service.say("READY=1")
        left_s = END_S
        while not done.wait(LOOK_S):
            self._look()
            if self._stop.is_requested:
                self._service.say("STOPPING=1")
                left_s -= LOOK_S
                if limited and left_s <= 0:
                    raise RecorderError(
                        "The disk did not answer in time; what was written before is in a file that ends in .part, "
                        "run `recorder recover` on it."
                    )
        self._service.say("STOPPING=1")

    def _look(self) -> None:
        silent = self._heartbeats.silent()
        if silent != self._silent:
            self._silent = silent
            if silent:
                self._journal.log.error("silent", who=silent)
        if silent:
            self._service.say(f"STATUS=Nothing heard from the {silent}: waiting for the watchdog.")
        else:
            self._service.say("WATCHDOG=1", f"STATUS={self._describe()}")
