"""The measured tables as Markdown, which reads well on a terminal too."""

from __future__ import annotations

import math
import os
import platform
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from benchmarks.acceptance import Line
from benchmarks.accuracy import TABLE_3_2, Measured, mean_error, published, thesis_mean
from benchmarks.box import Day, Sustained
from benchmarks.cost import Speed
from benchmarks.error_plot import Track, error_svg
from benchmarks.real_pictures import Read, Seen
from decoder.accuracy import ALL_VALUED, NeedleAccuracy

LIBRARIES = ("numpy", "opencv-python-headless", "mcap")
PROCESSORS = Path("/proc/cpuinfo")
Row = list[str]
Sights = Sequence[tuple[float, str, float]]

PICTURES = "pictures"
"""Folder of the pages' pictures, beside them."""


@dataclass(frozen=True, slots=True)
class Page:
    """A page of docs/, and its pictures' SVG by file name."""

    text: str
    pictures: Mapping[str, str] = field(default_factory=dict)


LEGEND = """\
Errors are in percent of the true value, over all frames that have a value, interpolated ones too; `%FS` is percent of
full scale on frames with status `read`. Beside them the thesis's own: mean and worst of its printed rows (tables A.1
and A.2), or 100 less its average accuracy (tables 3.1, of the plain flight, and 3.3), which is presumably a mean of
signed errors. `in 95 %`: frames whose error is within 1.96 sigma. `covered`, `clear`: frames that are flagged
(`interpolated` or `missing`) of those in which reflections took the needle, and of those in which none are on it.

In the plots every dot is a frame with a value: blue where the truth lies in the 95 % band of the flight data (grey),
red where it does not. Each needle has the scale that its largest error needs.
"""
SEEN_LEGEND = """\
## Pictures that nobody of us made

A simulator's cockpit of a Cessna 172P with its own property values as the truth, and real gauges read by eye. The
panels are in `benchmarks/panels`, the pictures are not part of the project. `mean` and `max` are over frames with
status `read`; `in 95 %`: the truth lies within 1.96 sigma, and the eye's doubt where it was read by eye. Beside them
ppf.angauge on the same dials, its mean over the frames in which it found a needle.
"""
OBLIQUE_LEGEND = """\
## The oblique cockpit

A cockpit like a T-1A's, seen at an angle, and odd dials: round ones, a card, an altimeter. Their tables are what
`python -m benchmarks.cockpit` prints.
"""
COST_LEGEND = """\
Times are of the processor, medians of rounds in which all are measured back to back; ratios are medians of the rounds'
own. Hold on to the ratios: milliseconds are this machine's. Decompression is OpenCV's, in grey. A process of its own
gets new memory from the system for each picture, which has to be cleared; one that has read the flight before has
enough, where the same costs a third less. Either is compared with reading the flight in the same way.
"""


def markdown(header: Row, rows: Sequence[Row]) -> str:
    """A table; the first column to the left, the others to the right."""
    widths = [max(len(row[column]) for row in [header, *rows]) for column in range(len(header))]
    dashes = ["-" * widths[0], *("-" * (width - 1) + ":" for width in widths[1:])]
    lines = (
        [row[0].ljust(widths[0]), *(f"{field:>{width}}" for field, width in zip(row[1:], widths[1:], strict=True))]
        for row in [header, dashes, *rows]
    )
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def machine() -> str:
    """What the numbers were measured on, and when."""
    libraries = ", ".join(f"{name} {version(name)}" for name in LIBRARIES)
    lines = PROCESSORS.read_text(encoding="utf-8").splitlines() if PROCESSORS.exists() else []
    model = next((line.partition(": ")[2] for line in lines if line.startswith("model name")), platform.machine())
    python, today = platform.python_version(), datetime.now(UTC)
    return f"Python {python}, {libraries}; {model}, {os.cpu_count()} cores; {today:%Y-%m-%d}."


def accuracy_page(
    runs: Sequence[Measured],
    plain: Sights,
    normalized: Sights,
    *,
    seen: Mapping[str, Seen],
    oblique: Mapping[str, Sequence[Track]],
    lines: Sequence[Line],
) -> Page:
    """All accuracy tables and plots.

    Parameters
    ----------
    seen
        By title, what was read on pictures that nobody of us made.
    oblique
        By title, the errors of a flight of the oblique cockpit.
    """
    plots = {
        **{run.run.title: run.tracks for run in runs},
        **oblique,
        **{title: known.tracks for title, known in seen.items()},
    }
    parts = [LEGEND, *map(_run_section, runs), OBLIQUE_LEGEND, *(_picture(title) for title in oblique)]
    header = ["frame", "AL, lb", "thesis %", "normxcorr %", "status", "xcorr %", "status"]
    rows = []
    for sequence, (truth, better, error), (_, worse, plain_error) in zip(TABLE_3_2, normalized, plain, strict=True):
        theirs = published("3.2", "fuel_al_lb", f"error_pct_frame_{sequence + 1}")
        rows.append(
            [str(sequence + 1), f"{truth:.1f}", f"{theirs:+.2f}", f"{error:+.3f}", better, f"{plain_error:+.3f}", worse]
        )
    parts += [f"## Table 3.2: AL slips behind FR\n\n{markdown(header, rows)}\n"]
    if seen:
        parts += [SEEN_LEGEND, *(_seen_section(title, known.reads) for title, known in seen.items())]
    parts += [_required_section(lines)]
    return Page("\n".join(parts), {_file(title): error_svg(title, needles) for title, needles in plots.items()})


def _file(title: str) -> str:
    return f"errors_{'_'.join(re.findall('[a-z0-9]+', title.lower()))}.svg"


def _picture(title: str) -> str:
    return f"![Errors: {title}]({PICTURES}/{_file(title)})\n"


def _run_section(measured: Measured) -> str:
    header = ["needle", "mean %", "thesis", "part", "signed %", "max %", "thesis", "%FS", "in 95 %", "covered", "clear"]
    rows = [_needle_row(measured, needle) for needle in measured.needles]
    title = measured.run.title
    return f"## {title[0].upper()}{title[1:]}\n\n{markdown(header, rows)}\n\n{_picture(title)}"


def _seen_section(title: str, reads: Sequence[Read]) -> str:
    header = ["needle", "frames", "valued", "read", "mean %FS", "max %FS", "in 95 %", "angauge valued", "its mean %FS"]
    rows = [
        [
            read.needle,
            str(read.frames),
            f"{read.valued:.1%}",
            f"{read.read:.1%}",
            f"{read.mean:.3f}",
            f"{read.largest:.3f}",
            f"{read.within_95:.0%}",
            f"{read.theirs_valued:.0%}",
            "-" if math.isnan(read.theirs_mean) else f"{read.theirs_mean:.2f}",
        ]
        for read in reads
    ]
    return f"### {title[0].upper()}{title[1:]}\n\n{markdown(header, rows)}\n\n{_picture(title)}"


def _needle_row(measured: Measured, needle: NeedleAccuracy) -> Row:
    every, read = needle.by_status[ALL_VALUED], needle.by_status.get("read")
    thesis = thesis_mean(measured.run.table, needle.needle)
    worst = published(measured.run.table, needle.needle, "max_error_pct")
    return [
        needle.needle,
        f"{every.mean_abs_pct:.4f}",
        f"{thesis:.3f}",
        f"{mean_error(needle) / thesis:.2f}",
        f"{every.mean_signed_pct:+.4f}",
        f"{every.max_abs_pct:.3f}",
        "-" if worst is None else f"{worst:.3f}",
        "-" if read is None else f"{read.mean_abs_pct_fs:.4f}",
        f"{every.within_95:.1%}",
        "{} of {}".format(*measured.covered[needle.needle]),
        "{} of {}".format(*measured.clear[needle.needle]),
    ]


BOX_LEGEND = """\
The recorder as a process of its own, replaying pictures of 5 MB at four a second; its start is not counted. The day is
43 200 small pictures into segments of a minute, replayed as fast as the disk allows, of which two hours are kept.
"""


def cost_page(took: Speed, peak: Mapping[int, float], work: Sustained, day: Day, lines: Sequence[Line]) -> str:
    """Speed and memory, of the desk and of the box."""
    ways = {
        "decompression, in a process of its own": took.bare_alone,
        "decode, in a process of its own, without its start": took.read_alone,
        "decompression, in a process that has done it before": took.bare,
        "decode, in the same process": took.read,
        "decode, from its start to written files": took.program,
    }
    rows = [[name, f"{own.ms:.2f}", f"{own.ratio:.2f}"] for name, own in ways.items()]
    sizes = [[str(frames), f"{mib:.1f}"] for frames, mib in peak.items()]
    header = ["one thread", "ms a frame", "ratio"]
    return (
        f"{COST_LEGEND}\n"
        f"## Processor time, {took.frames} frames of 1024 x 768, seven needles\n\n{markdown(header, rows)}\n\n"
        f"## Peak resident memory of `decode`\n\n{markdown(['frames', 'MiB'], sizes)}\n\n"
        f"## The box\n\n{BOX_LEGEND}\n{_box_table(work, day)}\n\n{_required_section(lines)}"
    )


def _box_table(work: Sustained, day: Day) -> str:
    rows = [
        ["four pictures of 5 MB a second", f"{work.processor_part:.1%}", f"{work.peak_mib:.1f}", str(work.dropped)],
        [
            f"a day in {day.took_s:.0f} s, {day.stored} pictures",
            f"{day.samples[-1].processor_s / day.took_s:.1%}",
            f"{day.samples[-1].peak_mib:.1f}",
            str(day.dropped),
        ],
    ]
    return markdown(["recording", "of one core", "peak MiB", "dropped"], rows)


def _required_section(lines: Sequence[Line]) -> str:
    header = ["what", "measured", "required", "worst needle", "holds"]
    return f"## What was required\n\n{markdown(header, [line.row for line in lines])}\n"
