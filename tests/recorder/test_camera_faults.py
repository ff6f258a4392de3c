"""A camera that fails, stays away, or was never there: the recorder goes on, and says so in the flight."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from camera_drivers.errors import CameraError, CameraUnusableError
from flight_file.reader import open_flight
from recorder.capture import SELDOM, SOON

Daemon = Any  # of the conftest
StartDaemon = Callable[..., Daemon]
Eventually = Callable[[Callable[[], object]], None]

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
    assert [frame.jpeg for frame in daemon.frames()] == [b"one", b"two"]
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
    assert [event["reason"] for event in daemon.events("camera_status") if event["level"] == "warning"] == [
        str(GONE)
    ] * 3


@pytest.mark.parametrize(("error", "pace"), [(GONE, SOON), (CameraUnusableError("It is no camera."), SELDOM)])
def test_attempts_become_rarer(
    start_daemon: StartDaemon,
    eventually: Eventually,
    error: CameraError,
    pace: Any,  # noqa: ANN401
) -> None:
    """Twice the wait after each failure, up to a limit; a camera that nobody can help is asked seldom, but asked."""
    daemon = start_daemon()
    eventually(lambda: daemon.camera.connections == 1)
    start_ns = daemon.clock.read().monotonic_ns
    for _ in range(8):
        daemon.camera.fail(error)
    eventually(lambda: daemon.camera.connections == 9)
    waited_s = (daemon.clock.read().monotonic_ns - start_ns) / 1e9
    waits_s = [min(pace.first_s * 2**number, pace.longest_s) for number in range(8)]

    assert waited_s == pytest.approx(sum(waits_s), abs=3)  # the writer's thread turns the clock a little as well
    daemon.finish()


def test_box_without_a_camera_leaves_a_trace_of_why(start_daemon: StartDaemon, eventually: Eventually) -> None:
    """One small segment an hour, not one a minute; it says what became of the camera."""
    daemon = start_daemon(storage={"segment_s": 60})
    for _ in range(100):
        daemon.camera.fail(GONE)
    eventually(lambda: daemon.camera.connections == 101)
    outcome = daemon.finish()

    assert outcome.stored == 0
    assert len(outcome.paths) == 1
    assert str(GONE) in {entry["reason"] for entry in daemon.messages("/camera/status") if entry["state"] == "lost"}


def test_first_segment_says_which_camera_it_is_from(start_daemon: StartDaemon) -> None:
    """The segment is opened when the camera has said who it is, or at the first frame."""
    daemon = start_daemon()
    daemon.feed(b"one")
    session = open_flight(daemon.finish().paths).session

    assert (session.camera_driver, session.camera_model, session.camera_serial) == ("puppet", "P-1", "7")


def test_sequence_numbers_of_lost_pictures_are_missing(start_daemon: StartDaemon) -> None:
    """What the driver calls lost is counted with its reason, beside what found no room."""
    daemon = start_daemon()
    daemon.feed(b"one")
    for _ in range(2):
        daemon.reporter.lost("the download broke off")
    daemon.feed(b"two", b"three", b"four", b"five")
    outcome = daemon.finish()
    reasons = [entry["reason"] for entry in daemon.messages("/camera/status")]

    assert outcome.dropped == 2
    assert "dropped: 2 because the download broke off" in reasons
    assert daemon.messages("/recorder/health")[-1]["drops_by_reason"] == {"the download broke off": 2}
