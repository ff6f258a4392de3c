"""`python -m benchmarks [--write] [PAGE ...]`: prints the numbers; --write puts them and their plots into docs/."""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.acceptance import accuracy_lines, box_lines, cost_lines, covered_lines, reading_lines
from benchmarks.accuracy import RUNS, measure, oblique_tracks, table_3_2
from benchmarks.box import called, day, sustained
from benchmarks.cockpit import cockpit_page
from benchmarks.comparison import compare
from benchmarks.comparison_page import comparison_section, memory_section, start_section
from benchmarks.cost import memory, speed
from benchmarks.newcomer import newcomer_page
from benchmarks.pages import PICTURES, Page, accuracy_page, cost_page, machine
from benchmarks.programs import RENDERED
from benchmarks.real_pictures import ATTITUDES, BORROWED, available, measure_source
from benchmarks.report_page import report_page
from benchmarks.setup_page import setup_page
from benchmarks.sized_flights import SIZES, Size
from benchmarks.starting import starts
from benchmarks.whole_panel import cost_section
from benchmarks.worker_memory import worker_memory
from fixtures.make import FLIGHTS
from fixtures.make import main as make_fixtures

OBLIQUE = {"oblique cockpit": "t1a_small", "odd dials": "odd_small"}
"""The committed flights of the oblique cockpit, by title."""
DOCS = Path(__file__).parents[1] / "docs"


def render_what_is_absent() -> None:
    """Renders the long flights and those over borrowed instruments, unless they are there."""
    if not all((RENDERED / f"{flight.name}{end}").exists() for flight in FLIGHTS for end in (".mcap", "_truth.csv")):
        sys.stderr.write("rendering the 400-frame flights ...\n")
        make_fixtures(["frames"])
        make_fixtures(["flights"])
    if not all(source in available() for source in (*BORROWED, *ATTITUDES)):
        sys.stderr.write("rendering the flights over borrowed instruments ...\n")
        make_fixtures(["borrowed"])


def measured_accuracy() -> Page:
    """The page on accuracy."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        runs = [measure(run, folder) for run in RUNS]
        plain, normalized = (table_3_2(folder, method) for method in ("xcorr", "normxcorr"))
        seen = {source.title: measure_source(source, folder / source.panel_picture) for source in available()}
        oblique = {title: oblique_tracks(name, folder) for title, name in OBLIQUE.items()}
    lines = [*accuracy_lines(runs), *covered_lines(plain, normalized)]
    return accuracy_page(runs, plain, normalized, seen=seen, oblique=oblique, lines=lines)


def measured_cost(sizes: Sequence[Size]) -> Page:
    """The page on speed and memory."""
    took, peak, work, calls = speed(), memory(), sustained(), called()
    with TemporaryDirectory() as name:
        a_day = day(Path(name), Path(name) / "flights", keep_hours=1, max_hours=2, keep_free_gib=0)
    compared, held, begun = compare(sizes), worker_memory(), starts()
    lines = [*cost_lines(took, peak), *reading_lines(compared, held, begun), *box_lines(work, a_day, calls)]
    page = cost_page(took, peak, work=work, day=a_day, calls=calls, lines=lines)
    sections = [page, cost_section(), comparison_section(compared), memory_section(held), start_section(begun)]
    return Page("\n".join(filter(None, sections)))


PAGES: dict[str, Callable[[Sequence[Size]], Page]] = {
    "accuracy": lambda _: measured_accuracy(),
    "performance": measured_cost,
    "cockpit": lambda _: Page(cockpit_page()),
    "report-speed": lambda _: Page(report_page()),
    "setup-speed": lambda _: Page(f"{setup_page()}\n## What a newcomer needs\n\n{newcomer_page()}"),
}


def main(words: list[str]) -> None:
    """Prints, and with --write writes, all pages or those that are named."""
    parser = ArgumentParser(prog="python -m benchmarks")
    parser.add_argument("--write", action="store_true", help="put the pages into docs/")
    parser.add_argument("--sizes", help=f"compare with these pictures only, such as {SIZES[0].name},{SIZES[1].name}")
    parser.add_argument("pages", nargs="*", metavar="PAGE", help=", ".join(PAGES))
    asked = parser.parse_args(words)
    unknown = set(asked.pages) - set(PAGES)
    if unknown:
        parser.error(f"there is no page {', '.join(sorted(unknown))}")
    sizes = [size for size in SIZES if asked.sizes is None or size.name in asked.sizes.split(",")]
    render_what_is_absent()
    for name in asked.pages or PAGES:
        page = PAGES[name](sizes)
        lead = f"{page.lead}\n" if page.lead else ""
        text = f"# {name.capitalize()}\n\n{lead}Written by `python -m benchmarks --write`. {machine()}\n\n{page.text}"
        sys.stdout.write(text + "\n")
        if asked.write:
            (DOCS / f"{name}.md").write_text(text, encoding="utf-8")
            for picture, svg in page.pictures.items():
                (DOCS / PICTURES / picture).write_text(svg, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
