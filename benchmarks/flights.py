"""The flights that are measured, decoded once for each method; rendered first if they are not there."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Self

from benchmarks.programs import run
from decoder.accuracy import Table, read_table
from fixtures.make import FLIGHTS, FOLDER
from fixtures.make import main as make_fixtures

RENDERED = FOLDER / "rendered"
PLAIN = RENDERED / "plain.mcap"


@dataclass(frozen=True, slots=True)
class Decoded:
    """A flight's data beside their truth."""

    name: str
    method: str
    data: Table
    truth: Table


class DecodedFlights:
    """Decodes flights as they are asked for, into a folder that goes when this does."""

    def __init__(self) -> None:
        self._folder = TemporaryDirectory()
        self._decoded: dict[tuple[str, str], Decoded] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._folder.cleanup()

    def get(self, name: str, method: str) -> Decoded:
        """A flight of the fixtures, decoded by one method."""
        if (name, method) not in self._decoded:
            folder = FOLDER if (FOLDER / f"{name}.mcap").exists() else RENDERED
            target = Path(self._folder.name) / method
            run("decode", folder / f"{name}.mcap", "-o", target, "--method", method)
            self._decoded[name, method] = Decoded(
                name, method, read_table(target / f"{name}.csv"), read_table(folder / f"{name}_truth.csv")
            )
        return self._decoded[name, method]


def render_what_is_absent() -> None:
    """Renders and records the long flights, unless they are there."""
    if not all((RENDERED / f"{flight.name}{end}").exists() for flight in FLIGHTS for end in (".mcap", "_truth.csv")):
        print("rendering the 400-frame flights ...", file=sys.stderr)
        make_fixtures(["frames"])
        make_fixtures(["flights"])
