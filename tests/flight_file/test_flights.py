"""Several files are one flight, if they belong together; everything else is one sentence."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from flight_file.errors import FlightFileError, FlightNotReadableError, MixedFlightsError, NotAFlightError
from flight_file.frame import Frame
from flight_file.losses import LossKind
from flight_file.reader import open_flight
from flight_file.sampling import spread
from flight_file.segments import free_recording_name, parse_segment_name, segment_path

WriteFlight = Callable[..., list[Path]]


def test_segments_are_one_flight_in_any_order(tmp_path: Path, frames: list[Frame], write_flight: WriteFlight) -> None:
    """Files are sorted by their segment number, and frames go on from one to the next."""
    paths = write_flight(tmp_path, frames, frames_per_segment=2)
    flight = open_flight(list(reversed(paths)))

    assert [path.name for path in paths] == ["flight_0000.mcap", "flight_0001.mcap", "flight_0002.mcap"]
    assert flight.paths == tuple(paths)
    assert list(flight.frames()) == frames
    assert flight.losses == []


def test_missing_segment_and_its_frames_are_losses(
    tmp_path: Path, frames: list[Frame], write_flight: WriteFlight
) -> None:
    """A segment that was not given is named, and so are the frames that were in it."""
    first, _, last = write_flight(tmp_path, frames, frames_per_segment=2)
    flight = open_flight([first, last])

    assert [frame.sequence for frame in flight.frames()] == [0, 1, 4, 5]
    assert [loss.kind for loss in flight.losses] == [LossKind.MISSING_SEGMENT, LossKind.GAP]
    assert flight.losses[1].reason == "frames 2 to 3 are missing"


def test_losses_are_the_same_when_a_flight_is_read_twice(
    tmp_path: Path, frames: list[Frame], write_flight: WriteFlight
) -> None:
    """Reading again does not count a loss again."""
    flight = open_flight(write_flight(tmp_path, [frames[0], frames[2]]))
    reads = [(list(flight.frames()), flight.losses) for _ in range(2)]

    assert reads[0] == reads[1]
    assert len(flight.losses) == 1


def test_files_of_two_recordings_are_refused(tmp_path: Path, frames: list[Frame], write_flight: WriteFlight) -> None:
    """The sentence names both recordings."""
    one = write_flight(tmp_path, frames, recording="one")
    two = write_flight(tmp_path, frames, recording="two")

    with pytest.raises(MixedFlightsError, match=r"one and two.*give the segments of one recording\.$"):
        open_flight(one + two)


def test_segment_given_twice_is_refused(flight: Path) -> None:
    """The same file twice is a mistake, not twice the flight."""
    with pytest.raises(MixedFlightsError, match=r"both segment 0; give each segment once\.$"):
        open_flight([flight, flight])


def test_no_file_at_all_is_a_sentence() -> None:
    """An empty list is refused."""
    with pytest.raises(FlightFileError, match="name at least one"):
        open_flight([])


@pytest.mark.parametrize(
    ("make", "error", "sentence"),
    [
        (lambda _path: None, FlightNotReadableError, "no such file"),
        (lambda path: path.mkdir(), FlightNotReadableError, "is a directory"),
        (lambda path: path.write_bytes(b""), NotAFlightError, "is empty"),
        (lambda path: path.write_bytes(b"\xff\xd8 a JPEG"), NotAFlightError, "not an MCAP file"),
    ],
)
def test_what_is_no_flight_is_one_sentence(
    tmp_path: Path, make: Callable[[Path], object], error: type[FlightFileError], sentence: str
) -> None:
    """Each says which file, what is wrong, and ends as a sentence."""
    path = tmp_path / "x.mcap"
    make(path)

    with pytest.raises(error, match=sentence) as caught:
        open_flight([path])
    assert str(caught.value).startswith(str(path))
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_file_without_permission_is_one_sentence(flight: Path) -> None:
    """A file that may not be read says so."""
    flight.chmod(0)

    with pytest.raises(FlightNotReadableError, match="permissions"):
        open_flight([flight])


@pytest.mark.parametrize("count", [0, 1, 2, 3, 5, 6, 100])
@pytest.mark.parametrize("frames_per_segment", [2, 1000])
def test_sample_is_spread_from_the_first_frame_to_the_last(
    tmp_path: Path, frames: list[Frame], write_flight: WriteFlight, count: int, frames_per_segment: int
) -> None:
    """At most so many frames, in order, the same each time, with both ends from two frames on."""
    flight = open_flight(write_flight(tmp_path, frames, frames_per_segment=frames_per_segment))
    sample = list(flight.sample_frames(count))

    assert sample == [frames[index] for index in sorted(spread(len(frames), count))]
    assert len(sample) == min(count, len(frames))
    assert count < 2 or (sample[0], sample[-1]) == (frames[0], frames[-1])
    assert list(flight.sample_frames(count)) == sample


def test_sample_leaves_out_a_damaged_frame(flight: Path, frames: list[Frame]) -> None:
    """A chosen frame whose chunk is damaged is missing from the sample, and nothing is raised."""
    data = bytearray(flight.read_bytes())
    data[data.index(frames[2].jpeg)] ^= 1
    flight.write_bytes(data)

    assert [frame.sequence for frame in open_flight([flight]).sample_frames(6)] == [0, 1, 3, 4, 5]


def test_segment_names_can_be_read_back(tmp_path: Path) -> None:
    """The name of a segment tells recording and number, finished or not; other names tell nothing."""
    path = segment_path(tmp_path, "2018_a", 12)

    assert parse_segment_name(path) == ("2018_a", 12)
    assert parse_segment_name(path.with_name(path.name + ".part")) == ("2018_a", 12)
    assert parse_segment_name(tmp_path / "notes.txt") is None


def test_taken_names_get_a_number(tmp_path: Path) -> None:
    """A recording never shares its name with another, whether that is finished or not."""
    (tmp_path / "R_0003.mcap.part").touch()
    (tmp_path / "R-2_0000.mcap").touch()

    assert free_recording_name(tmp_path, "R") == "R-3"
    assert free_recording_name(tmp_path, "S") == "S"
