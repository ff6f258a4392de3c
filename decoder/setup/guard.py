"""The guard before the set-up page, which admits only the browser given the address, and nothing large or foreign.

The server listens on this machine only, but other programs and, through the browser, other web pages could still reach
it. So the address contains a token; the Host must be this server's own, which no page gets by resolving its name to
127.0.0.1 (DNS rebinding); a request that states its origin must come from the page itself; and no answer allows
anything to be loaded from elsewhere.
"""

from __future__ import annotations

import secrets
from http import HTTPStatus

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from decoder.panel.errors import DecoderError
from flight_file.thresholds import MAX_YAML_BYTES

OWN_SITES = (None, "same-origin", "none")
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class BodyTooLarge(DecoderError):
    """A request's body is larger than `MAX_YAML_BYTES`, or continues beyond that."""

    def __init__(self) -> None:
        super().__init__(f"the request is larger than {MAX_YAML_BYTES // 2**20} MiB")


class Guard:
    """Passes requests to the page's application, and writes the headers of all answers.

    Parameters
    ----------
    token
        The first part of every path.
    hosts
        The permitted Host headers.
    """

    def __init__(self, app: ASGIApp, token: str, hosts: tuple[str, ...]) -> None:
        self._app, self._token, self._hosts = app, token, hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] != "http":
            return

        async def guarded_send(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers[name] = value
            await send(message)

        refusal = self._refusal(scope)
        if refusal is not None:
            status, reason = refusal
            await JSONResponse({"error": reason}, status)(scope, receive, guarded_send)
            return
        prefix = f"/{self._token}"
        inside = {**scope, "path": scope["path"].removeprefix(prefix) or "/", "root_path": "", "raw_path": b""}
        await self._app(inside, _counted(receive), guarded_send)

    def _refusal(self, scope: Scope) -> tuple[int, str] | None:
        headers = Headers(scope=scope)
        if headers.get("host") not in self._hosts:
            return HTTPStatus.MISDIRECTED_REQUEST, "this address is not the set-up page's own"
        origins = {f"http://{host}" for host in self._hosts}
        if headers.get("origin") is not None and headers["origin"] not in origins:
            return HTTPStatus.FORBIDDEN, "the request comes from another page"
        if headers.get("sec-fetch-site") not in OWN_SITES:
            return HTTPStatus.FORBIDDEN, "the request comes from another site"
        first = scope["path"].removeprefix("/").partition("/")[0]  # `OPTIONS *` has no path
        if not secrets.compare_digest(first.encode(errors="replace"), self._token.encode()):
            return HTTPStatus.FORBIDDEN, "the token is missing or wrong; open the address that `decode setup` printed"
        length = headers.get("content-length", "0")
        if not length.isdecimal() or len(length) > len(str(MAX_YAML_BYTES)) or int(length) > MAX_YAML_BYTES:
            return HTTPStatus.REQUEST_ENTITY_TOO_LARGE, str(BodyTooLarge())
        return None


def _counted(receive: Receive) -> Receive:
    taken = 0

    async def counted() -> Message:
        nonlocal taken
        message = await receive()
        taken += len(message.get("body", b""))
        if taken > MAX_YAML_BYTES:
            raise BodyTooLarge
        return message

    return counted
