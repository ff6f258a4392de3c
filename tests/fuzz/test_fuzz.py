"""No input makes a program crash, hang, swell or write where it should not: a few hundred, the same each time."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from fuzzing.flights import sealed_flight, shot
from fuzzing.inputs import KEY, fixture, signed_flight
from fuzzing.judge import Judge, Target
from fuzzing.running import Tally, fuzz
from fuzzing.targets import FUZZED, Fuzzed

pytestmark = pytest.mark.slow  # what is forked is not traced, and shall not be slowed down

SEED = 20180504
INPUTS = 3  # of the commands that are given fewest


def test_what_is_made_hostile_is_sound_before(judge: Judge) -> None:
    """Else every input would be refused for the same reason."""
    sound = sealed_flight([shot(number, picture) for number, picture in enumerate(fixture().pictures)], {"a": b"b"})
    names = {"flight_0000.mcap": signed_flight().content, "flight_0000.mcap.sig": signed_flight().signature, **KEY}

    assert judge(FUZZED["recorder verify"].target, {"flight.mcap": sound}).code == 0
    assert judge(FUZZED["signatures"].target, names).code == 0


@pytest.mark.parametrize("name", FUZZED)
def test_hostile_files_are_read_or_refused(judge: Judge, name: str, tmp_path: Path) -> None:
    """Each ends in time with one of the exit codes, and in words where it fails."""
    tally = Tally()
    fuzz(name, FUZZED[name], tally, judge, start=SEED, inputs=INPUTS * FUZZED[name].weight, kept=tmp_path)

    assert tally.faults == []
    assert tally.inputs > 0


FAULTS = {
    "raise ZeroDivisionError": "traceback: ZeroDivisionError",
    "while True: pass": "took more than",
    "bytearray(2**31)": "MemoryError",
    "open('in/stray', 'w').close()": "it wrote 'in/stray'",
    "import sys; sys.exit(1)": "without a word",
    "import sys; sys.exit(9)": "it ended with 9",
    "import os; os.kill(os.getpid(), 9)": "it hung, or was killed",
}


def test_judge_sees_what_may_not_be() -> None:
    """A judge that finds nothing is worth what it would have found."""
    with Judge({code: partial(exec, code) for code in FAULTS}, limit_s=1) as judge:
        outcomes = {code: judge(Target((code,)), {"file": b""}) for code in FAULTS}

    assert {
        code: outcomes[code]
        for code, fault in FAULTS.items()
        if not any(fault in each for each in outcomes[code].faults)
    } == {}


def test_smallest_input_with_a_fault_is_kept(tmp_path: Path) -> None:
    """In files that can be given to the program again."""
    tally, info = Tally(), FUZZED["recorder info"]
    with Judge({"recorder": partial(exec, "1 / 0")}) as judge:
        fuzz("recorder info", Fuzzed(info.target, info.files), tally, judge, start=SEED, inputs=3, kept=tmp_path)

    assert len(tally.faults) == 1
    assert (tmp_path / f"recorder_info_{SEED}" / "in" / "flight.mcap").stat().st_size > 0
