"""Videos in a flight file, read in the order of time: whole, in parts, in samples, and where packets are lost."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight_file.frame import Frame
from flight_file.reader import Flight, open_flight
from flight_file.video.groups import begins_group, in_groups
from recorder.command_replay import replay_into
from recorder.config import AttachSettings
from recorder.host import SimulatedClock, fixed_host
from recorder.supervision import Stop
from tests.flight_file.flights import make_frame
from tests.videos import STEADY, X264, film

KINDS = {
    "no B-frames": {"b_frames": 0},
    "B-frames": {"b_frames": 3},
    "open groups": {"b_frames": 3, "options": {"x264-params": X264["x264-params"] + ":open-gop=1"}},
    "one group": {"b_frames": 2, "group": 1000},
    "H.265, open groups": {"codec": "libx265", "b_frames": 3},
}


@pytest.fixture(scope="module", params=KINDS)
def flight(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Flight:
    """A film of forty pictures as a flight, in chunks of a few."""
    folder = tmp_path_factory.mktemp("film")
    video = film(folder / "a.mp4", noise=90, **KINDS[request.param])
    host = fixed_host(SimulatedClock(0))
    replay_into(folder / "a.mcap", [video], attach=AttachSettings(), host=host, stop=Stop())
    return open_flight([folder / "a.mcap"])


@pytest.fixture(scope="module")
def shown(flight: Flight) -> list[Frame]:
    """All of it."""
    return list(flight.shown())


def test_a_video_is_shown_in_the_order_of_time(flight: Flight, shown: list[Frame]) -> None:
    """Each picture once, and each with a group that holds its packet at its place; a time is found by its rank."""
    assert [frame.captured_ns for frame in shown] == sorted(frame.captured_ns for frame in flight.frames())
    assert [frame.sequence for frame in shown] == list(range(len(STEADY)))
    for frame in shown:
        assert frame.group is not None
        assert not frame.group.trouble
        assert dict(frame.group.packets)[frame.place] == frame.encoded
        assert begins_group(replace(frame, encoded=frame.group.packets[0][1]))
    assert [flight.captured_ns(rank) for rank in range(41)] == [*(frame.captured_ns for frame in shown), None]


@settings(max_examples=30)
@given(start=st.integers(0, 39), length=st.integers(0, 40), step=st.integers(1, 7))
def test_a_part_is_what_it_is_of_the_whole(
    flight: Flight, shown: list[Frame], start: int, length: int, step: int
) -> None:
    """Wherever it begins, with the same group: so the same is read of it."""
    part = range(start, min(start + length, 40), step)
    wanted = shown[part.start : part.stop : part.step]
    got = list(flight.shown(part))

    assert got == wanted
    assert [(frame.group, frame.place) for frame in got] == [(frame.group, frame.place) for frame in wanted]


def test_a_sample_is_spread_over_the_flight(flight: Flight) -> None:
    """As many as are asked for, in order, none twice, the same each time."""
    for count in (1, 2, 4, 7, 40, 100):
        sample = [frame.captured_ns for frame in flight.sample_frames(count)]

        assert len(sample) == min(count, 40)
        assert sample == sorted(set(sample))
        assert list(flight.sample_frames(count)) == list(flight.sample_frames(count))


def test_a_frame_is_returned_by_its_rank(flight: Flight, shown: list[Frame]) -> None:
    """In order of time, whatever its place in its group."""
    assert [flight.sample_frame(rank) for rank in range(40)] == shown


def test_after_a_lost_packet_nothing_is_decoded_up_to_the_next_key_frame(flight: Flight) -> None:
    """A picture that is built on a lost one would look whole and be wrong."""
    frames = list(flight.frames())
    keys = [frame.sequence for frame in frames if begins_group(frame)]
    lost = 3
    shown = [frame for group in in_groups(frame for frame in frames if frame.sequence != lost) for frame in group]
    following = next((key for key in keys if key > lost), 40)
    leading = (
        {frame.sequence for frame in frames[following + 1 :] if frame.captured_ns < frames[following].captured_ns}
        if following < 40
        else set()
    )
    stored = {frame.captured_ns: frame.sequence for frame in frames}
    broken = {stored[frame.captured_ns] for frame in shown if frame.group is not None and frame.group.trouble}

    assert broken == set(range(lost + 1, following)) | leading
    assert [frame.sequence for frame in shown] == sorted(set(range(40)) - {lost})


def test_pictures_before_the_first_key_frame_are_broken(flight: Flight) -> None:
    """A flight may begin anywhere."""
    frames = list(flight.frames())[1:]
    shown = [frame for group in in_groups(frames) for frame in group]

    assert shown[0].group is not None
    assert shown[0].group.trouble
    assert len(shown) == 39


def test_photographs_pass_as_they_are() -> None:
    """Each alone, without a group."""
    frames = [make_frame(number) for number in range(5)]

    assert list(in_groups(frames)) == [[frame] for frame in frames]
