"""What all tests share: order and worker, which are traced for coverage, Ctrl-C, Chromium, and what was skipped."""

from __future__ import annotations

import os
import shutil
import signal
import sys
import threading
from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import cv2
import pytest
from hypothesis import settings
from threadpoolctl import threadpool_limits

from decoder.parallel.processes import ONE_EACH

if TYPE_CHECKING:
    from playwright.sync_api import Browser

# One thread, as in the programs: the same bytes everywhere, and small problems are solved in a seventh of the time.
os.environ.update(ONE_EACH)  # for what is loaded or started later
cv2.setNumThreads(1)
threadpool_limits(1)

# Timing is asserted nowhere, and a busy machine is no fault. Each run tries the same examples, so that a change is
# judged by what it changed; `--hypothesis-profile searching` tries others.
settings.register_profile("unhurried", deadline=None, derandomize=True)
settings.register_profile("searching", deadline=None)
settings.load_profile("unhurried")

# What tests of these look at is not what coverage is measured of.
UNMEASURED = ("benchmarks", "fixtures", "systemd", "test_rooms.py")
COVERAGE_OF_PROGRAMS = ("COVERAGE_PROCESS_START", "COVERAGE_PROCESS_CONFIG")
CHROMIUMS = ("chromium", "chromium-browser", "google-chrome")
# What a test may be skipped for, as the reason names it, and how to get it.
OBTAINABLE = {
    "Chromium": "apt-get install -y chromium fonts-dejavu-core",
    "node and npm": "apt-get install -y nodejs npm",
    "foxglove-sdk": "pip install foxglove-sdk==0.30.3",
    "gcc": "apt-get install -y gcc libc6-dev linux-libc-dev",
    "systemd-analyze": "apt-get install -y systemd",
    "python3-gi": "apt-get install -y python3-gi gir1.2-nm-1.0",
    "shellcheck": "apt-get install -y shellcheck",
    "../shared": "benchmarks/real_pictures.py says which pictures belong there",
}


def pytest_itemcollected(item: pytest.Item) -> None:
    """Tests that share a fixture of their module are run by one worker, which makes it once."""
    if isinstance(item, pytest.Function) and item.get_closest_marker("xdist_group") is None:
        made = item._fixtureinfo.name2fixturedefs.values()
        if any(fixture.scope == "module" for definitions in made for fixture in definitions):
            item.add_marker(pytest.mark.xdist_group(item.nodeid.partition("::")[0]))


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
    is_measured = not item.nodeid.removeprefix("tests/").startswith(UNMEASURED)
    untraced = item.get_closest_marker("untraced") is not None or not is_measured
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


def skipped_lines(reports: Iterable[pytest.TestReport]) -> list[str]:
    """One line for each thing that was missing: how many tests in which folders, and how to get it.

    Tests skipped for any other reason share a line with those of the same reason.
    """
    folders: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for report in reports:
        *_, said = report.longrepr if isinstance(report.longrepr, (tuple, list)) else [str(report.longrepr)]
        reason = said.removeprefix("Skipped: ")
        missing = next((name for name in OBTAINABLE if name in reason), None)
        told = (reason, "") if missing is None else (f"no {missing}", f"; {OBTAINABLE[missing]}")
        folders[told].append("/".join(report.nodeid.split("::")[0].split("/")[:2]))
    return [
        f"skipped {len(where)} in {', '.join(sorted(set(where)))}: {reason}{remedy}"
        for (reason, remedy), where in sorted(folders.items(), key=lambda told: -len(told[1]))
    ]


@pytest.hookimpl(trylast=True)
def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say what was skipped below everything but failures, warnings and the closing line."""
    for line in skipped_lines(terminalreporter.stats.get("skipped", [])):
        terminalreporter.write_line(line, yellow=True)


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
