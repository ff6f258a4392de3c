"""Many frames at once: a frame's readings do not depend on the others."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from decoder.imaging.panel_pictures import panel_from_attachments
from decoder.imaging.picture_block import PictureBlock, TopOfFrame, batch_frames
from decoder.imaging.pictures import FramePicture, GreyPicture, grey_picture
from decoder.instruments.frame_batch import Outcome, Unread, batches, read_batch
from decoder.instruments.panel_reader import PanelReader
from decoder.instruments.reading import FrameReadings
from decoder.learning.fit import reader_from_panel, tune
from decoder.panel.errors import PictureError
from decoder.panel.vocabulary import Method
from flight_file.documents import picture_header
from flight_file.reader import Flight, open_flight
from tests.jpegs import encoded
from tests.programs import A2


@pytest.fixture(scope="module")
def flight() -> Flight:
    """The committed flight whose needles touch, hide each other and are lost in reflections."""
    return open_flight([A2])


@pytest.fixture(scope="module")
def pictures(flight: Flight) -> list[GreyPicture]:
    """Its frames."""
    return [grey_picture(frame.encoded) for frame in flight.frames()]


@pytest.fixture(scope="module")
def reader(flight: Flight, pictures: list[GreyPicture]) -> PanelReader:
    """A reader tuned to it."""
    panel = panel_from_attachments(flight.attachments, flight="thesis_a2.mcap")
    return tune(reader_from_panel(panel, Method.NORMXCORR), pictures)


def read_in(reader: PanelReader, pictures: Sequence[GreyPicture], cuts: Sequence[int]) -> list[str]:
    """All that is read of each frame, as text to the last bit, in batches that end at the cuts."""
    ends = [*sorted(cuts), len(pictures)]
    firsts = [0, *sorted(cuts)]
    batches = [pictures[first:end] for first, end in zip(firsts, ends, strict=True)]
    return [as_text(read) for batch in batches for read in reader.read([FramePicture(one) for one in batch])]


def as_text(read: FrameReadings | PictureError | Outcome) -> str:
    """Every number of a frame's readings, in hexadecimal."""
    assert isinstance(read, FrameReadings)
    rows = {
        name: [one.status, *(value.hex() for value in (one.angle_deg, one.sigma_deg, one.score))]
        for name, one in read.readings.items()
    }
    return json.dumps([rows, [value.hex() for value in read.alignment.elements]])


@pytest.fixture(scope="module")
def together(reader: PanelReader, pictures: list[GreyPicture]) -> list[str]:
    """The flight read in one batch."""
    return read_in(reader, pictures, [])


@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(order=st.permutations(range(21)), cuts=st.lists(st.integers(0, 21), max_size=8))
def test_company_changes_no_bit(
    reader: PanelReader, pictures: list[GreyPicture], together: list[str], order: list[int], cuts: list[int]
) -> None:
    """In whatever order frames come, and however they are cut into batches, empty ones too, each is read the same."""
    shuffled = read_in(reader, [pictures[index] for index in order], cuts)

    assert dict(zip(order, shuffled, strict=True)) == dict(enumerate(together))


def test_lost_and_damaged_frames_leave_their_batch_alone(
    flight: Flight, reader: PanelReader, pictures: list[GreyPicture], together: list[str]
) -> None:
    """A frame without a panel, and a picture that cannot be opened, have a reason; those beside them are as ever."""
    (batch,) = batches(flight.frames(), 30)
    black = coloured(np.zeros_like(pictures[1]))
    outcomes = read_batch(
        reader,
        (*batch[:3], replace(batch[3], encoded=black), replace(batch[4], encoded=batch[4].encoded[:1000]), *batch[5:]),
    )

    assert isinstance(outcomes[3], Unread)
    assert isinstance(outcomes[4], Unread)
    assert "not found" in outcomes[3].reason
    assert outcomes[4].reason.startswith("the picture is damaged, cut short or empty")
    assert [as_text(read) for read in outcomes[:3] + outcomes[5:]] == together[:3] + together[5:]


@pytest.mark.parametrize(
    ("size_px", "frames"),
    [((640, 480), 40), ((1616, 1212), 36), ((20000, 10000), 1)],
)
def test_larger_pictures_come_in_smaller_batches(size_px: tuple[int, int], frames: int) -> None:
    """A batch holds at most 40 frames, and no more pixels than four of 18 megapixels."""
    assert batch_frames(size_px) == frames


def coloured(picture: GreyPicture, **options: object) -> bytes:
    """A JPEG in colour, the picture in its green part."""
    return encoded(Image.fromarray(np.stack([picture, picture[::-1], picture // 2], axis=2)), **options)


@pytest.mark.parametrize("options", [{}, {"progressive": True}, {"subsampling": 0}, {"quality": 30}], ids=str)
def test_pictures_in_a_block_are_the_same_bit_for_bit(pictures: list[GreyPicture], options: dict[str, object]) -> None:
    """Whatever the kind of JPEG, and in memory that held another picture before."""
    block = PictureBlock()
    block.grey_picture(coloured(pictures[0]), 0)

    for picture in (pictures[1], pictures[2][:300, :401]):
        jpeg = coloured(picture, **options)
        assert np.array_equal(block.grey_picture(jpeg, 0), grey_picture(jpeg))


def claiming(jpeg: bytes, height_px: int, width_px: int) -> bytes:
    """A JPEG whose header says that it is so large."""
    header = picture_header(jpeg)
    assert header is not None
    return jpeg[: header.height_at] + height_px.to_bytes(2) + width_px.to_bytes(2) + jpeg[header.height_at + 4 :]


@pytest.mark.parametrize("size", [(12_000, 12_000), (65_535, 65_535), (40_000, 2_000)], ids=str)
def test_picture_that_claims_too_much_is_given_no_memory(pictures: list[GreyPicture], size: tuple[int, int]) -> None:
    """No memory is allocated for a picture that its bytes cannot contain; the damaged header is reported instead."""
    jpeg, block = claiming(coloured(pictures[0]), *size), PictureBlock()
    said = f"says that it is {size[1]} x {size[0]}, but has {len(jpeg)} bytes"

    for decompress in (grey_picture, partial(block.grey_picture, slot=0)):
        with pytest.raises(PictureError, match=said):
            decompress(jpeg)
    assert block._memory.size == 0


def test_one_large_picture_is_no_reason_for_room_for_many(pictures: list[GreyPicture]) -> None:
    """It has its own memory; the others' places do not change."""
    block, small, huge = PictureBlock(), coloured(pictures[0]), encoded(Image.new("L", (4000, 3000)))
    block.reserve(32)
    first, large, last = (block.grey_picture(jpeg, slot) for slot, jpeg in enumerate([small, huge, small]))

    assert large.shape == (3000, 4000)
    assert np.array_equal(first, last)
    assert block._memory.shape == (32, first.size)


@pytest.mark.parametrize("rows", [None, 16, 592])
def test_first_rows_alone_give_the_same_bits(
    flight: Flight, reader: PanelReader, together: list[str], rows: int | None
) -> None:
    """Only the rows with the panel are decompressed; if they are too few, the whole frame is."""
    enough = reader.placement.rows
    assert enough is not None
    assert enough < reader.source.picture.shape[0]
    block = PictureBlock()
    tops = [block.frame(frame.encoded, slot, None, rows or enough) for slot, frame in enumerate(flight.frames())]

    assert rows or all(isinstance(top, TopOfFrame) and len(top.pixels) == enough for top in tops)
    assert [as_text(read) for read in reader.read(tops)] == together


def test_first_rows_are_those_of_the_picture(flight: Flight, pictures: list[GreyPicture]) -> None:
    """Bit for bit; more rows than there are, or a progressive JPEG, give the whole picture."""
    block = PictureBlock()
    jpeg = next(iter(flight.frames())).encoded

    for rows in (16, 400, 401):
        assert np.array_equal(block.frame(jpeg, 0, None, rows).pixels, pictures[0][:rows])
    assert np.array_equal(block.frame(jpeg, 0, None, 768).pixels, pictures[0])
    progressive = coloured(pictures[0], progressive=True)
    assert isinstance(block.frame(progressive, 0, None, 400), FramePicture)
    with pytest.raises(PictureError):
        block.frame(jpeg[:-2], 0, None, 400)
