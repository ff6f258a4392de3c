"""Attitude indicators that others drew are read right: filmed by our camera, and in the simulator's cockpit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.real_pictures import ATTITUDES, SOURCES, Source, available, decode_source

pytestmark = [pytest.mark.slow, pytest.mark.untraced]

SIMULATED = [source for source in SOURCES if source.title.startswith("simulator's attitude")]
ROLL_DEG, PITCH_DEG = "roll", "pitch"
WORST_DEG = 2.0
"""What rules let a recorder be off."""


def errors_deg(source: Source, folder: Path, every: int = 1) -> dict[str, np.ndarray[tuple[int], np.dtype[np.float64]]]:
    """By roll and pitch the errors of what is `read`; at least four of five frames are."""
    decoded = decode_source(source, folder, every=every)
    found = {}
    for series, truth in zip(decoded.series, decoded.truth, strict=True):
        is_read = series.status == "read"
        assert is_read.mean() >= 0.8, series.name
        assert float((np.abs(series.error(truth)) <= 1.96 * series.sigma)[is_read].mean()) >= 0.6, series.name
        found[PITCH_DEG if "pitch" in series.name else ROLL_DEG] = np.abs(series.error(truth)[is_read])
    return found


@pytest.mark.parametrize("source", ATTITUDES, ids=lambda source: Path(source.truth).parent.name)
def test_an_indicator_that_others_drew_is_read(source: Source, tmp_path: Path) -> None:
    """By day, from the side through a whole roll, and at night: one of five frames, drawn as by a careful hand."""
    stored = replace(source, pictures=f"borrowed/{Path(source.truth).parent.name}/*.jpg")

    off_deg = errors_deg(stored, tmp_path)

    assert off_deg[ROLL_DEG].mean() < 0.5
    assert off_deg[PITCH_DEG].mean() < 0.4
    assert max(each.max() for each in off_deg.values()) < WORST_DEG


@pytest.mark.parametrize(
    ("source", "mean_roll_deg", "mean_pitch_deg"),
    [(SIMULATED[0], 0.3, 0.6), (SIMULATED[1], 0.8, 1.0), (SIMULATED[2], 0.3, 0.6)],
    ids=["oblique", "bad lens", "straight on"],
)
def test_the_simulators_indicator_is_read(
    source: Source, mean_roll_deg: float, mean_pitch_deg: float, tmp_path: Path
) -> None:
    """Its horizon turns by one and a half times what the bank ring does, and shows no ladder: one of three frames."""
    if source not in available():
        pytest.skip("benchmarks/real_pictures.py says which pictures belong beside the checkout")

    off_deg = errors_deg(source, tmp_path, every=3)

    assert off_deg[ROLL_DEG].mean() < mean_roll_deg
    assert off_deg[PITCH_DEG].mean() < mean_pitch_deg
    assert max(each.max() for each in off_deg.values()) < WORST_DEG
