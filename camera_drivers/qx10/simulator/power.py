"""The simulated camera on and off: away while it boots, mute while it hangs."""

from __future__ import annotations

import threading
from collections.abc import Callable

from camera_drivers.clock import Clock
from camera_drivers.qx10.simulator.model import CameraModel

_NS_PER_S = 1_000_000_000
_LOOK_S = 0.02


class Power:
    """Whether the camera is there.

    Parameters
    ----------
    set_on
        Makes the camera's ports be there, or not.
    """

    def __init__(self, model: CameraModel, clock: Clock, set_on: Callable[[bool], None]) -> None:
        self._model = model
        self._clock = clock
        self._set_on = set_on
        self._silent_until_ns = 0
        self._over = threading.Event()
        self.is_on = True

    def reboot(self) -> None:
        """Be gone, and come back after a while as after switching on."""
        self.is_on = False
        self._later(0.0, self._gone)

    def overheat(self) -> None:
        """Report an error for a while, and then be gone."""
        self._model.fail(failed=True)
        self._later(self._model.behaviour.error_s, self._gone)

    def fall_silent(self) -> None:
        """Answer nothing for a while."""
        self._silent_until_ns = self._clock.read().monotonic_ns + round(self._model.behaviour.silent_s * _NS_PER_S)

    def wait_while_silent(self) -> None:
        """Come back when there are answers again."""
        while self._clock.read().monotonic_ns < self._silent_until_ns and not self._over.wait(_LOOK_S):
            pass

    def end(self) -> None:
        """Nothing that was to happen later happens."""
        self._over.set()

    def _later(self, seconds: float, act: Callable[[], None]) -> None:
        def wait_and_act() -> None:
            if not self._over.wait(seconds):
                act()

        threading.Thread(target=wait_and_act, name="simulated power", daemon=True).start()

    def _gone(self) -> None:
        self.is_on = False
        self._set_on(False)
        if self._over.wait(self._model.behaviour.reboot_s):
            return
        self._model.switch_on()
        self.is_on = True
        self._set_on(True)
