"""What a user says of a truth: where it is, what it calls the needles, and what about its clock."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

AUTO = "auto"
TIME_COLUMN = "time_s"
WINDOW_S = 600.0


@dataclass(frozen=True, slots=True)
class TruthRequest:
    """A truth, not yet read.

    Attributes
    ----------
    file, map_file
        The table, and a file of names and units, if one was given.
    time_column
        None for `time_s`.
    offset
        Seconds to add to its times, `auto`, or None for nothing.
    window_s
        How far `auto` looks.
    limits
        Whether parameters shall be judged by published limits.
    """

    file: Path
    map_file: Path | None = None
    time_column: str | None = None
    offset: str | float | None = None
    window_s: float = WINDOW_S
    limits: bool = False

    @property
    def has_own_clock(self) -> bool:
        """Whether it is a recorder's, with names and a clock of its own."""
        return any(given is not None for given in (self.map_file, self.time_column, self.offset))

    @property
    def words(self) -> list[str]:
        """The options that say the same on a command line; files by their names alone."""
        words = ["--truth", self.file.name]
        words += [] if self.map_file is None else ["--map", self.map_file.name]
        words += [] if self.time_column is None else ["--time", self.time_column]
        words += [] if self.offset is None else ["--offset", str(self.offset)]
        words += ["--window", f"{self.window_s:g}"] if self.offset == AUTO else []
        return [*words, *(["--limits"] if self.limits else [])]
