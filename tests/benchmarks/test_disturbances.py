"""Strangers' flights in a rougher cockpit: what is disturbed, and that it makes nothing sure and wrong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.disturbances import DISTURBANCES, disturbed
from benchmarks.real_pictures import Source, available, decode_source, reads
from tests.programs import write_yaml, yaml_of

EVERY = 3
OBLIQUE = next((source for source in available() if source.title == "simulator flight, oblique"), None)

needs_pictures = pytest.mark.skipif(OBLIQUE is None, reason="../shared is absent")


def only(source: Source, column: str, folder: Path) -> Source:
    """The source with a panel of one needle."""
    panel = yaml_of(source.panel)
    gauges = [gauge for gauge in panel["gauges"] if any(n["name"] == column for n in gauge.get("needles", ()))]
    path = folder / "panel.yaml"
    write_yaml(path, {**panel, "gauges": gauges})
    return replace(source, panel=path)


@pytest.mark.parametrize("name", DISTURBANCES)
def test_disturbance_changes_frames_the_same_way_each_time(name: str) -> None:
    """Each leaves the picture's shape, and some picture of a flight as it is in none of its pixels."""
    picture = np.random.default_rng(2).uniform(20.0, 200.0, (90, 120, 3))
    seen = [DISTURBANCES[name](picture, 20 + seed, np.random.default_rng(seed)) for seed in range(4)]
    again = [DISTURBANCES[name](picture, 20 + seed, np.random.default_rng(seed)) for seed in range(4)]

    assert {each.shape for each in seen} == {picture.shape}
    assert max(float(np.abs(each - picture).max()) for each in seen) > 5.0
    assert all(np.array_equal(one, other) for one, other in zip(seen, again, strict=True))


@pytest.mark.shared
@needs_pictures
def test_panel_picture_and_truth_stay_as_they_were(tmp_path: Path) -> None:
    """Only the frames are disturbed."""
    assert OBLIQUE is not None
    rough = disturbed(OBLIQUE, DISTURBANCES["dusk"], tmp_path, 70)
    frames = [cv2.imread(str(path)) for path in sorted(tmp_path.glob(rough.pictures))[::70]]

    assert (rough.folder / rough.panel_picture).samefile(OBLIQUE.folder / OBLIQUE.panel_picture)
    assert (rough.folder / rough.truth).samefile(OBLIQUE.folder / OBLIQUE.truth)
    assert len(frames) == 2
    assert all(frame is not None for frame in frames)


@pytest.mark.shared
@needs_pictures
@pytest.mark.slow
def test_radio_compass_in_a_vibrating_flight_is_never_read_half_a_turn_off(tmp_path: Path) -> None:
    """Its needle is nearly the same both ways, and passes beside its centre in every frame."""
    assert OBLIQUE is not None
    rough = disturbed(only(OBLIQUE, "adf_needle_deg", tmp_path), DISTURBANCES["waves"], tmp_path, EVERY)
    (read,) = reads(decode_source(rough, tmp_path / "decoded", every=EVERY))

    assert read.gross == 0
