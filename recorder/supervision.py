"""What the main thread does while the others work: feeds the watchdog as long as both get on, and sees to the end.

systemd ends a service that does not say `WATCHDOG=1` in time, and starts it again. It is said only while the writer's
thread turns (the disk answers, with an error at least) and the camera's thread gets pictures or waits with good reason.
"""

from __future__ import annotations

from collections.abc import Callable

from recorder.errors import RecorderError
from recorder.journal import Journal
from recorder.service_manager import ServiceManager
from recorder.signs_of_life import SignsOfLife
from recorder.stop import Stop
from recorder.writing import Writing

LOOK_S = 0.5
END_S = 4.5  # together with a look less than the five seconds in which the recorder has to end


class Supervision:
    """Waits for the writer's thread.

    Parameters
    ----------
    describe
        One line for `systemctl status`.
    """

    def __init__(
        self, *, stop: Stop, signs: SignsOfLife, service: ServiceManager, journal: Journal, describe: Callable[[], str]
    ) -> None:
        self._stop = stop
        self._signs = signs
        self._service = service
        self._journal = journal
        self._describe = describe
        self._silent = ""

    def wait_for(self, writing: Writing, *, limited: bool) -> None:
        """Come back when it is done.

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
        while not writing.done.wait(LOOK_S):
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
        silent = self._signs.silent()
        if silent != self._silent:
            self._silent = silent
            if silent:
                self._journal.log.error("silent", who=silent)
        if silent:
            self._service.say(f"STATUS=Nothing heard from the {silent}: waiting for the watchdog.")
        else:
            self._service.say("WATCHDOG=1", f"STATUS={self._describe()}")
