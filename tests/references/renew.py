"""`make refs`: renews the reference flight data knowingly, and prints what moved."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.programs import rows_of
from tests.references.replayed import FLIGHTS, Rows, needles_of, reference_of, replayed_flight_data


def moves(before: Rows, after: Rows, full_scales: Mapping[str, float]) -> list[str]:
    """What moved, a line for each needle that did; rows are matched by frame."""
    old_rows = {row["frame"]: row for row in before}
    pairs = [(old_rows[new["frame"]], new) for new in after if new["frame"] in old_rows]
    lines = []
    for name in needles_of(after):
        columns = (name, f"{name}_status", f"{name}_score", f"{name}_sigma")
        rows = sum(any(old.get(column) != new[column] for column in columns) for old, new in pairs)
        statuses = sum(old.get(f"{name}_status") != new[f"{name}_status"] for old, new in pairs)
        steps = [abs(float(new[name]) - float(old[name])) for old, new in pairs if old.get(name) and new[name]]
        if rows:
            furthest = max(steps, default=0.0)
            part = f"{furthest / full_scales[name]:.4%} of full scale"
            lines.append(f"  {name}: {rows} rows, by {furthest:.4g} at most ({part}); {statuses} statuses")
    if len(pairs) != len(before) or len(pairs) != len(after):
        lines.append(f"  {len(before)} rows became {len(after)}, {len(pairs)} of them the same frames")
    return lines


def full_scales_of(description: Path) -> dict[str, float]:
    """Full scale by needle, from the JSON beside flight data."""
    needles = json.loads(description.read_text(encoding="utf-8"))["needles"]
    return {name: needle["scale_max"] - needle["scale_min"] for name, needle in needles.items()}


def main() -> None:
    """Renews the reference of every committed flight."""
    for flight in FLIGHTS:
        reference = reference_of(flight)
        with TemporaryDirectory() as folder:
            renewed = replayed_flight_data(flight, Path(folder))
            before = rows_of(reference) if reference.exists() else []
            full_scales = full_scales_of(renewed.with_suffix(".json"))
            lines = moves(before, rows_of(renewed), full_scales) if before else ["  new"]
            shutil.copyfile(renewed, reference)
        sys.stdout.write("\n".join([f"{flight.stem}:", *(lines or ["  nothing moved"])]) + "\n")


if __name__ == "__main__":
    main()
