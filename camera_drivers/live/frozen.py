"""Detection of pictures that stopped changing: a camera may keep sending its last one.

No two pictures of a real sensor are the same to the last bit, unless everything in them is black or white. So a camera
is connected again once for each picture that stays the same; if the very same one comes after that, it is what the
camera sees, or cannot be helped, and recording goes on.

     moving ──same for frozen_s──▶ connect again ──another one──▶ moving
                                        └──────the same one─────▶ standing, reported ──another one──▶ moving
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

from camera_drivers.errors import CameraError
from camera_drivers.waiting import Notes
from flight_file.frame import NS_PER_S

STATE = "frozen"
_PICTURE, _NUMBER = _WHAT = ("the picture", "the picture's number")


@dataclass(frozen=True, slots=True)
class _Standing:
    """A value, since when it has not changed (monotonic, ns), and since which frame."""

    value: Hashable
    since_ns: int
    sequence: int


class FrozenWatch:
    """Compares each picture with those before it, over all connections of one camera.

    Parameters
    ----------
    frozen_s
        How long a picture or its number may stay the same.
    """

    def __init__(self, frozen_s: float, notes: Notes) -> None:
        self._frozen_s = frozen_s
        self._notes = notes
        self._standing: dict[str, _Standing] = {}
        self._reconnected_for: dict[str, Hashable] = {}
        self._said: set[str] = set()

    def begin(self) -> None:
        """Start a new connection, which may restart the pictures' numbers."""
        self._standing.pop(_NUMBER, None)

    def look(self, values: Sequence[Hashable], now_ns: int, sequence: int) -> CameraError | None:
        """Check a picture's digest and, if it has one, its number; return the reason to connect again, if any.

        Parameters
        ----------
        now_ns
            By the monotonic clock.
        sequence
            Of the picture's frame, or the frame it would be, for the report.
        """
        trouble = None
        for what, value in zip(_WHAT[: len(values)], values, strict=True):
            held = self._standing.get(what)
            if held is None or held.value != value:
                self._moved(what, _Standing(value, now_ns, sequence))
            elif now_ns - held.since_ns >= self._frozen_s * NS_PER_S:
                trouble = self._stands(what, held) or trouble
        return trouble

    def _moved(self, what: str, standing: _Standing) -> None:
        self._standing[what] = standing
        if what in self._said:
            self._said.discard(what)
            self._notes.say(STATE, f"{what} changes again", sequence=standing.sequence)

    def _stands(self, what: str, held: _Standing) -> CameraError | None:
        if self._reconnected_for.get(what) != held.value:
            self._reconnected_for[what] = held.value
            return CameraError(
                f"{what[0].upper()}{what[1:]} has not changed for {self._frozen_s:g} s, since frame {held.sequence}; "
                "the camera is connected again."
            )
        if what not in self._said:
            self._said.add(what)
            self._notes.say(
                STATE,
                f"{what} is the same after connecting again: all black or white, or the camera hangs; switch it off"
                " and on",
                sequence=held.sequence,
            )
        return None
