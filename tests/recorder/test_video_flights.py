"""Flights made of video files, by the commands: made, described, checked, taken apart, repaired and replayed again."""

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
from jsonschema import validate
from mcap.reader import make_reader
from mcap.records import Channel, Message, Schema

from fixtures.telemetry import flight_payloads, with_telemetry
from flight_file.frame import SoundPacket, SoundPeaks
from flight_file.reader import Flight, open_flight
from flight_file.salvage import recover_segment
from recorder.command_replay import replay_into
from recorder.config import AttachSettings, parse_config
from recorder.host import SimulatedClock, fixed_host
from recorder.run import record
from recorder.supervision import Stop
from tests.programs import ran
from tests.recorder.helpers import recorder
from tests.sounds import RATE_HZ, recorded, times_s
from tests.videos import decoded, film, luma

TICKS = tuple(range(0, 40 * 1200, 1200))  # 4 s
TONE = recorded(np.sin(2 * np.pi * 200 * times_s(4)))
WINDOWS = 14


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A film of four seconds with B-frames and a tone."""
    metadata = {"creation_time": "2026-05-04T11:30:00Z"}
    folder = tmp_path_factory.mktemp("film")
    return film(folder / "cockpit.mp4", ticks=TICKS, sound=TONE, b_frames=2, noise=100, metadata=metadata)


@pytest.fixture(scope="module")
def flight(video: Path) -> Path:
    """The flight that is made of it."""
    return replayed(video, "flight")


@pytest.fixture(scope="module")
def with_sound(video: Path) -> Path:
    """The same, with its sound."""
    return replayed(video, "with_sound", "--keep-sound")


def replayed(source: Path, name: str, *options: str) -> Path:
    """The flight that is made of this."""
    target = source.with_name(f"{name}.mcap")
    done = recorder("replay", source, "-o", target, *options)
    assert done.returncode == 0, done.stderr
    return target


def recovered(flight: Path, folder: Path, size: int) -> Flight:
    """What is recovered of a flight that was cut off behind so many bytes."""
    part = folder / f"{flight.name}.part"
    part.write_bytes(flight.read_bytes()[:size])
    return open_flight([recover_segment(part, at=SimulatedClock(0).read()).path])


def read(flight: Path, topic: str | None = None) -> list[tuple[Schema | None, Channel, Message]]:
    """The messages of a topic, or of all, as strangers read them."""
    with flight.open("rb") as stream:
        return list(make_reader(stream).iter_messages(topics=topic))


def test_the_same_video_gives_the_same_bytes(tmp_path: Path, video: Path) -> None:
    """Nothing of the moment gets into the flight."""
    made = []
    for name in ("one", "two"):
        target = tmp_path / name / "flight.mcap"
        replay_into(target, [video], attach=AttachSettings(), host=fixed_host(SimulatedClock(0)), stop=Stop())
        made.append(target.read_bytes())

    assert made[0] == made[1]


def test_strangers_find_foxglove_messages(flight: Path) -> None:
    """On /camera/video, each an access unit at its own time."""
    found = read(flight, "/camera/video")
    messages = [CompressedVideo.FromString(message.data) for _, _, message in found]
    decoder = av.CodecContext.create("h264", "r")
    pictures = [each for message in messages for each in decoder.decode(av.Packet(message.data))]

    assert {schema.name for schema, _, _ in found if schema} == {"foxglove.CompressedVideo"}
    assert {message.format for message in messages} == {"h264"}
    assert len([*pictures, *decoder.decode(None)]) == len(TICKS)


def test_info_lists_the_original_with_its_digest_clocks_and_sound(video: Path, flight: Path) -> None:
    """And says that no clock is believed, in words and for scripts."""
    facts = json.loads(recorder("info", "--json", flight).stdout)
    page = recorder("info", flight).stdout
    (original,) = facts["originals"]

    assert (facts["frames"], facts["formats"], facts["time_of_day"]) == (40, ["h264"], "unknown")
    assert (facts["start_utc"], facts["end_utc"]) == (None, None)
    assert facts["duration_s"] == pytest.approx(3.9)
    assert facts["sound"] == {"windows": WINDOWS, "packets": 0}
    assert original["sha256"] == hashlib.sha256(video.read_bytes()).hexdigest()
    assert original["facts"]["creation time"].startswith("2026-05-04T11:30:00")
    assert original["facts"]["sound"] == f"aac {RATE_HZ} Hz mono"
    assert "time of day unknown" in page
    assert f"made of:     cockpit.mp4, {video.stat().st_size} bytes" in page
    assert "the strongest tones of 14 windows, never speech" in page


def test_verify_finds_a_changed_packet(tmp_path: Path, flight: Path) -> None:
    """The chain covers a video's pictures as it covers photographs."""
    data = bytearray(flight.read_bytes())
    packet = list(open_flight([flight]).frames())[7].encoded
    data[data.index(packet) + len(packet) // 2] ^= 1
    (tmp_path / "flight.mcap").write_bytes(data)

    assert recorder("verify", flight).returncode == 0
    assert recorder("verify", tmp_path / "flight.mcap").returncode == 1


def test_extract_gives_a_stream_that_plays_and_the_sound(tmp_path: Path, video: Path, with_sound: Path) -> None:
    """All packets in files that players open; a second time they are not written over."""
    done = recorder("extract", with_sound, "-o", tmp_path / "out")
    packets = [each for each in open_flight([with_sound]).heard() if isinstance(each, SoundPacket)]
    with av.open(str(tmp_path / "out" / "with_sound.h264")) as container:
        pictures = [luma(frame) for frame in container.decode(video=0)]
    with av.open(str(tmp_path / "out" / "with_sound.aac")) as container:
        samples = sum(frame.samples for frame in container.decode(audio=0))

    assert done.returncode == 0
    assert f"40 pictures, {len(packets)} packets of sound" in done.stdout
    assert np.array_equal(pictures, decoded(video))
    assert samples == pytest.approx(4 * RATE_HZ, abs=2048)
    assert recorder("extract", with_sound, "-o", tmp_path / "out").returncode == 1


def test_plain_samples_are_given_back_as_they_were(tmp_path: Path) -> None:
    """Sound that was never compressed."""
    flight = replayed(film(tmp_path / "a.mkv", ticks=TICKS, sound=TONE, sound_codec="pcm_s16le"), "a", "--keep-sound")
    recorder("extract", flight, "-o", tmp_path / "out")

    assert (tmp_path / "out" / "a.pcm_s16le").read_bytes() == np.round(TONE * 32767).astype("<i2").tobytes()


def test_strongest_tones_are_kept_and_never_speech(flight: Path) -> None:
    """Unless sound is asked for; each window is a message that fits its schema."""
    messages = [each for each in read(flight) if each[1].topic == "/sound/peaks"]

    for schema, _, message in messages:
        assert schema is not None
        validate(json.loads(message.data), json.loads(schema.data))
    assert len(messages) == WINDOWS
    assert read(flight, "/sound/packet") == []


def test_recorder_yaml_asks_for_sound_too(tmp_path: Path, video: Path) -> None:
    """By the key keep_sound."""
    config = {
        "camera": {"driver": "replay", "path": [str(video)], "pace": "fastest", "keep_sound": True},
        "storage": {"directory": str(tmp_path / "flights"), "keep_free_gib": 0},
    }
    paths = record(parse_config(config), host=fixed_host(SimulatedClock(0))).paths

    assert {type(each) for each in open_flight(paths).heard()} == {SoundPacket, SoundPeaks}


def test_film_without_sound_says_so(tmp_path: Path) -> None:
    """As a fact of the original; nothing is written in its place."""
    flight = replayed(film(tmp_path / "silent.mp4"), "silent")
    page = recorder("info", flight).stdout

    assert list(open_flight([flight]).heard()) == []
    assert "  sound: none" in page
    assert "sound:       none" in page


def test_recovery_and_another_replay_keep_pictures_and_sound(tmp_path: Path, with_sound: Path) -> None:
    """Of a flight that was cut off what is whole, with the original's name and the unknown time of day."""
    whole = open_flight([with_sound])
    frames, heard = list(whole.frames()), list(whole.heard())
    part = recovered(with_sound, tmp_path, with_sound.stat().st_size * 2 // 3)
    kept, kept_sound = list(part.frames()), list(part.heard())
    refused = recorder("replay", with_sound, "-o", tmp_path / "again.mcap", "--keep-sound")
    assert recorder("replay", with_sound, "-o", tmp_path / "again.mcap").returncode == 0

    assert 0 < len(kept) < 40
    assert kept == frames[: len(kept)]
    assert 0 < len(kept_sound) < len(heard)
    assert kept_sound == heard[: len(kept_sound)]
    assert not part.session.knows_time_of_day
    assert [original.name for original in part.session.originals] == ["cockpit.mp4"]
    assert list(open_flight([tmp_path / "again.mcap"]).heard()) == heard
    assert refused.returncode == 1
    assert "is no video; --keep-sound is for videos" in refused.stderr


def test_positions_go_wherever_the_pictures_go(tmp_path: Path, video: Path) -> None:
    """Replayed, verified, described, taken apart, replayed again, and recovered as far as the file is whole."""
    path = with_telemetry(video, tmp_path / "GX010123.MP4", flight_payloads(4))
    flight, again = tmp_path / "flight.mcap", tmp_path / "again.mcap"
    made = recorder("replay", path, "-o", flight, "--clock", "gps")
    assert recorder("replay", flight, "-o", again).returncode == 0
    fixes = list(open_flight([flight]).fixes())
    facts = json.loads(recorder("info", "--json", flight).stdout)
    (schema, _, first), *_ = read(flight, "/gps/fix")

    assert made.returncode == 0, made.stderr
    assert "GPS time: 2026-05-04T09:30:00.000Z at the film's time 0, sigma 0.29 s, by 4 times" in made.stdout
    assert "the GPS time is 2 h 0 min 0 s behind the creation time" in made.stdout
    assert (facts["time_of_day"], facts["start_utc"][:19]) == ("gps", "2026-05-04T09:30:00")
    assert "time by:     the GPS time of the video, which was trusted" in recorder("info", flight).stdout
    assert len(fixes) == 40
    assert list(open_flight([again]).fixes()) == fixes
    assert recorder("verify", flight, again).returncode == 0
    assert recorder("extract", flight, "-o", tmp_path / "out").returncode == 0
    assert (schema and schema.name, json.loads(first.data)["latitude"]) == ("foxglove.LocationFix", 47.5)
    (tmp_path / "cut").mkdir()
    kept = list(recovered(flight, tmp_path / "cut", flight.stat().st_size * 2 // 3).fixes())
    assert 0 < len(kept) < 40
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
    assert "first make one from it: recorder replay cockpit.mp4 -o cockpit.mcap" in done.stderr


def test_without_the_extra_a_video_is_answered_with_how_to_install_it(tmp_path: Path, video: Path) -> None:
    """The box itself needs no FFmpeg."""
    program = "import sys; sys.modules['av'] = None; from recorder.cli import main; main()"
    words = ["replay", str(video), "-o", str(tmp_path / "flight.mcap")]
    done = subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True, check=False)

    assert done.returncode == 1
    assert "pip install 'image-flight-recorder[video]'" in done.stderr
