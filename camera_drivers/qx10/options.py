"""What the driver can be told: what the camera shall do, and how long each thing may take.

The limits are generous where nobody has measured them on a real camera; docs/qx10.md says which those are.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from camera_drivers.qx10.addresses import BadUrlError, host_of
from camera_drivers.settings import MAX_URL_CHARACTERS, Seconds, Settings, Words, one_line
from flight_file.thresholds import MAX_READ_BYTES

SSDP_ADDRESS = ("239.255.255.250", 1900)


def _number_as_text(value: object) -> object:
    # The camera wants "400" where YAML reads a number; a person must not need to know.
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


def _http_url(url: str) -> str:
    try:
        host = host_of(url)
        host.encode("idna")  # a name with a part of no letter or of too many could be looked up nowhere
    except (BadUrlError, UnicodeError) as error:
        raise ValueError("it is no http URL") from error
    if ":" in host:
        raise ValueError("it has an IPv6 address, and the camera is called by IPv4 only; give its IPv4 address")
    return url


_HttpUrl = Annotated[str, Field(max_length=MAX_URL_CHARACTERS), AfterValidator(one_line), AfterValidator(_http_url)]


class Qx10Limits(Settings):
    """How long each thing may take on a QX10, seconds; for a camera that turns out to be slower than expected."""

    search_s: Seconds = 20.0
    """Looking for the camera on the network."""
    connect_s: Seconds = 5.0
    """Until a connection stands."""
    call_s: Seconds = 10.0
    """An ordinary call."""
    shot_s: Seconds = 90.0
    """Taking a picture: focus, exposure and processing."""
    exposure_s: Seconds = 180.0
    """Until a picture that was not finished in the first answer has an address."""
    download_s: Seconds = 60.0
    """Fetching a picture."""
    event_s: Seconds = 90.0
    """A call that waits for news."""
    ready_s: Seconds = 60.0
    """Until the camera is idle."""
    settle_s: Seconds = 5.0
    """Until a setting can be read back."""
    zoom_s: Seconds = 15.0
    """From one end of the zoom to the other."""
    stall_s: Seconds = 10.0
    """Without a liveview picture."""
    frozen_s: Seconds = 30.0
    """With the very same picture: then the camera is connected again."""
    picture_mib: Annotated[int, Field(gt=0, le=256)] = 32
    """The largest picture that is taken for one, MiB; above 60 it counts as 60, which a flight file takes."""

    @property
    def picture_bytes(self) -> int:
        """The largest picture, bytes."""
        return min(self.picture_mib * 2**20, MAX_READ_BYTES)


class Qx10Settings(Settings):
    """A Sony DSC-QX10; what is left out and has no value here stays as the camera has it."""

    driver: Literal["qx10"]
    """A Sony DSC-QX10."""
    url: _HttpUrl | None = None
    """Of the camera's description; without it the camera is looked for by SSDP."""
    interface: Words | None = None
    """The network interface on which it is looked for, such as `wlan0`; without it the system chooses."""
    mode: Literal["stills", "liveview"] = "stills"
    """Stills, or liveview: 640 x 480 pixels, about 14 a second."""
    interval_s: Annotated[float, Field(ge=0, le=3600)] = 2.0
    """Seconds from one still to the next; 0 is as fast as the camera can."""
    picture: Literal["Original", "2M"] = "Original"
    """All pixels, or about two megapixels, which is faster."""
    zoom: Literal["wide", "tele", "leave"] | Annotated[float, Field(gt=0, le=1000)] = "leave"
    """An end of the zoom, `leave` it as it is, or a focal length in mm (4.45 to 44.5)."""
    exposure_compensation: Annotated[int, Field(ge=-6, le=6)] | None = None
    """In the camera's steps of a third of an EV; in Program Auto only."""
    exposure_mode: Words | None = None
    """As the camera names it: `Program Auto`, `Intelligent Auto` or `Superior Auto`."""
    iso_speed_rate: Annotated[Words, BeforeValidator(_number_as_text)] | None = None
    """`AUTO`, or 100 to 3200; in Program Auto only."""
    white_balance: Words | None = None
    """As the camera names it, such as `Daylight`; in Program Auto only."""
    still_size: tuple[Words, Words] | None = None
    """Aspect and size, such as `["4:3", "18M"]`."""
    beep_mode: Words | None = None
    """`On`, `Off` or `Shutter Only`."""
    set_clock: bool = True
    """Whether the camera's clock is set to UTC at each connection."""
    long_poll: bool = True
    """Whether a call that waits for news is kept open, so that the Wi-Fi is never idle."""
    limits: Qx10Limits = Qx10Limits()
    """How long each thing may take."""
    search_address: ClassVar[tuple[str, int]] = SSDP_ADDRESS
    """Where the search is sent; tests have their own."""
