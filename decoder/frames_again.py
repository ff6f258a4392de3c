"""The flight's frames once more, for outputs that show them: each beside its own row of the flight data."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from decoder.errors import OutputError
from decoder.flight_data import FlightData
from flight_file.frame import Frame

Frames = Callable[[], Iterator[Frame]]


def matched_frames(data: FlightData, frames: Frames) -> Iterator[Frame]:
    """The frames again, one for each row of the flight data.

    Raises
    ------
    OutputError
        If they are others than before.
    """
    numbers = iter(data.frame.tolist())
    for frame in frames():
        if next(numbers, None) != frame.sequence:
            raise OutputError("the flight file gave other frames than before; is the disk failing?")
        yield frame
    if next(numbers, None) is not None:
        raise OutputError("the flight file gave fewer frames than before; is the disk failing?")
