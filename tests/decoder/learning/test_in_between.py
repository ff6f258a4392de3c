"""What the sample of a flight shows too little of is learned from frames in between."""

from __future__ import annotations

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from decoder.imaging.pictures import GreyPicture
from tests.programs import ran

WINDOW = (150, 40, 70, 200)
"""Left, top, width and height, px."""
INDEX_PX = 140.0
PX_PER_FT, NUMERALS_FT = 4.0, 10
FRAMES, FT_PER_FRAME = 31, 14.3
FIRST_FT = 1000.0


def drawn(altitude_ft: float, seed: int) -> GreyPicture:
    """A panel with an altitude tape of 50 ft behind its window, and print beside it."""
    picture = np.full((280, 360), 90, np.uint8)
    print_ = np.random.default_rng(5)
    for _ in range(60):
        x, y = int(print_.integers(230, 340)), int(print_.integers(10, 260))
        cv2.rectangle(picture, (x, y), (x + 8, y + 6), int(print_.integers(20, 230)), -1)
    left, top, width, height = WINDOW
    tape = np.full((height, width), 40, np.uint8)
    for at_ft in range(int(altitude_ft) - 60, int(altitude_ft) + 60):
        at_px = float(INDEX_PX - top - (at_ft - altitude_ft) * PX_PER_FT)
        if at_ft % 2 == 0:
            _line(tape, at_px, 6)
        if at_ft % NUMERALS_FT == 0:
            _line(tape, at_px, 12)
            cv2.putText(tape, str(at_ft), (14, round(at_px + 5.0)), cv2.FONT_HERSHEY_SIMPLEX, 0.5, 220, 1)
    picture[top : top + height, left : left + width] = tape
    noise = np.random.default_rng(seed).normal(0.0, 2.0, picture.shape)
    return np.asarray(np.clip(cv2.GaussianBlur(picture, (0, 0), 0.7) + noise, 0, 255), np.uint8)


def _line(tape: GreyPicture, y: float, size: int) -> None:
    cv2.line(tape, (0, round(16 * y)), (16 * size, round(16 * y)), 220, 1, cv2.LINE_AA, 4)


@pytest.mark.slow
def test_tape_that_moves_on_by_more_than_half_its_window_between_sampled_frames_is_read(tmp_path: Path) -> None:
    """Every second frame is in the sample, and two of those share less than half of what their windows show.

    Its ticks are alike everywhere, and its numerals differ in a digit or two.
    """
    pictures = tmp_path / "climb"
    pictures.mkdir()
    truth_ft = [FIRST_FT + FT_PER_FRAME * number for number in range(FRAMES)]
    for number, altitude_ft in enumerate(truth_ft):
        cv2.imwrite(str(pictures / f"{number:03d}.png"), drawn(altitude_ft, number))
    left, top, width, height = WINDOW
    corners = [[left, top], [left + width, top], [left + width, top + height], [left, top + height]]
    marks = [[INDEX_PX + step * NUMERALS_FT * PX_PER_FT, FIRST_FT - step * NUMERALS_FT] for step in (-2, -1, 0, 1, 2)]
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

    assert len(told) >= 0.7 * FRAMES
    assert max(abs(off_ft) for _, off_ft in told) < 1.0
