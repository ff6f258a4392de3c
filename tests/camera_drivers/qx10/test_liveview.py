"""The liveview of a simulated camera, and the times of its pictures."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from camera_drivers.errors import CameraError
from camera_drivers.qx10.liveview import Delay
from camera_drivers.qx10.simulator.pictures import drawn_picture

MS = 1_000_000

MakeBench = Callable[..., Any]


def test_frames_are_the_pictures_of_the_stream(make_bench: MakeBench) -> None:
    """Each in order, without the junk after its end, with times that never run back."""
    frames = make_bench(mode="liveview").take(5)

    assert [frame.jpeg for frame in frames] == [drawn_picture(number) for number in range(5)]
    assert [frame.sequence for frame in frames] == list(range(5))
    captured = [frame.captured_ns for frame in frames]
    assert captured == sorted(captured)
    assert all(frame.captured_sigma_ns for frame in frames)


@pytest.mark.parametrize(
    ("fault", "reports"), [("liveview_junk@3", 0), ("liveview_stall@3", 1), ("liveview_restart@3", 1)]
)
def test_stream_goes_on_after_a_fault(make_bench: MakeBench, fault: str, reports: int) -> None:
    """Junk costs nothing; a stream that ends or stalls begins again on the same connection."""
    bench = make_bench(fault, mode="liveview")
    frames = bench.take(6)

    assert len({frame.sha256 for frame in frames}) == 6
    assert len(bench.listener.reasons("liveview")) == reports
    assert bench.failures == []


def test_stop_ends_the_stream(make_bench: MakeBench) -> None:
    """None soon after stopping was asked for, though no picture comes."""
    bench = make_bench("liveview_stall@2", mode="liveview")
    stop = threading.Event()
    with bench.camera as camera:
        assert camera.next_frame(stop) is not None
        threading.Timer(0.1, stop.set).start()
        assert camera.next_frame(stop) is None

    assert bench.simulated.model.liveview is False


def test_camera_without_liveview_is_told_of(make_bench: MakeBench) -> None:
    """It is connected again rather than left without pictures."""
    bench = make_bench(mode="liveview", behaviour={"forbidden": frozenset({"startLiveview"})})
    with bench.camera as camera, pytest.raises(CameraError, match="refuses a liveview"):
        camera.next_frame(threading.Event())


@given(delays=st.lists(st.integers(0, 900), min_size=1, max_size=30))
def test_bursts_do_not_move_the_exposure(delays: list[int]) -> None:
    """Pictures at an even pace, each more or less late, are placed as if the quickest so far were not late at all."""
    delay = Delay()
    arrived, least = 0, 10**6
    for index, late in enumerate(delays):
        shown = index * 70
        arrived = max(arrived, 5000 + shown + late)
        least = min(least, arrived - shown)
        middle, sigma = delay.taken(shown, arrived * MS)
        # The quickest is forgotten at the pace at which clocks drift.
        assert 0 <= middle - (shown + least) * MS <= arrived * MS * Delay.DRIFT + 1
        assert sigma == Delay.SIGMA_NS


def test_timestamps_that_begin_anew_are_believed() -> None:
    """A jump of the timestamps begins a new count."""
    delay = Delay()
    delay.taken(100_000, 5_000 * MS)

    assert delay.taken(0, 6_000 * MS)[0] == 6_000 * MS
