"""A panel of another cockpit: refused before all frames are searched, but no flight that only begins elsewhere."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from decoder.imaging.panel_pictures import panel_from_attachments
from decoder.learning.fit import reader_from_panel
from decoder.panel.vocabulary import Method
from decoder.timeseries.flight_decoder import decode_flight
from flight_file.frame import Frame
from flight_file.reader import open_flight
from tests.programs import MakeFlight, Run

FRAMES = 24  # more than a sample has


@pytest.fixture(scope="module")
def elsewhere(pictures: list[bytes]) -> list[bytes]:
    """Pictures of something else, as large as the animation's: soft blots, other ones in each."""
    with Image.open(io.BytesIO(pictures[0])) as picture:
        width, height = picture.size
    made = []
    for seed in range(FRAMES):
        coarse = np.random.default_rng(seed).uniform(0, 255, (height // 16, width // 16)).astype(np.float32)
        blots = np.clip(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC), 0, 255).astype(np.uint8)
        stream = io.BytesIO()
        Image.fromarray(blots).convert("RGB").save(stream, "JPEG", quality=85)
        made.append(stream.getvalue())
    return made


def test_panel_of_another_cockpit_is_refused_after_a_sample(
    run: Run, tmp_path: Path, make_flight: MakeFlight, elsewhere: list[bytes]
) -> None:
    """One sentence says what was looked for, in how many frames, and what to do; nothing is written."""
    flight = make_flight(elsewhere[:FRAMES])
    done = run("decode", flight, "-o", tmp_path / "out")

    assert done.returncode == 1
    assert "none of 16 frames spread over the flight's 24" in done.stderr
    assert "knob" in done.stderr
    assert "--from" in done.stderr
    assert list((tmp_path / "out").glob("*.csv")) == []


def test_flight_that_begins_elsewhere_is_decoded(
    run: Run, tmp_path: Path, make_flight: MakeFlight, elsewhere: list[bytes], pictures: list[bytes]
) -> None:
    """Two thirds of it show something else: those frames are missing, the others are read."""
    flight = make_flight([*elsewhere[:FRAMES], *pictures[:12]])
    done = run("decode", flight, "-o", tmp_path / "out")
    rows = (tmp_path / "out" / "flight.csv").read_text().splitlines()[1:]

    assert done.returncode == 0
    assert len(rows) == FRAMES + 12
    assert all(",missing," in row for row in rows[:FRAMES])
    assert all(",read," in row for row in rows[FRAMES:])


def test_what_is_done_is_told_from_the_first_second(make_flight: MakeFlight, pictures: list[bytes]) -> None:
    """Before the first frame is taken: the panel, each frame of the sample, what is learned; then nothing."""
    told: list[str] = []
    flight = open_flight([make_flight(pictures[:8])])
    reader = reader_from_panel(panel_from_attachments(flight.attachments, flight="flight.mcap"), Method.NORMXCORR)

    def shown(frames: Iterator[Frame]) -> Iterator[Frame]:
        told.append("frames")
        yield from frames

    decode_flight(flight, reader, shown, tell=told.append)

    assert told[0] == "looks at frame 1 of a sample of 8"
    assert any("learns" in words for words in told)
    assert told[-2:] == ["", "frames"]
