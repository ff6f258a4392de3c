"""What the driver can be told: what the camera shall do, and how long each thing may take.

The limits are generous where nobody has measured them on a real camera; docs/qx10.md says which those are.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

SSDP_ADDRESS = ("239.255.255.250", 1900)


@dataclass(frozen=True, slots=True)
class Limits:
    """How long each thing may take, seconds, from beginning to end, and how large a picture may be.

    Attributes
    ----------
    search_s
        Looking for the camera on the network.
    connect_s
        Until a connection stands.
    call_s
        An ordinary call.
    shot_s
        Taking a picture: focus, exposure and processing; the camera may take several tens of seconds to say that it
        is not finished.
    exposure_s
        Until a picture that was not finished in the first answer has an address.
    download_s
        Fetching a picture.
    event_s
        A call that waits for news; the camera ends it itself after a time that is not documented.
    ready_s
        Until the camera is idle.
    settle_s
        Until a setting can be read back.
    zoom_s
        From one end of the zoom to the other.
    stall_s
        Without a liveview picture.
    picture_bytes
        The largest picture that is taken for one.
    """

    search_s: float = 20.0
    connect_s: float = 5.0
    call_s: float = 10.0
    shot_s: float = 90.0
    exposure_s: float = 180.0
    download_s: float = 60.0
    event_s: float = 90.0
    ready_s: float = 60.0
    settle_s: float = 5.0
    zoom_s: float = 15.0
    stall_s: float = 10.0
    picture_bytes: int = 32 * 2**20


@dataclass(frozen=True, slots=True)
class Options:
    """Wanted settings; None leaves one as the camera has it.

    Attributes
    ----------
    url
        Of the camera's description; None to look for it by SSDP.
    interface
        The network interface to look on; None for the system's choice.
    interval_s
        From one still to the next, 0 for as fast as the camera can.
    zoom
        wide, tele, leave, or a focal length in mm.
    exposure_compensation
        An index of the camera's own steps, a third of an EV each.
    still_size
        Aspect and size, such as ("4:3", "18M").
    set_clock
        Set the camera's clock to UTC at each connection.
    long_poll
        Keep a call open that waits for news; without it the camera is only asked when something is needed.
    search_address
        Where to send the search; tests have their own.
    """

    url: str | None = None
    interface: str | None = None
    mode: Literal["stills", "liveview"] = "stills"
    interval_s: float = 2.0
    picture: str = "Original"
    zoom: Literal["wide", "tele", "leave"] | float = "leave"
    exposure_mode: str | None = None
    exposure_compensation: int | None = None
    iso_speed_rate: str | None = None
    white_balance: str | None = None
    still_size: tuple[str, str] | None = None
    beep_mode: str | None = None
    set_clock: bool = True
    long_poll: bool = True
    limits: Limits = field(default_factory=Limits)
    search_address: tuple[str, int] = SSDP_ADDRESS
