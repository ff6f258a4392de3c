"""Each fault of the camera by its name: no picture twice, none missing without a reason, and it goes on.

The ledger of the simulated camera says which pictures it delivered whole; the frames must be exactly these.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from itertools import count
from typing import Any

import pytest

from camera_drivers.qx10.simulator.faults import DOWNLOAD, FAULTS, SHOT
from camera_drivers.qx10.simulator.model import CameraModel
from camera_drivers.qx10.simulator.pictures import drawn_picture
from tests.camera_drivers.qx10.conftest import LIMITS

MakeBench = Callable[..., Any]

FRAMES = 3

# What becomes of the picture: it comes all the same, it is lost with this reason, or none was taken.
COMES, NOT_TAKEN = "", "not taken"
OUTCOMES = {
    "lost_answer": "the connection was cut, though it was taken",
    "delayed": COMES,
    "dripping": "no whole answer within its time, though it was taken",
    "empty_answer": "the answer is no JSON object, though it was taken",
    "not_json": "the answer is no JSON object, though it was taken",
    "wrong_id": "the answer belongs to another question, though it was taken",
    "http_500": "no usable answer to the shot",
    "http_503": NOT_TAKEN,
    "error_1": "no usable answer to the shot",
    "error_403": NOT_TAKEN,
    "error_40400": NOT_TAKEN,
    "error_40401": COMES,
    "error_40403": COMES,
    "zero_host": COMES,
    "foreign_host": COMES,
    "reboot": "the connection was cut",
    "overheat": COMES,
    "silent": "the connection was cut",
    "another_clock": "the connection was cut",
    "drop_mid_download": COMES,
    "cut_short": COMES,
    "damaged": COMES,
    "without_exif": COMES,
    "without_length": COMES,
    "refused_download": COMES,
    "huge_picture": COMES,
}


def test_every_fault_of_a_shot_or_a_download_is_tested() -> None:
    """A new fault in the simulator needs an outcome here."""
    assert set(OUTCOMES) == {fault.name for fault in FAULTS.values() if fault.place in {SHOT, DOWNLOAD}}


@pytest.mark.parametrize(("fault", "outcome"), OUTCOMES.items())
def test_every_delivered_picture_is_a_frame_exactly_once(make_bench: MakeBench, fault: str, outcome: str) -> None:
    """At the second shot something goes wrong; what was delivered whole is there, and the rest has its reason."""
    bench = make_bench(f"{fault}@2")
    frames = bench.take(FRAMES)

    assert [frame.sha256 for frame in frames] == bench.simulated.ledger.delivered()
    lost = [outcome] if outcome not in {COMES, NOT_TAKEN} else []
    assert bench.listener.losses == lost
    assert frames[-1].sequence == FRAMES - 1 + len(lost)
    assert len(bench.listener.reasons("refused")) == (outcome == NOT_TAKEN)
    assert any("too hot" in reason for reason in bench.listener.reasons("error")) == (fault == "overheat")


@pytest.mark.parametrize("fault", ["cut_short", "damaged"])
def test_picture_that_stays_damaged_is_kept_and_reported(make_bench: MakeBench, fault: str) -> None:
    """What comes twice the same way is what the camera has; if it says how large it is, it is kept."""
    bench = make_bench(f"{fault}@2", f"{fault}@3")
    frames = bench.take(FRAMES)
    kept = fault == "cut_short"  # the other one has no header left

    assert len(bench.listener.reasons("damaged")) == kept
    assert len(bench.listener.losses) == (not kept)
    digests = [frame.sha256 for frame in frames]
    assert len(set(digests)) == FRAMES
    assert set(bench.simulated.ledger.delivered()) <= set(digests)


def test_picture_that_cannot_be_downloaded_is_lost_after_two_tries(make_bench: MakeBench) -> None:
    """The download is tried once more, not for ever; the next picture comes."""
    bench = make_bench("drop_mid_download@2", "drop_mid_download@3")
    bench.take(FRAMES)

    assert bench.listener.losses == ["the connection was cut"]
    assert len(bench.simulated.ledger.deliveries) == FRAMES + 2


@pytest.mark.parametrize("knows", ["tells_shots", "remembers_shot"])
def test_shot_whose_answer_was_lost_is_found_again(make_bench: MakeBench, knows: str) -> None:
    """A camera that tells of the picture afterwards: it is fetched, and no second one is taken for it."""
    bench = make_bench("lost_answer@2", behaviour={knows: True})
    frames = bench.take(FRAMES)

    assert [frame.sha256 for frame in frames] == bench.simulated.ledger.delivered()
    assert len(bench.simulated.ledger.taken) == FRAMES
    assert bench.listener.losses == []


@pytest.mark.parametrize("knows", ["tells_shots", "remembers_shot"])
def test_picture_before_is_not_taken_for_the_one_searched(make_bench: MakeBench, knows: str) -> None:
    """What the camera tells after a shot that was none is the last picture, which we have."""
    bench = make_bench("error_1@2", behaviour={knows: True})
    frames = bench.take(FRAMES)

    assert [frame.sha256 for frame in frames] == bench.simulated.ledger.delivered()
    assert len({frame.sha256 for frame in frames}) == FRAMES
    assert len(bench.listener.losses) == 1


@pytest.mark.parametrize("knows", ["tells_shots", "remembers_shot"])
def test_picture_before_is_not_taken_again_on_a_new_connection(make_bench: MakeBench, knows: str) -> None:
    """What the camera tells after the first shot of a connection, that was none, is a frame of the one before."""
    bench = make_bench("error_1@2", behaviour={knows: True})
    frames = bench.take(1) + bench.take(2)

    assert [frame.sha256 for frame in frames] == bench.simulated.ledger.delivered()
    assert len(bench.listener.losses) == 1


def test_picture_of_somebody_who_pressed_the_button_is_no_frame(make_bench: MakeBench) -> None:
    """The camera told of it before the shot that was none, whose picture it cannot be."""
    bench = make_bench("error_1@2", behaviour={"tells_shots": True})
    frames = bench.take(1)
    bench.simulated.model.call("camera", "actTakePicture", [], "1.0")
    frames += bench.take(2)

    asked_for = [name for place, name in enumerate(bench.simulated.ledger.taken) if place != 1]
    assert [each.name for each in bench.simulated.ledger.deliveries] == asked_for
    assert len(bench.listener.losses) == 1


def test_camera_that_refuses_again_and_again_is_connected_again(make_quick_bench: MakeBench) -> None:
    """After some refusals in a row the driver gives up the connection, not the pictures."""
    bench = make_quick_bench(*(f"error_40400@{number}" for number in range(1, 6)))
    frames = bench.take(1)

    assert len(bench.failures) == 1
    assert "4 times in a row" in bench.failures[0]
    assert [frame.sha256 for frame in frames] == bench.simulated.ledger.delivered()


def test_description_of_a_gigabyte_is_refused(make_bench: MakeBench) -> None:
    """The first attempt fails at its limit of size, the second succeeds."""
    bench = make_bench("huge_description@1")

    assert len(bench.take(1)) == 1
    assert "larger than allowed" in bench.failures[0]


def test_camera_with_another_clock_is_noticed(make_bench: MakeBench) -> None:
    """A clock that cannot be set and jumps by years shows in the pictures."""
    bench = make_bench(
        "another_clock@2", behaviour={"forbidden": frozenset({"setCurrentTime"}), "clock_offset_s": 3600.0}
    )
    bench.take(3)
    clock = [status for status in bench.listener.reports if status.camera_clock_offset_ns is not None]

    assert [status.reason for status in clock] == [
        "the camera's clock shows in its pictures",
        "a clock was set, the camera's or the box's",
    ]
    assert abs(clock[0].camera_clock_offset_ns / 1e9 - 3600) < 1.5
    assert abs(clock[1].camera_clock_offset_ns / 1e9 - 3600 + 5 * 365 * 86400) < 1.5
    assert any("does not let its clock be set" in reason for reason in bench.listener.reasons("clock"))


@pytest.mark.parametrize("mode", ["stills", "liveview"])
def test_camera_that_sends_the_same_picture_again_and_again_is_connected_again_once(
    make_bench: MakeBench, monkeypatch: pytest.MonkeyPatch, mode: str
) -> None:
    """It hangs: each copy is stored, and the flight says from where to where it stood still."""
    numbers = count(1)
    bench = make_bench(mode=mode, limits=LIMITS.model_copy(update={"frozen_s": 0.5}))
    for name in ("picture", "live_picture"):
        monkeypatch.setattr(
            CameraModel,
            name,
            lambda *_: drawn_picture(next(numbers) if bench.listener.reasons("frozen") else 0),
        )
    frames = bench.take(40)

    (failure,) = bench.failures
    assert failure == "The picture has not changed for 0.5 s, since frame 0; the camera is connected again."
    assert [frame.sequence for frame in frames] == list(range(40))
    moved = len([frame for frame in frames if frame.encoded == drawn_picture(0)])
    assert 2 < moved < 40
    assert {frame.encoded for frame in frames[:moved]} == {drawn_picture(0)}
    said = [(each.sequence, each.reason.partition(":")[0]) for each in bench.listener.reports if each.state == "frozen"]
    assert said == [(0, "the picture is the same after connecting again"), (moved, "the picture changes again")]


@pytest.mark.parametrize("thread", ["camera description", "qx10 watcher", "camera actTakePicture", "camera download"])
def test_system_that_has_no_thread_left_for_a_while_ends_no_recording(
    make_bench: MakeBench, monkeypatch: pytest.MonkeyPatch, thread: str
) -> None:
    """A call that cannot begin was not made: the camera is connected again, and no picture comes twice."""
    start, left = threading.Thread.start, [2]

    def refuse(started: threading.Thread) -> None:
        if started.name == thread and left[0]:
            left[0] -= 1
            raise RuntimeError("can't start new thread")
        start(started)

    monkeypatch.setattr(threading.Thread, "start", refuse)
    frames = make_bench().take(FRAMES)

    assert left == [0]
    assert len({frame.sha256 for frame in frames}) == FRAMES
