"""A JPEG's markers."""

from __future__ import annotations

from collections.abc import Callable

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from camera_drivers.jpeg import JpegFacts, jpeg_end, jpeg_facts

MakeJpeg = Callable[..., bytes]


def test_size_is_read_from_the_header(make_jpeg: MakeJpeg) -> None:
    """Width and height, without decoding."""
    facts = jpeg_facts(make_jpeg())

    assert (facts.width_px, facts.height_px, facts.whole) == (64, 48, True)


def test_cut_picture_keeps_its_size_but_is_not_whole(make_jpeg: MakeJpeg) -> None:
    """What the header says is still true when the end is missing."""
    facts = jpeg_facts(make_jpeg()[:-10])

    assert (facts.width_px, facts.height_px, facts.whole) == (64, 48, False)


def test_zeros_behind_the_end_are_allowed(make_jpeg: MakeJpeg) -> None:
    """Some cameras pad their files."""
    assert jpeg_facts(make_jpeg() + bytes(100)).whole


@given(data=st.binary(max_size=300))
def test_any_bytes_may_be_given(data: bytes) -> None:
    """What is no JPEG has no size and is not whole."""
    facts = jpeg_facts(data)

    assert facts == JpegFacts(None, None, b"", whole=False) or data.startswith(b"\xff\xd8")
    assert isinstance(jpeg_facts(b"\xff\xd8" + data), JpegFacts)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_headers_raise_nothing(make_jpeg: MakeJpeg, data: st.DataObject) -> None:
    """Any byte of a picture may be any other."""
    jpeg = bytearray(make_jpeg())
    jpeg[data.draw(st.integers(0, len(jpeg) - 1))] = data.draw(st.integers(0, 255))

    assert isinstance(jpeg_facts(bytes(jpeg)), JpegFacts)


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
