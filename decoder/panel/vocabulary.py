"""Words of files and of the command line that are known before any library is loaded."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

# The names under which a flight file contains what the desk needs.
PANEL_FILE = "panel.yaml"
CAMERA_FILE = "camera.yaml"


class Method(StrEnum):
    """How the best row is found: by normalized or by plain cross-correlation."""

    NORMXCORR = "normxcorr"
    XCORR = "xcorr"


Names = Path | tuple[tuple[str, str], ...]
"""What the truth calls the needles: a file that says so, or pairs of a needle and a column."""
AUTO = "auto"
TIME_COLUMN = "time_s"
WINDOW_S = 600.0


@dataclass(frozen=True, slots=True)
class TruthRequest:
    """A truth that has not been read yet.

    Attributes
    ----------
    file
        The table; the flight data's own if they are compared with the camera's GPS.
    names
        What it calls the needles, if given.
    time_column
        None for `time_s`.
    offset
        Seconds to add to its times, `auto`, or None for nothing.
    window_s
        How far `auto` searches.
    limits
        Whether parameters should be judged by published limits.
    """

    file: Path
    names: Names | None = None
    time_column: str | None = None
    offset: str | float | None = None
    window_s: float = WINDOW_S
    limits: bool = False

    @property
    def has_own_clock(self) -> bool:
        """Whether it is a recorder's, with its own names and clock."""
        return any(given is not None for given in (self.names, self.time_column, self.offset))

    @property
    def words(self) -> list[str]:
        """The equivalent options on a command line, with file names only."""
        words = ["--truth", self.file.name]
        words += [] if self.names is None else ["--map", _typed(self.names)]
        words += [] if self.time_column is None else ["--time", self.time_column]
        words += [] if self.offset is None else ["--offset", str(self.offset)]
        words += ["--window", f"{self.window_s:g}"] if self.offset == AUTO else []
        return [*words, *(["--limits"] if self.limits else [])]


def _typed(names: Names) -> str:
    return names.name if isinstance(names, Path) else ",".join(f"{needle}={column}" for needle, column in names)
