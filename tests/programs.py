"""What tests of the programs share: where things are, programs run to their end, and what stands in their files."""

from __future__ import annotations

import atexit
import csv
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import yaml

from decoder.parallel.processes import ONE_EACH

ROOT = Path(__file__).parents[1]
FIXTURES = ROOT / "fixtures"
A1, A2 = FIXTURES / "thesis_a1.mcap", FIXTURES / "thesis_a2.mcap"
PROGRAMS = Path(sys.executable).parent
DECODE, RECORDER = str(PROGRAMS / "decode"), str(PROGRAMS / "recorder")
PATIENCE_S = 120

Done = subprocess.CompletedProcess[str]
Run = Callable[..., Done]
MakeFlight = Callable[..., Path]


# As before any test: whichever asks first, programs can be traced for coverage. And a thread pool that a fork leaves
# behind must never have been made.
_ENVIRONMENT = {**os.environ, **ONE_EACH}


def _server() -> subprocess.Popen[str]:
    """Forks our programs without loading their libraries anew; see program_server.py."""
    command = [sys.executable, "-P", str(Path(__file__).with_name("program_server.py"))]
    server = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=_ENVIRONMENT)
    atexit.register(server.communicate)
    return server


_idle: list[subprocess.Popen[str]] = []


def ran(program: str, *words: object, cwd: Path | None = None, env: Mapping[str, str] | None = None) -> Done:
    """A program of ours that came to its end, whatever that was."""
    server = _idle.pop() if _idle else _server()
    assert server.stdin is not None
    assert server.stdout is not None
    with TemporaryFile("w+", encoding="utf-8") as out, TemporaryFile("w+", encoding="utf-8") as err:
        files = [f"/proc/{os.getpid()}/fd/{file.fileno()}" for file in (out, err)]  # they have no other name
        told = {"place": str(cwd or Path.cwd()), "env": {**os.environ, **(env or {})}, "files": files}
        server.stdin.write(json.dumps({"program": program, "words": [*map(str, words)], **told}) + "\n")
        server.stdin.flush()
        code = int(server.stdout.readline())
        _idle.append(server)
        for file in (out, err):
            file.seek(0)
        return Done([program, *map(str, words)], code, out.read(), err.read())


def begun(program: str, *words: object, env: Mapping[str, str] | None = None, **options: Any) -> subprocess.Popen[str]:  # noqa: ANN401 - Popen's
    """A program of ours in work, what it says in pipes."""
    return subprocess.Popen(
        [str(PROGRAMS / program), *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, **(env or {})},
        **options,
    )


def until(condition: Callable[[], Any]) -> Any:  # noqa: ANN401 - whatever the condition gives
    """Waits for something to become true; gives it."""
    limit = time.monotonic() + PATIENCE_S
    while not (found := condition()):
        assert time.monotonic() < limit, "nothing came of it"
        time.sleep(0.02)
    return found


def says(done: Done, *words: str) -> None:
    """A program of ours failed with exit code 1 and one sentence that holds all the words."""
    assert done.returncode == 1, done.stderr
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert [word for word in words if word not in done.stderr] == []


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, by its place there."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def rows_of(table: Path) -> list[dict[str, str]]:
    """The rows of a CSV file."""
    with table.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def yaml_of(file: Path) -> Any:  # noqa: ANN401 - what YAML holds
    """What stands in a YAML file."""
    return yaml.safe_load(file.read_text(encoding="utf-8"))


def write_yaml(file: Path, content: object) -> Path:
    """A YAML file with this in it."""
    file.write_text(yaml.safe_dump(content), encoding="utf-8")
    return file
