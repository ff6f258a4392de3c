"""Flights of films with sound, by the commands: what is said of it, kept, given back, repaired and replayed again."""

from __future__ import annotations

import json
from pathlib import Path

import av
import numpy as np
import pytest
from jsonschema import validate
from mcap.reader import make_reader

from flight_file.frame import Sound, SoundPacket, SoundPeaks
from flight_file.reader import open_flight
from flight_file.salvage import recover_segment
from recorder.config import parse_config
from recorder.host import SimulatedClock, fixed_host
from recorder.run import record
from tests.recorder.helpers import recorder
from tests.sounds import RATE_HZ, recorded, times_s
from tests.videos import film

LONG = tuple(range(0, 40 * 1200, 1200))  # 4 s
WINDOWS = 14


@pytest.fixture
def video(tmp_path: Path) -> Path:
    """A film of four seconds with a tone."""
    sound = recorded(np.sin(2 * np.pi * 200 * times_s(4)))
    return film(tmp_path / "cockpit.mp4", ticks=LONG, sound=sound, b_frames=2, noise=100)


def made(video: Path, *options: str) -> Path:
    """The flight that is made of it."""
    flight = video.with_name("flight.mcap")
    done = recorder("replay", video, "-o", flight, *options)
    assert done.returncode == 0, done.stderr
    return flight


def heard(flight: Path) -> list[Sound]:
    """All that is kept of its sound."""
    return list(open_flight([flight]).heard())


def test_strongest_tones_are_kept_and_never_speech(video: Path) -> None:
    """Each window is a message that fits its schema; verify and info count nothing as lost."""
    flight = made(video)
    with flight.open("rb") as stream:
        read = list(make_reader(stream).iter_messages())
    messages = [each for each in read if each[1].topic == "/sound/peaks"]
    facts = json.loads(recorder("info", "--json", flight).stdout)

    for schema, _, message in messages:
        validate(json.loads(message.data), json.loads(schema.data))
    assert len(messages) == WINDOWS
    assert "/sound/packet" not in {channel.topic for _, channel, _ in read}
    assert facts["sound"] == {"windows": WINDOWS, "packets": 0}
    assert facts["originals"][0]["facts"]["sound"] == f"aac {RATE_HZ} Hz mono"
    assert "the strongest tones of 14 windows, never speech" in recorder("info", flight).stdout
    assert recorder("verify", flight).returncode == 0


@pytest.mark.parametrize("codec", ["aac", "pcm_s16le"])
def test_sound_that_was_kept_is_given_back(tmp_path: Path, codec: str) -> None:
    """Asked for on the command line: the same packets, in a file that players open."""
    sound = recorded(np.sin(2 * np.pi * 200 * times_s(4)))
    video = film(tmp_path / "cockpit.mkv", ticks=LONG, sound=sound, sound_codec=codec)
    flight = made(video, "--keep-sound")
    done = recorder("extract", flight, "-o", tmp_path / "out")
    packets = [each for each in heard(flight) if isinstance(each, SoundPacket)]
    (given,) = (tmp_path / "out").glob(f"flight.{codec}")

    assert done.returncode == 0
    assert f"40 pictures, {len(packets)} packets of sound" in done.stdout
    if codec == "aac":
        with av.open(str(given)) as container:
            assert sum(frame.samples for frame in container.decode(audio=0)) == pytest.approx(4 * RATE_HZ, abs=2048)
    else:
        assert given.read_bytes() == np.round(sound * 32767).astype("<i2").tobytes()
    assert recorder("extract", flight, "-o", tmp_path / "out").returncode == 1


def test_recorder_yaml_asks_for_sound_too(video: Path) -> None:
    """By the key keep_sound."""
    config = {
        "camera": {"driver": "replay", "path": [str(video)], "pace": "fastest", "keep_sound": True},
        "storage": {"directory": str(video.parent / "flights"), "keep_free_gib": 0},
    }
    outcome = record(parse_config(config), host=fixed_host(SimulatedClock(0)))

    assert {type(each) for path in outcome.paths for each in heard(path)} == {SoundPacket, SoundPeaks}


def test_film_without_sound_says_so(tmp_path: Path) -> None:
    """As a fact of the original; nothing is written in its place."""
    flight = made(film(tmp_path / "silent.mp4"))
    page = recorder("info", flight).stdout

    assert heard(flight) == []
    assert "  sound: none" in page
    assert "sound:       none" in page


def test_recovery_and_another_replay_keep_what_was_heard(tmp_path: Path, video: Path) -> None:
    """Of a flight that was cut off what is whole; of one that is replayed all."""
    flight = made(video, "--keep-sound")
    whole = heard(flight)
    again = tmp_path / "again.mcap"
    assert recorder("replay", flight, "-o", again).returncode == 0
    data = flight.read_bytes()
    part = flight.with_name("flight.mcap.part")
    part.write_bytes(data[: len(data) * 2 // 3])
    flight.unlink()
    kept = heard(recover_segment(part, at=SimulatedClock(0).read()).path)

    assert heard(again) == whole
    assert 0 < len(kept) < len(whole)
    assert kept == whole[: len(kept)]


def test_what_is_no_video_keeps_no_sound(tmp_path: Path, video: Path) -> None:
    """A sentence, rather than an option that does nothing."""
    flight = made(video)
    done = recorder("replay", flight, "-o", tmp_path / "again.mcap", "--keep-sound")

    assert done.returncode == 1
    assert "is no video; --keep-sound is for videos" in done.stderr
