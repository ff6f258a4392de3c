"""The numbers that the thesis published (tables 3.1, 3.2, 3.3), and those that its own rows give (A.1, A.2)."""

from __future__ import annotations

import csv
from pathlib import Path

FILE = Path(__file__).parent / "published.csv"
TABLE_3_2_FRAMES = (266, 267, 268, 269)

Published = dict[tuple[str, str, str], float]


def published() -> Published:
    """By table, needle and measure; all in percent of the true value."""
    with FILE.open(encoding="utf-8", newline="") as stream:
        rows = csv.DictReader(stream)
        return {(row["table"], row["needle"], row["measure"]): float(row["value"]) for row in rows}
