"""A camera that fails, stays away, or was never there: the recorder goes on, and says so in the flight."""

from __future__ import annotations

import pytest

from benchmarks.recorders import eventually
from camera_drivers.errors import CameraError, CameraUnusableError
from flight_file.reader import open_flight
from recorder.thresholds import CAMERA_AGAIN_S, UNUSABLE_AGAIN_S
from tests.recorder.helpers import PuppetCamera, StartDaemon

GONE = CameraError("The camera does not answer; check that it is on.")


def test_camera_is_connected_again_for_ever(start_daemon: StartDaemon) -> None:
    """Each loss and each return stands in the flight, with its reason; the frames around them are all there."""
    daemon = start_daemon()
    daemon.feed(b"one")
    for _ in range(3):
        daemon.camera.fail(GONE)
    daemon.feed(b"two")
    daemon.finish()

    assert daemon.camera.connections == 4
    assert [frame.encoded for frame in daemon.frames()] == [b"one", b"two"]
    assert [(entry["state"], entry["reason"]) for entry in daemon.messages("/camera/status")] == [
        ("connecting", "puppet"),
        ("capturing", "puppet"),
        ("lost", str(GONE)),
        ("capturing", "puppet (after 1 failed attempt)"),
        ("lost", str(GONE)),
        ("capturing", "puppet (after 2 failed attempts)"),
        ("lost", str(GONE)),
        ("capturing", "puppet (after 3 failed attempts)"),
        ("finished", "stopped by the test"),
    ]
    assert [event["level"] for event in daemon.events("camera_status")].count("warning") == 3


def test_camera_for_which_no_memory_is_left_is_connected_again(
    start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While connecting and while a picture is fetched; the picture that this cost is counted, in the flight too."""
    connect, failures = PuppetCamera.__enter__, [MemoryError()]

    def connect_later(camera: PuppetCamera) -> PuppetCamera:
        if failures:
            raise failures.pop()
        return connect(camera)

    monkeypatch.setattr(PuppetCamera, "__enter__", connect_later)
    daemon = start_daemon()
    daemon.feed(b"one")
    daemon.camera.fail(MemoryError())
    daemon.feed(b"two")
    outcome = daemon.finish()
    states = [(entry["state"], entry["reason"]) for entry in daemon.messages("/camera/status")]

    assert [frame.encoded for frame in daemon.frames()] == [b"one", b"two"]
    assert [reason.partition(";")[0] for state, reason in states if state == "lost"] == [
        "No memory is left for the camera, which is connected again"
    ] * 2
    assert ("capturing", "puppet (after 1 failed attempt)") in states
    assert outcome.dropped == 1
    assert daemon.events("frames_dropped")[-1]["by_reason"] == {"no memory was left for it": 1}


@pytest.mark.parametrize(
    ("error", "pace"), [(GONE, CAMERA_AGAIN_S), (CameraUnusableError("It is no camera."), UNUSABLE_AGAIN_S)]
)
def test_attempts_become_rarer(start_daemon: StartDaemon, error: CameraError, pace: tuple[float, float]) -> None:
    """Twice the wait after each failure, up to a limit; a camera that nobody can help is asked seldom, but asked."""
    daemon = start_daemon()
    eventually(lambda: daemon.camera.connections == 1)
    start_ns = daemon.clock.read().monotonic_ns
    for _ in range(8):
        daemon.camera.fail(error)
    eventually(lambda: daemon.camera.connections == 9)
    waited_s = (daemon.clock.read().monotonic_ns - start_ns) / 1e9
    waits_s = [min(pace[0] * 2**number, pace[1]) for number in range(8)]

    assert waited_s == pytest.approx(sum(waits_s), abs=3)  # the writer's thread turns the clock a little as well
    daemon.finish()


def test_box_without_a_camera_leaves_a_trace_of_why(start_daemon: StartDaemon) -> None:
    """One small segment an hour, not one a minute; it says what became of the camera."""
    daemon = start_daemon(storage={"segment_s": 60})
    for _ in range(100):
        daemon.camera.fail(GONE)
    eventually(lambda: daemon.camera.connections == 101)
    outcome = daemon.finish()

    assert outcome.stored == 0
    assert len(outcome.paths) == 1
    assert str(GONE) in {entry["reason"] for entry in daemon.messages("/camera/status") if entry["state"] == "lost"}


def test_sequence_numbers_of_lost_pictures_are_missing(start_daemon: StartDaemon) -> None:
    """What the driver calls lost is counted with its reason; the first segment says which camera it was."""
    daemon = start_daemon()
    daemon.feed(b"one")
    for _ in range(2):
        daemon.reporter.lost("the download broke off")
    daemon.feed(b"two", b"three", b"four", b"five")
    outcome = daemon.finish()
    reasons = [entry["reason"] for entry in daemon.messages("/camera/status")]
    session = open_flight(outcome.paths).session

    assert (session.camera_driver, session.camera_model, session.camera_serial) == ("puppet", "P-1", "7")
    assert outcome.dropped == 2
    assert "dropped: 2 because the download broke off" in reasons
    assert daemon.messages("/recorder/health")[-1]["drops_by_reason"] == {"the download broke off": 2}
