"""How a simulated camera is: how long it takes, and what it does where nobody knows what a real one does."""

from __future__ import annotations

from dataclasses import dataclass

from camera_drivers.qx10.simulator.methods import FORBIDDEN


@dataclass(frozen=True, slots=True)
class Behaviour:
    """Timing and habits of the simulated camera.

    Attributes
    ----------
    shot_s, save_s
        How long it takes a picture, and then saves it, s.
    apply_s
        How long a setting that was accepted takes to show, s.
    long_poll_s
        After so long without news a call that waits for them is answered with a timeout, s.
    delay_s, reboot_s, error_s, silent_s
        How long these faults last, s.
    zoom_percent_per_s
        How fast the lens goes.
    forbidden
        Calls that are answered with 403 though they are listed.
    tells_shots
        Whether `getEvent` tells of pictures that were taken over the network.
    remembers_shot
        Whether `awaitTakePicture` tells the last picture again after its answer was lost.
    clock_offset_s
        By how much its clock is ahead at first.
    """

    shot_s: float = 0.3
    save_s: float = 0.2
    apply_s: float = 0.0
    long_poll_s: float = 20.0
    delay_s: float = 3.0
    reboot_s: float = 5.0
    error_s: float = 2.0
    silent_s: float = 5.0
    zoom_percent_per_s: float = 40.0
    forbidden: frozenset[str] = FORBIDDEN
    tells_shots: bool = False
    remembers_shot: bool = False
    clock_offset_s: float = 0.0
