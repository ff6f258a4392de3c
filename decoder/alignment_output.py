"""`NAME_alignment.tsv`: where the panel lay in each frame, how well it was found, and which anchors failed."""

from __future__ import annotations

import csv
from typing import IO

from decoder.csv_output import utc_text
from decoder.flight_data import FlightData

COLUMNS = ("frame", "time_utc", "alignment_score", "failed", "shift_x_px", "shift_y_px", "roll_deg", "scale")


def write_alignment(data: FlightData, size_px: tuple[int, int], stream: IO[str]) -> None:
    """Writes one row for each frame; shift, roll and scale are those at the panel picture's middle.

    Parameters
    ----------
    size_px : width and height of the panel picture
    """
    writer = csv.writer(stream, delimiter="\t", lineterminator="\n")
    writer.writerow(COLUMNS)
    middle = ((size_px[0] - 1) / 2, (size_px[1] - 1) / 2)
    for row, (frame, time_ns) in enumerate(zip(data.frame.tolist(), data.time_ns.tolist(), strict=True)):
        alignment = data.alignments[row]
        fields = [str(frame), utc_text(time_ns)]
        failed = ";".join(data.alignments.failed(row))
        if alignment is None:
            writer.writerow([*fields, "", failed, "", "", "", ""])
            continue
        motion = alignment.motion_at(middle)
        (right, down), roll_deg, scale = motion.shift_px, motion.roll_deg, motion.scale
        numbers = [f"{right:.3f}", f"{down:.3f}", f"{roll_deg:.4f}", f"{scale:.6f}"]
        writer.writerow([*fields, f"{alignment.score:.4f}", failed, *(_unsigned(number) for number in numbers)])


def _unsigned(number: str) -> str:
    """A zero without the sign that rounding leaves."""
    return number.removeprefix("-") if float(number) == 0 else number
