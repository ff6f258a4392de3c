"""The commands, as processes of their own."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from benchmarks.recorders import PATIENCE_S, Box, eventually
from flight_file.reader import open_flight
from flight_file.thresholds import MAX_READ_BYTES
from tests.flight_file.flights import make_frame, write_flight
from tests.programs import RECORDER, begun, until, write_yaml
from tests.recorder.helpers import WriteConfig, recorder, stuck_pipe


@pytest.fixture
def flight(write_config: WriteConfig) -> list[Path]:
    """A recorded flight of three segments."""
    return [Path(line) for line in recorder("run", "--config", write_config(storage={"segment_s": 4})).stdout.split()]


def test_run_lists_the_segments_and_logs_json_lines(write_config: WriteConfig) -> None:
    """The finished files on stdout, each with recorder.yaml inside, and events with level and time on stderr."""
    config = write_config(storage={"segment_s": 4})
    result = recorder("run", "--config", config)
    paths = [Path(line) for line in result.stdout.splitlines()]
    lines = [json.loads(line) for line in result.stderr.splitlines()]

    assert result.returncode == 0
    assert [path.name for path in paths] == [f"20180504T120000Z_000{number}.mcap" for number in range(3)]
    assert len(list(open_flight(paths).frames())) == 40
    assert [open_flight([path]).attachments["recorder.yaml"] for path in paths] == [config.read_bytes()] * 3
    assert [line["event"] for line in lines] == ["recording_started", "recording_finished"]
    assert all({"level", "timestamp"} <= set(line) for line in lines)


def test_ctrl_c_ends_the_recording_cleanly(write_config: WriteConfig) -> None:
    """A finished file whose end record names the signal; a terminal that closes ends nothing."""
    box = Box(write_config(camera={"pace": "realtime"}))
    eventually(lambda: box.said_stored() >= 1)
    box.process.send_signal(signal.SIGHUP)
    box.process.send_signal(signal.SIGINT)
    box.process.wait(PATIENCE_S)
    (path,) = box.stop()
    flight = open_flight([path])
    frames = list(flight.frames())

    assert flight.segments[0].end is not None
    assert flight.segments[0].end.reason == "stopped by SIGINT"
    assert [frame.sequence for frame in frames] == list(range(len(frames)))
    assert flight.losses == []
    assert box.in_work() is None


def _full() -> int:
    return os.open("/dev/full", os.O_WRONLY)


def _broken() -> int:
    reading, writing = os.pipe()
    os.close(reading)
    return writing


def _stuck() -> int:
    _, writing = stuck_pipe()
    return writing


@pytest.mark.parametrize("stderr", [_full, _broken, _stuck])
def test_log_that_cannot_be_written_does_not_cost_the_recording(
    write_config: WriteConfig, stderr: Callable[[], int]
) -> None:
    """All pictures are stored and the program succeeds, whether stderr is full, broken or stuck."""
    descriptor = stderr()
    command = [RECORDER, "run", "--config", str(write_config())]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=descriptor, text=True, timeout=PATIENCE_S, check=True)
    os.close(descriptor)
    (path,) = map(Path, done.stdout.splitlines())

    assert len(list(open_flight([path]).frames())) == 40


def test_output_that_cannot_be_written_is_one_sentence(write_config: WriteConfig) -> None:
    """The list of segments finds no room; the recording is whole all the same."""
    config = write_config()
    command = [RECORDER, "run", "--config", str(config)]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    (path,) = config.parent.glob("flights/*.mcap")

    assert done.returncode == 1
    assert done.stderr.splitlines()[2:] == [
        "Error: stdout cannot be written (No space left on device); send it elsewhere."
    ]
    assert len(list(open_flight([path]).frames())) == 40


def test_exit_code_does_not_depend_on_the_log(write_config: WriteConfig) -> None:
    """A wrong configuration stays one (78) where the sentence about it cannot be written: systemd must not retry."""
    command = [RECORDER, "run", "--config", str(write_config(storage={"segment_s": -1}))]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=full, check=False)

    assert done.returncode == 78


def test_closed_streams_are_not_taken_for_the_flight(write_config: WriteConfig) -> None:
    """With stdin, stdout and stderr closed, no file of the recording gets their numbers and the log's lines."""
    config = write_config()
    closed = 'exec 0<&- 1>&- 2>&-; exec "$@"'
    subprocess.run(["/bin/sh", "-c", closed, "sh", RECORDER, "run", "--config", str(config)], check=True)
    (path,) = config.parent.glob("flights/*.mcap")
    flight = open_flight([path])

    assert len(list(flight.frames())) == 40
    assert flight.losses == []


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


def test_info_of_what_is_no_flight_is_one_sentence(tmp_path: Path) -> None:
    """Exit code 1 and a sentence, no traceback; a command that there is not is wrong usage (2)."""
    assert recorder("fly").returncode == 2
    path = tmp_path / "x.mcap"
    path.write_bytes(b"\x89MCAP0\r\n")
    result = recorder("info", path)

    assert result.returncode == 1
    assert "no picture" in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("blocks", "code", "sentence"),
    [
        ({"storage": {"segment_s": -1}}, 78, "storage.segment_s: "),
        ({"storage": {"directory": "recorder.yaml/flights"}}, 78, "recorder.yaml, on the way there, is none; name"),
        ({"camera": {"path": ".", "rate_hz": None}}, 78, "Error: camera.path: "),
        ({"camera": {"path": "none", "rate_hz": None}}, 1, "there is no such file"),
        ({"evidence": {"key": "recorder.yaml"}}, 78, "Error: evidence.key: "),
    ],
)
def test_run_that_cannot_be_is_one_sentence(
    write_config: WriteConfig, tmp_path: Path, blocks: dict[str, Any], code: int, sentence: str
) -> None:
    """What is wrong and where; after a wrong configuration (78) systemd does not start it again."""
    result = recorder("run", "--config", write_config(**blocks))

    assert result.returncode == code
    assert sentence in result.stderr
    assert result.stderr.count("\n") == 1
    assert not list((tmp_path / "flights").glob("*.mcap*"))


@pytest.mark.parametrize("unread", ["recorder.yaml", "attach", "evidence"])
def test_run_whose_files_the_disk_does_not_give_is_started_again(write_config: WriteConfig, unread: str) -> None:
    """Exit code 1, not 78, of a file that cannot be read just now: the next start may read it, and nobody is there."""
    failing = "/proc/self/mem"  # a regular file whose first byte is an error of input
    blocks = {"attach": {"attach": {"panel": failing}}, "evidence": {"evidence": {"key": failing}}}
    config = write_config(**blocks.get(unread, {}))
    result = recorder("run", "--config", failing if unread == "recorder.yaml" else config)

    assert result.returncode == 1
    assert "cannot be read (Input/output error)" in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize("missing", ["recorder.yaml", "panel.yaml", "panel.jpg", "recorder.key"])
def test_run_begins_when_the_disk_with_its_files_is_mounted(
    write_config: WriteConfig, tmp_path: Path, missing: str
) -> None:
    """Until then it ends with 1, after which systemd starts it again, and one sentence that names the file."""
    disk, absent = tmp_path / "disk", tmp_path / "absent"
    disk.mkdir()
    blocks = {"attach": {"panel": "disk/panel.yaml"}, "evidence": {"key": "disk/recorder.key"}}
    (disk / "recorder.yaml").write_bytes(write_config(**blocks).read_bytes().replace(b"disk/", b""))
    (disk / "panel.yaml").write_text("{name: P, picture: panel.jpg}", encoding="utf-8")
    (disk / "panel.jpg").write_bytes(b"picture")
    recorder("keygen", disk / "recorder.key")
    (disk / missing).rename(absent)
    early = recorder("run", "--config", disk / "recorder.yaml")
    absent.rename(disk / missing)
    late = recorder("run", "--config", disk / "recorder.yaml")

    assert early.returncode == 1
    assert f"{disk / missing}" in early.stderr
    assert "cannot be read (No such file or directory)" in early.stderr
    assert early.stderr.count("\n") == 1
    assert late.returncode == 0, late.stderr
    assert sum(1 for _ in open_flight(list(map(Path, late.stdout.splitlines()))).frames()) == 40


@pytest.mark.parametrize(
    ("modules", "heavy"),
    [
        ("os", {"pydantic", "mcap", "PIL", "yaml"}),
        (
            "recorder.run, recorder.evidence, recorder.command_info, recorder.command_recover",
            {"cv2", "numpy", "decoder", "requests", "cryptography"},
        ),
    ],
)
def test_box_stays_light(modules: str, heavy: set[str]) -> None:
    """Help loads next to nothing; recording without a key nothing of the desk, and none of what signs."""
    code = f"import sys, recorder.cli, {modules}; print(*sys.modules)"
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True)

    assert not heavy & set(done.stdout.split())


@pytest.mark.slow
def test_photographs_become_one_flight_and_come_out_of_it(pictures: Path, tmp_path: Path) -> None:
    """Byte for byte, in order, whatever its length: 40 pictures of 40 days; the panel's picture goes in with it."""
    target, folder = tmp_path / "flights" / "august.mcap", tmp_path / "out"
    (tmp_path / "panel.yaml").write_text("{name: P, picture: panel.jpg}", encoding="utf-8")
    (tmp_path / "panel.jpg").write_bytes(b"picture")
    (tmp_path / "lens.yaml").write_text("{}", encoding="utf-8")
    beside = ("--panel", tmp_path / "panel.yaml", "--camera", tmp_path / "lens.yaml")
    made = recorder("replay", pictures, "-o", target, "--rate", repr(1 / 86400), *beside)
    taken = recorder("extract", target, "-o", folder)

    assert (made.returncode, made.stdout, made.stderr) == (0, f"{target}: 40 pictures\n", "")
    assert (taken.returncode, taken.stdout) == (0, f"{folder}: 40 pictures\n")
    assert [path.read_bytes() for path in sorted(folder.iterdir())] == [
        path.read_bytes() for path in sorted(pictures.iterdir())
    ]
    assert list(target.parent.iterdir()) == [target]
    assert open_flight([target]).recording == "august"
    assert set(open_flight([target]).attachments) == {"panel.yaml", "panel.jpg", "camera.yaml"}


@pytest.mark.parametrize(
    ("source", "name", "sentence"),
    [
        ("pictures", "there.mcap", "is there already; choose another name"),
        ("pictures", "flight.avi", "a flight file ends in .mcap"),
        ("pictures", "flight.mcap", "give rate_hz (--rate), the pictures per second."),
        ("nothing", "flight.mcap", "there is no such file"),
        ("pictures", "there.mcap/flight.mcap", "cannot be written"),
    ],
)
def test_what_cannot_be_made_is_one_sentence(
    pictures: Path, tmp_path: Path, source: str, name: str, sentence: str
) -> None:
    """Nothing is replaced, and nothing is left behind."""
    (tmp_path / "there.mcap").write_bytes(b"a flight")
    done = recorder("replay", pictures.parent / source, "-o", tmp_path / name)

    assert done.returncode == 1
    assert sentence in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["pictures", "there.mcap"]
    assert (tmp_path / "there.mcap").read_bytes() == b"a flight"


@pytest.mark.parametrize("command", ["extract", "replay"])
def test_what_a_flight_has_lost_is_said(pictures: Path, tmp_path: Path, command: str) -> None:
    """The other pictures come out; pictures lost at its end leave no gap, so they are told. Exit code 3."""
    flight, target = tmp_path / "flight.mcap", tmp_path / "out.mcap"
    recorder("replay", pictures, "-o", flight, "--rate", "4")
    content = flight.read_bytes()
    flight.write_bytes(content[: len(content) // 2])
    done = recorder(command, flight, "-o", target)
    count = len(list(target.iterdir())) if command == "extract" else open_flight([target]).count()

    assert done.returncode == 3
    assert "  lost: " in done.stderr
    assert 0 < count < 40


@pytest.mark.slow
def test_picture_that_a_flight_does_not_take_is_a_loss_of_its_replay(tmp_path: Path) -> None:
    """Of a flight by another writer, in which it can still be read: it is counted, and the exit code is 3."""
    frames = [make_frame(0), replace(make_frame(1), encoded=bytes(MAX_READ_BYTES + 1))]
    digested = [replace(frame, sha256=hashlib.sha256(frame.encoded).hexdigest()) for frame in frames]
    done = recorder("replay", *write_flight(tmp_path, digested), "-o", tmp_path / "new.mcap")

    assert (done.returncode, done.stdout) == (3, f"{tmp_path / 'new.mcap'}: 1 pictures\n")
    assert done.stderr == "  lost: 1 of the pictures, which are larger than a flight file takes\n"


def test_other_pictures_are_not_replaced(pictures: Path, tmp_path: Path) -> None:
    """A folder that holds another picture of the same name is refused; the same pictures once more are not."""
    target, folder = tmp_path / "flight.mcap", tmp_path / "out"
    recorder("replay", pictures, "-o", target, "--rate", "4")
    again = [recorder("extract", target, "-o", folder).returncode for _ in range(2)]
    (folder / "000003.jpg").write_bytes(b"mine")
    done = recorder("extract", target, "-o", folder)

    assert again == [0, 0]
    assert done.returncode == 1
    assert "000003.jpg: is there already with another picture; choose another folder" in done.stderr
    assert (folder / "000003.jpg").read_bytes() == b"mine"


def deliveries(ledger: Path) -> list[dict[str, object]]:
    """What the simulated camera has sent so far."""
    return [json.loads(line) for line in ledger.read_text().splitlines()] if ledger.exists() else []


def test_recorder_stores_what_the_camera_delivered(tmp_path: Path, pictures: Path) -> None:
    """Pictures of a folder, through two processes and some faults: each delivered picture is in the flight once."""
    ledger = tmp_path / "ledger"
    options = [word for fault in ("cut_short@2", "lost_answer@3", "drop_mid_download@6") for word in ("--fault", fault)]
    camera = begun("recorder", "simulate", "--pictures", pictures, "--ledger", ledger, "--shot-s", "0", *options)
    assert camera.stdout is not None
    document = {
        "camera": {"driver": "qx10", "url": camera.stdout.readline().strip(), "interval_s": 0},
        "storage": {"directory": str(tmp_path / "flights"), "keep_free_gib": 0},
    }
    write_yaml(tmp_path / "recorder.yaml", document)
    box = begun("recorder", "run", "--config", tmp_path / "recorder.yaml")
    until(lambda: len(deliveries(ledger)) >= 9)
    box.send_signal(signal.SIGTERM)
    paths = [Path(line) for line in box.communicate(timeout=PATIENCE_S)[0].splitlines()]
    camera.send_signal(signal.SIGTERM)
    camera.communicate(timeout=PATIENCE_S)

    assert (box.returncode, camera.returncode) == (0, 0)
    delivered = [line["sha256"] for line in deliveries(ledger) if line["complete"] and line["intact"]]
    stored = [frame.sha256 for frame in open_flight(paths).frames()]
    # The box may have been stopped between the last delivery and its storing, which it tells.
    assert stored in (delivered, delivered[:-1])
    assert len(stored) >= 6


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        (["--list-faults"], 0, "another_clock"),
        (["--fault", "none_such"], 2, "There is no fault 'none_such'"),
        (["--fault", "reboot@x"], 2, "write NAME, or NAME@NUMBER"),
        (["--pictures", "/nowhere"], 2, "does not exist"),
        (["--host", "192.0.2.7"], 1, "cannot be used"),
    ],
)
def test_simulate_says_what_it_can(arguments: list[str], code: int, sentence: str) -> None:
    """Its faults, and what is wrong with its options, with click's usage above it."""
    result = recorder("simulate", *arguments)

    assert result.returncode == code
    assert sentence in result.stdout + result.stderr
    assert "Traceback" not in result.stderr
