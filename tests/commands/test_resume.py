"""`decode --resume` after a real `kill -9`: the same bytes as without one."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.programs import MakeFlight, contents, ran

pytestmark = pytest.mark.untraced  # tests/workers goes through the same lines

# As the program, but its batches are smaller, and noted from the first on: flights of seconds are too long for a test.
EAGER = """
from decoder.imaging import picture_block
from decoder.parallel.decode_journal import DecodeJournal
picture_block.MAX_BATCH_FRAMES = 15
DecodeJournal.__init__.__kwdefaults__["begin_after"] = 1
from decoder.start import main
main()
"""


@pytest.fixture
def flight(make_flight: MakeFlight, pictures: list[bytes]) -> Path:
    """A flight of 120 frames, eight small batches."""
    return make_flight(pictures * 6)


def eager(*words: object) -> subprocess.Popen[str]:
    """A decode that keeps a journal from the first batch on."""
    command = [sys.executable, "-c", EAGER, *map(str, words)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def stopped(running: subprocess.Popen[str], journal: Path, batches: int, how: signal.Signals) -> str:
    """Sends a signal when so many batches are in the journal; gives what the decode says on stderr."""
    with running:
        while running.poll() is None and not (journal.exists() and journal.read_bytes().count(b"\n") > batches):
            time.sleep(0.005)
        running.send_signal(how)
        _, said = running.communicate(timeout=60)
    assert running.returncode != 0
    return said


@pytest.mark.slow
def test_decode_that_is_killed_again_and_again_gives_the_same_bytes(flight: Path, tmp_path: Path) -> None:
    """Each time it goes on where it was; at the end the files are those of an unbroken decode, and nothing else."""
    ran("decode", flight, "-o", tmp_path / "whole")
    journal = tmp_path / "out" / "flight.decode-journal"
    for batches, jobs in ((1, 1), (3, 2), (5, 1)):
        words = (flight, "-o", tmp_path / "out", "--resume", "--jobs", jobs)
        stopped(eager(*words), journal, batches, signal.SIGKILL)
        assert contents(tmp_path / "out").keys() == {journal.name}
        assert journal.read_bytes().count(b"\n") > batches
    with eager(flight, "-o", tmp_path / "out", "--resume") as running:
        _, said = running.communicate(timeout=60)

    assert running.returncode == 0
    assert "decode: " not in said
    assert contents(tmp_path / "out") == contents(tmp_path / "whole")


def test_interrupted_decode_says_how_to_go_on(flight: Path, tmp_path: Path) -> None:
    """Ctrl-C keeps what was read; the same command again starts over, and says so."""
    journal = tmp_path / "out" / "flight.decode-journal"
    said = stopped(eager(flight, "-o", tmp_path / "out", "--jobs", "1"), journal, 2, signal.SIGINT)
    again = ran("decode", flight, "-o", tmp_path / "out")

    assert "frames; --resume continues from there" in said
    assert "decode: interrupted; nothing was written" in said
    assert "Traceback" not in said
    assert "this one starts over, --resume would have continued from there" in again.stderr
    assert again.returncode == 0
    assert not journal.exists()


def test_changed_options_are_not_resumed(flight: Path, tmp_path: Path) -> None:
    """A journal of the whole flight is none of a part of it, nor of the other method."""
    journal = tmp_path / "out" / "flight.decode-journal"
    stopped(eager(flight, "-o", tmp_path / "out"), journal, 2, signal.SIGKILL)
    part = ran("decode", flight, "-o", tmp_path / "out", "--resume", "--every", "20", "--method", "xcorr")

    assert part.returncode == 0
    assert "is of another decode (method, part), so this decode starts at the beginning" in part.stderr
    assert journal.exists()


def test_what_was_read_outlives_a_truth_that_does_not_fit(flight: Path, tmp_path: Path) -> None:
    """Where nothing can be written although all was read, it says what is kept."""
    (tmp_path / "truth.csv").write_text("frame,altitude_ft\n0,1000\n")
    words = (flight, "-o", tmp_path / "out", "--format", "csv,html", "--truth", tmp_path / "truth.csv", "--jobs", 1)
    with eager(*words) as running:
        _, said = running.communicate(timeout=60)

    assert running.returncode == 1
    assert "flight.decode-journal keeps 120 frames; --resume continues from there" in said
    assert contents(tmp_path / "out").keys() == {"flight.decode-journal"}
