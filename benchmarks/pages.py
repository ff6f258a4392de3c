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
from benchmarks.box import FIRST_STILLS, Called, Day, Sustained
from benchmarks.cost import Speed
from benchmarks.error_plot import Track, error_svg
from benchmarks.real_pictures import Read, Seen
from decoder.timeseries.accuracy import ALL_VALUED, NeedleAccuracy

LIBRARIES = ("numpy", "opencv-python-headless", "mcap")
PROCESSORS = Path("/proc/cpuinfo")
Row = list[str]
Sights = Sequence[tuple[float, str, float]]

PICTURES = "pictures"
"""Folder of the pages' pictures, beside them."""


@dataclass(frozen=True, slots=True)
class Page:
    """A page of docs/, what stands above everything else in it, and its pictures' SVG by file name."""

    text: str
    pictures: Mapping[str, str] = field(default_factory=dict)
    lead: str = ""


ACCURACY_LEAD = """\
Everything under [Pictures that we drew](#pictures-that-we-drew) is our own rendering: frames drawn with sensor noise,
blur and JPEG compression, which no camera took. [Pictures by others](#pictures-by-others) come first.
"""
SEEN_LEGEND = """\
## Pictures by others

A flight simulator's cockpit of a Cessna 172P, with the simulator's own values as the truth, and real gauges read by
eye. The panels are in `benchmarks/panels` or came with the pictures, which are not part of the project. The last six
sets are instruments that others drew, of four npm packages, in a panel of ours and filmed by our simulated camera
([fixtures/borrowed](../fixtures/borrowed/README.md)): their truth is exact, their panels are drawn as by hand. Full
scale of roll is 360 degrees, of pitch 180. `mean`
and `max` are over frames with status `read`, in percent of full scale; `2 % off` counts those of them that are off by
more. `in 95 %`: of all frames with a value, and of the interpolated ones, in how many the truth lies within 1.96 sigma
(and the eye's own doubt, where it was read by eye). The last two columns are ppf.angauge on the same dials: frames in
which it found a needle, and its mean error over those.
"""
DRAWN_LEGEND = """\
## Pictures that we drew

Errors are in percent of the true value, over all frames that have a value, interpolated ones included; `%FS` is percent
of full scale on frames with status `read`. Beside them stand the thesis's own: mean and worst of its printed rows
(tables A.1 and A.2), or 100 minus its average accuracy (tables 3.1, of the plain flight, and 3.3), which is presumably
a mean of signed errors. `part` is our mean error divided by the thesis's. `in 95 %`: frames whose error is within 1.96
sigma. `covered` counts the flagged frames (`interpolated` or `missing`) of those in which reflections hid the needle,
`clear` of those in which there are none on it.

The thesis read table A.1 with its method `xcorr` and table A.2 with `normxcorr`; we read A.1 with both. Its own
pictures are not public: ours have the truth that its tables print.
"""
PLOT_LEGEND = """\
In the plots every dot is a frame with a value: blue where the truth lies in the 95 % band of the flight data (grey),
red where it does not. Each needle has the scale that its largest error needs.
"""
OBLIQUE_LEGEND = """\
### The oblique cockpit

A cockpit like a T-1A's, seen at an angle, and odd dials: round ones, a card, an altimeter. Their tables are printed by
`python -m benchmarks.cockpit`.
"""
COST_LEGEND = """\
Times are processor times, medians of rounds in which everything is measured back to back; ratios are medians of the
rounds' own ratios. Trust the ratios: milliseconds are this machine's. Decompression is OpenCV's, in grey. A fresh
process gets new memory from the system for each picture, which has to be cleared first; one that has read the flight
before already has its memory, and the same work costs a third less. Reading is compared with decompression in the same
kind of process.
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
        By title, what was read on pictures by others.
    oblique
        By title, the errors of a flight of the oblique cockpit.
    """
    plots = {
        **{run.run.title: run.tracks for run in runs},
        **oblique,
        **{title: known.tracks for title, known in seen.items()},
    }
    parts = [PLOT_LEGEND]
    if seen:
        parts += [SEEN_LEGEND, *(_seen_section(title, known.reads) for title, known in seen.items())]
    parts += [DRAWN_LEGEND, *map(_run_section, runs), OBLIQUE_LEGEND, *(_picture(title) for title in oblique)]
    header = ["frame", "AL, lb", "thesis %", "normxcorr %", "status", "xcorr %", "status"]
    rows = []
    for sequence, (truth, better, error), (_, worse, plain_error) in zip(TABLE_3_2, normalized, plain, strict=True):
        theirs = published("3.2", "fuel_al_lb", f"error_pct_frame_{sequence + 1}")
        rows.append(
            [str(sequence + 1), f"{truth:.1f}", f"{theirs:+.2f}", f"{error:+.3f}", better, f"{plain_error:+.3f}", worse]
        )
    parts += [f"### Table 3.2: AL slips behind FR\n\n{markdown(header, rows)}\n"]
    parts += [_required_section(lines, "What was required, on pictures that we drew")]
    plotted = {_file(title): error_svg(title, needles) for title, needles in plots.items()}
    return Page("\n".join(parts), plotted, ACCURACY_LEAD)


def _file(title: str) -> str:
    return f"errors_{'_'.join(re.findall('[a-z0-9]+', title.lower()))}.svg"


def _picture(title: str) -> str:
    return f"![Errors: {title}]({PICTURES}/{_file(title)})\n"


def _run_section(measured: Measured) -> str:
    header = ["needle", "mean %", "thesis", "part", "signed %", "max %", "thesis", "%FS", "in 95 %", "covered", "clear"]
    rows = [_needle_row(measured, needle) for needle in measured.needles]
    title = measured.run.title
    return f"### {title[0].upper()}{title[1:]}\n\n{markdown(header, rows)}\n\n{_picture(title)}"


def _seen_section(title: str, reads: Sequence[Read]) -> str:
    header = [
        "needle",
        "frames",
        "valued",
        "read",
        "mean %FS",
        "max %FS",
        "2 % off",
        "in 95 %",
        "interpolated in 95 %",
        "angauge valued",
        "its mean %FS",
    ]
    rows = [
        [
            read.needle,
            str(read.frames),
            f"{read.valued:.1%}",
            f"{read.read:.1%}",
            f"{read.mean:.3f}",
            f"{read.largest:.3f}",
            str(read.gross),
            f"{read.within_95:.0%}",
            "-" if math.isnan(read.bridged_within_95) else f"{read.bridged_within_95:.0%}",
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
The recorder runs as a process of its own and replays four 5 MB pictures a second; its start is not counted. The day is
43 200 small pictures, written in one-minute segments as fast as the disk allows, of which two hours are kept.
"""


CALLED_LEGEND = """\
The same with the camera's driver, which calls the simulated camera, a process of its own, over HTTP: some five calls a
still, and beside them one that waits for news is always open. That camera takes no time, so this is as fast as both
can. Every tenth of a second the recorder was looked at; a row has when it had so many stills, its resident memory then,
and the most since the row above.
"""


def cost_page(
    took: Speed, peak: Mapping[int, float], *, work: Sustained, day: Day, calls: Called, lines: Sequence[Line]
) -> str:
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
        f"## The box\n\n{BOX_LEGEND}\n{_box_table(work, day)}\n\n"
        f"{CALLED_LEGEND}\n{called_table(calls)}\n\n{_required_section(lines)}"
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


def called_table(calls: Called) -> str:
    """What a recorder took over its stills, as a table."""
    last = calls.samples[-1][0]
    steps = [FIRST_STILLS, *range(1000, last, 1000), last]
    rows = []
    for begin, end in zip([0, *steps], steps, strict=False):
        now = calls.at(end)
        since = [each for stills, each in calls.samples if stills >= begin and each.at_s <= now.at_s]
        most = [max(each.resident_mib for each in since)]
        most += [max(each.files for each in since), max(each.threads for each in since)]
        rows.append([str(end), f"{now.at_s:.0f}", f"{now.resident_mib:.1f}", *(f"{each:.4g}" for each in most)])
    return markdown(["stills", "s", "MiB", "most MiB", "most files", "most threads"], rows)


def _required_section(lines: Sequence[Line], title: str = "What was required") -> str:
    header = ["what", "measured", "required", "worst needle", "holds"]
    return f"## {title}\n\n{markdown(header, [line.row for line in lines])}\n"
