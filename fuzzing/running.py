"""Give a command many inputs, count what came of them, and keep the smallest that shows a fault."""

from __future__ import annotations

import shutil
import warnings
from dataclasses import dataclass, field
from pathlib import Path

from hypothesis import HealthCheck, Phase, Verbosity, assume, given, seed, settings
from hypothesis.errors import HypothesisWarning

from fuzzing.inputs import MOST_BYTES, Files
from fuzzing.judge import Judge
from fuzzing.targets import Fuzzed


class FaultFound(AssertionError):
    """An input did what none may; it is kept."""


@dataclass(slots=True)
class Tally:
    """What came of the inputs of one command.

    Attributes
    ----------
    codes
        Inputs by exit code.
    slowest_s, largest_bytes
        Processor time and memory of the input that took most.
    faults
        What was found, each with where its input is kept.
    """

    inputs: int = 0
    codes: dict[int, int] = field(default_factory=dict)
    slowest_s: float = 0.0
    largest_bytes: int = 0
    faults: list[str] = field(default_factory=list)


def fuzz(name: str, fuzzed: Fuzzed, tally: Tally, judge: Judge, *, start: int, inputs: int, kept: Path) -> None:
    """Run a command on so many inputs that follow from a seed, up to the first fault, which is made small.

    Parameters
    ----------
    name
        Of the command; the input with a fault is kept under it.
    tally
        Is added to.
    start
        The seed.
    kept
        Folder for inputs with faults.
    """
    folder = kept / f"{name.replace(' ', '_')}_{start}"

    @seed(start)
    @settings(
        max_examples=inputs,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
        phases=(Phase.generate, Phase.shrink),
        verbosity=Verbosity.quiet,
        report_multiple_bugs=False,
    )
    @given(fuzzed.files)
    def run(files: Files) -> None:
        assume(sum(map(len, files.values())) <= MOST_BYTES)
        outcome = judge(fuzzed.target, files)
        tally.inputs += 1
        tally.codes[outcome.code] = tally.codes.get(outcome.code, 0) + 1
        tally.slowest_s = max(tally.slowest_s, outcome.seconds)
        tally.largest_bytes = max(tally.largest_bytes, outcome.memory_bytes)
        if outcome.faults:
            _keep(folder, files, outcome.said)
            raise FaultFound("; ".join(outcome.faults))

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", HypothesisWarning)  # of how long an input is, which is kept in files
            run()
    except FaultFound as found:
        tally.faults.append(f"{found} ({folder})")


def _keep(folder: Path, files: Files, said: str) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    for name, content in files.items():
        path = folder / "in" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    (folder / "said.txt").write_text(said, encoding="utf-8")
