"""Parts of a flight: the right frames, found without reading the others."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from decoder.panel.errors import PartError
from decoder.timeseries.flight_part import AskedPart, part_of, typed_time
from flight_file.reader import Flight, open_flight
from flight_file.records import FileSource
from tests.programs import A1, MakeFlight, ran


def asked(start: str | None = None, end: str | None = None, every: int = 1) -> AskedPart:
    """The part between two times as they are typed."""
    return AskedPart(None if start is None else typed_time(start), None if end is None else typed_time(end), every)


@pytest.fixture
def flight() -> Flight:
    """Twenty frames, four a second, from noon on."""
    return open_flight([A1])


@pytest.mark.parametrize(
    ("part", "ranks"),
    [
        (asked(), range(20)),
        (asked("1"), range(4, 20)),
        (asked(end="1"), range(5)),
        (asked("1", "2"), range(4, 9)),
        (asked("1.01", "1.99"), range(5, 8)),
        (asked("0:01", "12:00:02Z"), range(4, 9)),
        (asked("2018-05-04T12:00:01.000000Z", every=5), range(4, 20, 5)),
        (asked(every=7), range(0, 20, 7)),
        (asked("2018-05-03T00:00:00Z", "2019-01-01T00:00:00Z"), range(20)),
    ],
)  # fmt: skip
def test_part_is_the_frames_between_two_times(flight: Flight, part: AskedPart, ranks: range) -> None:
    """Both ends belong to it; every so many are counted from its first frame."""
    found = part_of(flight, part)

    assert list(found.ranks) == list(ranks)
    assert [frame.sequence for frame in flight.frames(found.ranks)] == list(ranks)
    assert found.frames_in_flight == 20
    assert flight.losses == []


@pytest.mark.parametrize("part", [asked("5"), asked("1.01", "1.02"), asked("2", "1"), asked(end="2017-01-01 00:00")])
def test_part_without_frames_is_refused(flight: Flight, part: AskedPart) -> None:
    """With the times of the flight, so that one can be typed that lies in it."""
    with pytest.raises(PartError, match=r"begins at 2018-05-04T12:00:00Z and lasts 4\.75 s"):
        part_of(flight, part)


def counted(monkeypatch: pytest.MonkeyPatch) -> Callable[[], int]:
    """Counts the bytes that are read from files from now on."""
    taken = 0
    read_at = FileSource.read_at

    def counting(source: FileSource, offset: int, length: int) -> bytes:
        nonlocal taken
        data = read_at(source, offset, length)
        taken += len(data)
        return data

    monkeypatch.setattr(FileSource, "read_at", counting)
    return lambda: taken


def test_only_what_is_needed_is_read(
    monkeypatch: pytest.MonkeyPatch, make_flight: MakeFlight, pictures: list[bytes]
) -> None:
    """Of 200 frames: those of the part, and one for each time the flight is halved."""
    flight = open_flight([make_flight(pictures * 10)])
    chunk = max(place.length for place in flight.segments[0].chunks)
    read_bytes = counted(monkeypatch)
    part = part_of(flight, asked("10", "12"))
    halvings = math.ceil(math.log2(200))

    assert read_bytes() <= (2 * halvings + 3) * chunk
    before = read_bytes()
    assert [frame.sequence for frame in flight.frames(part.ranks)] == list(range(40, 49))
    assert read_bytes() - before <= 9 * chunk
    before = read_bytes()
    assert len(list(flight.frames(range(0, 200, 50)))) == 4
    assert read_bytes() - before <= 4 * chunk


@pytest.mark.parametrize(
    ("hit", "ranks", "losses"),
    [((6, 12), range(4, 9), ["chunk", "frame 6 is missing"]), ((0,), range(3), ["chunk"])],
    ids=["in the middle", "at the beginning"],
)
def test_damage_in_a_part_is_a_loss_of_it(
    tmp_path: Path, hit: tuple[int, ...], ranks: range, losses: list[str]
) -> None:
    """A damaged frame of the part is reported, one beside it is not looked at; times are found all the same."""
    holding = [place for place in open_flight([A1]).segments[0].chunks if sum(place.messages.values()) > 1]
    content = bytearray(A1.read_bytes())
    for place in (holding[number] for number in hit):
        content[place.offset + place.length // 2] ^= 0xFF
    (tmp_path / "damaged.mcap").write_bytes(content)
    flight = open_flight([tmp_path / "damaged.mcap"])

    assert flight.count() == 20
    assert hit == (0,) or part_of(flight, asked("1", "2")).ranks == ranks
    assert [frame.sequence for frame in flight.frames(ranks)] == [rank for rank in ranks if rank not in hit]
    assert [known in loss.reason for known, loss in zip(losses, flight.losses, strict=True)] == [True] * len(losses)


def test_part_has_the_rows_of_the_whole(decode: Callable[..., Any], decoded_a1: Any) -> None:  # noqa: ANN401
    """Frame numbers, times and values are those that the whole flight has; the description says which part it is."""
    part = decode(A1, "--from", "1", "--to", "12:00:04Z", "--every", "3", "--jobs", 2)
    described = part.described

    assert (part.done.returncode, part.done.stderr) == (0, "")
    assert part.done.stdout.startswith("thesis_a1: decoding 5 of 20 frames")
    assert part.rows == decoded_a1.rows[4:17:3]
    assert described["part"] == {"every": 3, "frames_in_flight": 20, "flight_start_utc": "2018-05-04T12:00:00.000000Z"}
    assert (described["start_utc"], described["duration_s"]) == ("2018-05-04T12:00:01.000000Z", 3.0)
    assert "part" not in decoded_a1.described


def test_pictures_are_those_of_the_part(decode: Callable[..., Any]) -> None:
    """`--with-images` puts in the pictures of the frames that were decoded."""
    part = decode(A1, "--format", "mcap", "--with-images", "--every", "10")
    sizes = [len(frame.encoded) for frame in open_flight([A1]).frames(range(0, 20, 10))]

    assert part.done.returncode == 0, part.done.stderr
    assert sum(sizes) < (part.folder / "thesis_a1.mcap").stat().st_size < 2 * sum(sizes)


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["--from", "soon"], 2, "'soon' is no time: 90, 1:30, 12:01:30Z or 2018-05-04T12:01:30Z"),
        (["--every", "0"], 2, "0 is not in the range"),
        (["--from", "60"], 1, "no frame lies between --from and --to; the flight begins at 2018-05-04T12:00:00Z"),
    ],
)
def test_times_that_do_not_fit_are_named(tmp_path: Path, words: list[str], code: int, said: str) -> None:
    """One sentence that says what a time looks like, or which the flight has; nothing is written."""
    done = ran("decode", A1, "-o", tmp_path / "out", *words)

    assert done.returncode == code
    assert said in done.stderr
    assert not (tmp_path / "out").exists()
