"""A value that few frames show: the flight data say so in words, whatever else they hold."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest
import yaml

from decoder.instruments.reading import Status
from decoder.timeseries.flight_data import FlightData
from decoder.timeseries.flight_decoder import decode_flight
from fixtures.recordings import record_flight
from flight_file.reader import open_flight
from tests.decoder.cockpit import DOCUMENT, PANEL_ANGLES_DEG, angles_of, draw, reader_of

FRAMES = 12


def decoded(folder: Path, shown: int) -> FlightData:
    """A flight whose first frames show all needles, and the others no speed."""
    pictures = []
    for seed in range(FRAMES):
        hands = angles_of(seed)
        if seed >= shown:
            del hands["speed_kt"]
        pictures.append(folder / f"{seed:02}.jpg")
        cv2.imwrite(str(pictures[-1]), draw(hands, noise=2.0, seed=seed), [cv2.IMWRITE_JPEG_QUALITY, 95])
    (folder / "panel.yaml").write_text(yaml.safe_dump(DOCUMENT), encoding="utf-8")
    cv2.imwrite(str(folder / "panel.png"), draw(PANEL_ANGLES_DEG))
    record_flight(pictures, folder / "panel.yaml", folder / "flight.mcap")
    return decode_flight(open_flight([folder / "flight.mcap"]), reader_of(), lambda frames: frames)


@pytest.mark.parametrize("shown", [FRAMES, 4])
def test_value_that_few_frames_show_is_named(tmp_path: Path, shown: int) -> None:
    """It is named with how often it was read; one that is read as a rule is not."""
    data = decoded(tmp_path, shown)
    (speed,) = (series for series in data.series if series.quantity.name == "speed_kt")
    named = [warning for warning in data.warnings if warning.startswith("speed_kt: read in ")]

    assert int(speed.has(Status.READ, Status.EDGE).sum()) <= shown
    assert bool(named) == (shown < FRAMES)
    assert not any(warning.startswith("al_lb: read in") for warning in data.warnings)
