"""A reader fitted to a committed flight, and its frames in small batches."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from decoder.imaging.panel_pictures import panel_from_attachments
from decoder.imaging.pictures import FramePicture, grey_picture
from decoder.instruments.frame_batch import Batch, Outcome, batches, read_here
from decoder.instruments.panel_reader import PanelReader
from decoder.learning.fit import fit_to_flight, reader_from_panel
from decoder.panel.vocabulary import Method
from flight_file.reader import open_flight
from tests.programs import A1


@dataclass(frozen=True, slots=True)
class Fitted:
    """A reader, the batches of four frames of the flight that it is fitted to, and what it reads of each."""

    reader: PanelReader
    batches: tuple[Batch, ...]
    results: list[tuple[Batch, list[Outcome]]]


@pytest.fixture(scope="session")
def fitted() -> Fitted:
    """Of the flight with the frames of table A.1."""
    flight = open_flight([A1])
    panel = panel_from_attachments(flight.attachments, flight=A1.name)

    def sample(frames: int) -> list[FramePicture]:
        return [FramePicture(grey_picture(frame.encoded)) for frame in flight.sample_frames(frames)]

    reader = fit_to_flight(reader_from_panel(panel, Method.NORMXCORR), sample).reader
    cut = tuple(batches(flight.frames(), 4))
    return Fitted(reader, cut, list(read_here(reader, cut)))
