"""The summary that `decode` prints: for each needle how many frames have which status, and its lowest score."""

from __future__ import annotations

from decoder.flight_data import STATUSES, FlightData, status_counts
from decoder.json_output import lowest_score
from decoder.text_table import text_table


def summary_table(data: FlightData) -> str:
    """A text table, one row for each needle."""
    rows = []
    for series in data.series:
        score = lowest_score(series)
        counts = status_counts(series)
        rows.append(
            [
                series.quantity.name,
                series.quantity.unit,
                *(str(counts[status.value]) for status in STATUSES),
                "-" if score is None else f"{score:.3f}",
            ]
        )
    return text_table(["needle", "unit", *(status.value for status in STATUSES), "lowest score"], rows)
