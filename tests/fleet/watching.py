"""What is looked at from outside while a fleet is decoded: its results, its processes and their files."""

from __future__ import annotations

import contextlib
import subprocess
from pathlib import Path

import psutil

from tests.programs import PATIENCE_S, begun, contents, rows_of


def results(folder: Path) -> dict[str, bytes]:
    """All results in an output but markers and index, by their place."""
    return {
        place: content for place, content in contents(folder).items() if not place.endswith(("fleet.done", "index.csv"))
    }


def index(output: Path) -> dict[str, dict[str, str]]:
    """The rows of an output's index, by flight."""
    return {row["flight"]: row for row in rows_of(output / "index.csv")}


def states(output: Path) -> dict[str, str]:
    """The status of each flight in an output's index."""
    return {flight: row["status"] for flight, row in index(output).items()}


def started(*words: object) -> subprocess.Popen[str]:
    """`decode fleet`, started."""
    return begun("decode", "fleet", *words)


def kill_whole(process: subprocess.Popen[bytes]) -> None:
    """Kills a process and its children, as when a machine loses its power."""
    with contextlib.suppress(psutil.NoSuchProcess):
        whole = psutil.Process(process.pid)
        for each in [*whole.children(recursive=True), whole]:
            with contextlib.suppress(psutil.NoSuchProcess):
                each.kill()
    process.wait(timeout=PATIENCE_S)


def find_reader(path: Path, *above: int) -> psutil.Process | None:
    """The process below other ones that has a file open."""
    for process in (below for pid in above for below in psutil.Process(pid).children(recursive=True)):
        with contextlib.suppress(psutil.NoSuchProcess, psutil.AccessDenied):
            if any(opened.path == str(path) for opened in process.open_files()):
                return process
    return None


def is_gone(process: psutil.Process) -> bool:
    """Whether a process has ended, waited for or not."""
    with contextlib.suppress(psutil.NoSuchProcess):
        return not process.is_running() or bool(process.status() == psutil.STATUS_ZOMBIE)
    return True
