"""How `decode` starts: quickly, since it imports late, and ready for Ctrl-C from the first moment."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from decoder.parallel.processes import ONE_EACH
from tests.programs import FIXTURES

HEAVY = {"cv2", "mcap", "numpy", "pydantic", "requests", "yaml"}

SAY_IMPORTS = """
import sys
from decoder.start import main
try:
    main()
except SystemExit as done:
    code = done.code
print("IMPORTED", *sorted({name.partition(".")[0] for name in sys.modules}))
"""

# Stands before the real finders, and presses Ctrl-C when a module is looked for.
PRESS = """
import os, signal, sys
class Finger:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Finger())
from decoder.start import main
main()
"""

SAY_THREADS = """
import os
from decoder.start import main
try:
    main()
except SystemExit:
    pass
import numpy
print("THREADS", len(os.listdir("/proc/self/task")))
"""

ASK_HALFWAY = """
import sys
from decoder.commands import cli
import click
def seen(text="", **_):
    print("FIRST", text)
    print("IMPORTED", *sorted({name.partition(".")[0] for name in sys.modules}))
    sys.exit(0)
click.echo = seen
cli.main()
"""


def python(script: str, *words: object) -> subprocess.CompletedProcess[str]:
    """Runs a script with these arguments."""
    command = [sys.executable, "-c", script, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)


def imported(done: subprocess.CompletedProcess[str]) -> set[str]:
    """The outermost packages that a script had imported."""
    (line,) = (line for line in done.stdout.splitlines() if line.startswith("IMPORTED"))
    return set(line.split()[1:])


@pytest.mark.parametrize(
    ("words", "heavy"),
    [
        (["--help"], HEAVY),
        (["--version"], HEAVY),
        (["calibrate", "--help"], HEAVY),
        (["flight", "--help"], {"cv2", "numpy", "pydantic"}),
    ],
)
def test_help_imports_nothing_heavy(words: list[str], heavy: set[str]) -> None:
    """What only says what the program is needs none of the libraries that do the work."""
    done = python(SAY_IMPORTS, *words)

    assert done.returncode == 0, done.stderr
    assert "--help" in done.stdout or "--version" in words
    assert imported(done) & heavy == set()


def test_first_line_comes_before_the_libraries() -> None:
    """`decode FLIGHT` says what it is going to do before it imports what does it."""
    done = python(ASK_HALFWAY, FIXTURES / "thesis_a1.mcap")

    assert "FIRST thesis_a1: decoding 20 frames with the panel it carries" in done.stdout
    assert imported(done) & {"cv2", "numpy", "pydantic"} == set()


@pytest.mark.untraced
@pytest.mark.parametrize("module", ["click", "zstandard", "numpy", "cv2", "pydantic", "tqdm"])
def test_interrupt_while_it_starts_is_one_sentence(module: str, tmp_path: Path) -> None:
    """Ctrl-C while anything is being imported ends with a sentence and 1, never with a traceback."""
    done = python(PRESS.format(module=module), FIXTURES / "thesis_a1.mcap", "-o", tmp_path / "out")

    assert (done.returncode, done.stderr) == (1, "decode: interrupted; nothing was written\n")
    assert not (tmp_path / "out").exists()


@pytest.mark.untraced
def test_ignored_interrupt_stays_ignored(tmp_path: Path) -> None:
    """Where Ctrl-C is ignored, as behind `nohup`, it is not taken up again by the imports."""
    ignoring = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)" + PRESS.format(module="cv2")
    done = python(ignoring, FIXTURES / "thesis_a1.mcap", "-o", tmp_path / "out")

    assert (done.returncode, done.stderr) == (0, "")


def test_libraries_make_no_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """A thread of theirs would spin while it waits for work, on a processor that reads frames."""
    for name in ONE_EACH:
        monkeypatch.delenv(name, raising=False)

    assert "THREADS 1\n" in python(SAY_THREADS, "--help").stdout
