"""The film beside the report, in a real browser, from a file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from decoder.outputs.film import film_times_s
from decoder.outputs.outputs import Decoded, planned_files, write_all
from tests.report.conftest import opened_offline
from tests.report.reports import make_report
from tests.report.test_page import until

ROWS = 40
AN_HOUR_NS = 3_600_000_000_000


@pytest.fixture(scope="module")
def report() -> Decoded:
    """A flight whose clock was set back an hour after the first ten frames."""
    report = make_report(ROWS)
    time_ns = report.data.time_ns.copy()
    time_ns[10:] -= AN_HOUR_NS
    return make_report(data=replace(report.data, time_ns=time_ns))


@pytest.fixture(scope="module")
def made(report: Decoded, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page with the film beside it, as `--format html,film` writes them."""
    folder = tmp_path_factory.mktemp("film")
    files = planned_files("flight", ["html", "film"])
    write_all(folder, {name: make(report) for name, make in files.items()})
    return folder


@pytest.fixture
def page(made: Path, open_report: Callable[..., Page]) -> Page:
    """The page, open, the film loaded."""
    page = open_report((made / "flight.html").read_bytes(), (made / "flight.film.mp4").read_bytes())
    until(page, "document.getElementById('film').readyState > 1")
    return page


def expect_film_at(page: Page, report: Decoded, row: int) -> None:
    """The film shows a frame, by its row in the flight data."""
    expect(page.locator("#film")).to_have_attribute("data-row", str((row - 10) % ROWS))
    shown = "(s) => [document.getElementById('film')].some((it) => !it.seeking && Math.abs(it.currentTime - s) < 0.01)"
    until(page, shown, float(film_times_s(report.data)[row]) + 0.001)
    expect(page.locator("#film-says")).to_have_text(f"frame {row} · {report.data.time_s[row]:.3f} s")


def test_the_film_follows_the_keys_and_the_pointer(page: Page, report: Decoded) -> None:
    """The chosen frame is shown; while the pointer is over a plot the one under it; then the chosen one again."""
    page.keyboard.press("Home")  # the first in the order of time: the one after the clock was set
    expect_film_at(page, report, 10)
    page.keyboard.press("Shift+ArrowRight")
    expect_film_at(page, report, 20)
    page.evaluate("document.querySelector('.plot').scrollIntoView({ block: 'start', behavior: 'instant' })")
    box = page.locator(".plot").first.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] - 16, box["y"] + 30)
    expect_film_at(page, report, 9)
    page.mouse.move(2, 2)
    expect_film_at(page, report, 20)


def test_played_it_chooses_frames(page: Page) -> None:
    """V plays it and stops it, and the page goes along."""
    page.keyboard.press("Home")
    page.keyboard.press("v")
    expect(page.locator("#evidence")).not_to_have_attribute("data-row", "0")
    page.keyboard.press("v")
    until(page, "document.getElementById('film').paused")
    assert page.evaluate("document.getElementById('film').videoHeight") == 480


def test_a_film_that_was_left_behind_is_named(browser: Browser, made: Path, tmp_path: Path) -> None:
    """The page works without it."""
    (tmp_path / "flight.html").write_bytes((made / "flight.html").read_bytes())
    page = opened_offline(browser, tmp_path / "flight.html", [])

    expect(page.locator("#film-says")).to_contain_text(
        "not in this page's folder, or cannot be played: flight.film.mp4"
    )
    expect(page.locator("#film")).to_have_count(0)
    page.keyboard.press("ArrowRight")
    expect(page.locator("#evidence")).not_to_have_attribute("data-row", "0")
    expect(page.locator("#film-says")).to_contain_text("cannot be played")
    page.context.close()


def test_a_report_without_a_film_allows_none(report: Decoded, made: Path, tmp_path: Path) -> None:
    """Only the page with one may load media, and only from where it lies."""
    write_all(tmp_path, {"flight.html": planned_files("flight", ["html"])["flight.html"](report)})
    plain, own = (folder / "flight.html" for folder in (tmp_path, made))

    assert "media-src &#39;none&#39;" in plain.read_text(encoding="utf-8")
    assert "<video" not in plain.read_text(encoding="utf-8")
    assert "media-src &#39;self&#39; file:" in own.read_text(encoding="utf-8")
