"""Finishes, in the background, the segments that were left in work: by an earlier life, or when the disk failed."""

from __future__ import annotations

import os
import queue
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from flight_file.errors import FlightFileError
from flight_file.segments import parse_segment_name
from flight_file.writer import PART_SUFFIX
from recorder.journal import Journal

Recover = Callable[[Path], str]
"""Finishes one file in work; says in words what became of it, and raises FlightFileError."""

_NICE = 10  # the camera and the disk go first
_AGAIN_S = 600.0  # how often to look whether there is room by now


def files_in_work(directory: Path) -> list[Path]:
    """Segments in work in a directory, by name; empty if it cannot be listed."""
    with suppress(OSError):
        return sorted(
            path
            for path in directory.iterdir()
            if path.name.endswith(PART_SUFFIX) and parse_segment_name(path) and path.is_file()
        )
    return []


class Salvager(threading.Thread):
    """Takes one file after another; it is a daemon thread, and a recovery that is cut off can be done again.

    Parameters
    ----------
    free_bytes
        Room left where a path lies, bytes; None if unknown.
    """

    def __init__(self, recover: Recover, *, free_bytes: Callable[[Path], int | None], journal: Journal) -> None:
        super().__init__(name="salvage", daemon=True)
        self._recover = recover
        self._free_bytes = free_bytes
        self._journal = journal
        self._paths: queue.SimpleQueue[Path] = queue.SimpleQueue()
        self._postponed: list[Path] = []

    def submit(self, path: Path) -> None:
        """See to this file when there is time."""
        self._paths.put(path)

    def run(self) -> None:
        """Work for ever."""
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICE)
        while True:
            try:
                path = self._paths.get(timeout=_AGAIN_S)
            except queue.Empty:
                self._try_postponed()
            else:
                self._salvage(path)

    def _try_postponed(self) -> None:
        postponed, self._postponed = self._postponed, []
        for path in postponed:
            self._salvage(path)

    def _salvage(self, path: Path) -> None:
        try:
            if not self._has_room(path):
                self._postponed.append(path)
                self._journal.log.warning("segment_not_salvaged", path=str(path), reason="there is no room for it now")
                return
            became = self._recover(path)
        except FlightFileError as error:
            self._journal.log.warning("segment_not_salvaged", path=str(path), reason=str(error))
        except OSError as error:
            self._journal.log.warning("segment_not_salvaged", path=str(path), reason=error.strerror)
        else:
            self._journal.log.warning("segment_salvaged", path=str(path), became=became)

    def _has_room(self, path: Path) -> bool:
        # The copy needs as much room as the file has. As much again is for what is being recorded meanwhile: a file in
        # work can be read as it is, so no flight shall be deleted for it.
        free = self._free_bytes(path.parent)
        return free is None or free >= 2 * path.stat().st_size
