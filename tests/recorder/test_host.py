"""Clocks, also one that is set, by years, while the recorder runs or between two runs."""

from __future__ import annotations

import resource
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from flight_file.frame import ClockReading, LogClock
from recorder.host import ReportingClock, SystemClock, WallClock, jump_in_words, this_host
from recorder.housekeeping import by_age
from tests.recorder.helpers import ManualClock, StartDaemon

NOON_NS = 1_525_435_200_000_000_000  # 2018-05-04T12:00:00Z
YEARS_NS = 10 * 365 * 86400 * 10**9


def test_system_clock_waits_and_is_interrupted() -> None:
    """It sleeps until the time has come, but not when `stop` is set."""
    clock, stop = SystemClock(), threading.Event()
    start = clock.read()
    clock.wait_until(start.monotonic_ns + 20_000_000, stop)
    waited_ns = clock.read().monotonic_ns - start.monotonic_ns
    stop.set()
    clock.wait_until(start.monotonic_ns + 10**12, stop)

    assert waited_ns >= 19_000_000
    assert abs(start.realtime_ns - time.time_ns()) < 60 * 10**9


def test_health_of_a_machine_that_opens_no_more_files_is_not_known() -> None:
    """Its reports go on without temperatures; what needs no file is still there."""
    host = this_host()
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, hard))
    try:
        known = host.temperatures_c(), host.free_bytes(Path("/")), host.clock_state()
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))

    assert known[0] == {}
    assert known[1]
    assert known[2].startswith("system")


def test_driver_that_only_waits_can_be_heard() -> None:
    """A replay whose next picture is an hour away says every few seconds that it waits."""
    heard, clock = list[str](), ManualClock(0)
    ReportingClock(clock, SimpleNamespace(waiting=heard.append)).wait_until(3600 * 10**9, threading.Event())

    assert clock.read().monotonic_ns == 3600 * 10**9
    assert len(heard) == 1800


@pytest.mark.parametrize("jump_ns", [YEARS_NS, -YEARS_NS])
def test_jump_by_years_is_recorded_and_breaks_nothing(start_daemon: StartDaemon, jump_ns: int) -> None:
    """Status, log and health have it; log times and names stay in order over all segments, and no frame is lost."""
    daemon = start_daemon(storage={"segment_s": 1})
    daemon.feed(b"1", b"2", b"3")
    daemon.clock.set_realtime(daemon.clock.read().realtime_ns + jump_ns)
    daemon.feed(b"4", b"5", b"6", b"7")
    outcome = daemon.finish()
    log_times = [entry["log_ns"] for entry in daemon.messages("/camera/status")]
    frames = daemon.messages("/camera/frame")
    jumps = [entry for entry in daemon.messages("/camera/status") if "wall clock was set" in entry["reason"]]
    offsets = {entry["clock_offset"]["sec"] for entry in daemon.messages("/recorder/health")}

    assert [frame.encoded for frame in daemon.frames()] == [b"1", b"2", b"3", b"4", b"5", b"6", b"7"]
    assert len(outcome.paths) > 2
    assert list(outcome.paths) == sorted(outcome.paths)
    assert log_times == sorted(log_times)
    assert [entry["log_ns"] for entry in frames] == sorted(entry["log_ns"] for entry in frames)
    assert [entry["state"] for entry in jumps] == ["capturing"]
    assert jumps[0]["reason"] == jump_in_words(jump_ns)
    assert [event["by_s"] for event in daemon.events("wall_clock_set")] == [jump_ns / 1e9]
    assert offsets == {(NOON_NS + jump_ns) // 10**9}


@pytest.mark.parametrize("jump_ns", [YEARS_NS, -YEARS_NS, 0])
def test_new_recording_sorts_after_the_older_ones(start_daemon: StartDaemon, jump_ns: int) -> None:
    """Also if the box starts with a clock that is years behind, or in the same second."""
    first = start_daemon()
    first.feed(b"1")
    before = first.finish()
    second = start_daemon(realtime_ns=NOON_NS + jump_ns)
    second.feed(b"2")
    after = second.finish()
    names = [path.name for path in (*before.paths, *after.paths)]

    assert names == sorted(names)
    assert by_age(names[::-1]) == names


def test_slewing_is_no_jump_and_setting_is() -> None:
    """The kernel slews by at most half a thousandth; 50 ms at once means that the clock was set."""
    wall_clock = WallClock()
    readings = [(0, 0), (10**12 + 5 * 10**8, 10**12), (2 * 10**12 + 10**9, 2 * 10**12), (2 * 10**12, 2 * 10**12)]
    slewed = [wall_clock.jump_ns(ClockReading(*pair)) for pair in readings]

    assert slewed == [0, 0, 0, -(10**9)]
    assert jump_in_words(-50_000_000) == "the wall clock was set back by 0.050 s"


def test_log_time_follows_a_clock_that_is_set_right_from_the_next_segment_on() -> None:
    """A board without a battery starts in 1970; once its clock is right, new segments use it. It never goes back."""
    log_clock = LogClock()
    log_clock.begin_segment(ClockReading(0, 100))
    within = log_clock.time_ns(ClockReading(NOON_NS, 200))
    log_clock.begin_segment(ClockReading(NOON_NS, 200))
    right = log_clock.time_ns(ClockReading(NOON_NS + 50, 250))
    log_clock.begin_segment(ClockReading(5, 300))
    set_back = log_clock.time_ns(ClockReading(15, 310))

    assert (within, right, set_back) == (100, NOON_NS + 50, NOON_NS + 110)


def test_retention_asks_no_wall_clock() -> None:
    """Recordings of 2099 and 1970 are ordered by their names, which never sort before older ones."""
    names = ["20991231T235959Z_0000.mcap", "20991231T235960Z_0000.mcap", "20180504T120000Z-2_0001.mcap"]
    names += ["20180504T120000Z_0010.mcap", "20180504T120000Z_0009.mcap", "20180504T120000Z_0009.recovered.mcap"]

    assert by_age([*names, "holiday_0000.mcap", "20180504T120000Z_0000.mcap.part", "x"]) == [
        "20180504T120000Z_0009.mcap",
        "20180504T120000Z_0009.recovered.mcap",
        "20180504T120000Z_0010.mcap",
        "20180504T120000Z-2_0001.mcap",
        "20991231T235959Z_0000.mcap",
        "20991231T235960Z_0000.mcap",
    ]
