"""The host in a URL. The camera's URLs are never trusted with it.

After about a hundred pictures, related models were seen to name 0.0.0.0 as the host of a picture; others name a foreign
address. Whatever host an answer names, what is called is the address where the camera itself was found, with the port,
path and query of the answer. So a wrong host costs no picture, and no stranger is ever called.
"""

from __future__ import annotations

from urllib.parse import urlsplit, urlunsplit

HTTP_PORT = 80


class BadUrlError(ValueError):
    """The text is not an http URL."""


def host_of(url: str) -> str:
    """Return the host of an http URL, in lower case and without port; raises BadUrlError."""
    try:
        parts = urlsplit(url)
        host, _ = parts.hostname, parts.port
    except ValueError as error:
        raise BadUrlError(url) from error
    if parts.scheme != "http" or not host:
        raise BadUrlError(url)
    return host


def at_host(url: str, host: str) -> str:
    """Replace the host of a URL; port, path and query stay, a user name is dropped.

    Raises
    ------
    BadUrlError
        It is no http URL.
    """
    host_of(url)
    parts = urlsplit(url)
    bracketed = f"[{host}]" if ":" in host else host
    return urlunsplit(("http", f"{bracketed}:{parts.port or HTTP_PORT}", parts.path or "/", parts.query, ""))
