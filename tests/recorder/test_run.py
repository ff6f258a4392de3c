"""Recording, from a configuration to flight files, in this process."""

from __future__ import annotations

import io
import json
import threading
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pytest
from mcap.reader import make_reader

from camera_drivers.camera import CameraIdentity
from camera_drivers.errors import ReplayError
from flight_file.durable_file import DurableFile
from flight_file.errors import FlightNotWrittenError
from flight_file.frame import ClockReading, Frame, HostTimes
from flight_file.reader import open_flight
from recorder import run as run_module
from recorder.drivers import Wiring
from recorder.errors import RecorderError
from recorder.journal import Journal
from recorder.run import Outcome, record
from recorder.settings import RecorderConfig
from recorder.stop import Stop
from recorder.testing import ManualClock, fixed_host

NOON_NS = 1_525_435_200_000_000_000
NOW_NS = 1_800_000_000_000_000_000

Configure = Callable[..., RecorderConfig]


def run(config: RecorderConfig, stop: Stop | None = None, log: io.StringIO | None = None) -> Outcome:
    """Record on the machine that leaves no trace."""
    return record(config, host=fixed_host(ManualClock(NOW_NS)), stop=stop, journal=Journal(log or io.StringIO()))


def messages(path: Path, topic: str) -> list[dict[str, Any]]:
    """The JSON messages of a topic, by an independent reader."""
    with path.open("rb") as file:
        found = make_reader(file, validate_crcs=True).iter_messages(topics=[topic])
        return [json.loads(message.data) for _, _, message in found]


class ScriptedCamera:
    """Gives frames without pause, then does what the script says."""

    identity = CameraIdentity(driver="scripted")

    def __init__(self, frames: int, then: Callable[[threading.Event], None], size: int = 10) -> None:
        self._frames = iter(range(frames))
        self._then = then
        self._size = size

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None: ...

    def next_frame(self, stop: threading.Event) -> Frame | None:
        """A frame, or what the script says."""
        sequence = next(self._frames, None)
        if sequence is None:
            self._then(stop)
            return None
        at = ClockReading(NOON_NS + sequence, sequence)
        digest = "0" * 64
        return Frame(sequence, NOON_NS + sequence, bytes(self._size), digest, HostTimes(at, at, at))


@pytest.fixture
def with_camera(monkeypatch: pytest.MonkeyPatch) -> Callable[[ScriptedCamera], None]:
    """Record from this live camera, whatever the configuration says."""

    def use(camera: ScriptedCamera) -> None:
        clock = ManualClock(NOW_NS)
        monkeypatch.setattr(run_module, "wire", lambda _config, _host, _reporter: Wiring(camera, clock, live=True))

    return use


def test_replayed_folder_is_a_flight(configure: Configure, pictures: Path) -> None:
    """Every picture is there, byte for byte, with its time; the flight is named after the first of them."""
    outcome = run(configure())
    flight = open_flight(outcome.paths)
    frames = list(flight.frames())

    assert outcome.recording == "20180504T120000Z"
    assert (outcome.stored, outcome.dropped, outcome.reason) == (40, 0, "no more pictures")
    assert [frame.jpeg for frame in frames] == [path.read_bytes() for path in sorted(pictures.iterdir())]
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


def test_second_recording_does_not_touch_the_first(configure: Configure) -> None:
    """The same start time gives another name, never another flight's file."""
    first, second = run(configure()), run(configure())

    assert second.recording == "20180504T120000Z-2"
    assert not set(first.paths) & set(second.paths)


def test_recording_can_be_named(configure: Configure) -> None:
    """A fixture has a name of its own, in the file's name and inside."""
    outcome = record(
        configure(), host=fixed_host(ManualClock(NOW_NS)), journal=Journal(io.StringIO()), name="thesis_a1"
    )

    assert [path.name for path in outcome.paths] == ["thesis_a1_0000.mcap"]
    assert open_flight(outcome.paths).recording == "thesis_a1"


def test_replayed_flight_is_the_same_flight(tmp_path: Path, configure: Configure) -> None:
    """Frames of a recorded flight come out of a second recording unchanged, and its panel with them."""
    panel = tmp_path / "panel.yaml"
    panel.write_text("name: x\n")
    first = run(configure(attach={"panel": panel}, storage={"segment_s": 3}))
    again = configure(
        camera={"path": [str(path) for path in first.paths], "rate_hz": None},
        storage={"directory": tmp_path / "again"},
    )
    before, after = open_flight(first.paths), open_flight(run(again).paths)

    assert list(after.frames()) == list(before.frames())
    assert dict(after.attachments) == {"panel.yaml": b"name: x\n"}


def test_flight_replayed_with_its_own_panel_keeps_the_new_one(tmp_path: Path, configure: Configure) -> None:
    """What the configuration attaches takes the place of what the flight brings along."""
    old, new = tmp_path / "old.yaml", tmp_path / "new.yaml"
    old.write_text("name: old\n")
    new.write_text("name: new\n")
    first = run(configure(attach={"panel": old}))
    again = configure(camera={"path": [str(path) for path in first.paths], "rate_hz": None}, attach={"panel": new})

    assert dict(open_flight(run(again).paths).attachments) == {"panel.yaml": b"name: new\n"}


def test_health_is_reported_each_ten_seconds_and_at_the_end(tmp_path: Path, configure: Configure) -> None:
    """39 quarters of a second between the pictures, at a tenth of the rate: 97.5 s."""
    (path,) = run(configure(camera={"rate_hz": 0.4}, storage={"segment_s": 3600})).paths
    health = messages(path, "/recorder/health")

    assert len(health) == 10
    assert [entry["stored"] for entry in health][-2:] == [37, 40]
    assert health[0]["frame_rate_hz"] == pytest.approx(0.5)
    assert health[0]["clock"] == "simulated"
    assert tmp_path.exists()


def test_status_says_how_it_began_and_ended(configure: Configure) -> None:
    """Connected with what is replayed, finished with the reason."""
    (path,) = run(configure()).paths

    assert [(entry["state"], entry["reason"]) for entry in messages(path, "/camera/status")] == [
        ("connected", "replay: 40 pictures from a folder, 0 other files in it ignored"),
        ("finished", "no more pictures"),
    ]


def test_drops_of_a_live_camera_are_counted_and_visible(
    configure: Configure, with_camera: Callable[[ScriptedCamera], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a slow disk the oldest that wait are dropped; status, health, log, end record and outcome agree on it."""
    release = threading.Event()
    write = DurableFile.write

    def slow_write(file: DurableFile, data: bytes) -> int:
        if len(data) > 50_000:
            release.wait(10)
        return write(file, data)

    monkeypatch.setattr(DurableFile, "write", slow_write)
    with_camera(ScriptedCamera(100, lambda _stop: release.set(), size=100_000))
    outcome = run(configure())
    (path,) = outcome.paths

    assert outcome.dropped >= 100 - 64 - 2
    assert outcome.stored == 100 - outcome.dropped
    assert messages(path, "/recorder/health")[-1]["dropped"] == outcome.dropped
    assert messages(path, "/recorder/health")[-1]["drops_by_reason"] == {
        "the disk is slower than the camera": outcome.dropped
    }
    assert messages(path, "/camera/status")[-1]["dropped"] == outcome.dropped
    end = open_flight([path]).segments[0].end
    assert end is not None
    assert end.dropped == outcome.dropped
    with path.open("rb") as file:
        assert b"frames_dropped" in next(make_reader(file).iter_messages(topics=["/recorder/log"]))[2].data


def test_replay_that_fails_ends_the_recording_cleanly(
    configure: Configure, with_camera: Callable[[ScriptedCamera], None], tmp_path: Path
) -> None:
    """What it gave before is stored in a finished file whose end record has the reason; the error comes out."""

    def fail(_stop: threading.Event) -> None:
        raise ReplayError("the picture is gone; put it back.")

    with_camera(ScriptedCamera(3, fail))
    with pytest.raises(ReplayError, match="put it back"):
        run(configure())
    (path,) = (tmp_path / "flights").iterdir()
    end = open_flight([path]).segments[0].end

    assert path.suffix == ".mcap"
    assert end is not None
    assert (end.frames, end.reason) == (3, "camera failed: the picture is gone; put it back.")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_crashing_driver_does_not_cost_the_recording(
    configure: Configure, with_camera: Callable[[ScriptedCamera], None], tmp_path: Path
) -> None:
    """A bug in a driver ends the run as a failure, but the files are closed with all frames."""

    def crash(_stop: threading.Event) -> None:
        raise ZeroDivisionError

    with_camera(ScriptedCamera(3, crash))
    with pytest.raises(RecorderError, match="crashed"):
        run(configure())
    (path,) = (tmp_path / "flights").iterdir()

    assert path.suffix == ".mcap"


def test_camera_that_hangs_does_not_hold_up_the_end(
    configure: Configure, with_camera: Callable[[ScriptedCamera], None]
) -> None:
    """When told to stop, the recorder closes its files even if the camera never answers."""
    forever, stop = threading.Event(), Stop()

    def hang(_stop: threading.Event) -> None:
        stop.request("stopped by SIGTERM")
        forever.wait(20)

    with_camera(ScriptedCamera(3, hang))
    outcome = run(configure(), stop)
    forever.set()

    assert outcome.stored == 3
    assert outcome.reason == "stopped by SIGTERM; the camera did not answer"


@pytest.fixture
def failing_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that is full after 30 kB."""
    write = DurableFile.write

    def limited(file: DurableFile, data: bytes) -> int:
        if file.tell() > 30_000:
            raise FlightNotWrittenError(file.path, reason="cannot be written (No space left); make room on the disk")
        return write(file, data)

    monkeypatch.setattr(DurableFile, "write", limited)


@pytest.mark.usefixtures("failing_disk")
def test_full_disk_is_one_error_and_keeps_what_was_stored(configure: Configure, tmp_path: Path) -> None:
    """The run ends with a sentence; the frames that were synced are in the file in work."""
    with pytest.raises(FlightNotWrittenError, match="make room"):
        run(configure())
    (path,) = (tmp_path / "flights").iterdir()

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
