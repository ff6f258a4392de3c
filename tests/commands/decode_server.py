"""A `decode` that has loaded its libraries and waits for words: for each line of them it forks one that runs.

Loading takes several times as long as decoding a short flight. What runs is the whole program in a process of its own,
from its words to its exit code; tests/commands/test_starting.py looks at the start itself.
"""

from __future__ import annotations

import gc
import json
import os
import signal
import sys

import decoder.commands.calibrate_board
import decoder.commands.calibrate_pose
import decoder.commands.calibrate_ruler
import decoder.commands.export
import decoder.commands.flight_work
import decoder.commands.frames  # noqa: F401 - loaded for those that are forked
from decoder.start import main

LIMIT_S = 300


def become(words: list[str], place: str, out: str, err: str) -> None:
    """Turns a forked process into `decode WORDS` in a folder, what it prints into files; one that hangs is killed."""
    signal.alarm(LIMIT_S)
    for descriptor, path in ((1, out), (2, err)):
        file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(file, descriptor)
        os.close(file)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.chdir(place)
    sys.argv = ["decode", *words]
    main()


def serve() -> None:
    """One program after the other; prints the exit code of each."""
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
