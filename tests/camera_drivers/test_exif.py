"""EXIF: every tag optional, garbage is nothing."""

from __future__ import annotations

from calendar import timegm
from collections.abc import Callable
from datetime import datetime

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from camera_drivers.exif import exif_time_ns, read_exif
from camera_drivers.jpeg import jpeg_facts
from flight_file.frame import Exif

MakeJpeg = Callable[..., bytes]


def exif_of(jpeg: bytes) -> Exif:
    """The tags of a JPEG."""
    return read_exif(jpeg_facts(jpeg).exif)


def test_all_tags_are_read(make_jpeg: MakeJpeg) -> None:
    """Focal length, exposure, aperture, ISO, and the time with its fraction and offset."""
    tags = {
        0x920A: 4.45,
        0x829A: 0.004,
        0x829D: 3.3,
        0x8827: 400,
        0x9003: "2018:05:04 12:34:56",
        0x9291: "123",
        0x9011: "+02:00",
    }
    assert exif_of(make_jpeg(tags)) == Exif(4.45, 0.004, 3.3, 400, "2018-05-04T12:34:56.123+02:00")


@pytest.mark.parametrize("tag", [0x920A, 0x829A, 0x829D])
def test_zero_is_no_value(make_jpeg: MakeJpeg, tag: int) -> None:
    """Cameras write 0 where they do not know; that is no focal length, no exposure, no aperture."""
    assert exif_of(make_jpeg({tag: 0.0})) == Exif()


@pytest.mark.parametrize(
    ("date", "expected"),
    [
        ("2018:05:04 12:34:56", "2018-05-04T12:34:56"),
        ("0000:00:00 00:00:00", None),
        ("2018:13:04 12:34:56", None),
        ("    :  :     :  :  ", None),
        ("yesterday", None),
    ],
)
def test_time_is_believed_only_if_it_is_one(make_jpeg: MakeJpeg, date: str, expected: str | None) -> None:
    """What cameras with an unset clock write is no time."""
    assert exif_of(make_jpeg({0x9003: date})).datetime == expected


@pytest.mark.parametrize(
    ("fraction", "offset", "expected"),
    [("5", "Z", ".5Z"), ("x", "elsewhere", ""), ("", "-03:30", "-03:30"), ("1234567890", "", "")],
)
def test_fraction_and_offset_are_taken_only_if_they_are_such(
    make_jpeg: MakeJpeg, fraction: str, offset: str, expected: str
) -> None:
    """Nonsense in one of the two does not cost the time itself."""
    tags = {0x9003: "2018:05:04 12:34:56", 0x9291: fraction, 0x9011: offset}

    assert exif_of(make_jpeg(tags)).datetime == "2018-05-04T12:34:56" + expected


def test_picture_without_exif_has_no_tags(make_jpeg: MakeJpeg) -> None:
    """No block, no values."""
    assert exif_of(make_jpeg()) == Exif()


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_block_raises_nothing_and_warns_of_nothing(make_jpeg: MakeJpeg, data: st.DataObject) -> None:
    """Whatever bytes of the block are others or missing, the result is an Exif."""
    tags = {0x920A: 4.45, 0x829A: 0.004, 0x8827: 400, 0x9003: "2018:05:04 12:34:56", 0x9291: "1"}
    block = bytearray(jpeg_facts(make_jpeg(tags)).exif)
    for _ in range(data.draw(st.integers(1, 8))):
        block[data.draw(st.integers(0, len(block) - 1))] = data.draw(st.integers(0, 255))

    assert isinstance(read_exif(bytes(block[: data.draw(st.integers(0, len(block)))])), Exif)


@settings(deadline=None)
@given(block=st.binary(max_size=400))
@example(block=b"Exif\x00\x00")
@example(block=b"Exif\x00\x00II*\x00\xff\xff\xff\xff")
def test_any_bytes_may_be_given(block: bytes) -> None:
    """Garbage is the same as nothing."""
    assert isinstance(read_exif(b"Exif\x00\x00" + block), Exif)
    assert isinstance(read_exif(block), Exif)


@given(moment=st.datetimes(datetime(1970, 1, 1), datetime(9999, 12, 31)))  # noqa: DTZ001 - EXIF has no zone
def test_time_without_offset_is_utc(moment: datetime) -> None:
    """Nanoseconds since 1970 of a naive time, to the microsecond that Python can say."""
    text = moment.isoformat(timespec="microseconds")
    seconds, fraction = divmod(exif_time_ns(text) or 0, 10**9)

    assert seconds == timegm(moment.timetuple())
    assert fraction == moment.microsecond * 1000


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1970-01-01T00:00:01.000000001", 1_000_000_001),
        ("1970-01-01T02:00:00+02:00", 0),
        ("1970-01-01T00:00:00.5Z", 500_000_000),
        (None, None),
        ("1970-02-30T00:00:00", None),
        ("noon", None),
    ],
)
def test_times_are_exact(text: str | None, expected: int | None) -> None:
    """Nine decimals, offsets, and no number for what is no time."""
    assert exif_time_ns(text) == expected
