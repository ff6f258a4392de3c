"""The commands, as processes of their own."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from flight_file.errors import NotAFlightError
from flight_file.reader import open_flight

WriteConfig = Callable[..., Path]
Result = subprocess.CompletedProcess[str]
RECORDER = (sys.executable, "-c", "from recorder.cli import main; main()")


def recorder(*arguments: str | Path) -> Result:
    """Run a command to its end."""
    return subprocess.run([*RECORDER, *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False)


@pytest.fixture
def flight(write_config: WriteConfig) -> list[Path]:
    """A recorded flight of several segments."""
    result = recorder("run", "--config", write_config(storage={"segment_s": 4}))
    return [Path(line) for line in result.stdout.splitlines()]


def test_run_records_and_lists_the_segments(flight: list[Path]) -> None:
    """Exit code 0 when a replay is over, the finished files on stdout."""
    assert [path.name for path in flight] == [f"20180504T120000Z_000{number}.mcap" for number in range(3)]
    assert len(list(open_flight(flight).frames())) == 40


def test_run_logs_json_lines(write_config: WriteConfig) -> None:
    """Each line of stderr is a JSON object with an event, a level and a time."""
    result = recorder("run", "--config", write_config())
    lines = [json.loads(line) for line in result.stderr.splitlines()]

    assert result.returncode == 0
    assert [line["event"] for line in lines] == ["recording_started", "recording_finished"]
    assert all({"level", "timestamp"} <= set(line) for line in lines)


def test_configuration_travels_inside(flight: list[Path], tmp_path: Path) -> None:
    """recorder.yaml is attached byte for byte, in every segment."""
    for path in flight:
        assert open_flight([path]).attachments["recorder.yaml"] == (tmp_path / "recorder.yaml").read_bytes()


def start_realtime(config: Path, frames: int) -> tuple[subprocess.Popen[str], Path]:
    """Start a recording at the pictures' own pace; comes back when its file is large enough for so many frames."""
    process = subprocess.Popen([*RECORDER, "run", "--config", str(config)], stderr=subprocess.PIPE, text=True)
    directory = config.parent / "flights"
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline:
        for path in directory.glob("*.part"):
            with suppress(NotAFlightError):  # looked at between its making and its first bytes
                if len(list(open_flight([path]).frames())) >= frames:
                    return process, path
        time.sleep(0.05)
    process.kill()
    pytest.fail("nothing was recorded in time")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signal_ends_the_recording_cleanly(write_config: WriteConfig, number: signal.Signals) -> None:
    """Exit code 0, a finished file, and an end record that names the signal."""
    process, part = start_realtime(write_config(camera={"pace": "realtime", "rate_hz": 20}), 1)
    process.send_signal(signal.SIGHUP)
    process.send_signal(number)
    _, log = process.communicate(timeout=60)
    flight = open_flight([part.with_suffix("")])
    frames = list(flight.frames())

    assert process.returncode == 0, log
    assert flight.segments[0].end is not None
    assert flight.segments[0].end.reason == f"stopped by {number.name}"
    assert [frame.sequence for frame in frames] == list(range(len(frames)))
    assert flight.losses == []
    assert not part.exists()


def test_killed_recording_keeps_what_was_synced(write_config: WriteConfig) -> None:
    """After SIGKILL the file in work has every frame that had been synced, and says that it was cut off."""
    process, part = start_realtime(write_config(camera={"pace": "realtime", "rate_hz": 20}), 15)
    process.kill()
    process.communicate(timeout=60)
    flight = open_flight([part])
    frames = list(flight.frames())

    assert len(frames) >= 15
    assert [frame.sequence for frame in frames] == list(range(len(frames)))
    assert "no end record" in {loss.kind.value for loss in flight.losses}
    assert recorder("info", part).returncode == 3


def test_info_is_a_page_or_a_document(flight: list[Path]) -> None:
    """The same facts for people and for scripts."""
    page, document = recorder("info", *flight), recorder("info", "--json", *flight)
    facts = json.loads(document.stdout)

    assert (page.returncode, document.returncode) == (0, 0)
    assert "frames:      40, 4.00 Hz" in page.stdout
    assert "zoom:        4.45 to 43.45 mm" in page.stdout
    assert "losses:      none" in page.stdout
    assert facts["frames"] == 40
    assert facts["rate_hz"] == pytest.approx(4.0)
    assert facts["duration_s"] == pytest.approx(9.75)
    assert facts["start_utc"] == "2018-05-04T12:00:00Z"
    assert facts["picture_sizes_px"] == [[64, 48]]
    assert facts["focal_length_mm"] == [4.45, 43.45]
    assert [file["end_reason"] for file in facts["files"]] == ["next segment", "next segment", "no more pictures"]
    assert list(facts["attachments"]) == ["recorder.yaml"]
    assert facts["losses"] == []


def test_info_of_a_flight_with_losses_exits_with_3(flight: list[Path]) -> None:
    """A missing segment and a damaged picture are listed, with where they are."""
    data = bytearray(flight[0].read_bytes())
    data[len(data) // 2] ^= 1
    flight[0].write_bytes(data)
    result = recorder("info", "--json", flight[0], flight[2])
    facts = json.loads(result.stdout)

    assert result.returncode == 3
    assert {loss["kind"] for loss in facts["losses"]} == {"damaged", "missing segment", "gap"}
    assert facts["frames_missing"] >= 16
    assert "losses:\n  2018" in recorder("info", flight[0], flight[2]).stdout


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (None, "no such file"),
        (b"", "is empty"),
        (b"hello, world", "not an MCAP file"),
        (b"\x89MCAP0\r\n", "no picture"),
    ],
)
def test_info_of_what_is_no_flight_is_one_sentence(tmp_path: Path, content: bytes | None, sentence: str) -> None:
    """Exit code 1 and a sentence, no traceback."""
    path = tmp_path / "x.mcap"
    if content is not None:
        path.write_bytes(content)
    result = recorder("info", path)

    assert result.returncode == 1
    assert sentence in result.stderr
    assert result.stderr.count("\n") == 1


def test_wrong_configuration_exits_with_78(write_config: WriteConfig) -> None:
    """One sentence with the path of the wrong value; systemd does not start it again."""
    result = recorder("run", "--config", write_config(storage={"segment_s": -1}))

    assert result.returncode == 78
    assert "storage.segment_s: " in result.stderr
    assert result.stderr.count("\n") == 1


def test_disk_that_cannot_be_written_exits_with_1(write_config: WriteConfig, tmp_path: Path) -> None:
    """A directory that cannot be made is one sentence."""
    (tmp_path / "file").touch()
    result = recorder("run", "--config", write_config(storage={"directory": str(tmp_path / "file" / "flights")}))

    assert result.returncode == 1
    assert "check storage.directory" in result.stderr


def test_replay_of_nothing_exits_with_1(write_config: WriteConfig, tmp_path: Path) -> None:
    """A folder without pictures is one sentence."""
    result = recorder("run", "--config", write_config(camera={"path": str(tmp_path)}))

    assert result.returncode == 1
    assert "there is no JPEG in it" in result.stderr


@pytest.mark.parametrize("arguments", [("run",), ("info",), ("fly",), ("info", "--yaml", "x")])
def test_wrong_usage_exits_with_2(arguments: tuple[str, ...]) -> None:
    """Missing and unknown options, arguments and commands."""
    assert recorder(*arguments).returncode == 2


@pytest.mark.parametrize("arguments", [("--help",), ("run", "--help"), ("info", "-h")])
def test_help_has_examples(arguments: tuple[str, ...]) -> None:
    """Every command shows how it is used."""
    result = recorder(*arguments)

    assert result.returncode == 0
    assert "Examples:\n" in result.stdout


def test_the_box_stays_light() -> None:
    """Recording loads neither OpenCV, nor numpy, nor anything of the desk; help loads next to nothing."""
    code = "import sys, recorder.cli, {}; print(*sys.modules)"
    full = subprocess.run(
        [sys.executable, "-c", code.format("recorder.command_run, recorder.command_info")],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONWARNINGS": "error"},
    )
    light = subprocess.run([sys.executable, "-c", code.format("os")], capture_output=True, text=True, check=True)

    assert not {"cv2", "numpy", "decoder", "requests"} & set(full.stdout.split())
    assert not {"pydantic", "mcap", "PIL", "yaml"} & set(light.stdout.split())
