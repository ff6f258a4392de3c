"""SIGTERM and Ctrl-C ask a recording to stop, in its own time."""

from __future__ import annotations

import signal
import threading

from recorder.stop import Stop

_ENDING = (signal.SIGTERM, signal.SIGINT)


def stop_on_signals(stop: Stop) -> None:
    """From now on, signals that would end the process request `stop` instead."""
    # A thread of its own waits for them: a handler would run in the middle of whatever the main thread does, and might
    # find a lock taken. The other threads inherit the mask.
    signal.pthread_sigmask(signal.SIG_BLOCK, _ENDING)
    # A terminal that goes away must not end a recording.
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    threading.Thread(target=_wait_for_signals, args=(stop,), name="signals", daemon=True).start()


def _wait_for_signals(stop: Stop) -> None:
    while True:
        stop.request(f"stopped by {signal.Signals(signal.sigwait(_ENDING)).name}")
