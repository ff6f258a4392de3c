"""What reading costs in several ways, what workers hold, and how soon there is an answer, as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.comparison import Compared
from benchmarks.pages import markdown
from benchmarks.starting import Start
from benchmarks.worker_memory import Held

COMPARED_LEGEND = """\
Processor time per frame, as a multiple of decompressing the frame in grey in the same round; medians of the rounds'
ratios, one thread. `decode` is everything that decoding a flight of that many frames takes in a running process:
reading its chunks, fitting the reader to it, reading the frames. `matchTemplate` is the thesis's method written
directly with OpenCV (`benchmarks/plain_way.py`): find the knob in the frame, `warpPolar` each gauge, find each needle
by normalized cross-correlation. `match_template` is the same with scikit-image's function. `ppf.angauge` is that
package on the dials with one needle, without any alignment. These three were given only a few of the frames. Larger
pictures are the same frames enlarged, with a sensor's noise added; 24 needles are the same dials listed again under
other names.

`two workers` is how much sooner two processes finish than one (wall clock, medians). `two bare` is the same for two
processes that only decompress and share nothing, the lower of the measurements before and after: it is what two of the
machine's processors can give. On a shared host this varies from minute to minute, so only `rounds` in which it was at
least 1.85 count, if there were three of them.
"""
MEMORY_LEGEND = """\
The larger of two workers, seven needles.
"""
START_LEGEND = """\
Time until the first line of output, the shortest of several runs.
"""


def comparison_section(compared: Sequence[Compared]) -> str:
    """The table of all ways."""
    header = [
        "pictures",
        "needles",
        "frames",
        "decompress ms",
        *compared[0].ratios,
        "two workers",
        "two bare",
        "rounds",
    ]
    rows = [
        [
            each.size.name,
            str(each.needles),
            str(each.size.frames),
            f"{each.decompress_ms:.2f}",
            *(f"{ratio:.2f}" for ratio in each.ratios.values()),
            f"{each.two_by_one.ours:.2f}",
            f"{each.two_by_one.bare:.2f}",
            f"{each.two_by_one.rounds} of {each.two_by_one.all_rounds}",
        ]
        for each in compared
    ]
    return f"## Beside other ways\n\n{COMPARED_LEGEND}\n{markdown(header, rows)}\n"


def memory_section(held: Sequence[Held]) -> str:
    """What workers hold."""
    rows = [[each.size.name, str(each.size.frames), f"{each.peak_mib:.0f}"] for each in held]
    return f"## Peak resident memory of a worker\n\n{MEMORY_LEGEND}\n{markdown(['pictures', 'frames', 'MiB'], rows)}\n"


def start_section(starts: Sequence[Start]) -> str:
    """How soon there is an answer."""
    rows = [[each.words, f"{each.processor_s:.3f}", f"{each.wall_s:.3f}"] for each in starts]
    return f"## Start\n\n{START_LEGEND}\n{markdown(['command', 'processor s', 'clock s'], rows)}\n"
