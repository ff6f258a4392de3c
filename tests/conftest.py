"""What all tests have in common: their order, which are traced for coverage, Ctrl-C, and a real Chromium for pages."""

from __future__ import annotations

import os
import shutil
import signal
import threading
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser

COVERAGE_OF_PROGRAMS = ("COVERAGE_PROCESS_START", "COVERAGE_PROCESS_CONFIG")
CHROMIUMS = ("chromium", "chromium-browser", "google-chrome")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Slow tests are begun first, so that no worker is left with one at the end."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Slow tests, and programs that they start, are not traced for coverage: quick ones go through the same lines.

    Tracing costs up to twice the time of what is traced.
    """
    coverage = item.config.pluginmanager.getplugin("_cov")
    tracing = coverage and coverage.cov_controller and coverage.cov_controller.started
    if not tracing or item.get_closest_marker("slow") is None:
        return (yield)
    told = {name: os.environ.pop(name) for name in COVERAGE_OF_PROGRAMS if name in os.environ}
    coverage.cov_controller.pause()
    try:
        return (yield)
    finally:
        coverage.cov_controller.resume()
        os.environ.update(told)


@pytest.fixture(scope="session", autouse=True)
def ctrl_c() -> None:
    """Lets programs that are started here hear Ctrl-C, though the tests run in a shell's background."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """A real browser."""
    found = next((path for name in CHROMIUMS if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip("no Chromium on this machine; apt-get install chromium")
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 - most tests need none

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=found, args=["--no-sandbox", "--disable-dev-shm-usage"])
        yield chromium
        chromium.close()
