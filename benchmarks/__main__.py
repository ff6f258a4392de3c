"""`python -m benchmarks [--write]`: prints the numbers; --write puts them into docs/accuracy.md and performance.md."""

from __future__ import annotations

import os
import platform
import sys
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.accuracy import RUNS, Measured, mean_error, measure, published, table_3_2
from benchmarks.cost import memory, speed
from decoder.accuracy import ALL_VALUED

DOCS = Path(__file__).parents[1] / "docs"
LIBRARIES = ("numpy", "opencv-python-headless", "mcap")
Row = list[str]


def markdown(header: Row, rows: list[Row]) -> str:
    """A table that reads well as text and as Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def machine() -> str:
    """What the numbers were measured on, and when."""
    libraries = ", ".join(f"{name} {version(name)}" for name in LIBRARIES)
    return f"Python {platform.python_version()}, {libraries}; {os.cpu_count()} cores; {datetime.now(UTC):%Y-%m-%d}."


def accuracy_table(measured: Measured) -> str:
    """A run's needles beside the thesis's."""
    header = ["needle", "mean %", "signed %", "max %", "thesis %", "part of it", "mean %FS, read", "within 95 %"]
    header += ["covered: flagged", "clear: flagged"]
    rows = []
    for needle in measured.needles:
        every, read = needle.by_status[ALL_VALUED], needle.by_status.get("read")
        thesis = published(measured.run.table, needle.needle)
        rows.append(
            [
                needle.needle,
                f"{every.mean_abs_pct:.4f}",
                f"{every.mean_signed_pct:+.4f}",
                f"{every.max_abs_pct:.3f}",
                f"{thesis:.3f}",
                f"{mean_error(needle) / thesis:.2f}",
                "-" if read is None else f"{read.mean_abs_pct_fs:.4f}",
                f"{every.within_95:.0%}",
                "{} of {}".format(*measured.covered[needle.needle]),
                "{} of {}".format(*measured.clear[needle.needle]),
            ]
        )
    return f"## {measured.run.title}\n\n{markdown(header, rows)}\n"


def accuracy_page(folder: Path) -> str:
    """All accuracy tables."""
    parts = [accuracy_table(measure(run, folder)) for run in RUNS]
    for method in ("xcorr", "normxcorr"):
        rows = [[f"{truth:.3f}", status, f"{error:+.3f}"] for truth, status, error in table_3_2(folder, method)]
        parts.append(
            f"## Table 3.2's frames, AL needle, {method}\n\n{markdown(['AL, lb', 'status', 'error %'], rows)}\n"
        )
    return "\n".join(parts)


def cost_page() -> str:
    """Speed and memory."""
    took, peak = speed(), memory()
    rows = [
        ["decompression in grey, one thread", f"{took.decompress_ms:.2f} ms a frame", "1"],
        ["decode, seven needles, in process", f"{took.decode_ms:.2f} ms a frame", f"{took.ratio:.2f}"],
        [f"the whole program, {took.frames} frames", f"{took.program_s:.2f} s", "-"],
    ]
    sizes = [[str(frames), f"{mib:.0f}"] for frames, mib in peak.items()]
    return (
        f"## Processor time, {took.frames} frames of 1024 x 768\n\n{markdown(['what', 'median', 'ratio'], rows)}\n\n"
        f"## Peak resident memory of `decode`\n\n{markdown(['frames', 'MiB'], sizes)}\n"
    )


def main(words: list[str]) -> None:
    """Prints, and with --write writes, both pages."""
    with TemporaryDirectory() as folder:
        pages = {"accuracy": accuracy_page(Path(folder)), "performance": cost_page()}
    for name, page in pages.items():
        text = f"# {name.capitalize()}\n\nMeasured by `make bench`. {machine()}\n\n{page}"
        sys.stdout.write(text + "\n")
        if "--write" in words:
            (DOCS / f"{name}.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
