"""A real Chromium without network, to look at reports in."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

expect.set_options(timeout=60_000)  # a busy machine is no failure


def opened_offline(browser: Browser, page_file: Path, said: list[str], **options: Any) -> Page:  # noqa: ANN401 - a context's
    """A report in a tab without network; what it asks of one, or says on the console, is noted."""
    context = browser.new_context(viewport={"width": 1440, "height": 900}, offline=True, **options)
    page = context.new_page()
    page.on("console", lambda message: said.append(f"{message.type}: {message.text}"))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("dialog", lambda dialog: said.append(f"dialog: {dialog.message}"))
    page.on("request", lambda asked: said.append(asked.url) if asked.url.startswith(("http", "ws")) else None)
    page.goto(page_file.as_uri())
    page.wait_for_selector("body[data-ready]")
    return page


@pytest.fixture(scope="module")
def open_report(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Page]]:
    """Opens reports; what one asks of a network, or says on the console, fails the last test that had it."""
    said: list[str] = []
    pages: list[Page] = []

    def opened(content: bytes, film: bytes | None = None, **options: Any) -> Page:  # noqa: ANN401 - a context's
        page_file = tmp_path_factory.mktemp("report") / "flight.html"
        page_file.write_bytes(content)
        if film is not None:
            page_file.with_name("flight.film.mp4").write_bytes(film)
        pages.append(opened_offline(browser, page_file, said, **options))
        return pages[-1]

    yield opened
    for page in pages:
        page.context.close()
    assert said == []
