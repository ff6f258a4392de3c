"""Our programs, loaded and waiting for words: for each line of them one is forked that runs.

Loading takes several times as long as what most tests ask for. What runs is the whole program in a process of its own,
from its words to its exit code; tests/commands/test_starting.py and tests/recorder/test_commands.py look at the start.
"""

from __future__ import annotations

import gc
import json
import os
import signal
import sys
import threading
from collections.abc import Callable
from importlib import import_module

import decoder.commands.cli as desk
import decoder.commands.flight_work
import decoder.start
import recorder.cli as box

MAINS: dict[str, Callable[[], object]] = {"decode": decoder.start.main, "recorder": box.main}
LIMIT_S = 300
TRACED = "COVERAGE_PROCESS_CONFIG"


def become(program: str, words: list[str], place: str, env: dict[str, str], files: list[str]) -> None:
    """Turns a forked process into a program in a folder, what it prints into files; one that hangs is killed."""
    signal.alarm(LIMIT_S)
    for descriptor, path in zip((0, 1, 2), (os.devnull, *files), strict=True):
        file = os.open(path, os.O_RDWR)
        os.dup2(file, descriptor)
        os.close(file)
    os.chdir(place)
    os.environ.clear()
    os.environ.update(env)
    if TRACED not in env:
        sys.settrace(None)
        threading.settrace(None)
    sys.argv = [program, *words]
    MAINS[program]()


def serve() -> None:
    """One program after the other; prints the exit code of each."""
    for module, _ in (*box.COMMANDS.values(), *desk.COMMANDS.values(), *desk.CALIBRATIONS.values()):
        import_module(module.partition(":")[0])
    gc.freeze()
    while line := sys.stdin.readline():
        child = os.fork()
        if child == 0:
            become(**json.loads(line))
            return
        _, status = os.waitpid(child, 0)
        sys.stdout.write(f"{os.waitstatus_to_exitcode(status)}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    serve()
