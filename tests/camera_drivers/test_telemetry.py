"""A GoPro's telemetry: where and when, on the film's clock, whatever a camera or an accident puts there."""

from __future__ import annotations

import struct
from contextlib import suppress
from datetime import datetime, timedelta
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camera_drivers.errors import ReplayError
from camera_drivers.replay.camera import open_source
from camera_drivers.replay.gpmf import GpsSample, Payload, parse
from camera_drivers.replay.telemetry import Fixes, TimedPayload, times_of
from camera_drivers.replay.video_clocks import Believed
from fixtures.telemetry import (
    BEGAN,
    PLACE,
    device,
    entry,
    flight_payloads,
    flown,
    gps5,
    gps9,
    nest,
    readout,
    with_telemetry,
)
from flight_file.frame import MAX_TIME_NS, Frame, GpsFix
from recorder.host import SimulatedClock
from tests.videos import film

SAMPLE = Path(__file__).parents[3] / "shared" / "data" / "gopro" / "max-heromode.mp4"
BEGAN_NS = int(BEGAN.timestamp()) * 10**9
TICKS_OF_5_S = tuple(range(0, 5 * 12_000, 1_192))  # the last picture lasts 400


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A film of five seconds; its creation time is local time that is labelled UTC."""
    metadata = {"creation_time": "2026-05-04T11:30:17Z"}
    return film(tmp_path_factory.mktemp("plain") / "a.mp4", ticks=TICKS_OF_5_S, metadata=metadata)


def played(*paths: Path, believed: Believed | None = None) -> tuple[list[Frame], list[GpsFix]]:
    """All frames of a replay, and the positions that come with them."""
    source = open_source(paths, rate_hz=None, clock=SimulatedClock(0), believed=believed)
    frames = [upcoming.take(SimulatedClock(0)) for upcoming in source.pictures()]
    return frames, [fix for frame in frames for fix in frame.fixes]


def facts(*paths: Path, believed: Believed | None = None) -> list[dict[str, str]]:
    """What each chapter says of itself."""
    source = open_source(paths, rate_hz=None, clock=SimulatedClock(0), believed=believed)
    return [dict(one.facts) for one in source.identity.originals]


def test_positions_are_read_as_the_format_has_them() -> None:
    """Scaled, with the payload's fix and precision, its time with the first of them."""
    found = parse(device(gps5([flown(0), flown(1)], BEGAN), nest("STRM", readout(20.6))))

    first, second = found.samples
    where = (first.latitude_deg, first.longitude_deg, first.altitude_m, first.speed_mps, first.speed_3d_mps)
    assert where == pytest.approx((*PLACE[:4], 50.04), abs=1e-6)
    assert (first.fix, first.dop, first.utc_ns, second.utc_ns) == (3, 1.5, BEGAN_NS, None)
    assert second.latitude_deg == pytest.approx(47.5003)
    assert found.readout_s == pytest.approx(0.0206)
    assert (found.device, found.has_gps, found.times_each, found.damaged) == ("GoPro Max", True, False, 0)


def test_each_sample_of_gps9_has_its_own_time_fix_and_precision() -> None:
    """It goes before the GPS5 that HERO11 writes beside it."""
    moments = [BEGAN + timedelta(seconds=0.1 * place) for place in range(3)]
    found = parse(device(gps5([flown(9)], None), gps9([flown(0)] * 3, moments, fix=2)))

    assert [sample.utc_ns for sample in found.samples] == [BEGAN_NS + place * 10**8 for place in range(3)]
    assert {(sample.fix, sample.dop, sample.altitude_m) for sample in found.samples} == {(2, 1.5, None)}
    assert found.times_each


@pytest.mark.parametrize(
    ("streams", "samples", "damaged"),
    [
        ([gps5([flown(0)], BEGAN, fix=0)], (GpsSample(),), 0),
        ([gps5([(0, 0, 0, 0, 0), flown(0)], BEGAN)], None, 0),
        ([gps5([flown(0)], b"5509100082240400")], None, 1),
        ([gps5([], b"5509100082240400", fix=0)], (), 0),
        ([gps5([(147.5, 8.25, 600, 50, 50)], BEGAN)], (GpsSample(),), 1),
        ([gps5([flown(0)] * 300, BEGAN)], (), 1),
        ([gps5([(0, 0, 0, 0, 0)] * 200, BEGAN)] * 2, (GpsSample(),) * 200, 1),
        ([gps5([flown(0)], BEGAN).replace(b"\0\x98\x96\x80", b"\0\0\0\0", 1)], (), 1),
        ([nest("STRM", entry("TYPE", "c", 1, b"lZ"), entry("GPS9", "?", 8, bytes(8)))], (), 1),
        ([nest("STRM", readout(float("nan")))], (), 1),
        ([gps9([flown(0)], [BEGAN]).replace(struct.pack(">i", 34_200_000), b"\x7f\0\0\0")], (GpsSample(),), 1),
        ([gps5([flown(0)], BEGAN)[:-8]], (), 1),
    ],
    ids=[
        "no fix",
        "a fix in the middle",
        "a time that is none",
        "nothing yet",
        "beyond the pole",
        "too many",
        "too many in two streams",
        "divided by zero",
        "a type that nobody knows",
        "no read-out time",
        "no time of day",
        "cut off",
    ],
)
def test_what_is_no_position_is_none_and_what_is_damaged_is_counted(
    streams: list[bytes], samples: tuple[GpsSample, ...] | None, damaged: int
) -> None:
    """As real cameras and real accidents leave it."""
    found = parse(device(*streams))

    assert found.damaged == damaged
    if samples is not None:
        assert found.samples == samples
    else:
        assert found.samples[-1].fix == 3
        assert all(sample.fix == 0 for sample in found.samples[:-1])


@given(seed=st.integers(0, 2**32 - 1), cut=st.booleans())
def test_a_damaged_payload_gives_what_is_whole_of_it(*, seed: int, cut: bool) -> None:
    """Wherever it is hit: places on Earth, numbers that are finite, and no exception."""
    rng = np.random.default_rng(seed)
    data = bytearray(device(gps5([flown(0)] * 4, BEGAN), gps9([flown(0)] * 4, [BEGAN] * 4), nest("STRM", readout(9))))
    for at in rng.integers(0, len(data), rng.integers(1, 6)):
        data[at] = int(rng.integers(0, 256))
    found = parse(bytes(data[: int(rng.integers(0, len(data)))] if cut else data))

    assert isinstance(found, Payload)
    for sample in found.samples:
        assert sample.fix in (0, 2, 3)
        if sample.fix:
            assert sample.latitude_deg is not None
            assert abs(sample.latitude_deg) <= 90
            assert sample.dop is None or 0 < sample.dop < 1000


def test_positions_stand_on_the_films_clock_and_gps_time_begins_the_flight(plain: Path, tmp_path: Path) -> None:
    """Also where the first time is stale, as in GoPro's own sample."""
    payloads = flight_payloads(5)
    payloads[0] = device(gps5([flown(0)] * 10, BEGAN - timedelta(seconds=1.4)))
    path = with_telemetry(plain, tmp_path / "a.mp4", payloads, of_camera=device(readout(20.6)))
    frames, fixes = played(path, believed=Believed(clock="gps"))
    (said,) = facts(path)

    assert [fix.captured_ns - BEGAN_NS for fix in fixes] == [place * 10**8 for place in range(50)]
    assert [fix.origin_ns for fix in fixes] == [place * 10**8 for place in range(50)]
    assert frames[0].captured_ns == BEGAN_NS
    assert {frame.captured_sigma_ns for frame in frames} == {round(10**9 / 12**0.5)}
    assert {round(frame.readout_s or 0, 4) for frame in frames} == {0.0206}
    assert (
        said["GPS time"]
        == "2026-05-04T09:30:00.000Z at the film's time 0, sigma 0.29 s, by 5 times, 1 of them more than 0.5 s off"
    )
    assert said["GPS"] == "50 positions, 0 samples without a fix, precision (DOP) 1.5 to 1.5"
    assert said["clocks"] == "the GPS time is 2 h 0 min 17 s behind the creation time"
    (typed,) = facts(path, believed=Believed(start="2026-05-04T09:30:02Z"))
    assert typed["clocks"].endswith("; the time that was typed is 2 s ahead of the GPS time")


def test_times_of_single_samples_leave_less_doubt(plain: Path, tmp_path: Path) -> None:
    """GPS9: the doubt is that of a tenth of a second."""
    payloads = [
        device(gps9([flown(0)] * 10, [BEGAN + timedelta(seconds=second + 0.1 * place) for place in range(10)]))
        for second in range(5)
    ]
    frames, _ = played(with_telemetry(plain, tmp_path / "a.mp4", payloads), believed=Believed(clock="gps"))

    assert frames[0].captured_ns == BEGAN_NS
    assert frames[0].captured_sigma_ns == round(10**8 / 12**0.5)


@pytest.mark.parametrize(
    ("payloads", "words"),
    [
        (flight_payloads(5, lost=range(5)), "no fix"),
        ([device(nest("STRM", readout(9)))] * 5, "this camera records no position"),
        ([], "it has no telemetry"),
    ],
    ids=["no fix", "HERO12", "no telemetry"],
)
def test_a_film_without_positions_is_said_to_have_none(
    plain: Path, tmp_path: Path, payloads: list[bytes], words: str
) -> None:
    """Its pictures are a flight like any other; GPS time is refused, saying why."""
    path = with_telemetry(plain, tmp_path / "a.mp4", payloads)
    frames, fixes = played(path)

    assert len(frames) == len(TICKS_OF_5_S)
    assert all(fix.latitude_deg is None for fix in fixes)
    with pytest.raises(ReplayError, match=f"has no GPS time .*{words}"):
        played(path, believed=Believed(clock="gps"))
    with pytest.raises(ReplayError, match="leave --utc-offset out"):
        played(path, believed=Believed(clock="gps", utc_offset="+02:00"))


def test_the_shift_of_a_chapters_telemetry_is_told(plain: Path, tmp_path: Path) -> None:
    """The first chapter that knows the time tells it for all of them."""
    first = with_telemetry(plain, tmp_path / "GX010123.MP4", flight_payloads(5, lost=range(5)))
    second = with_telemetry(plain, tmp_path / "GX020123.MP4", flight_payloads(5))
    third = with_telemetry(plain, tmp_path / "GX030123.MP4", flight_payloads(5, began=BEGAN + timedelta(seconds=6.3)))
    frames, fixes = played(first, second, third, believed=Believed(clock="gps"))
    said = facts(first, second, third)

    assert frames[0].captured_ns == BEGAN_NS - 5 * 10**9
    assert [one.get("GPS time", "").partition("; ")[2] for one in said] == [
        "",
        "",
        "1.30 s ahead of the chapters before",
    ]
    assert [fix.origin_file for fix in fixes] == [0] * 50 + [1] * 50 + [2] * 50
    assert all(after.captured_ns > before.captured_ns for before, after in pairwise(fixes))


@pytest.mark.parametrize("left", [0.3, 0.6, 0.9])
def test_of_a_copy_that_broke_off_the_telemetry_that_is_there_is_read(plain: Path, tmp_path: Path, left: float) -> None:
    """As its pictures are; what is cut is counted."""
    whole = with_telemetry(plain, tmp_path / "whole.mp4", flight_payloads(5), muxing={"movflags": "faststart"})
    path = tmp_path / "cut.mp4"
    path.write_bytes(whole.read_bytes()[: round(left * whole.stat().st_size)])
    frames, fixes = played(path)

    assert 0 < len(frames) <= len(TICKS_OF_5_S)
    assert fixes == played(whole)[1][: len(fixes)]
    lost = 5 - len(fixes) // 10
    assert lost > 0
    assert f"{lost} parts of it cannot be read" in facts(path)[0]["telemetry"]


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_film_with_damaged_telemetry_is_a_flight_all_the_same(
    plain: Path, tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    """Its pictures are all there, whatever stands in the other track or in what is said of the camera."""
    rng = np.random.default_rng(seed)
    payloads = [bytearray(each) for each in flight_payloads(5)]
    of_camera = bytearray(device(readout(20.6)))
    for each in (*payloads, of_camera):
        for at in rng.integers(0, len(each), 3):
            each[at] = int(rng.integers(0, 256))
    folder = tmp_path_factory.mktemp("damaged")
    path = with_telemetry(plain, folder / "a.mp4", [bytes(each) for each in payloads], of_camera=bytes(of_camera))
    frames, fixes = played(path)

    assert len(frames) == len(TICKS_OF_5_S)
    assert all(0 <= fix.captured_ns < 5 * 10**9 for fix in fixes)


@settings(max_examples=50)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_film_whose_boxes_are_damaged_is_read_or_refused(
    plain: Path, tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    """Whatever times and places they give the telemetry."""
    rng = np.random.default_rng(seed)
    folder = tmp_path_factory.mktemp("boxes")
    data = bytearray(with_telemetry(plain, folder / "a.mp4", flight_payloads(5)).read_bytes())
    track = data.rindex(b"GoPro MET")
    for at in rng.integers(track, len(data), 8):
        data[at] = int(rng.integers(0, 256))
    (folder / "a.mp4").write_bytes(data)
    with suppress(ReplayError):
        frames, fixes = played(folder / "a.mp4", believed=Believed(clock="gps"))
        assert all(0 <= each.captured_ns <= MAX_TIME_NS for each in (*frames, *fixes))


def test_no_time_is_told_that_no_flight_is_at() -> None:
    """Neither of a position nor of the film's beginning, whatever a file says of its payloads."""
    payload = parse(device(gps5([flown(0)], BEGAN)))
    timed = [TimedPayload(3, start_ns, 10**9, payload) for start_ns in (-1, 0, BEGAN_NS, MAX_TIME_NS + 1, 10**40)]

    assert [fix.captured_ns for fix in Fixes(iter(timed), 0, 0).up_to(10**40)] == [0, BEGAN_NS]
    assert [list(times_of(each)) for each in timed] == [
        [(BEGAN_NS + 1, 10**9)],
        [(BEGAN_NS, 10**9)],
        [(0, 10**9)],
        [],
        [],
    ]


def test_boxes_whose_length_cannot_be_say_nothing_of_the_camera(plain: Path, tmp_path: Path) -> None:
    """The film is read all the same; a length of 0 reaches to the end of the file."""
    path = with_telemetry(plain, tmp_path / "a.mp4", flight_payloads(5), of_camera=device(readout(20.6)))
    data = bytearray(path.read_bytes())
    at = data.rindex(b"GPMF") - 4
    for length in (0, 1, 4, 2**31):
        data[at : at + 4] = struct.pack(">I", length)
        path.write_bytes(data)
        frames, _ = played(path)

        assert len(frames) == len(TICKS_OF_5_S)
        assert {frame.readout_s is None for frame in frames} == {length != 0}


@pytest.mark.skipif(not SAMPLE.exists(), reason="GoPro's public sample is not here")
def test_gopros_own_sample_is_read() -> None:
    """Carlsbad, at a walk; a first time that is 1.4 s stale; a creation time in local time."""
    frames, fixes = played(SAMPLE, believed=Believed(clock="gps"))
    (said,) = facts(SAMPLE)
    assert open_source([SAMPLE], rate_hz=None, clock=SimulatedClock(0)).identity.model == "GoPro Max"

    assert (len(frames), len(fixes)) == (315, 191)
    assert all(
        33.12 < (fix.latitude_deg or 0) < 33.13 and -117.33 < (fix.longitude_deg or 0) < -117.32 for fix in fixes
    )
    assert all(0.5 < (fix.speed_mps or 0) < 2 for fix in fixes)
    assert all(after.captured_ns > before.captured_ns for before, after in pairwise(fixes))
    assert (
        frames[0].captured_ns == int(datetime.fromisoformat("2019-11-18T23:45:15Z").timestamp()) * 10**9 + 425_000_000
    )
    assert frames[0].readout_s == pytest.approx(0.0206, abs=1e-4)
    assert "11 times, 1 of them more than 0.5 s off" in said["GPS time"]
    assert said["clocks"].endswith("the GPS time is 7 h 59 min 43.4 s ahead of the creation time")
