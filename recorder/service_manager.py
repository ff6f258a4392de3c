"""Talking to systemd: one datagram to the socket that it names, as sd_notify(3) describes it.

Twenty lines of our own, because the libraries that do it are unmaintained or need a C compiler on the box.
"""

from __future__ import annotations

import socket
from collections.abc import Mapping
from contextlib import suppress

SOCKET_VARIABLE = "NOTIFY_SOCKET"


class ServiceManager:
    """Whoever started us and wants to know how we are; nobody, if the address is empty.

    Parameters
    ----------
    address
        Of a unix datagram socket: a path, or a name in the abstract namespace after an `@`.
    """

    def __init__(self, address: str = "") -> None:
        self._address = "\0" + address[1:] if address.startswith("@") else address

    @classmethod
    def from_environment(cls, environment: Mapping[str, str]) -> ServiceManager:
        """The one that the environment names."""
        return cls(environment.get(SOCKET_VARIABLE, ""))

    def say(self, *lines: str) -> None:
        """Send assignments such as `READY=1`; never waits, and a manager that does not listen is none of our worry."""
        if not self._address:
            return
        with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as sender:
            sender.sendto("\n".join(lines).encode(), self._address)
