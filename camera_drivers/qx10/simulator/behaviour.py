"""Behaviour of a simulated camera: its timing, and its choices where a real one's behaviour is unknown."""

from __future__ import annotations

from dataclasses import dataclass

from camera_drivers.qx10.simulator.methods import FORBIDDEN


@dataclass(frozen=True, slots=True)
class Behaviour:
    """Timing and habits of the simulated camera.

    Attributes
    ----------
    shot_s, save_s
        Duration of taking a picture, and of saving it, s.
    apply_s
        How long an accepted setting takes to show, s.
    long_poll_s
        A call that waits for news is answered with a timeout after this long, s.
    delay_s, reboot_s, error_s, silent_s
        How long these faults last, s.
    zoom_percent_per_s
        Speed of the lens.
    forbidden
        Calls that are answered with 403 though they are listed.
    tells_shots
        Whether `getEvent` reports pictures taken over the network.
    remembers_shot
        Whether `awaitTakePicture` repeats the last picture after its answer was lost.
    clock_offset_s
        Initial offset of its clock, positive if ahead.
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
