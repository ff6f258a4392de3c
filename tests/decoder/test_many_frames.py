"""Many frames at once: what is read of a frame does not depend on its company, and is what its gauge readers say."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from decoder.arrays import Floats
from decoder.errors import PictureError
from decoder.fitting import Fitter
from decoder.flight_tuning import tune
from decoder.jpeg_header import jpeg_header
from decoder.many_frames import ManyFrames, PlacedFrame
from decoder.method import Method
from decoder.needle_template import NeedleTemplate
from decoder.panel_pictures import panel_from_attachments
from decoder.panel_reader import FrameReadings, PanelReader
from decoder.picture_block import PictureBlock, TopOfFrame
from decoder.pictures import FramePicture, GreyPicture, grey_picture
from decoder.plain_fit import PlainFitter
from decoder.quick_fit import QuickFitter
from decoder.reading import Status
from flight_file.reader import Flight, open_flight

FIXTURES = Path(__file__).parents[2] / "fixtures"


@pytest.fixture(scope="module")
def flight() -> Flight:
    """The committed flight whose needles touch, hide each other and are lost in reflections."""
    return open_flight([FIXTURES / "thesis_a2.mcap"])


@pytest.fixture(scope="module")
def pictures(flight: Flight) -> list[GreyPicture]:
    """Its frames."""
    return [grey_picture(frame.jpeg) for frame in flight.frames()]


@pytest.fixture(scope="module")
def reader(flight: Flight, pictures: list[GreyPicture]) -> PanelReader:
    """A reader tuned to it."""
    panel = panel_from_attachments(flight.attachments, flight="thesis_a2.mcap")
    return tune(PanelReader.from_panel(panel, Method.NORMXCORR), pictures)


def read_in(reader: PanelReader, pictures: Sequence[GreyPicture], cuts: Sequence[int]) -> list[str]:
    """All that is read of each frame, as text to the last bit, in batches that end at the cuts."""
    ends = [*sorted(cuts), len(pictures)]
    firsts = [0, *sorted(cuts)]
    batches = [pictures[first:end] for first, end in zip(firsts, ends, strict=True)]
    return [as_text(read) for batch in batches for read in reader.read_many([FramePicture(one) for one in batch])]


def as_text(read: FrameReadings | PictureError) -> str:
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


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cuts=st.lists(st.integers(0, 21), max_size=8))
def test_any_split_into_batches_gives_the_same_bits(
    reader: PanelReader, pictures: list[GreyPicture], together: list[str], cuts: list[int]
) -> None:
    """However the frames are cut into batches, empty ones too, each number is the same to the last bit."""
    assert read_in(reader, pictures, cuts) == together


@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(order=st.permutations(range(21)))
def test_order_of_frames_changes_nothing(
    reader: PanelReader, pictures: list[GreyPicture], together: list[str], order: list[int]
) -> None:
    """In whatever company and at whatever place of a batch a frame stands, its readings are the same."""
    shuffled = read_in(reader, [pictures[index] for index in order], [5, 16])

    assert dict(zip(order, shuffled, strict=True)) == dict(enumerate(together))


def test_what_is_plain_is_what_the_gauge_readers_say(reader: PanelReader, pictures: list[GreyPicture]) -> None:
    """Statuses are equal; rows agree to a thousandth of a degree, sigmas to a thousandth part, scores to 1e-4."""
    panel, tuning = reader.source.panel, reader.tuning
    slow = ManyFrames(panel.gauges, reader.grids, tuning, reader._gauges, is_quick=False)
    quick = ManyFrames(panel.gauges, reader.grids, tuning, reader._gauges, is_quick=True)
    whole = [True] * len(panel.gauges)
    frames = [PlacedFrame(one, reader.aligner.align(one), whole) for one in pictures]
    sigmas_deg = np.linspace(0.0, 0.2, len(frames) * len(whole)).reshape(len(frames), -1)

    statuses = []
    for one, other in zip(quick.read(frames, sigmas_deg), slow.read(frames, sigmas_deg), strict=True):
        for own, expected in zip(one, other, strict=True):
            for name, reading in own.items():
                statuses.append(reading.status)
                assert reading.status is expected[name].status
                assert reading.angle_deg == pytest.approx(expected[name].angle_deg, abs=1e-3)
                assert reading.sigma_deg == pytest.approx(expected[name].sigma_deg, rel=1e-3)
                assert reading.score == pytest.approx(expected[name].score, abs=1e-4)
    assert statuses.count(Status.READ) > 100
    assert set(statuses) > {Status.READ, Status.EDGE}


def test_lost_frame_in_a_batch_is_an_error_in_its_place(reader: PanelReader, pictures: list[GreyPicture]) -> None:
    """A frame without a panel, and one that could not be opened, are errors where they stand."""
    unopened = PictureError("is no picture")
    black = FramePicture(np.zeros_like(pictures[1]))
    read = reader.read_many([FramePicture(pictures[0]), black, unopened, FramePicture(pictures[2])])

    assert [isinstance(one, FrameReadings) for one in read] == [True, False, False, True]
    assert read[2] is unopened


def needle(rng: np.random.Generator) -> NeedleTemplate:
    """A bright bar, 25 rows by 8 columns, slightly different each time."""
    rows = np.arange(25)[:, None] - 12 + rng.uniform(-0.3, 0.3)
    cover = np.clip(4.0 - np.abs(rows), 0.0, 1.0).repeat(8, axis=1).astype(np.float32)
    light = (220 * cover).astype(np.float32)
    ones = np.ones_like(light)
    return NeedleTemplate(light, light, 1 - cover, ones, 0.5)


def windows_of(template: NeedleTemplate, faces: Floats, shifts: Floats) -> Floats:
    """A needle over faces (M, 25, 8), shifted down by parts of a row, with a sensor's noise."""
    windows = np.stack(
        [
            cv2.warpAffine(
                template.light + template.transparency * face,
                np.array([[1.0, 0.0, 0.0], [0.0, 1.0, shift]]),
                (8, 25),
                borderMode=cv2.BORDER_REPLICATE,
            )
            for face, shift in zip(faces, shifts, strict=True)
        ]
    )
    return np.rint(windows + np.random.default_rng(71).normal(0.0, 1.0, windows.shape)).astype(np.float32)


def test_fits_in_many_windows_are_those_of_one() -> None:
    """Needles at all places within a row of the middle, whole or in part: as `Fitter` has them one by one."""
    rng = np.random.default_rng(61)
    template = needle(rng)
    faces = rng.uniform(20, 60, (40, 25, 8)).astype(np.float32)
    masks = (rng.uniform(0, 1, faces.shape) > 0.3).astype(np.float32)
    shifts = rng.uniform(-1.0, 1.0, 40)
    windows, guesses = windows_of(template, faces, shifts), np.clip(shifts, -0.5, 0.5)
    flat = [each.reshape(40, -1) for each in (windows, faces, masks)]
    found = QuickFitter(template, 0.5).fit(flat[0], flat[1], guesses, masks=flat[2])

    for index, (window, face, mask, guess) in enumerate(zip(windows, faces, masks, guesses, strict=True)):
        alone = Fitter(template, 0.5).fit(window, lambda _, face=face: face, mask, guess_rows=guess)
        assert found.fraction[index] == pytest.approx(alone.fraction, abs=1e-4)
        assert found.sigma_rows[index] == pytest.approx(alone.sigma_rows, rel=1e-2)
        assert found.score[index] == pytest.approx(alone.score, abs=1e-4)
        assert found.correlation[index] == pytest.approx(alone.correlation, abs=1e-4)


def test_fits_by_known_sums_are_those_of_one() -> None:
    """Two needles on dials of their own, at any row, also at one that was seen before."""
    rng = np.random.default_rng(67)
    templates = [needle(rng), needle(rng)]
    dials = [rng.uniform(20, 60, (rows, 8)).astype(np.float32) for rows in (70, 90)]
    rows, shifts = rng.integers(0, 45, (20, 2)), rng.uniform(-1.0, 1.0, (20, 2))
    faces = np.stack([[dials[one][row : row + 25] for one, row in enumerate(own)] for own in rows])
    windows = np.stack([windows_of(templates[one], faces[:, one], shifts[:, one]) for one in (0, 1)], axis=1)
    guesses = np.clip(shifts, -0.5, 0.5)
    fitter = PlainFitter(templates, dials, [0.5, 0.4])

    for _ in range(2):
        found = fitter.fit(windows.reshape(20, 2, -1), rows, guesses)
        for frame, one in np.ndindex(20, 2):
            alone = Fitter(templates[one], (0.5, 0.4)[one]).fit(
                windows[frame, one], lambda _, face=faces[frame, one]: face, guess_rows=guesses[frame, one]
            )
            assert found.fraction[frame, one] == pytest.approx(alone.fraction, abs=1e-4)
            assert found.sigma_rows[frame, one] == pytest.approx(alone.sigma_rows, rel=1e-2)
            assert found.score[frame, one] == pytest.approx(alone.score, abs=1e-4)


def encoded(picture: GreyPicture, **options: object) -> bytes:
    """A JPEG in colour, the picture in its green part."""
    stream = io.BytesIO()
    Image.fromarray(np.stack([picture, picture[::-1], picture // 2], axis=2)).save(stream, "JPEG", **options)
    return stream.getvalue()


@pytest.mark.parametrize("options", [{}, {"progressive": True}, {"subsampling": 0}, {"quality": 30}], ids=str)
def test_pictures_in_a_block_are_the_same_bit_for_bit(pictures: list[GreyPicture], options: dict[str, object]) -> None:
    """Whatever the kind of JPEG, and in memory that held another picture before."""
    block = PictureBlock()
    block.grey_picture(encoded(pictures[0]), 0)

    for picture in (pictures[1], pictures[2][:300, :401]):
        jpeg = encoded(picture, **options)
        assert np.array_equal(block.grey_picture(jpeg, 0), grey_picture(jpeg))


def test_flight_s_own_frames_are_the_same_bit_for_bit(flight: Flight, pictures: list[GreyPicture]) -> None:
    """Frames as the camera sent them."""
    block = PictureBlock()
    slots = [block.grey_picture(frame.jpeg, slot) for slot, frame in enumerate(flight.frames())]

    assert all(np.array_equal(one, other) for one, other in zip(slots, pictures, strict=True))


@pytest.mark.parametrize("cut", [0, 1, 3, 20, 400, -400, -1])
def test_cut_pictures_are_refused_as_ever(pictures: list[GreyPicture], cut: int) -> None:
    """A JPEG that breaks off anywhere is an error in a block as it is alone, or gives the same picture."""
    jpeg = encoded(pictures[0])[:cut]
    try:
        alone = grey_picture(jpeg)
    except PictureError:
        with pytest.raises(PictureError):
            PictureBlock().grey_picture(jpeg, 0)
    else:
        assert np.array_equal(PictureBlock().grey_picture(jpeg, 0), alone)


@given(st.binary(max_size=200))
def test_header_of_anything_is_none_or_a_size(data: bytes) -> None:
    """Bytes of any kind give no error and no size of nothing."""
    header = jpeg_header(b"\xff\xd8\xff" + data)

    assert header is None or min(header.height_px, header.width_px) > 0


def test_header_says_the_size(pictures: list[GreyPicture]) -> None:
    """Height and width as the picture has them; a PNG has no such header."""
    header = jpeg_header(encoded(pictures[0][:200, :300]))

    assert header is not None
    assert (header.height_px, header.width_px) == (200, 300)
    assert jpeg_header(b"\x89PNG") is None


def claiming(jpeg: bytes, height_px: int, width_px: int) -> bytes:
    """A JPEG whose header says that it is so large."""
    header = jpeg_header(jpeg)
    assert header is not None
    return jpeg[: header.height_at] + height_px.to_bytes(2) + width_px.to_bytes(2) + jpeg[header.height_at + 4 :]


@pytest.mark.parametrize("size", [(12_000, 12_000), (65_535, 65_535), (40_000, 2_000)], ids=str)
def test_picture_that_claims_too_much_is_given_no_memory(pictures: list[GreyPicture], size: tuple[int, int]) -> None:
    """A damaged header is no reason to make room for a picture that its bytes cannot hold; it is said instead."""
    jpeg, block = claiming(encoded(pictures[0]), *size), PictureBlock()
    said = f"says that it is {size[1]} x {size[0]}, which its {len(jpeg)} bytes cannot hold"

    for decompress in (grey_picture, partial(block.grey_picture, slot=0)):
        with pytest.raises(PictureError, match=said):
            decompress(jpeg)
    assert block._memory.size == 0


def test_one_large_picture_is_no_reason_for_room_for_many(pictures: list[GreyPicture]) -> None:
    """It has memory of its own; those beside it lie where they would."""
    stream = io.BytesIO()
    Image.new("L", (4000, 3000)).save(stream, "JPEG")
    block, small = PictureBlock(), encoded(pictures[0])
    block.reserve(32)
    first, large, last = (block.grey_picture(jpeg, slot) for slot, jpeg in enumerate([small, stream.getvalue(), small]))

    assert large.shape == (3000, 4000)
    assert np.array_equal(first, last)
    assert block._memory.shape == (32, first.size)


@pytest.mark.parametrize("options", [{}, {"optimize": True}, {"progressive": True}], ids=str)
def test_plain_pictures_may_be_as_small_as_jpegs_can_be(options: dict[str, object]) -> None:
    """Nothing but black, in the fewest bytes that there are for it, is believed."""
    stream = io.BytesIO()
    Image.new("L", (4000, 3000)).save(stream, "JPEG", quality=1, **options)

    assert PictureBlock().grey_picture(stream.getvalue(), 0).shape == (3000, 4000)


def test_first_rows_alone_give_the_same_bits(flight: Flight, reader: PanelReader, together: list[str]) -> None:
    """Where the panel lies in the first rows the others need not be decompressed: no number changes."""
    rows = reader.tuning.rows
    assert rows is not None
    assert rows < reader.source.picture.shape[0]
    block = PictureBlock()
    tops = [block.frame(frame.jpeg, slot, None, rows) for slot, frame in enumerate(flight.frames())]

    assert all(isinstance(top, TopOfFrame) and len(top.pixels) == rows for top in tops)
    assert [as_text(read) for read in reader.read_many(tops)] == together


@pytest.mark.parametrize("rows", [16, 320, 592, 600])
def test_too_few_rows_are_made_up_for(flight: Flight, reader: PanelReader, together: list[str], rows: int) -> None:
    """A frame whose first rows do not show all of the panel is decompressed whole: no number changes."""
    block = PictureBlock()
    tops = [block.frame(frame.jpeg, slot, None, rows) for slot, frame in enumerate(flight.frames())]

    assert [as_text(read) for read in reader.read_many(tops)] == together


def test_first_rows_are_those_of_the_picture(flight: Flight, pictures: list[GreyPicture]) -> None:
    """Bit for bit; more rows than there are, or a progressive JPEG, give the whole picture."""
    block = PictureBlock()
    jpeg = next(iter(flight.frames())).jpeg

    for rows in (16, 400, 401):
        assert np.array_equal(block.frame(jpeg, 0, None, rows).pixels, pictures[0][:rows])
    assert np.array_equal(block.frame(jpeg, 0, None, 768).pixels, pictures[0])
    progressive = encoded(pictures[0], progressive=True)
    assert isinstance(block.frame(progressive, 0, None, 400), FramePicture)
    with pytest.raises(PictureError):
        block.frame(jpeg[:-2], 0, None, 400)
