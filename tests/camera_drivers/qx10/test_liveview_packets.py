"""The liveview's parser: packets in, pictures out, whatever lies between."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from camera_drivers.qx10.liveview_packets import HEADER_BYTES, LivePicture, LiveviewParser
from camera_drivers.qx10.simulator.liveview_stream import information_packet, packet

# A JPEG as short as one can be that its markers make sense: a table, a scan with stuffing and a restart, an end.
SCANS = st.binary(max_size=400).map(lambda data: data.replace(b"\xff", b"\xff\x00"))
JPEGS = SCANS.map(lambda scan: b"\xff\xd8\xff\xdb\x00\x04ab\xff\xda\x00\x03c" + scan + b"\xff\xd0" + b"x\xff\xd9")
PICTURES = st.builds(LivePicture, st.integers(0, 65535), st.integers(0, 2**32 - 1), JPEGS)

START = b"\x24\x35\x68\x79"
LOOKALIKES = st.builds(
    lambda size, tail: b"\xff\x01" + bytes(6) + START + size.to_bytes(3, "big") + b"\x00" + bytes(120) + tail,
    st.integers(0, 2**24 - 1),
    st.sampled_from((b"", b"\xff\xd8", b"\xff\xd8\xff\xda\x00\x02ab")),
)
JUNK = st.one_of(
    st.binary(max_size=300),
    st.sampled_from((b"", b"\xff", b"\xff\x01", START, b"\xff\x01" + bytes(6) + START, information_packet(7))),
    LOOKALIKES,
    # A packet that breaks off, in its header or in its picture.
    PICTURES.flatmap(
        lambda each: st.integers(0, HEADER_BYTES + len(each.jpeg) - 1).map(lambda cut: as_packet(each)[:cut])
    ),
)


def as_packet(picture: LivePicture) -> bytes:
    """A picture as the camera sends it, with junk after its end."""
    return packet(picture.number, picture.timestamp_ms, picture.jpeg)


def parsed(stream: bytes, sizes: list[int]) -> list[LivePicture]:
    """The pictures of a stream that comes in pieces of these sizes, over and over."""
    parser, found, position, turn = LiveviewParser(), [], 0, 0
    while position < len(stream):
        size = sizes[turn % len(sizes)]
        found += parser.feed(stream[position : position + size])
        position += size
        turn += 1
    return found


PIECES = st.lists(st.integers(7, 700), min_size=1, max_size=5)


@settings(deadline=None)
@given(pictures=st.lists(PICTURES, max_size=6), pieces=PIECES)
def test_pictures_of_a_clean_stream_come_in_order(pictures: list[LivePicture], pieces: list[int]) -> None:
    """However the stream is cut into pieces, and without the junk that rounds them up."""
    assert parsed(b"".join(map(as_packet, pictures)), pieces) == pictures


@settings(max_examples=200, deadline=None)
@given(parts=st.lists(st.tuples(JUNK, PICTURES), max_size=5), last=JUNK, pieces=PIECES)
def test_junk_between_packets_costs_no_picture_and_adds_no_byte(
    parts: list[tuple[bytes, LivePicture]], last: bytes, pieces: list[int]
) -> None:
    """Junk, headers that announce too much, packets that break off: each whole packet gives its picture, no more."""
    stream = b"".join(junk + as_packet(picture) for junk, picture in parts) + last
    found = parsed(stream, pieces)

    assert found == [picture for _, picture in parts]


@settings(deadline=None)
@given(first=PICTURES, second=PICTURES, cut=st.integers(1, 200))
def test_packet_that_breaks_off_costs_only_itself(first: LivePicture, second: LivePicture, cut: int) -> None:
    """The end of a packet is missing, and the next one follows at once."""
    whole = packet(first.number, first.timestamp_ms, first.jpeg)
    stream = whole[: HEADER_BYTES + max(0, len(first.jpeg) - cut)] + as_packet(second)

    assert parsed(stream, [64]) == [second]


@settings(deadline=None)
@given(stream=st.binary(max_size=2000), pieces=PIECES)
def test_any_bytes_may_come(stream: bytes, pieces: list[int]) -> None:
    """Nothing is raised, and nothing is made up."""
    assert parsed(stream, pieces) == []


def test_buffer_does_not_grow_on_junk() -> None:
    """Megabytes without a packet leave nothing behind but what may be the beginning of one."""
    parser = LiveviewParser()
    for _ in range(64):
        parser.feed(bytes(65536))

    assert len(parser._buffer) < 2 * HEADER_BYTES
