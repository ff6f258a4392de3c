"""`python -m benchmarks.strangers ROWS.csv [--against EARLIER.csv]`: how pictures by others are read, row by row.

Every source of `real_pictures` and the whole panel, drawn as they are and by an unsteady hand: one row for each column
of flight data. Rows are written as they come, so that two checkouts can be held against each other: run it before and
after a change to what reads, and hold the second against the first.
"""

from __future__ import annotations

import csv
import sys
from argparse import ArgumentParser
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.real_pictures import Source, available, decode_source, reads
from benchmarks.unsteady_hand import manners
from benchmarks.whole_panel import SOURCES as WHOLE
from decoder.outputs.csv_output import text_table

MANNERS = 2  # as it is, and by the steadier of the unsteady hands
HOLDS = 0.85
NOTED = 0.05
TOTALS = ("rows", "valued", "read", "gross", f"in 95 % under {HOLDS:.0%}")


@dataclass(frozen=True, slots=True)
class Row:
    """One column of flight data over one source: parts of its frames, a count, and a mean error in percent."""

    source: str
    manner: str
    column: str
    valued: float
    read: float
    gross: int
    within_95: float
    mean: float

    @property
    def key(self) -> tuple[str, str, str]:
        """What names the row in every run."""
        return self.source, self.manner, self.column

    def is_unlike(self, other: Row) -> bool:
        """Whether the two differ by what is worth a look."""
        shares = ((self.valued, other.valued), (self.read, other.read), (self.within_95, other.within_95))
        return self.gross != other.gross or any(abs(now - before) > NOTED for now, before in shares)


def sources(words: str) -> list[Source]:
    """List the sources whose title has these words and whose pictures are there, the whole panel last."""
    there = [*available(), *(source for source in WHOLE if any(source.folder.glob(source.pictures)))]
    return [source for source in there if words in source.title]


def rows_of(source: Source, every: int) -> Iterator[Row]:
    """A source's rows as its panel is drawn and by an unsteady hand; a panel that is refused has none, on stderr."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        for number, (manner, drawn) in enumerate(islice(manners(source, folder), MANNERS)):
            try:
                found = reads(decode_source(drawn, folder / str(number), every=every))
            except SystemExit as refused:
                sys.stderr.write(f"{source.title}, {manner}: {refused}\n")
                continue
            for one in found:
                yield Row(source.title, manner, one.needle, one.valued, one.read, one.gross, one.within_95, one.mean)


def write(rows: Iterator[Row], path: Path) -> list[Row]:
    """Write rows as they come, and give them back."""
    kept = []
    with path.open("w", encoding="utf-8", newline="") as stream:
        table = csv.writer(stream)
        table.writerow(Row.__slots__)
        for row in rows:
            table.writerow([getattr(row, name) for name in Row.__slots__])
            stream.flush()
            kept.append(row)
    return kept


def read(path: Path) -> dict[tuple[str, str, str], Row]:
    """The rows that an earlier run wrote, by their keys."""
    with path.open(encoding="utf-8", newline="") as stream:
        rows = [
            Row(
                each["source"],
                each["manner"],
                each["column"],
                float(each["valued"]),
                float(each["read"]),
                int(each["gross"]),
                float(each["within_95"]),
                float(each["mean"]),
            )
            for each in csv.DictReader(stream)
        ]
    return {row.key: row for row in rows}


def summary(rows: Sequence[Row]) -> tuple[str, ...]:
    """All rows in one line, under `TOTALS`."""
    valued, parts, within = (np.array([getattr(row, name) for row in rows]) for name in ("valued", "read", "within_95"))
    gross = sum(row.gross for row in rows)
    return str(len(rows)), f"{valued.mean():.2%}", f"{parts.mean():.2%}", str(gross), str((within < HOLDS).sum())


def differences(rows: Sequence[Row], earlier: Mapping[tuple[str, str, str], Row]) -> list[tuple[str, ...]]:
    """The rows that are unlike those of an earlier run, each with what it was and what it is."""
    names = ("valued", "read", "gross", "within_95")
    return [
        (*row.key, *(f"{getattr(earlier[row.key], name):.3g} -> {getattr(row, name):.3g}" for name in names))
        for row in rows
        if row.key in earlier and row.is_unlike(earlier[row.key])
    ]


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, write the rows, and print what they come to."""
    parser = ArgumentParser(prog="python -m benchmarks.strangers", description=__doc__)
    parser.add_argument("rows", type=Path, metavar="ROWS.csv")
    parser.add_argument("--every", type=int, default=3, help="read one picture of so many (default: %(default)s)")
    parser.add_argument("--only", default="", metavar="WORDS", help="only sources whose title has these words")
    parser.add_argument("--against", type=Path, metavar="EARLIER.csv", help="list the rows that differ")
    asked = parser.parse_args(arguments)
    rows = write((row for source in sources(asked.only) for row in rows_of(source, asked.every)), asked.rows)
    lines = [summary(rows)]
    if asked.against:
        earlier = read(asked.against)
        lines.insert(0, summary([earlier[row.key] for row in rows if row.key in earlier]))
        for line in differences(rows, earlier):
            sys.stdout.write("  ".join(line) + "\n")
    sys.stdout.write(text_table(TOTALS, lines) + "\n")


if __name__ == "__main__":
    main()
