"""`python -m benchmarks [--write]`: prints the numbers; --write puts them into docs/."""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.acceptance import accuracy_lines, box_lines, cost_lines, covered_lines
from benchmarks.accuracy import RUNS, measure, table_3_2
from benchmarks.box import day, sustained
from benchmarks.cockpit import cockpit_page
from benchmarks.cost import memory, speed
from benchmarks.pages import accuracy_page, cost_page, machine
from benchmarks.programs import RENDERED
from benchmarks.real_pictures import available, measure_source
from benchmarks.setup_page import setup_page
from fixtures.make import FLIGHTS
from fixtures.make import main as make_fixtures

DOCS = Path(__file__).parents[1] / "docs"


def render_what_is_absent() -> None:
    """Renders and records the long flights, unless they are there."""
    if not all((RENDERED / f"{flight.name}{end}").exists() for flight in FLIGHTS for end in (".mcap", "_truth.csv")):
        sys.stderr.write("rendering the 400-frame flights ...\n")
        make_fixtures(["frames"])
        make_fixtures(["flights"])


def measured_accuracy() -> str:
    """The page on accuracy."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        runs = [measure(run, folder) for run in RUNS]
        plain, normalized = (table_3_2(folder, method) for method in ("xcorr", "normxcorr"))
        seen = {source.title: measure_source(source, folder / source.panel_picture) for source in available()}
    return accuracy_page(runs, plain, normalized, seen, [*accuracy_lines(runs), *covered_lines(plain, normalized)])


def measured_cost() -> str:
    """The page on speed and memory."""
    took, peak, work = speed(), memory(), sustained()
    with TemporaryDirectory() as name:
        a_day = day(Path(name), Path(name) / "flights", keep_hours=1, max_hours=2, keep_free_gib=0)
    return cost_page(took, peak, work, a_day, [*cost_lines(took, peak), *box_lines(work, a_day)])


PAGES = {
    "accuracy": measured_accuracy,
    "performance": measured_cost,
    "cockpit": cockpit_page,
    "setup-speed": setup_page,
}


def main(words: list[str]) -> None:
    """Prints, and with --write writes, all pages."""
    render_what_is_absent()
    for name, measured in PAGES.items():
        text = f"# {name.capitalize()}\n\nWritten by `python -m benchmarks --write`. {machine()}\n\n{measured()}"
        sys.stdout.write(text + "\n")
        if "--write" in words:
            (DOCS / f"{name}.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
