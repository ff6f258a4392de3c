"""The camera's controls: which are wanted, and how one is set and verified.

| setting         | automatic                  | its own value              | unit of the latter |
| --------------- | -------------------------- | -------------------------- | ------------------ |
| exposure_s      | EXPOSURE_AUTO 3, manual 1  | EXPOSURE_ABSOLUTE          | 100 us             |
| focus           | FOCUS_AUTO 1, manual 0     | FOCUS_ABSOLUTE             | the camera's       |
| white_balance_k | AUTO_WHITE_BALANCE 1, 0    | WHITE_BALANCE_TEMPERATURE  | K                  |
| gain            | -                          | GAIN                       | the camera's       |
| power_line_hz   | -                          | POWER_LINE_FREQUENCY       | 0 off, 1 50, 2 60  |

A control is looked up, set within its limits, and read back. A control that is missing or refused is reported once and
left as it is: pictures with the wrong exposure are better than none. Source: linux/v4l2-controls.h; EXPOSURE_AUTO 3 is
aperture priority, the one automatic mode that UVC cameras have.
"""

from __future__ import annotations

import errno
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from camera_drivers.uvc.device import GONE, Device
from camera_drivers.uvc.options import UvcSettings
from camera_drivers.uvc.v4l2 import CONTROL_DISABLED, Control, ControlQuery, ControlValue, Request
from camera_drivers.waiting import Notes

STATE = "setting"
EXPOSURE_UNITS_PER_S = 10_000
_POWER_LINE = {None: None, 0: 0, 50: 1, 60: 2}


@dataclass(frozen=True, slots=True)
class Wish:
    """A control, its wanted value, and the setting that asks for it."""

    setting: str
    control: Control
    value: int


@dataclass(frozen=True, slots=True)
class _Held:
    """A value that the camera chooses automatically unless fixed: the two controls, and the values of the first."""

    setting: str
    automatic: Control
    own: Control
    auto: int
    manual: int

    def wishes(self, value: int | Literal["auto"] | None) -> Iterator[Wish]:
        """Yield one wish or two, or none if it is to be left alone."""
        if value is None:
            return
        yield Wish(self.setting, self.automatic, self.auto if value == "auto" else self.manual)
        if value != "auto":
            yield Wish(self.setting, self.own, value)


_EXPOSURE = _Held("exposure_s", Control.EXPOSURE_AUTO, Control.EXPOSURE_ABSOLUTE, auto=3, manual=1)
_FOCUS = _Held("focus", Control.FOCUS_AUTO, Control.FOCUS_ABSOLUTE, auto=1, manual=0)
_WHITE = _Held("white_balance_k", Control.AUTO_WHITE_BALANCE, Control.WHITE_BALANCE_TEMPERATURE, auto=1, manual=0)


def wishes(options: UvcSettings) -> list[Wish]:
    """List the wanted controls in the order in which they must be set: automatic modes first."""
    single = {
        ("gain", Control.GAIN): options.gain,
        ("power_line_hz", Control.POWER_LINE_FREQUENCY): _POWER_LINE[options.power_line_hz],
    }
    return [
        *_EXPOSURE.wishes(_exposure_units(options.exposure_s)),
        *_FOCUS.wishes(options.focus),
        *_WHITE.wishes(options.white_balance_k),
        *(Wish(setting, control, value) for (setting, control), value in single.items() if value is not None),
    ]


def _exposure_units(wanted_s: float | Literal["auto"] | None) -> int | Literal["auto"] | None:
    if wanted_s is None or wanted_s == "auto":
        return wanted_s
    return max(1, round(wanted_s * EXPOSURE_UNITS_PER_S))


def set_controls(device: Device, options: UvcSettings, notes: Notes) -> None:
    """Set all that is wanted.

    Raises
    ------
    OSError
        The device is gone.
    """
    for wish in wishes(options):
        try:
            problem = _problem(device, wish)
        except OSError as error:
            if error.errno in GONE:
                raise
            problem = f"the camera refuses it ({error.strerror})"
        if problem:
            notes.say_once(STATE, f"{wish.setting} is not as wanted: {problem}")


def _problem(device: Device, wish: Wish) -> str:
    limits = ControlQuery(id=wish.control)
    try:
        device.ioctl(Request.QUERYCTRL, limits)
    except OSError as error:
        if error.errno != errno.EINVAL:
            raise
        limits.flags = CONTROL_DISABLED
    if limits.flags & CONTROL_DISABLED:
        return f"the camera has no {wish.control.name.lower()}"
    value = min(max(wish.value, limits.minimum), limits.maximum)
    held = ControlValue(id=wish.control, value=value)
    device.ioctl(Request.S_CTRL, held)
    shown = ControlValue(id=wish.control)
    device.ioctl(Request.G_CTRL, shown)
    name = wish.control.name.lower()
    if value != wish.value:
        return f"{name} takes {limits.minimum} to {limits.maximum} and is {shown.value}, not {wish.value}"
    return "" if shown.value == value else f"{name} was set to {value} and shows {shown.value}"
