"""A JPEG's markers."""

from __future__ import annotations

from collections.abc import Callable

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from camera_drivers.jpeg import JpegFacts, jpeg_facts

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
