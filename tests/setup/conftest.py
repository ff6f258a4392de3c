"""The set-up page's server in a thread, a real Chromium to look at it, and a hand to draw with."""

from __future__ import annotations

import http.client
import json
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, Page, expect

from decoder.setup.app import SetupServer, setup_server
from decoder.setup.session import SetupSession
from decoder.setup.sources import open_source
from tests.programs import A1, FIXTURES

expect.set_options(timeout=60_000)  # a busy machine is no failure


@dataclass(frozen=True, slots=True)
class Running:
    """A server at work."""

    server: SetupServer
    session: SetupSession
    thread: threading.Thread

    @property
    def url(self) -> str:
        """Where its page is."""
        return self.server.url

    def stop(self) -> None:
        """Ends it, as Ctrl-C does."""
        self.server.server.should_exit = True
        self.thread.join(10.0)


Start = Callable[..., Running]


@contextmanager
def serving(flight: Path, panel: Path | None, save_as: Path) -> Iterator[Running]:
    """A server that ends with the block."""
    session = SetupSession(open_source([flight]), panel, save_as)
    server = setup_server(session)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    running = Running(server, session, thread)
    yield running
    running.stop()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts servers; a new panel is begun unless one is named."""
    with ExitStack() as stack:

        def begin(
            flight: Path = A1, panel: Path | None = tmp_path / "new" / "panel.yaml", save_as: Path | None = None
        ) -> Running:
            return stack.enter_context(serving(flight, panel, save_as or panel or tmp_path / "panel.yaml"))

        yield begin


@pytest.fixture(scope="module")
def shared_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """A server with a flight and its own panel, for tests that leave its panel as it is, or save it whatever it is."""
    with serving(A1, None, tmp_path_factory.mktemp("saved") / "folder" / "panel.yaml") as running:
        yield running


@pytest.fixture(scope="module")
def server_of_picture(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """A server with that panel on its own picture alone: a gauge is tried at once, however often something changes."""
    target = tmp_path_factory.mktemp("saved") / "folder" / "panel.yaml"
    with serving(FIXTURES / "panel.jpg", FIXTURES / "panel.yaml", target) as running:
        yield running


def without_drafts(running: Running) -> Running:
    """A server, with no draft of another test."""
    for draft in running.session.target.parent.glob(".*.draft"):
        draft.unlink()
    return running


@pytest.fixture
def server(shared_server: Running) -> Running:
    """A server with a flight, for tests that leave its panel as it is."""
    return without_drafts(shared_server)


@pytest.fixture
def still(server_of_picture: Running) -> Running:
    """A server with a picture, for tests that leave its panel as it is."""
    return without_drafts(server_of_picture)


Answer = tuple[int, Any, Mapping[str, str]]
Send = Callable[..., Answer]


@pytest.fixture(scope="module")
def send(shared_server: Running) -> Send:
    """Sends requests to a running page as they stand, and gives status, JSON or bytes, and headers."""
    url = urlsplit(shared_server.url)

    def request(
        method: str,
        path: str,
        body: str | bytes | Iterable[bytes] | None = None,
        *,
        token: str | None = None,
        **headers: str,
    ) -> Answer:
        connection = http.client.HTTPConnection("127.0.0.1", url.port or 0, timeout=60)
        prefix = url.path.rstrip("/") if token is None else token
        connection.request(method, prefix + path, body, {k.replace("_", "-"): v for k, v in headers.items()})
        answer = connection.getresponse()
        content = answer.read()
        connection.close()
        told = answer.getheader("content-type", "")
        return answer.status, json.loads(content) if told == "application/json" else content, dict(answer.headers)

    return request


OpenPage = Callable[[Running], Page]


@pytest.fixture
def open_page(browser: Browser) -> Iterator[OpenPage]:
    """Opens the page in a tab of its own; what it says on the console fails the test at its end.

    How its gauges stood then, and what it still waited for, is printed for tests that fail.
    """
    said: list[str] = []
    waiting: list[str] = []
    pages: list[Page] = []

    def opened(running: Running, *, quiet: bool = True) -> Page:
        # Nothing pulses: without a graphics processor that costs more than what is tested.
        page = browser.new_context(viewport={"width": 1500, "height": 940}, reduced_motion="reduce").new_page()
        page.set_default_timeout(15_000)
        if quiet:
            page.on("console", lambda message: said.append(f"{message.type}: {message.text}"))
            page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: waiting.append(request.url))
        for event in ("requestfinished", "requestfailed"):
            page.on(event, lambda request: waiting.remove(request.url))
        page.goto(running.url)
        page.wait_for_selector("body[data-ready]")
        pages.append(page)
        return page

    yield opened
    for page in pages:
        stand = page.locator("#outline").all_inner_texts() if not page.is_closed() else []
        sys.stdout.write(f"{page.url} shows {stand} and waits for {waiting}\n")
        page.context.close()
    assert said == []
