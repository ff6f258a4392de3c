"""Flights made of video files, by the commands: made, described, checked, taken apart and repaired like any other."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from pathlib import Path

import av
import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from mcap.reader import make_reader

from fixtures.telemetry import flight_payloads, with_telemetry
from flight_file.reader import open_flight
from flight_file.salvage import recover_segment
from recorder.command_replay import replay_into
from recorder.config import AttachSettings
from recorder.host import SimulatedClock, fixed_host
from recorder.supervision import Stop
from tests.programs import ran
from tests.recorder.helpers import recorder
from tests.videos import STEADY, TICKS_PER_S, decoded, film, luma


@pytest.fixture
def video(tmp_path: Path) -> Path:
    """A film with B-frames."""
    return film(tmp_path / "cockpit.mp4", b_frames=2, metadata={"creation_time": "2026-05-04T11:30:00Z"})


@pytest.fixture
def flight(tmp_path: Path, video: Path) -> Path:
    """The flight that is made of it."""
    made = recorder("replay", video, "-o", tmp_path / "flight.mcap")
    assert made.returncode == 0, made.stderr
    return tmp_path / "flight.mcap"


def test_the_same_video_gives_the_same_bytes(tmp_path: Path, video: Path) -> None:
    """Nothing of the moment gets into the flight."""
    made = []
    for name in ("one", "two"):
        target = tmp_path / name / "flight.mcap"
        host = fixed_host(SimulatedClock(0))
        replay_into(target, [video], attach=AttachSettings(), host=host, stop=Stop())
        made.append(target.read_bytes())

    assert made[0] == made[1]


def test_strangers_find_foxglove_messages(flight: Path) -> None:
    """On /camera/video, each an access unit at its own time."""
    with flight.open("rb") as stream:
        read = make_reader(stream).iter_messages(topics=["/camera/video"])
        messages = [(schema.name, CompressedVideo.FromString(message.data)) for schema, _, message in read if schema]

    assert {name for name, _ in messages} == {"foxglove.CompressedVideo"}
    assert {message.format for _, message in messages} == {"h264"}
    decoder = av.CodecContext.create("h264", "r")
    pictures = [each for _, message in messages for each in decoder.decode(av.Packet(message.data))]
    assert len([*pictures, *decoder.decode(None)]) == len(STEADY)


def test_info_lists_the_original_with_its_digest_and_clocks(video: Path, flight: Path) -> None:
    """And says that no clock is believed, in words and for scripts."""
    facts = json.loads(recorder("info", "--json", flight).stdout)
    page = recorder("info", flight).stdout

    assert (facts["frames"], facts["formats"], facts["time_of_day"]) == (40, ["h264"], "unknown")
    assert (facts["start_utc"], facts["end_utc"]) == (None, None)
    assert facts["duration_s"] == pytest.approx((STEADY[-1] - STEADY[0]) / TICKS_PER_S)
    (original,) = facts["originals"]
    assert original["sha256"] == hashlib.sha256(video.read_bytes()).hexdigest()
    assert original["facts"]["creation time"].startswith("2026-05-04T11:30:00")
    assert "time of day unknown" in page
    assert f"made of:     cockpit.mp4, {video.stat().st_size} bytes" in page


def test_verify_finds_a_changed_packet(flight: Path) -> None:
    """The chain covers a video's pictures as it covers photographs."""
    assert recorder("verify", flight).returncode == 0
    data = bytearray(flight.read_bytes())
    packet = list(open_flight([flight]).frames())[7].encoded
    data[data.index(packet) + len(packet) // 2] ^= 1
    flight.write_bytes(data)

    assert recorder("verify", flight).returncode != 0


def test_extract_gives_a_stream_that_plays(tmp_path: Path, video: Path, flight: Path) -> None:
    """One file with all packets; a second time it is not written over."""
    done = recorder("extract", flight, "-o", tmp_path / "out")
    (stream,) = (tmp_path / "out").iterdir()
    with av.open(str(stream)) as container:
        pictures = [luma(frame) for frame in container.decode(video=0)]

    assert done.returncode == 0
    assert "40 pictures" in done.stdout
    assert stream.name == "flight.h264"
    assert np.array_equal(pictures, decoded(video))
    assert recorder("extract", flight, "-o", tmp_path / "out").returncode == 1


def test_recover_keeps_the_packets_that_are_whole(tmp_path: Path) -> None:
    """Of a flight that was cut off, with the originals' names and the unknown time of day."""
    flight = tmp_path / "flight.mcap"
    recorder("replay", film(tmp_path / "cockpit.mp4", b_frames=2, noise=100), "-o", flight)
    frames = list(open_flight([flight]).frames())
    data = flight.read_bytes()
    part = flight.with_name("flight.mcap.part")
    part.write_bytes(data[: data.index(frames[30].encoded)])
    flight.unlink()
    recovery = recover_segment(part, at=SimulatedClock(0).read())
    again = open_flight([recovery.path])
    kept = list(again.frames())

    assert 0 < len(kept) <= 30
    assert kept == frames[: len(kept)]
    assert not again.session.knows_time_of_day
    assert [original.name for original in again.session.originals] == ["cockpit.mp4"]


def test_positions_go_wherever_the_pictures_go(tmp_path: Path, video: Path) -> None:
    """Replayed, verified, described, taken apart, replayed again, and recovered as far as the file is whole."""
    path = with_telemetry(video, tmp_path / "GX010123.MP4", flight_payloads(2))
    flight, again = tmp_path / "flight.mcap", tmp_path / "again.mcap"
    made = recorder("replay", path, "-o", flight, "--clock", "gps")
    assert recorder("replay", flight, "-o", again).returncode == 0
    fixes = list(open_flight([flight]).fixes())
    facts = json.loads(recorder("info", "--json", flight).stdout)

    assert made.returncode == 0, made.stderr
    assert "GPS time: 2026-05-04T09:30:00.000Z at the film's time 0, sigma 0.29 s, by 2 times" in made.stdout
    assert "the GPS time is 2 h 0 min 0 s behind the creation time" in made.stdout
    assert (facts["time_of_day"], facts["start_utc"][:19]) == ("gps", "2026-05-04T09:30:00")
    assert "time by:     the GPS time of the video, which was believed" in recorder("info", flight).stdout
    assert len(fixes) == 20
    assert list(open_flight([again]).fixes()) == fixes
    assert recorder("verify", flight, again).returncode == 0
    assert recorder("extract", flight, "-o", tmp_path / "out").returncode == 0
    with flight.open("rb") as stream:
        (first, *_) = make_reader(stream).iter_messages(topics=["/gps/fix"])
    assert (first[0] and first[0].name, json.loads(first[2].data)["latitude"]) == ("foxglove.LocationFix", 47.5)

    part = flight.with_name("flight.mcap.part")
    data = flight.read_bytes()
    part.write_bytes(data[: data.rindex(b"/gps/fix") - 9])
    flight.unlink()
    recovered = open_flight([recover_segment(part, at=SimulatedClock(0).read()).path])
    kept = list(recovered.fixes())
    assert 0 < len(kept) <= 20
    assert kept == fixes[: len(kept)]


def test_a_broken_copy_is_done_with_loss(tmp_path: Path) -> None:
    """What is whole is stored, what is missing is counted."""
    path = film(tmp_path / "a.mp4", muxing={"movflags": "faststart"})
    path.write_bytes(path.read_bytes()[:-2000])
    done = recorder("replay", path, "-o", tmp_path / "flight.mcap")

    assert done.returncode == 3
    assert "of the pictures that the index lists" in done.stderr
    assert (tmp_path / "flight.mcap").exists()


@pytest.mark.parametrize("program", ["recorder", "decode"])
def test_a_video_in_place_of_a_flight_is_answered_with_the_command_to_run_first(video: Path, program: str) -> None:
    """One sentence."""
    done = ran(program, *(["info"] if program == "recorder" else []), video)

    assert done.returncode == 1
    assert "first make one of it: recorder replay cockpit.mp4 -o cockpit.mcap" in done.stderr


def test_without_the_extra_a_video_is_answered_with_how_to_install_it(tmp_path: Path, video: Path) -> None:
    """The box itself needs no FFmpeg."""
    program = "import sys; sys.modules['av'] = None; from recorder.cli import main; main()"
    words = ["replay", str(video), "-o", str(tmp_path / "flight.mcap")]

    done = subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True, check=False)

    assert done.returncode == 1
    assert "pip install 'image-flight-recorder[video]'" in done.stderr
