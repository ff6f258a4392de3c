"""What the driver can be told of an IP camera, and its address, which is never shown with a password in it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote, urlsplit

from camera_drivers.errors import CameraUnusableError
from camera_drivers.live.camera import Pace
from flight_file.thresholds import MAX_SMALL_BYTES
from flight_file.untrusted import read_regular


class BadAddressError(ValueError):
    """It is no address of an RTSP stream; the message does not repeat it, since it may hold a password."""


@dataclass(frozen=True, slots=True)
class Options:
    """Wanted settings.

    Attributes
    ----------
    url
        Of the stream, without user and password.
    credentials
        File with one line, `user:password`; None for a camera that anybody may look at.
    latency_s
        How long the camera may take from exposure to sending.
    open_s
        How long connecting may take.
    """

    url: str
    credentials: Path | None = None
    latency_s: float = 0.5
    open_s: float = 15.0
    pace: Pace = field(default_factory=Pace)


def checked_address(url: str) -> str:
    """Return the URL if it is one of an RTSP stream.

    Raises
    ------
    BadAddressError
        It is none, or holds a user or password.
    """
    try:
        parts = urlsplit(url)
        host, _ = parts.hostname, parts.port
    except ValueError as error:
        raise BadAddressError("it is no rtsp URL") from error
    if "@" in parts.netloc:
        raise BadAddressError("it holds a user or password, which every flight would carry; put them into credentials")
    if parts.scheme != "rtsp" or not host or not url.isascii() or not url.isprintable() or " " in url:
        raise BadAddressError("it is no rtsp URL")
    return url


def with_credentials(options: Options) -> str:
    """Return the address with user and password in it, which is to be shown to nobody.

    Raises
    ------
    CameraUnusableError
        The file with the credentials cannot be read, or does not hold any.
    """
    if options.credentials is None:
        return options.url
    try:
        line = read_regular(options.credentials, limit_bytes=MAX_SMALL_BYTES).decode("utf-8").strip("\r\n")
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is no text"
        raise CameraUnusableError(f"camera.credentials: {options.credentials} cannot be read ({why}).") from error
    user, colon, password = line.partition(":")
    if not user or not colon or not line.isprintable():
        raise CameraUnusableError(f"camera.credentials: {options.credentials} must hold one line, user:password.")
    return options.url.replace("://", f"://{quote(user, safe='')}:{quote(password, safe='')}@", 1)
