"""Web servers that are no camera, and do harm to whoever asks them."""

from __future__ import annotations

import socket
import threading
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from socketserver import BaseRequestHandler, ThreadingTCPServer

Act = Callable[[socket.socket], object]
OK = b"HTTP/1.1 200 OK\r\n"


class Strangers(ThreadingTCPServer):
    """A web server that does what was ordered for each page; counts what it is asked for."""

    daemon_threads = True
    request_queue_size = 128

    def __init__(self) -> None:
        self.acts: dict[str, Act] = {}
        self.asked: Counter[str] = Counter()
        self.most_threads = 0
        super().__init__(("127.0.0.1", 0), _Handler)

    def url(self, act: Act, page: str = "x") -> str:
        """Of a page that does this."""
        self.acts[page] = act
        return f"http://127.0.0.1:{self.server_address[1]}/{page}"


class _Handler(BaseRequestHandler):
    server: Strangers

    def handle(self) -> None:
        """Do it."""
        page = self.request.recv(65536).split()[1].decode().lstrip("/")
        self.server.asked[page] += 1
        threads = sum(thread.name == "camera description" for thread in threading.enumerate())
        self.server.most_threads = max(self.server.most_threads, threads)
        with suppress(OSError):
            self.server.acts[page](self.request)


def drip(head: bytes) -> Act:
    """A byte now and then, for longer than anybody waits."""

    def act(connection: socket.socket) -> None:
        connection.sendall(head)
        while True:
            connection.sendall(b"x")
            threading.Event().wait(0.05)

    return act


def send(answer: bytes) -> Act:
    """Send and close."""
    return lambda connection: connection.sendall(answer)


def send_a_gigabyte(head: bytes = b"") -> Act:
    """Whether it was announced or not."""

    def act(connection: socket.socket) -> None:
        connection.sendall(OK + head + b"\r\n")
        for _ in range(2**14):
            connection.sendall((b"10000\r\n" if b"chunked" in head else b"") + bytes(65536) + b"\r\n")

    return act
