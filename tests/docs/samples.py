"""What the documents show of commands' output, run as a reader would run them; `make docs-samples` renews it.

In a document, a `console` fence holds commands after `$ `, each above what it prints, and an `output` fence holds what
the last command of the fence above it prints. A fence with a file's name after its language (`csv eye.csv`) is a file
that the reader saves. All commands of a document run one after the other, by `sh`, in what looks like a fresh clone.

Shown and printed agree if their words and whole numbers are the same, and numbers with decimals differ by at most one
in the last: another kind of processor may round otherwise. Columns may be wider or narrower. A line of three dots
stands for any number of lines.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.programs import PROGRAMS, ROOT, Done, ran

DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
FENCE = re.compile(r"^```(?P<kind>\w*) ?(?P<name>[\w.]*)\n(?P<body>.*?)^```$", re.MULTILINE | re.DOTALL)
SESSION = re.compile(r"^\$ (?P<command>.*)\n(?P<shown>(?:(?!\$ ).*\n)*)", re.MULTILINE)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?")
LEFT_OUT = "...\n"
NEEDS_SHELL = re.compile(r"[|<>$*;&`~]")


@dataclass(frozen=True, slots=True)
class SavedFile:
    """A file that the reader saves."""

    name: str
    content: str


@dataclass(frozen=True, slots=True)
class Sample:
    """A command, what is shown of its output, and where that stands in the document."""

    command: str
    shown: str
    begin: int
    end: int


def steps(text: str) -> Iterator[SavedFile | Sample]:
    """What a document's reader does, in order."""
    above = ""
    for fence in FENCE.finditer(text):
        body = fence["body"]
        if fence["kind"] == "console":
            for told in SESSION.finditer(body):
                at = fence.start("body") + told.start("shown")
                yield Sample(told["command"], told["shown"], at, at + len(told["shown"]))
        elif fence["kind"] == "output":
            yield Sample(above.splitlines()[-1], body, fence.start("body"), fence.end("body"))
        elif fence["name"]:
            yield SavedFile(fence["name"], body)
        above = body


def has_samples(document: Path) -> bool:
    """Whether a document shows what a command prints."""
    return any(isinstance(step, Sample) for step in steps(document.read_text(encoding="utf-8")))


def printed(text: str, folder: Path) -> Iterator[tuple[Sample, str]]:
    """Each sample of a document, and what its command prints in an empty folder made to look like a clone.

    Raises
    ------
    subprocess.CalledProcessError
        A command failed; its standard error is in `stderr`.
    """
    shutil.copytree(ROOT / "fixtures", folder / "fixtures", ignore=shutil.ignore_patterns("rendered", "__pycache__"))
    for name in ("Makefile", "pyproject.toml", "requirements.lock"):
        shutil.copy(ROOT / name, folder)
    (folder / ".venv").mkdir()
    (folder / ".venv" / "bin").symlink_to(PROGRAMS)
    (folder / ".venv" / ".ready").touch()
    for step in steps(text):
        if isinstance(step, SavedFile):
            (folder / step.name).write_text(step.content, encoding="utf-8")
            continue
        done = _run(step.command, folder)
        done.check_returncode()
        yield step, done.stdout


def _run(command: str, folder: Path) -> Done:
    program, *words = shlex.split(command)
    if program in {"decode", "recorder"} and not NEEDS_SHELL.search(command):
        return ran(program, *words, cwd=folder)  # which need not be loaded anew for each
    env = {**os.environ, "PATH": f"{PROGRAMS}{os.pathsep}{os.environ['PATH']}"}
    return subprocess.run(["sh", "-c", command], cwd=folder, env=env, capture_output=True, text=True, check=False)


def fresh(shown: str, output: str) -> str:
    """What is to be shown: as much of the output as is shown now, or all of it if not even the words are the same."""
    lines = shown.splitlines(keepends=True)
    found = re.fullmatch("".join(map(_line_pattern, lines)), output)
    if found is None:
        return output
    renewed = iter(found.groups())
    return "".join(line if line == LEFT_OUT else next(renewed) for line in lines)


def _line_pattern(line: str) -> str:
    if line == LEFT_OUT:
        return r"(?:.*\n)*?"
    kinds = {"number": NUMBER.pattern, "rule": "--+", "space": " +"}
    tokens = re.finditer("|".join(f"(?P<{kind}>{pattern})" for kind, pattern in kinds.items()) + "|.|\n", line)
    return f"({''.join(kinds.get(token.lastgroup or '', re.escape(token[0])) for token in tokens)})"


def agree(shown: str, found: str) -> bool:
    """Whether two texts are the same but for the last decimal of their numbers, and for the width of columns."""
    pattern = "".join(map(_line_pattern, shown.splitlines(keepends=True)))
    return re.fullmatch(pattern, found) is not None and all(
        one == other or ("." in one and abs(float(one) - float(other)) < 1.5 * 10.0 ** -len(one.partition(".")[2]))
        for one, other in zip(NUMBER.findall(shown), NUMBER.findall(found), strict=True)
    )


def renew(document: Path) -> bool:
    """Put what the commands print now into a document; whether anything moved."""
    text = before = document.read_text(encoding="utf-8")
    with TemporaryDirectory() as name:
        for sample, output in reversed(list(printed(text, Path(name)))):
            text = text[: sample.begin] + fresh(sample.shown, output) + text[sample.end :]
    document.write_text(text, encoding="utf-8")
    return text != before


if __name__ == "__main__":
    for path in filter(has_samples, DOCUMENTS):
        sys.stdout.write(f"{path.relative_to(ROOT)}: {'renewed' if renew(path) else 'as it was'}\n")
