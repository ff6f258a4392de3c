"""Recording, from a configuration to flight files, in this process."""

from __future__ import annotations

import io
import threading
from pathlib import Path

import pytest
from mcap.reader import make_reader

from benchmarks.harm import FailingDisk
from benchmarks.recorders import PATIENCE_S
from camera_drivers.errors import ReplayError
from flight_file.errors import FlightNotWrittenError
from flight_file.files import DurableFile
from flight_file.reader import open_flight
from flight_file.thresholds import MAX_READ_BYTES
from recorder import writer_thread
from recorder.config import RecorderConfig
from recorder.errors import RecorderError
from recorder.host import SimulatedClock, fixed_host
from recorder.journal import Journal
from recorder.run import Outcome, record
from recorder.supervision import Stop
from tests.recorder.helpers import Configure, StartDaemon, messages

NOON_NS = 1_525_435_200_000_000_000
NOW_NS = 1_800_000_000_000_000_000


def run(config: RecorderConfig, stop: Stop | None = None, log: io.StringIO | None = None) -> Outcome:
    """Record on the machine that leaves no trace."""
    return record(config, host=fixed_host(SimulatedClock(NOW_NS)), stop=stop, journal=Journal(log or io.StringIO()))


def test_replayed_folder_is_a_flight(configure: Configure, pictures: Path) -> None:
    """Every picture is there, byte for byte, with its time; the flight is named after the first of them."""
    outcome = run(configure())
    flight = open_flight(outcome.paths)
    frames = list(flight.frames())

    assert outcome.recording == "20180504T120000Z"
    assert [(entry["state"], entry["reason"]) for entry in messages("/camera/status", *outcome.paths)] == [
        ("connected", "replay: 40 pictures from a folder, 0 other files in it ignored"),
        ("finished", "no more pictures"),
    ]
    assert (outcome.stored, outcome.dropped, outcome.reason) == (40, 0, "no more pictures")
    assert [frame.encoded for frame in frames] == [path.read_bytes() for path in sorted(pictures.iterdir())]
    assert [frame.captured_ns for frame in frames] == [NOON_NS + index * 250_000_000 for index in range(40)]
    assert frames[3].exif.focal_length_mm == pytest.approx(7.45)
    assert flight.losses == []
    assert flight.session.clock == "simulated"


def test_recording_twice_gives_the_same_bytes(tmp_path: Path, configure: Configure) -> None:
    """With a machine that leaves no trace, the files are identical, segment by segment."""
    folders = [tmp_path / name for name in ("one", "two")]
    runs = [run(configure(storage={"directory": folder, "segment_s": 3})).paths for folder in folders]

    assert len(runs[0]) == 4
    assert [path.name for path in runs[0]] == [path.name for path in runs[1]]
    assert [path.read_bytes() for path in runs[0]] == [path.read_bytes() for path in runs[1]]


def test_segment_ends_after_so_many_pictures_and_another_recording_has_another_name(configure: Configure) -> None:
    """Its index waits in memory until then; the same start time never gives another flight's file."""
    first, second = run(configure(storage={"segment_frames": 15})), run(configure())

    assert [len(list(open_flight([path]).frames())) for path in first.paths] == [15, 15, 10]
    assert second.recording == "20180504T120000Z-2"
    assert not set(first.paths) & set(second.paths)


def test_replayed_flight_is_the_same_flight(tmp_path: Path, configure: Configure) -> None:
    """Frames come out of a second recording unchanged, and the panel with them, unless another one is attached."""
    old, new = tmp_path / "old.yaml", tmp_path / "new.yaml"
    old.write_text("name: old\n")
    new.write_text("name: new\n")
    first = run(configure(attach={"panel": old}, storage={"segment_s": 3}))
    camera = {"path": [str(path) for path in first.paths], "rate_hz": None}
    before = open_flight(first.paths)
    for attach, panel in (({}, b"name: old\n"), ({"panel": new}, b"name: new\n")):
        after = open_flight(run(configure(camera=camera, attach=attach)).paths)

        assert list(after.frames()) == list(before.frames())
        assert dict(after.attachments) == {"panel.yaml": panel}


def test_health_is_reported_each_ten_seconds_and_at_the_end(configure: Configure) -> None:
    """39 quarters of a second between the pictures, at a tenth of the rate: 97.5 s."""
    (path,) = run(configure(camera={"rate_hz": 0.4}, storage={"segment_s": 3600})).paths
    health = messages("/recorder/health", path)

    assert len(health) == 10
    assert [entry["stored"] for entry in health][-2:] == [37, 40]
    assert health[0]["frame_rate_hz"] == pytest.approx(0.5)
    assert health[0]["clock"] == "simulated"


def test_drops_of_a_live_camera_are_counted_and_visible(
    start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a slow disk the oldest that wait are dropped; status, health, log, end record and outcome agree on it."""
    disk, daemon = FailingDisk(monkeypatch.setattr), start_daemon()
    daemon.feed(bytes(100_000))
    disk.released.clear()
    daemon.flood(*[bytes(100_000)] * 100)
    disk.released.set()
    outcome = daemon.finish()
    health = daemon.messages("/recorder/health")[-1]
    end = open_flight(outcome.paths).segments[0].end

    assert outcome.dropped >= 100 - 64 - 2
    assert outcome.stored == 101 - outcome.dropped
    assert health["dropped"] == outcome.dropped
    assert health["drops_by_reason"] == {"the disk is slower than the camera": outcome.dropped}
    assert daemon.messages("/camera/status")[-1]["dropped"] == outcome.dropped
    assert end is not None
    assert end.dropped == outcome.dropped
    with outcome.paths[0].open("rb") as file:
        assert b"frames_dropped" in next(make_reader(file).iter_messages(topics=["/recorder/log"]))[2].data


def test_picture_that_no_reader_would_find_is_dropped_and_counted(start_daemon: StartDaemon) -> None:
    """Of a camera that sends more than a flight file takes; the pictures around it are stored."""
    daemon = start_daemon()
    for picture in (b"1", bytes(MAX_READ_BYTES + 1), b"2"):
        daemon.feed(picture)
    outcome = daemon.finish()

    assert (outcome.stored, outcome.dropped) == (2, 1)
    assert [frame.encoded for frame in daemon.frames()] == [b"1", b"2"]
    assert daemon.events("frames_dropped")[-1]["by_reason"] == {"the picture is larger than 60 MiB": 1}


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.parametrize(
    ("failure", "seen", "told"),
    [
        (ReplayError("the picture is gone; put it back."), ReplayError, "the picture is gone; put it back."),
        (ZeroDivisionError(), RecorderError, "crashed"),
    ],
)
def test_driver_that_fails_or_crashes_does_not_cost_the_recording(
    start_daemon: StartDaemon, failure: Exception, seen: type[Exception], told: str
) -> None:
    """What it gave before is stored in a finished file whose end record has the reason; the error comes out."""
    daemon = start_daemon()
    daemon.feed(b"1", b"2", b"3")
    daemon.camera.fail(failure)
    with pytest.raises(seen, match=told):
        daemon.over.result(PATIENCE_S)
    for thread in threading.enumerate():
        if thread.name == "capture":
            thread.join(PATIENCE_S)  # its traceback is this test's, not the next one's
    (path,) = daemon.directory.glob("*.mcap*")
    end = open_flight([path]).segments[0].end

    assert path.suffix == ".mcap"
    assert end is not None
    assert end.frames == 3
    assert end.reason.startswith("camera failed: ") == (seen is ReplayError)


def test_camera_that_hangs_does_not_hold_up_the_end(start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch) -> None:
    """When told to stop, the recorder closes its files even if the camera never answers."""
    monkeypatch.setattr(writer_thread, "PATIENCE_S", 0.1)
    hangs, answers, daemon = threading.Event(), threading.Event(), start_daemon()
    daemon.feed(b"1", b"2", b"3")
    daemon.camera.fail(lambda: (hangs.set(), answers.wait(PATIENCE_S)))
    assert hangs.wait(PATIENCE_S)
    outcome = daemon.finish()
    answers.set()

    assert outcome.stored == 3
    assert outcome.reason == "stopped by the test; the camera did not answer"


def test_full_disk_is_one_error_and_keeps_what_was_stored(
    configure: Configure, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The run ends with a sentence; the frames that were synced are in the file in work."""
    write = DurableFile.write

    def limited(file: DurableFile, data: bytes) -> int:
        if file.tell() > 30_000:
            raise FlightNotWrittenError(file.path, reason="cannot be written (No space left); make room on the disk")
        return write(file, data)

    monkeypatch.setattr(DurableFile, "write", limited)
    with pytest.raises(FlightNotWrittenError, match="make room"):
        run(configure())
    (path,) = (tmp_path / "flights").glob("*.mcap*")

    assert path.suffix == ".part"
    assert 0 < len(list(open_flight([path]).frames())) < 40


def test_stop_before_the_start_records_nothing_and_closes(configure: Configure) -> None:
    """A stop that comes early still gives a finished file."""
    stop = Stop()
    stop.request("stopped by SIGTERM")
    stop.request("another reason")
    outcome = run(configure(), stop)

    assert outcome.reason == "stopped by SIGTERM"
    assert open_flight(outcome.paths).losses == []
