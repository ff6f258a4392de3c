"""The sample of a flight: the same frames each time, however much of them is decompressed and kept."""

from __future__ import annotations

import pytest

from decoder.imaging.panel_pictures import PanelPictures, panel_from_attachments
from decoder.instruments.frame_batch import batches, read_batch
from decoder.instruments.panel_reader import PanelReader
from decoder.learning.fit import fit_to_flight, reader_from_panel
from decoder.learning.flight_sample import FlightSample
from decoder.panel.vocabulary import Method
from flight_file.reader import Flight, open_flight
from tests.programs import A1

HEIGHT_PX = 768


@pytest.fixture(scope="module")
def flight() -> Flight:
    """A committed flight of twenty frames."""
    return open_flight([A1])


@pytest.fixture(scope="module")
def panel(flight: Flight) -> PanelPictures:
    """Its panel."""
    return panel_from_attachments(flight.attachments, flight="thesis_a1.mcap")


@pytest.fixture(scope="module")
def reader(flight: Flight, panel: PanelPictures) -> PanelReader:
    """A reader fitted to whole pictures of it."""
    return fit_to_flight(reader_from_panel(panel, Method.NORMXCORR), FlightSample(flight)).reader


@pytest.mark.parametrize("rows", [None, 640, 400])
def test_picture_of_the_sample_is_read_as_its_frame(flight: Flight, reader: PanelReader, rows: int | None) -> None:
    """Decompressed pictures are not decompressed again, and every bit is read alike; they are released once."""
    sample = FlightSample(flight, rows)
    taken = list(sample(8))
    (fresh,) = batches(flight.frames(), 20)
    (kept,) = batches(flight.frames(), 20, sample.given_up)

    assert [frame.picture for frame in kept if frame.picture is not None] == taken
    assert read_batch(reader, kept) == read_batch(reader, fresh)
    assert all(sample.given_up(frame) is None for frame in flight.frames())


def test_sample_is_the_same_each_time(flight: Flight) -> None:
    """Whether it is read from the file, kept from before, a part of a larger one, or partly given up."""
    sample = FlightSample(flight)
    first = [frame.pixels for frame in sample(16)]
    again, few = [frame.pixels for frame in sample(16)], [frame.pixels for frame in sample(6)]
    sample.given_up(next(flight.frames()))
    later = [frame.pixels for frame in sample(6)]

    assert all(one is other for one, other in zip(first, again, strict=True))
    assert all((one == first[rank]).all() for one, rank in zip(few, range(0, 16, 3), strict=True))
    assert all((one == other).all() for one, other in zip(few, later, strict=True))


def test_first_rows_fit_a_reader_as_whole_pictures_do(
    flight: Flight, panel: PanelPictures, reader: PanelReader
) -> None:
    """The rows in which the panel may lie, and rows that turn out to be too few."""
    (batch,) = batches(flight.frames(), 20)
    for rows in (reader_from_panel(panel, Method.NORMXCORR).placer.rows_at_first(), 320):
        fitted = fit_to_flight(reader_from_panel(panel, Method.NORMXCORR), FlightSample(flight, rows)).reader

        assert rows is not None
        assert rows < HEIGHT_PX
        assert read_batch(fitted, batch) == read_batch(reader, batch)
