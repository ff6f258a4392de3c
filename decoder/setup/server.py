"""The set-up page's server: on this machine alone, on whatever port is free, until Ctrl-C."""

from __future__ import annotations

import secrets
import socket
import sys
from contextlib import suppress
from dataclasses import dataclass

import uvicorn

from decoder.setup.app import setup_app
from decoder.setup.guard import Guard
from decoder.setup.session import SetupSession

ADDRESS = "127.0.0.1"
GRACE_S = 1
# An answer that somebody waits for is not to queue behind a trial of a gauge in another thread.
SWITCH_S = 0.0005


@dataclass(frozen=True, slots=True)
class SetupServer:
    """A server that listens already; `url` is where its page is."""

    server: uvicorn.Server
    listening: socket.socket
    url: str

    def run(self) -> None:
        """Serves until it is told to end."""
        before = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH_S)
        try:
            with suppress(KeyboardInterrupt):  # how a page ends
                self.server.run(sockets=[self.listening])
        finally:
            sys.setswitchinterval(before)
            self.listening.close()


def setup_server(session: SetupSession) -> SetupServer:
    """The server of a session's page."""
    listening = socket.socket()
    listening.bind((ADDRESS, 0))
    listening.listen()  # who is told the address may ask at once
    port = listening.getsockname()[1]
    token = secrets.token_urlsafe(24)
    app = Guard(setup_app(session), token, (f"{ADDRESS}:{port}", f"localhost:{port}"))
    config = uvicorn.Config(
        app, log_level="critical", access_log=False, lifespan="off", ws="none", server_header=False,
        timeout_graceful_shutdown=GRACE_S,
    )  # fmt: skip
    return SetupServer(uvicorn.Server(config), listening, f"http://{ADDRESS}:{port}/{token}/")
