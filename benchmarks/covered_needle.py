"""Table 3.2: the AL needle slips behind the FR needle, by plain and by normalized cross-correlation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.accuracy import SEEN
from benchmarks.flights import Decoded
from benchmarks.published import TABLE_3_2_FRAMES, Published
from benchmarks.tables import markdown, number

FLIGHT, NEEDLE = "table_3_2", "fuel_al_lb"
LOST_PCT = 1.0  # a reading that is further off has lost the needle


@dataclass(frozen=True, slots=True)
class Sight:
    """The AL needle in one frame; the error in percent of the true value is None where there is no value."""

    frame: int
    truth: float
    status: str
    value: float
    error_pct: float | None

    @property
    def lost(self) -> bool:
        """Whether the needle was not seen, or was taken for something else."""
        return self.status not in SEEN or self.error_pct is None or abs(self.error_pct) > LOST_PCT


def sights(decoded: Decoded) -> list[Sight]:
    """The four frames of the table."""
    frames = decoded.truth.columns["animation_frame"]
    truths, values = decoded.truth.numbers(NEEDLE), decoded.data.numbers(NEEDLE)
    found = []
    for frame in TABLE_3_2_FRAMES:
        row = frames.index(str(frame))
        truth, value = float(truths[row]), float(values[row])
        error = None if value != value else (value - truth) / truth * 100  # noqa: PLR0124 - NaN is not itself
        found.append(Sight(frame, truth, decoded.data.columns[f"{NEEDLE}_status"][row], value, error))
    return found


def covered_table(plain: Sequence[Sight], normalized: Sequence[Sight], thesis: Published) -> str:
    """Both methods beside the thesis's normalized cross-correlation (its plain one lost the needle)."""
    header = ["frame", "truth lb", "thesis %", "normxcorr lb", "status", "error %", "xcorr lb", "status", "error %"]
    return markdown(
        header,
        [
            [
                str(better.frame),
                number(better.truth, 1),
                number(thesis["3.2", NEEDLE, f"error_pct_frame_{better.frame}"], 2, sign=True),
                number(better.value, 1),
                better.status,
                number(better.error_pct, sign=True),
                number(worse.value, 1),
                worse.status,
                number(worse.error_pct, sign=True),
            ]
            for better, worse in zip(normalized, plain, strict=True)
        ],
    )
