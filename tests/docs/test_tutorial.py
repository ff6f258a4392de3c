"""Who follows docs/tutorial.md to the letter sees what it shows."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TUTORIAL = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
PROGRAMS = Path(sys.executable).parent
SERVES = "decode setup "  # until somebody ends it; tests/setup draws on its page


def commands() -> Iterator[tuple[str, str | None]]:
    """Each command, and what is shown below it where something is."""
    for kind, block in re.findall(r"^```([a-z]*)\n(.*?)^```$", TUTORIAL, re.MULTILINE | re.DOTALL):
        if kind == "console":
            command, _, shown = block.removeprefix("$ ").partition("\n")
            yield command, shown
        elif not kind and not block.startswith(SERVES):
            yield from ((line, None) for line in block.splitlines())


def without_numbers(text: str) -> str:
    """A better decoder reads other numbers, in narrower or wider columns; what they stand beside is the same."""
    return " ".join(re.sub(r"--+", "-", re.sub(r"[-+]?\d[\d.]*", "0", text)).split())


@pytest.mark.slow
def test_tutorial_does_what_it_says(tmp_path: Path) -> None:
    """Every command, one after the other, in a folder that has nothing but the fixtures."""
    (tmp_path / "fixtures").symlink_to(ROOT / "fixtures")
    (table,) = re.findall(r"^```csv\n(.*?)^```", TUTORIAL, re.MULTILINE | re.DOTALL)
    (tmp_path / "eye.csv").write_text(table, encoding="utf-8")
    followed = list(commands())
    for command, shown in followed:
        program, *words = shlex.split(command)
        path = PROGRAMS / program if (PROGRAMS / program).exists() else Path(shutil.which(program) or program)
        done = subprocess.run([str(path), *words], cwd=tmp_path, capture_output=True, text=True, check=False)

        assert done.returncode == 0, (command, done.stderr)
        assert shown is None or without_numbers(done.stdout) == without_numbers(shown), command
    assert len(followed) >= 9
    assert list((tmp_path / "pictures").iterdir())
    assert (tmp_path / "results" / "flight.html").exists()
