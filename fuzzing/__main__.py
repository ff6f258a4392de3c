"""`make fuzz`: commands in turn, for so many minutes; writes what came of it to a page of docs/ if it is asked to."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from fuzzing.judge import LIMIT_BYTES, LIMIT_S, Judge
from fuzzing.running import Tally, fuzz
from fuzzing.targets import FUZZED

PAGE = Path(__file__).parents[1] / "docs" / "reliability.md"
FIGURES = "<!-- figures of the last long run: `python -m fuzzing --write` -->\n"
INPUTS_A_TURN = 10


def main() -> None:
    """Ends with 1 where a fault was found."""
    parser = argparse.ArgumentParser(prog="python -m fuzzing", description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1, help="of the first turn; each turn has the next")
    parser.add_argument("--kept", type=Path, default=Path("fuzzing/found"), help="folder for inputs with faults")
    parser.add_argument("--write", action="store_true", help="put the figures into docs/reliability.md")
    asked = parser.parse_args()
    tallies = {name: Tally() for name in FUZZED}
    turn, began = asked.seed, time.monotonic()
    with Judge() as judge:
        while time.monotonic() - began < asked.minutes * 60:
            for name, fuzzed in FUZZED.items():
                known = len(tallies[name].faults)
                fuzz(
                    name,
                    fuzzed,
                    tallies[name],
                    judge,
                    start=turn,
                    inputs=INPUTS_A_TURN * fuzzed.weight,
                    kept=asked.kept,
                )
                for fault in tallies[name].faults[known:]:
                    print(f"{name}: {fault}", flush=True)
            turn += 1
    figures = table(tallies, (time.monotonic() - began) / 60)
    print(figures)
    if asked.write:
        text, _, _ = PAGE.read_text(encoding="utf-8").partition(FIGURES)
        PAGE.write_text(text + FIGURES + "\n" + figures + "\n", encoding="utf-8")
    sys.exit(any(tally.faults for tally in tallies.values()))


def table(tallies: dict[str, Tally], minutes: float) -> str:
    """The figures as Markdown."""
    total = sum(tally.inputs for tally in tallies.values())
    lines = [
        f"{total} inputs in {minutes:.0f} minutes; the limits are {LIMIT_S} s and {LIMIT_BYTES >> 20} MiB.",
        "",
        "| command | inputs | done | failed | with loss | slowest, s | most memory, MB | faults |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name, tally in tallies.items():
        done, failed, loss = (sum(tally.codes.get(code, 0) for code in codes) for codes in ((0,), (1, 2, 78), (3,)))
        memory_mb = tally.largest_bytes / 1e6
        lines.append(
            f"| {name} | {tally.inputs} | {done} | {failed} | {loss} | {tally.slowest_s:.1f} | {memory_mb:.0f}"
            f" | {len(tally.faults)} |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
