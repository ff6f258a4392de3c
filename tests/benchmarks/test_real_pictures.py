"""Pictures that nobody of us made are read as well as is asked for."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.real_pictures import PICTURES, SOURCES, Read, decode_source, reads

pytestmark = [
    pytest.mark.shared,
    pytest.mark.skipif(not PICTURES.exists(), reason="needs ../shared/data, which is not part of the project"),
]
# Percent of full scale, by needle: the mean error that is allowed with the camera fixed.
ALLOWED = {
    "tach_rpm": 0.15,
    "fuel_left_gal": 0.3,
    "fuel_right_gal": 0.3,
    "oil_temp_degF": 0.3,
    "oil_press_psi": 0.3,
    "egt_norm": 0.5,
}
GROSS = 2.0


def reads_of(title: str, folder: Path, *, every: int = 1) -> dict[str, Read]:
    """What is read of one source, by needle, from all or one of so many of its pictures; `make bench` reads all."""
    (source,) = (source for source in SOURCES if source.title == title)
    return {read.needle: read for read in reads(decode_source(source, folder, every=every))}


@pytest.mark.slow
@pytest.mark.untraced
def test_simulator_cockpit_with_a_fixed_camera(tmp_path: Path) -> None:
    """Every needle within what is allowed, in at least 98 % of the frames, and no value that is far off."""
    found = reads_of("simulator cockpit, camera fixed", tmp_path, every=2)

    for name, allowed in ALLOWED.items():
        assert found[name].mean <= allowed, name
    assert min(read.valued for read in found.values()) >= 0.98
    assert max(read.largest for read in found.values()) <= GROSS


def test_steam_gauge_agrees_with_the_eye(tmp_path: Path) -> None:
    """All frames have a value, and each that was read by eye is met within the eye's doubt."""
    (read,) = reads_of("steam gauge", tmp_path).values()

    assert read.valued == 1.0
    assert read.within_95 == 1.0


@pytest.mark.slow
@pytest.mark.untraced
def test_simulator_cockpit_with_a_moving_camera(tmp_path: Path) -> None:
    """The same panel serves a camera that stands elsewhere and moves: at most two and a half times the mean error."""
    found = reads_of("simulator cockpit, camera moving", tmp_path)

    for name, allowed in ALLOWED.items():
        assert found[name].mean <= 2.5 * allowed, name
        assert found[name].valued >= 0.98, name
    assert max(read.largest for read in found.values()) <= 1.2 * GROSS
    assert sum(read.within_95 for read in found.values()) / len(found) > 0.85


def test_photographed_gauge_agrees_with_the_eye(tmp_path: Path) -> None:
    """Pictures of other sizes, zooms and places: all have a value, each within the eye's doubt."""
    (read,) = reads_of("pressure gauge", tmp_path).values()

    assert read.valued == 1.0
    assert read.within_95 == 1.0
