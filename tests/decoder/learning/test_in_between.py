"""What the sample of a flight shows too little of is learned from frames in between."""

from __future__ import annotations

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from decoder.imaging.pictures import GreyPicture
from decoder.panel.arrays import Floats
from tests.programs import ran

WINDOW = (150, 40, 70, 120)
"""Left, top, width and height, px."""
INDEX_PX = 100.0
PX_PER_FT, NUMERALS_FT, FINER = 4.0, 10, 8
FIRST_FT = 1000.0
# Back and forth, so that in the sample a place looks like another before its own is known.
WAVES_FT = FIRST_FT + 36.0 * np.sin(np.arange(72) / 8.4) + 1.5 * np.arange(72)
# Put elsewhere at once, as a simulator's flight is: 1028 ft and 1828 ft differ in one digit.
JUMPS_FT = np.concatenate([FIRST_FT + 3.0 * np.arange(60), 1826.0 + 1.4 * np.arange(20), 2020.0 + 1.4 * np.arange(20)])


def drawn(altitude_ft: float, seed: int) -> GreyPicture:
    """A panel with an altitude tape of 30 ft behind its window, and print beside it."""
    picture = np.full((280, 360), 90, np.uint8)
    print_ = np.random.default_rng(5)
    for _ in range(60):
        x, y = int(print_.integers(230, 340)), int(print_.integers(10, 260))
        cv2.rectangle(picture, (x, y), (x + 8, y + 6), int(print_.integers(20, 230)), -1)
    left, top, width, height = WINDOW
    tape = np.full((FINER * height, FINER * width), 40, np.uint8)
    for at_ft in range(int(altitude_ft) - 60, int(altitude_ft) + 60):
        at_px = round(FINER * (INDEX_PX - top - (at_ft - altitude_ft) * PX_PER_FT))
        if at_ft % 2 == 0:
            size = 12 if at_ft % NUMERALS_FT == 0 else 6
            cv2.line(tape, (0, at_px), (FINER * size, at_px), 220, FINER)
        if at_ft % NUMERALS_FT == 0:
            place = (FINER * 14, at_px + FINER * 5)
            cv2.putText(tape, str(at_ft), place, cv2.FONT_HERSHEY_SIMPLEX, 0.5 * FINER, 220, FINER)
    tape = np.asarray(cv2.resize(tape, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
    picture[top : top + height, left : left + width] = tape
    noise = np.random.default_rng(seed).normal(0.0, 2.0, picture.shape)
    return np.asarray(np.clip(cv2.GaussianBlur(picture, (0, 0), 0.7) + noise, 0, 255), np.uint8)


@pytest.mark.slow
@pytest.mark.parametrize("flown_ft", [WAVES_FT, JUMPS_FT], ids=["waves", "jumps"])
def test_tape_that_moves_on_by_more_than_half_its_window_between_sampled_frames_is_read(
    tmp_path: Path, flown_ft: Floats
) -> None:
    """Two frames of the sample share less than half of what their windows show.

    Its ticks are alike everywhere, and its numerals differ in a digit or two.
    """
    pictures = tmp_path / "climb"
    pictures.mkdir()
    truth_ft = flown_ft.tolist()
    for number, altitude_ft in enumerate(truth_ft):
        cv2.imwrite(str(pictures / f"{number:03d}.png"), drawn(altitude_ft, number))
    left, top, width, height = WINDOW
    corners = [[left, top], [left + width, top], [left + width, top + height], [left, top + height]]
    marks = [[INDEX_PX + step * NUMERALS_FT * PX_PER_FT, FIRST_FT - step * NUMERALS_FT] for step in (-1, 0, 1)]
    panel = {
        "name": "climb",
        "picture": "climb/000.png",
        "anchors": [{"name": "print", "box": [228, 8, 124, 262]}],
        "gauges": [
            {
                "name": "altitude",
                "window": corners,
                "unit": "ft",
                "tape": {"name": "altitude_ft", "moves": "down", "index": INDEX_PX, "marks": marks},
            }
        ],
    }
    (tmp_path / "panel.yaml").write_text(yaml.safe_dump(panel))
    flight = tmp_path / "flight.mcap"
    assert ran("recorder", "replay", pictures, "-o", flight, "--rate", "1").returncode == 0
    assert ran("decode", flight, "--panel", tmp_path / "panel.yaml", "-o", tmp_path / "out").returncode == 0

    rows = list(csv.DictReader((tmp_path / "out" / "flight.csv").read_text().splitlines()))
    told = [
        (row["altitude_ft_status"], float(row["altitude_ft"]) - truth)
        for row, truth in zip(rows, truth_ft, strict=True)
        if row["altitude_ft"]
    ]

    assert len(told) >= 0.5 * len(truth_ft)
    assert max(abs(off_ft) for _, off_ft in told) < 1.0
