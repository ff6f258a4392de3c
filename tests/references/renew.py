"""`make refs`: renews the reference flight data knowingly, and prints what moved."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).parent))

from replayed import FLIGHTS, Rows, needles_of, read_rows, reference_of, replayed_flight_data


def moves(before: Rows, after: Rows) -> list[str]:
    """What moved, a line for each needle that did."""
    lines = []
    for name in needles_of(after):
        pairs = [(old.get(name, ""), new[name]) for old, new in zip(before, after, strict=False)]
        changed = [(old, new) for old, new in pairs if old != new]
        statuses = sum(
            old.get(f"{name}_status") != new[f"{name}_status"] for old, new in zip(before, after, strict=False)
        )
        if changed or statuses:
            furthest = max((abs(float(new) - float(old)) for old, new in changed if old and new), default=0.0)
            lines.append(f"  {name}: {len(changed)} values, by {furthest:g} at most; {statuses} statuses")
    if len(before) != len(after):
        lines.append(f"  {len(before)} rows became {len(after)}")
    return lines


def main() -> None:
    """Renews the reference of every committed flight."""
    for flight in FLIGHTS:
        reference = reference_of(flight)
        with TemporaryDirectory() as folder:
            renewed = replayed_flight_data(flight, Path(folder))
            before = read_rows(reference) if reference.exists() else []
            lines = moves(before, read_rows(renewed)) if before else ["  new"]
            shutil.copyfile(renewed, reference)
        sys.stdout.write("\n".join([f"{flight.stem}:", *(lines or ["  nothing moved"])]) + "\n")


if __name__ == "__main__":
    main()
