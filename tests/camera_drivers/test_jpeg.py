"""A JPEG's markers, and its EXIF: every tag is optional, garbage is nothing."""

from __future__ import annotations

import struct
from collections.abc import Callable

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from camera_drivers.exif import exif_time_ns, read_exif
from camera_drivers.jpeg import JpegFacts, jpeg_end, jpeg_facts
from flight_file.frame import Exif

MakeJpeg = Callable[..., bytes]


@pytest.mark.parametrize(("less", "more", "whole"), [(0, 0, True), (10, 0, False), (0, 100, True)])
def test_size_is_read_from_the_header(make_jpeg: MakeJpeg, less: int, more: int, *, whole: bool) -> None:
    """Without decoding; it is still true when the end is missing, and some cameras pad their files with zeros."""
    jpeg = make_jpeg()
    facts = jpeg_facts(jpeg[: len(jpeg) - less] + bytes(more))

    assert (facts.width_px, facts.height_px, facts.whole) == (64, 48, whole)


def test_end_is_where_the_markers_lead(make_jpeg: MakeJpeg) -> None:
    """Neither a thumbnail's end nor one in the junk behind is taken for it; a picture that is cut has none."""
    jpeg = make_jpeg({0x9003: "2018:05:04 12:00:00"})
    thumbnail = b"\xff\xe2" + (len(jpeg) + 2).to_bytes(2, "big") + jpeg
    nested = jpeg[:2] + thumbnail + jpeg[2:]

    assert jpeg_end(nested + b"junk\xff\xd9") == len(nested)
    assert jpeg_end(b"abc" + nested, 3) == len(nested) + 3
    assert all(jpeg_end(nested[:cut]) is None for cut in range(len(nested)))


@given(data=st.binary(max_size=300))
@example(data=b"\xff\xff\xff\xd0\xff\xd9")  # fill bytes, and a marker that stands alone
def test_any_bytes_may_be_given(data: bytes) -> None:
    """What is no JPEG has no size and is not whole; an end is within the data."""
    facts = jpeg_facts(data)

    assert facts == JpegFacts(None, None, b"", whole=False) or data.startswith(b"\xff\xd8")
    for some in (data, b"\xff\xd8" + data, b"\xff\xd8\xff\xda\x00\x02" + data):
        end = jpeg_end(some)
        assert isinstance(jpeg_facts(some), JpegFacts)
        assert end is None or some[end - 2 : end] == b"\xff\xd9"


NOON = {0x9003: "2018:05:04 12:34:56"}
TAGS: list[tuple[dict[int, object], Exif]] = [
    (
        {0x920A: 4.45, 0x829A: 0.004, 0x829D: 3.3, 0x8827: 400, **NOON, 0x9291: "123", 0x9011: "+02:00"},
        Exif(4.45, 0.004, 3.3, 400, "2018-05-04T12:34:56.123+02:00"),
    ),
    # Cameras write 0 where they do not know.
    ({}, Exif()),
    ({0x920A: 0.0, 0x829A: 0.0, 0x829D: 0.0}, Exif()),
    # A clock that was never set.
    ({0x9003: "0000:00:00 00:00:00"}, Exif()),
    ({0x9003: "2018:13:04 12:34:56"}, Exif()),
    ({0x9003: "    :  :     :  :  "}, Exif()),
    ({0x9003: "yesterday"}, Exif()),
    # A fraction or an offset that is none does not cost the time.
    ({**NOON, 0x9291: "5", 0x9011: "Z"}, Exif(datetime="2018-05-04T12:34:56.5Z")),
    ({**NOON, 0x9291: "", 0x9011: "-03:30"}, Exif(datetime="2018-05-04T12:34:56-03:30")),
    ({**NOON, 0x9291: "x", 0x9011: "elsewhere"}, Exif(datetime="2018-05-04T12:34:56")),
    ({**NOON, 0x9291: "1234567890"}, Exif(datetime="2018-05-04T12:34:56")),
]


@pytest.mark.parametrize(("tags", "expected"), TAGS)
def test_tags_are_read_and_what_is_no_value_is_none(
    make_jpeg: MakeJpeg, tags: dict[int, object], expected: Exif
) -> None:
    """Focal length, exposure, aperture, ISO, and the time with its fraction and offset."""
    assert read_exif(jpeg_facts(make_jpeg(tags)).exif) == expected


@pytest.mark.parametrize(
    ("tag", "kind", "value", "expected"),
    [
        (0x829A, 12, struct.pack("<d", 2.5), Exif(exposure_s=2.5)),
        (0x829A, 12, struct.pack("<d", 1e300), Exif()),
        (0x829A, 12, struct.pack("<d", float("nan")), Exif()),
        (0x8827, 16, struct.pack("<Q", 2**64 - 1), Exif()),
    ],
)
def test_value_that_no_camera_has_is_none(tag: int, kind: int, value: bytes, expected: Exif) -> None:
    """An exposure of ages or a sensitivity of twenty digits, in types that hold them: doubles and 64-bit integers."""
    offset = 26
    first = struct.pack("<2sHIHHHIII", b"II", 42, 8, 1, 0x8769, 4, 1, offset, 0)
    own = struct.pack("<HHHIII", 1, tag, kind, 1, offset + 18, 0)

    assert read_exif(b"Exif\0\0" + first + own + value) == expected


@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_block_raises_nothing_and_warns_of_nothing(make_jpeg: MakeJpeg, data: st.DataObject) -> None:
    """Whatever bytes of the block are others or missing, the result is an Exif."""
    tags = {0x920A: 4.45, 0x829A: 0.004, 0x8827: 400, 0x9003: "2018:05:04 12:34:56", 0x9291: "1"}
    block = bytearray(jpeg_facts(make_jpeg(tags)).exif)
    for _ in range(data.draw(st.integers(1, 8))):
        block[data.draw(st.integers(0, len(block) - 1))] = data.draw(st.integers(0, 255))

    assert isinstance(read_exif(bytes(block[: data.draw(st.integers(0, len(block)))])), Exif)


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
