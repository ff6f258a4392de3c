"""Frames in batches: cut by position alone, and each read as if it were alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from decoder.flight_fitting import fit_to_flight
from decoder.frame_batch import RawFrame, Unread, batch_frames, batches, read_batch
from decoder.method import Method
from decoder.panel_pictures import panel_from_attachments
from decoder.panel_reader import FrameReadings, PanelReader
from decoder.pictures import FramePicture, grey_picture
from flight_file.reader import Flight, open_flight

FIXTURES = Path(__file__).parents[2] / "fixtures"


@pytest.fixture(scope="module")
def flight() -> Flight:
    """A committed flight of twenty frames."""
    return open_flight([FIXTURES / "thesis_a1.mcap"])


@pytest.fixture(scope="module")
def reader(flight: Flight) -> PanelReader:
    """A reader fitted to it."""
    panel = panel_from_attachments(flight.attachments, flight="thesis_a1.mcap")

    def sample(frames: int) -> list[FramePicture]:
        return [FramePicture(grey_picture(frame.jpeg)) for frame in flight.sample_frames(frames)]

    return fit_to_flight(PanelReader.from_panel(panel, Method.NORMXCORR), sample).reader


@pytest.mark.parametrize(
    ("size_px", "frames"),
    [((1024, 768), 40), ((640, 480), 40), ((1616, 1212), 36), ((4896, 3672), 4), ((20000, 10000), 1)],
)
def test_larger_pictures_come_in_smaller_batches(size_px: tuple[int, int], frames: int) -> None:
    """A batch holds at most 40 frames, and no more pixels than four of 18 megapixels."""
    assert batch_frames(size_px) == frames


def test_batches_are_the_frames_in_order(flight: Flight) -> None:
    """All frames, so many at a time, the rest in the last batch."""
    cut = list(batches(flight.frames(), 8))

    assert [len(batch) for batch in cut] == [8, 8, 4]
    assert [frame.sequence for batch in cut for frame in batch] == list(range(20))


def test_damaged_frame_leaves_its_batch_alone(flight: Flight, reader: PanelReader) -> None:
    """A picture that cannot be opened has a reason; those beside it are read to the bit as without it."""
    (batch,) = batches(flight.frames(), 20)
    whole = read_batch(reader, batch)
    damaged = [*batch[:4], replace(batch[4], jpeg=batch[4].jpeg[:1000]), *batch[5:]]
    outcomes = read_batch(reader, damaged)

    assert outcomes[4] == Unread("the picture is damaged or cut short")
    assert outcomes[:4] + outcomes[5:] == whole[:4] + whole[5:]


def test_same_batch_reads_the_same_again(flight: Flight, reader: PanelReader) -> None:
    """Nothing is kept from batch to batch: after others, and in a reader made anew, a batch gives the same bits."""
    first, second = batches(flight.frames(), 10)
    fresh = PanelReader(reader.source, reader.method, reader.tuning)
    before, _, after = read_batch(reader, first), read_batch(reader, second), read_batch(reader, first)

    assert before == after == read_batch(fresh, first)
    assert all(isinstance(outcome, FrameReadings) for outcome in before)


def test_empty_batch_is_no_batch(reader: PanelReader) -> None:
    """No frames give no readings."""
    assert read_batch(reader, ()) == []
    assert list(batches([], 16)) == []
    assert read_batch(reader, [RawFrame(0, 0, b"")]) == [Unread("the picture is empty")]
