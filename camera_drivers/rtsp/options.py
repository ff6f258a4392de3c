"""What the driver can be told of an IP camera, and its address, which is never shown with a password in it."""

from __future__ import annotations

from typing import Annotated, Literal
from urllib.parse import quote, urlsplit

from pydantic import BeforeValidator, Field

from camera_drivers.errors import CameraUnusableError
from camera_drivers.settings import MAX_URL_CHARACTERS, AnchoredPath, LiveSettings, Seconds, WithheldError
from flight_file.thresholds import MAX_SMALL_BYTES
from flight_file.untrusted import read_regular


def checked_address(url: object) -> str:
    """Return the URL if it is one of an RTSP stream.

    Raises
    ------
    WithheldError
        It is none, or holds a user or password; the message does not repeat it.
    """
    if not isinstance(url, str) or len(url) > MAX_URL_CHARACTERS:
        raise WithheldError("it is no rtsp URL")
    try:
        parts = urlsplit(url)
        host, _ = parts.hostname, parts.port
    except ValueError as error:
        raise WithheldError("it is no rtsp URL") from error
    if "@" in parts.netloc:
        raise WithheldError("it holds a user or password, which every flight would carry; put them into credentials")
    if parts.scheme != "rtsp" or not host or not url.isascii() or not url.isprintable() or " " in url:
        raise WithheldError("it is no rtsp URL")
    return url


class RtspSettings(LiveSettings):
    """An IP camera that sends H.264 or H.265 over RTSP; needs the extra `video`."""

    driver: Literal["rtsp"]
    """An IP camera."""
    url: Annotated[str, BeforeValidator(checked_address)]
    """Of its stream, such as `rtsp://192.168.1.20:554/stream1`, without user and password."""
    credentials: AnchoredPath | None = None
    """A file with one line, `user:password`, that the recorder can read; it is never attached."""
    latency_s: Annotated[float, Field(gt=0, le=10)] = 0.5
    """How long the camera may take from exposure to sending. Its own clock is believed if it is behind the box's by no
    more than this, and not ahead."""
    open_s: Seconds = 15.0
    """How long connecting may take."""


def with_credentials(options: RtspSettings) -> str:
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
