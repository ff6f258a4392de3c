"""A reader fitted to a committed flight, and its frames in small batches."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from decoder.flight_fitting import fit_to_flight
from decoder.frame_batch import Batch, batches
from decoder.method import Method
from decoder.panel_pictures import panel_from_attachments
from decoder.panel_reader import PanelReader
from decoder.pictures import FramePicture, grey_picture
from flight_file.reader import open_flight

FLIGHT = Path(__file__).parents[2] / "fixtures" / "thesis_a1.mcap"


@dataclass(frozen=True, slots=True)
class Fitted:
    """A reader, and the batches of four frames of the flight that it is fitted to."""

    reader: PanelReader
    batches: tuple[Batch, ...]


@pytest.fixture(scope="session")
def fitted() -> Fitted:
    """Of the flight with the frames of table A.1."""
    flight = open_flight([FLIGHT])
    panel = panel_from_attachments(flight.attachments, flight=FLIGHT.name)

    def sample(frames: int) -> list[FramePicture]:
        return [FramePicture(grey_picture(frame.jpeg)) for frame in flight.sample_frames(frames)]

    reader = fit_to_flight(PanelReader.from_panel(panel, Method.NORMXCORR), sample).reader
    return Fitted(reader, tuple(batches(flight.frames(), 4)))
