"""A JPEG's markers, and its EXIF: every tag is optional, garbage is nothing."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import HealthCheck, given, settings
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


@given(data=st.binary(max_size=300))
def test_any_bytes_may_be_given(data: bytes) -> None:
    """What is no JPEG has no size and is not whole."""
    facts = jpeg_facts(data)

    assert facts == JpegFacts(None, None, b"", whole=False) or data.startswith(b"\xff\xd8")
    assert isinstance(jpeg_facts(b"\xff\xd8" + data), JpegFacts)


def test_end_is_where_the_markers_lead(make_jpeg: MakeJpeg) -> None:
    """Neither a thumbnail's end nor one in the junk behind is taken for it; a picture that is cut has none."""
    jpeg = make_jpeg({0x9003: "2018:05:04 12:00:00"})
    thumbnail = b"\xff\xe2" + (len(jpeg) + 2).to_bytes(2, "big") + jpeg
    nested = jpeg[:2] + thumbnail + jpeg[2:]

    assert jpeg_end(nested + b"junk\xff\xd9") == len(nested)
    assert jpeg_end(b"abc" + nested, 3) == len(nested) + 3
    assert all(jpeg_end(nested[:cut]) is None for cut in range(len(nested)))


@given(data=st.binary(max_size=200))
def test_end_of_any_bytes_may_be_asked(data: bytes) -> None:
    """Nothing is raised, and an end is within the data."""
    for given_bytes in (data, b"\xff\xd8" + data, b"\xff\xd8\xff\xda\x00\x02" + data):
        end = jpeg_end(given_bytes)
        assert end is None or given_bytes[end - 2 : end] == b"\xff\xd9"


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


@pytest.mark.parametrize("tags", [{}, {0x920A: 0.0}, {0x829A: 0.0}, {0x829D: 0.0}])
def test_zero_is_no_value(make_jpeg: MakeJpeg, tags: dict[int, object]) -> None:
    """Cameras write 0 where they do not know; that is no focal length, no exposure, no aperture, as if absent."""
    assert exif_of(make_jpeg(tags)) == Exif()


@pytest.mark.parametrize("date", ["0000:00:00 00:00:00", "2018:13:04 12:34:56", "    :  :     :  :  ", "yesterday"])
def test_time_is_believed_only_if_it_is_one(make_jpeg: MakeJpeg, date: str) -> None:
    """What cameras with an unset clock write is no time."""
    assert exif_of(make_jpeg({0x9003: date})).datetime is None


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


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
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
