"""An interrupted decode continues where it was: the same readings to the bit, none of them read twice."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.imaging.alignment import Alignment
from decoder.instruments.frame_batch import Batch, LeftOut, Outcome, RawFrame, Unread, read_here
from decoder.instruments.panel_reader import PanelReader
from decoder.instruments.reading import FrameReadings, Reading, Status
from decoder.panel.errors import OutputError
from decoder.panel.lens import BrownConrady, Fisheye, Lens
from decoder.parallel.decode_journal import DecodeJournal, content_of, line_of, outcomes_of, plain_batch

IDENTITY = {"flight file": ["0a"], "method": "normxcorr", "part": None}
Fitted = Any
NUMBERS = st.floats(allow_nan=False)


@dataclass(slots=True)
class Counting:
    """Reads here, and counts the batches; breaks off before the one that is named."""

    stop_at: int | None = None
    read: int = 0

    def __call__(self, reader: PanelReader, cut: Iterable[Batch]) -> Iterator[tuple[Batch, list[Outcome]]]:
        """As `read_here`."""
        for result in read_here(reader, cut):
            if self.read == self.stop_at:
                raise KeyboardInterrupt
            self.read += 1
            yield result


def journal_at(
    path: Path, *, resume: bool = False, begin_after: int = 1, **identity: object
) -> tuple[DecodeJournal, list[str]]:
    """A journal, and the sentences that it says."""
    said: list[str] = []
    own = {**IDENTITY, **identity}
    return DecodeJournal(path, lambda _: own, resume=resume, tell=said.append, begin_after=begin_after), said


def broken_off(path: Path, fitted: Fitted, after: int) -> None:
    """Leaves the journal of a decode that ended after so many batches."""
    journal, _ = journal_at(path)
    with pytest.raises(KeyboardInterrupt):
        list(journal.around(Counting(stop_at=after))(fitted.reader, fitted.batches))
    journal.close()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where the journal is, in a folder that is not there yet."""
    return tmp_path / "out" / "flight.decode-journal"


@pytest.mark.parametrize("after", [1, 2, 4])
def test_resumed_decode_gives_what_an_unbroken_one_gives(path: Path, fitted: Fitted, after: int) -> None:
    """What was read before is not read again; when all is done the journal is gone."""
    broken_off(path, fitted, after)
    reading = Counting()
    journal, said = journal_at(path, resume=True)
    results = list(journal.around(reading)(fitted.reader, fitted.batches))

    assert results == fitted.results
    assert (reading.read, said) == (len(fitted.batches) - after, [])
    assert journal.frames == 20
    journal.remove()
    assert list(path.parent.iterdir()) == []


def resumed(path: Path, fitted: Fitted) -> int:
    """How many batches a resumed decode reads; what it gives is what an unbroken one gives."""
    reading = Counting()
    journal, _ = journal_at(path, resume=True)

    assert list(journal.around(reading)(fitted.reader, fitted.batches)) == fitted.results
    journal.close()
    return reading.read


def test_torn_line_is_read_again(path: Path, fitted: Fitted) -> None:
    """Wherever a power cut ended the file, the intact part before is used, and continued."""
    broken_off(path, fitted, 3)
    whole = path.read_bytes()
    ends = [index + 1 for index, byte in enumerate(whole) if byte == ord("\n")]
    for size in (ends[0], ends[1] - 1, ends[1], ends[1] + 5, ends[2] - 2, len(whole)):
        path.write_bytes(whole[:size])

        assert len(fitted.batches) - resumed(path, fitted) == sum(end <= size for end in ends) - 1
        assert resumed(path, fitted) == 0


@pytest.mark.parametrize("change", [b"\x00", b"x"])
def test_changed_line_ends_what_is_known(path: Path, fitted: Fitted, change: bytes) -> None:
    """A byte that is not as it was written costs its batch and those behind it, no more and no less."""
    broken_off(path, fitted, 3)
    content = bytearray(path.read_bytes())
    second = content.index(b"\n", content.index(b"\n") + 1) + 100
    content[second : second + 1] = change
    path.write_bytes(content)

    assert resumed(path, fitted) == len(fitted.batches) - 1


def test_other_frames_end_what_is_known(path: Path, fitted: Fitted) -> None:
    """A batch of other frames than the journal names is read."""
    broken_off(path, fitted, 3)
    other = (replace(fitted.batches[1][0], captured_ns=1), *fitted.batches[1][1:])
    reading = Counting()
    journal, _ = journal_at(path, resume=True)
    list(journal.around(reading)(fitted.reader, (fitted.batches[0], other, *fitted.batches[2:])))
    journal.close()

    assert reading.read == len(fitted.batches) - 1


@pytest.mark.parametrize("resume", [True, False])
def test_journal_that_cannot_be_read_is_told(path: Path, fitted: Fitted, resume: bool) -> None:  # noqa: FBT001
    """A bad disk, or somebody else's file: one sentence that says what to do."""
    path.parent.mkdir()
    path.symlink_to("/proc/self/mem")  # a file at whose beginning nothing can be read, whoever asks
    journal, _ = journal_at(path, resume=resume)

    with pytest.raises(OutputError, match=r"the journal cannot be read: .*; remove it, or choose another folder with"):
        list(journal.around(Counting())(fitted.reader, fitted.batches))


def test_frame_that_was_left_out_is_read_again(path: Path, fitted: Fitted) -> None:
    """A batch that a killed process did not read is read anew, those before and after it are not."""
    outcomes = {batch: list(some) for batch, some in fitted.results[:3]}
    outcomes[fitted.batches[1]][2] = LeftOut("the process that read it was killed (SIGKILL) each time")
    journal, _ = journal_at(path)
    list(journal.around(lambda _reader, _cut: iter(outcomes.items()))(fitted.reader, fitted.batches))
    journal.close()

    assert resumed(path, fitted) == 1 + len(fitted.batches) - 3


def test_journal_of_another_decode_is_not_used(path: Path, fitted: Fitted) -> None:
    """It says in what it differs, and is replaced when the new decode has something to keep."""
    broken_off(path, fitted, 3)
    reading = Counting()
    journal, said = journal_at(path, resume=True, method="xcorr", begin_after=2)
    results = journal.around(reading)(fitted.reader, fitted.batches)
    next(results)
    assert said == [f"{path} is of another decode (method), so this decode starts at the beginning"]
    list(results)

    assert reading.read == len(fitted.batches)
    assert said[1:] == [f"{path}: the journal of another decode is replaced"]
    journal.remove()
    assert not path.exists()


def test_journal_of_another_decode_outlives_a_short_one(path: Path, fitted: Fitted) -> None:
    """A decode that keeps nothing of its own takes nothing away."""
    broken_off(path, fitted, 3)
    before = path.read_bytes()
    journal, said = journal_at(path, method="xcorr", begin_after=64)
    list(journal.around(read_here)(fitted.reader, fitted.batches))
    journal.remove()

    assert path.read_bytes() == before
    assert said == []


@pytest.mark.parametrize("content", [None, b"", b"\0" * 4096, b"my own notes\n"])
def test_resume_without_a_journal_starts_at_the_beginning(path: Path, fitted: Fitted, content: bytes | None) -> None:
    """Where there is none, or nothing that can be read, it says so and decodes."""
    if content is not None:
        path.parent.mkdir()
        path.write_bytes(content)
    journal, said = journal_at(path, resume=True, begin_after=64)
    results = list(journal.around(read_here)(fitted.reader, fitted.batches))

    assert results == fitted.results
    assert len(said) == 1
    assert "so this decode starts at the beginning" in said[0]


def test_short_decode_leaves_nothing_behind(path: Path, fitted: Fitted) -> None:
    """What is soon done again is not written down, not even the folder."""
    journal, _ = journal_at(path, begin_after=len(fitted.batches) + 1)
    list(journal.around(read_here)(fitted.reader, fitted.batches))
    assert not path.parent.exists()
    assert journal.frames == 0


def test_journal_that_cannot_be_written_is_an_output_error(tmp_path: Path, fitted: Fitted) -> None:
    """With the sentence that other outputs have."""
    (tmp_path / "file").touch()
    journal, _ = journal_at(tmp_path / "file" / "flight.decode-journal")
    with pytest.raises(OutputError, match="choose another folder with -o"):
        list(journal.around(read_here)(fitted.reader, fitted.batches))
    assert list(tmp_path.iterdir()) == [tmp_path / "file"]


READINGS = st.builds(Reading, st.sampled_from(Status), NUMBERS, NUMBERS, NUMBERS)
THREE = st.tuples(NUMBERS, NUMBERS, NUMBERS)
LENSES = st.none() | st.builds(
    Lens,
    st.tuples(st.integers(1), st.integers(1)),
    st.tuples(NUMBERS, NUMBERS),
    NUMBERS,
    NUMBERS,
    st.builds(BrownConrady, THREE, st.tuples(NUMBERS, NUMBERS), st.just((0.0, 0.0, 0.0)) | THREE)
    | st.builds(Fisheye, st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS)),
)
FAILED = st.lists(st.text()).map(tuple)
OUTCOMES = st.builds(Unread, st.text(), FAILED) | st.builds(
    FrameReadings,
    st.builds(Alignment, st.lists(NUMBERS, min_size=9, max_size=9).map(tuple), NUMBERS, FAILED, LENSES),
    st.dictionaries(st.text(), READINGS),
    st.lists(st.tuples(NUMBERS, NUMBERS)).map(tuple),
)


@given(outcome=OUTCOMES, time_ns=st.integers(0, 2**63))
def test_line_gives_back_what_was_written(outcome: Outcome, time_ns: int) -> None:
    """Any outcome comes back equal to the last bit, and not for another frame."""
    batch = (RawFrame(7, time_ns, b""),)
    content = content_of(line_of(plain_batch(batch, [outcome])))

    assert outcomes_of(content, batch) == [outcome]
    assert outcomes_of(content, (RawFrame(8, time_ns, b""),)) is None


def test_not_a_number_comes_back() -> None:
    """NaN, which is equal to nothing, is one again."""
    reading = Reading(Status.MISSING, math.nan, math.inf, -math.inf)
    batch = (RawFrame(0, 0, b""),)
    outcome = FrameReadings(Alignment((1.0,) * 9, math.nan), {"n": reading})
    (back,) = outcomes_of(content_of(line_of(plain_batch(batch, [outcome]))), batch) or []

    assert isinstance(back, FrameReadings)
    assert math.isnan(back.readings["n"].angle_deg)
    assert math.isnan(back.alignment.score)
    assert (back.readings["n"].sigma_deg, back.readings["n"].score) == (math.inf, -math.inf)
