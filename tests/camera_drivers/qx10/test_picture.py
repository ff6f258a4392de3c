"""A picture's faults, and when it was taken."""

from __future__ import annotations

import struct

import pytest

from camera_drivers.qx10.picture import FrameMaker, fault_of, middle_of_exposure
from camera_drivers.qx10.simulator.pictures import drawn_picture, with_exif, without_exif
from flight_file.frame import ClockReading, Exif, HostTimes

S = 1_000_000_000
JPEG = drawn_picture(1)


@pytest.mark.parametrize(
    ("jpeg", "fault"),
    [
        (JPEG, ""),
        (JPEG + bytes(1000), ""),
        (JPEG + drawn_picture(2), ""),
        (JPEG[: len(JPEG) // 2], "the picture is cut short"),
        (JPEG[:-1], "the picture is cut short"),
        (b"", "the picture is no JPEG"),
        (b"<html>", "the picture is no JPEG"),
        (JPEG.replace(struct.pack(">HH", 480, 640), struct.pack(">HH", 60000, 60000)), "larger than any"),
        (JPEG.replace(b"\xff\xdb", b"\xff\xee"), "the picture is damaged"),
    ],
    ids=["whole", "padded", "two", "half", "last byte", "empty", "page", "bomb", "no tables"],
)
def test_fault_is_named(jpeg: bytes, fault: str) -> None:
    """What can be shown has none; what is cut, damaged, huge or something else has."""
    assert fault in fault_of(jpeg)
    assert bool(fault) == bool(fault_of(jpeg))


def times(before_s: float, answered_s: float, *, jump_s: float = 0.0) -> HostTimes:
    """The box's clocks; its wall clock is set while the camera works."""

    def at(seconds: float, ahead: float = 0.0) -> ClockReading:
        return ClockReading(round((100 + seconds + ahead) * S), round(seconds * S))

    return HostTimes(at(before_s), at(answered_s, jump_s), at(answered_s + 1, jump_s))


def test_exposure_is_in_the_middle_as_uncertain_as_the_rest_is_long() -> None:
    """Two seconds of which one is the exposure: half a second to either side of the middle."""
    assert middle_of_exposure(times(1, 3), Exif()) == (2 * S, round(2 * S / 12**0.5))
    assert middle_of_exposure(times(1, 3), Exif(exposure_s=1.0)) == (2 * S, round(1 * S / 12**0.5))
    assert middle_of_exposure(times(1, 3), Exif(exposure_s=30.0)) == (2 * S, 0)


def test_wall_clock_that_jumps_does_not_stretch_the_exposure() -> None:
    """The monotonic clock carries the interval; the wall clock is that of the answer."""
    frame = FrameMaker().frame(JPEG, times(1, 3, jump_s=1e6), zoom_position=None)

    assert frame.captured_ns == 102 * S + 10**6 * S
    assert frame.captured_sigma_ns == round(2 * S / 12**0.5)


def test_lost_picture_leaves_a_gap() -> None:
    """The numbers go on."""
    maker = FrameMaker()
    maker.skip()

    assert maker.frame(JPEG, times(1, 2), zoom_position=3.0).sequence == 1


def test_exif_of_the_simulated_camera_is_spliced_in() -> None:
    """The coded picture stays byte for byte, and comes back when the EXIF goes."""
    from datetime import UTC, datetime  # noqa: PLC0415 - used here alone

    from camera_drivers.qx10.simulator.pictures import Taken  # noqa: PLC0415 - the same

    spliced = with_exif(JPEG, Taken(3, datetime(2026, 1, 2, tzinfo=UTC), 12.5, 0.01))
    frame = FrameMaker().frame(spliced, times(1, 2), zoom_position=None)

    assert without_exif(spliced) == JPEG
    assert (frame.exif.focal_length_mm, frame.exif.datetime) == (12.5, "2026-01-02T00:00:00")
