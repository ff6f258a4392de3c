"""What all tests have in common: their order, which are traced for coverage, Ctrl-C, and a real Chromium for pages."""

from __future__ import annotations

import os
import shutil
import signal
import sys
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
    """Slow and untraced tests are not traced for coverage, nor are programs that untraced ones start.

    Quick tests go through the same lines; tracing takes up to three times as long. `no_cover` would not do: coverage is
    begun three times in a worker (by the process, by pytest-cov, by pytest-cov as a worker), and it stops one of them.
    """
    untraced = item.get_closest_marker("untraced") is not None
    if not untraced and item.get_closest_marker("slow") is None:
        return (yield)
    told = {name: os.environ.pop(name) for name in COVERAGE_OF_PROGRAMS if untraced and name in os.environ}
    here, in_threads = sys.gettrace(), threading.gettrace()
    sys.settrace(None)
    threading.settrace(None)
    try:
        return (yield)
    finally:
        threading.settrace(in_threads)
        sys.settrace(here)
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
