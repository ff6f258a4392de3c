"""What there is to show, line by line: what was measured, what was asked, and whether it holds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from benchmarks.accuracy import Measured, mean_error, published, thesis_mean
from benchmarks.box import FIRST_STILLS, PICTURES, STILLS, Called, Day, Sustained
from benchmarks.comparison import NEEDLES, Compared
from benchmarks.cost import Speed
from benchmarks.starting import Start
from benchmarks.worker_memory import LARGE, SMALL, Held
from decoder.timeseries.accuracy import ALL_VALUED, NeedleAccuracy

ROW_TABLES = ("A.1", "A.2")
PART_OF_THESIS = 1 / 3
MAX_PCT_FS = 0.05
MAX_CLEAR_FLAGGED = 0.01
MAX_COVERED_PCT = 0.15
MAX_ALONE_RATIO, MAX_RATIO = 1.1, 1.6
MAX_LARGE_RATIO = 1.1
MIN_BY_ONE = 1.8
MAX_WORKER_MB = {SMALL.name: 200.0, LARGE.name: 400.0}
MAX_START_S = {"decode --help": 0.15, "decode FLIGHT": 0.6}
MAX_CORE = 0.25
MAX_BOX_MIB = 120.0
MAX_DAY_GROWTH_MIB = 2.0  # its pictures have 41 MiB in all
MAX_OPEN_FILES = 10
MAX_CALLS_GROWTH_MIB = 2.0
MAX_CALLS_FILES = 16  # connections that come and go beside those of the recording
MAX_THREADS = 12
MAX_GROWTH = 1.05  # of peak memory from 400 frames to 4400: the table itself is a megabyte

Row = list[str]


@dataclass(frozen=True, slots=True)
class Line:
    """One requirement; `measured` is of the needle that is worst off, which is named."""

    what: str
    measured: float
    required: float
    worst: str = ""
    at_least: bool = False

    @property
    def holds(self) -> bool:
        """Whether it is met."""
        return self.measured >= self.required if self.at_least else self.measured <= self.required

    @property
    def row(self) -> Row:
        """For a table."""
        limit = f"{'>=' if self.at_least else '<='} {self.required:.3g}"
        return [self.what, f"{self.measured:.3g}", limit, self.worst, "yes" if self.holds else "NO"]


def accuracy_lines(runs: Sequence[Measured]) -> list[Line]:
    """The lines about the flights that the thesis has tables for."""
    lines = []
    for measured in runs:
        lines += _row_lines(measured) if measured.run.table in ROW_TABLES else _long_flight_lines(measured)
    return lines


def _row_lines(measured: Measured) -> list[Line]:
    table = measured.run.table
    return [
        _worst(
            f"{measured.run.title}: mean error, part of the thesis's",
            measured,
            lambda needle: mean_error(needle) / thesis_mean(table, needle.needle),
            PART_OF_THESIS,
        ),
        _worst(
            f"{measured.run.title}: worst row, part of the thesis's worst",
            measured,
            lambda needle: (
                (needle.by_status[ALL_VALUED].max_abs_pct or 0.0)
                / (published(table, needle.needle, "max_error_pct") or math.nan)
            ),
            1.0,
        ),
    ]


def _long_flight_lines(measured: Measured) -> list[Line]:
    def signed(status: str) -> Callable[[NeedleAccuracy], float]:
        return lambda needle: (
            abs(needle.by_status[status].mean_signed_pct or 0.0) / thesis_mean(measured.run.table, needle.needle)
        )

    title, table = measured.run.title, measured.run.table
    covered = [sum(counts) for counts in zip(*measured.covered.values(), strict=True)]
    lines = [
        _worst(
            f"{title}: mean error on `read`, % of full scale",
            measured,
            lambda needle: needle.by_status["read"].mean_abs_pct_fs or math.nan,
            MAX_PCT_FS,
        ),
        _worst(f"{title}: signed error on `read`, part of table {table}'s", measured, signed("read"), 1.0),
        _worst(f"{title}: signed error on all frames, part of table {table}'s", measured, signed(ALL_VALUED), 1.0),
        _worst(
            f"{title}: clear needles that are flagged, part",
            measured,
            lambda needle: _part(measured.clear[needle.needle]),
            MAX_CLEAR_FLAGGED,
        ),
    ]
    if covered[1]:
        lines.append(Line(f"{title}: covered needles that are flagged", covered[0], covered[1], at_least=True))
    return lines


def _worst(what: str, measured: Measured, number: Callable[[NeedleAccuracy], float], required: float) -> Line:
    numbers = {needle.needle: number(needle) for needle in measured.needles}
    worst = max(numbers, key=lambda name: math.inf if math.isnan(numbers[name]) else numbers[name])
    return Line(what, numbers[worst], required, worst)


def _part(counts: tuple[int, int]) -> float:
    return counts[0] / counts[1] if counts[1] else 0.0


def covered_lines(
    plain: Sequence[tuple[float, str, float]], normalized: Sequence[tuple[float, str, float]]
) -> list[Line]:
    """The lines about table 3.2's frames: status and error in percent of the AL needle by either method."""
    lost = sum(status not in ("read", "edge") or abs(error) > 1.0 for _, status, error in plain)
    largest = max((math.inf if math.isnan(error) else abs(error)) for _, _, error in normalized)
    return [
        Line("table 3.2: frames in which xcorr loses AL", lost, len(plain), at_least=True),
        Line("table 3.2: largest error of normxcorr, %", largest, MAX_COVERED_PCT, "fuel_al_lb"),
    ]


def cost_lines(took: Speed, peak: dict[int, float]) -> list[Line]:
    """The lines about processor time and memory."""
    short, long = min(peak), max(peak)
    return [
        Line("400 frames: decode, times bare decompression, a process each", took.read_alone.ratio, MAX_ALONE_RATIO),
        Line("the same in one process that has done both before", took.read.ratio, MAX_RATIO),
        Line(f"peak memory, {long} frames by {short}", peak[long] / peak[short], MAX_GROWTH),
    ]


def reading_lines(compared: Sequence[Compared], held: Sequence[Held], begun: Sequence[Start]) -> list[Line]:
    """The lines about seven needles in pictures of the camera's sizes, workers, and starting."""
    seven = [each for each in compared if each.needles == min(NEEDLES)]
    large = [each for each in seven if each.size == LARGE]
    times = f"{LARGE.name}, {LARGE.frames} frames: decode, times bare decompression"
    return [
        *(Line(times, each.ratios["decode"], MAX_LARGE_RATIO) for each in large),
        *(
            Line(f"{each.size.name}: two workers by one", each.two_by_one.ours, MIN_BY_ONE, at_least=True)
            for each in seven
        ),
        *(Line(f"{_of(each)}: peak memory of a worker, MB", _mb(each), MAX_WORKER_MB[each.size.name]) for each in held),
        *(Line(f"{each.words}: s to its first line", each.wall_s, MAX_START_S[each.words]) for each in begun),
    ]


def _of(held: Held) -> str:
    return f"{held.size.name}, {held.size.frames} frames"


def _mb(held: Held) -> float:
    return held.peak_mib * 2**20 / 10**6


def box_lines(work: Sustained, day: Day, calls: Called) -> list[Line]:
    """The lines about the box."""
    settled = [each for _, each in calls.settled]
    return [
        Line("box, four 5 MB pictures a second: part of one core", work.processor_part, MAX_CORE),
        Line("box, the same: pictures that were stored", work.stored, PICTURES, at_least=True),
        Line("box, the same: peak resident memory, MiB", work.peak_mib, MAX_BOX_MIB),
        Line("box, a day of recording: growth of its memory, MiB", day.growth_mib(), MAX_DAY_GROWTH_MIB),
        Line("box, the same: open files", day.most_files(), MAX_OPEN_FILES),
        Line(
            f"box, {STILLS} stills after {FIRST_STILLS}: growth of its memory, MiB",
            calls.growth_mib(),
            MAX_CALLS_GROWTH_MIB,
        ),
        Line("box, the same: open files", max(each.files for each in settled), MAX_CALLS_FILES),
        Line("box, the same: threads", max(each.threads for each in settled), MAX_THREADS),
    ]
