"""The order of a recording's chapters, by the names that cameras give them.

| names                        | camera                  | first    | then                    |
| ---------------------------- | ----------------------- | -------- | ----------------------- |
| `GX010123`, `GX020123`       | GoPro since HERO6       | 01       | chapter, then recording |
| `GOPR0123`, `GP010123`       | GoPro before            | `GOPR`   | chapter, then recording |
| anything with a number in it | others                  | smallest | numbers count as such   |

A GoPro's names sort by chapter before recording, and an old one's first chapter sorts after the others. Source:
GoPro's file naming conventions.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from camera_drivers.errors import ReplayError

_GOPRO = re.compile(r"(?P<kind>G[HXLP])(?P<chapter>\d\d)(?P<recording>\d{4})", re.IGNORECASE)
_OLD_FIRST = re.compile(r"GOPR(?P<recording>\d{4})", re.IGNORECASE)


def counted(path: Path) -> tuple[list[str | int], str]:
    """Sort IMG_9 before IMG_10."""
    parts = re.split(r"(\d+)", path.name)
    return [int(part) if index % 2 else part for index, part in enumerate(parts)], path.name


def in_order(paths: Sequence[Path]) -> list[Path]:
    """Sort the chapters of one recording.

    Raises
    ------
    ReplayError
        They are chapters of two recordings, one is given twice, or one between them is missing.
    """
    places = {path: _gopro_place(path) for path in paths}
    if len(places) < len(paths):
        twice = next(path for path in paths if paths.count(path) > 1)
        raise ReplayError(f"{twice}: is given twice; give each chapter once.")
    known = [(place, path) for path, place in places.items() if place is not None]
    if len(known) < len(paths):
        return sorted(paths, key=counted)
    known.sort()
    ((recording, first), path), *others = known
    for number, ((other, chapter), other_path) in enumerate(others, start=first + 1):
        if other != recording:
            raise ReplayError(f"{path} and {other_path} are two recordings by their names; make a flight file of each.")
        if chapter != number:
            raise ReplayError(f"{other_path}: chapter {number} of this recording is not given; give it too.")
    return [path for _, path in known]


def _gopro_place(path: Path) -> tuple[str, int] | None:
    """Parse a GoPro's name: recording and chapter; None for another name."""
    old = _OLD_FIRST.fullmatch(path.stem)
    if old is not None:
        return f"GP{old['recording']}", 0
    match = _GOPRO.fullmatch(path.stem)
    return None if match is None else (match["kind"].upper() + match["recording"], int(match["chapter"]))
