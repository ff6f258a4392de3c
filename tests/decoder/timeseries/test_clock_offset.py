"""The offset between two clocks: found where curves determine it, with a valid uncertainty, and otherwise refused."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from decoder.panel.errors import AccuracyError
from decoder.timeseries.clock_offset import clock_offset
from decoder.timeseries.tables import FlightTable, Table
from tests.decoder.tables import flight_of, table

Curve = Callable[[NDArray[np.float64]], NDArray[np.float64]]
FLIGHT_S = np.arange(0.0, 200.0, 0.25)
RECORDER_S = np.arange(-60.0, 260.0, 1.0)


def wandering(seed: int) -> Curve:
    """A smooth curve without a period."""
    rng = np.random.default_rng(seed)
    periods_s, phases = rng.uniform(15.0, 90.0, 6), rng.uniform(0.0, 6.28, 6)
    return lambda time_s: sum(
        np.sin(6.2832 * time_s / period_s + phase) for period_s, phase in zip(periods_s, phases, strict=True)
    )


def flight(tmp_path: Path, curves: Mapping[str, Curve], *, noise: float = 0.0, wraps: bool = False) -> FlightTable:
    """Flight data of curves, each value with a little noise."""
    rng = np.random.default_rng(7)
    columns = {name: curve(FLIGHT_S) + rng.normal(0.0, noise, len(FLIGHT_S)) for name, curve in curves.items()}
    needle = {"unit": "kt", "scale_max": 10} | ({"wraps": 360} if wraps else {})
    return flight_of(tmp_path, {"time_s": FLIGHT_S}, columns, dict.fromkeys(curves, needle))


def recorder(
    curves: Mapping[str, Curve], offset_s: float, *, noise: float = 0.0, gain: float = 1.0, constant: float = 0.0
) -> Table:
    """The same curves from a recorder whose clock lacks `offset_s`."""
    rng = np.random.default_rng(8)
    values = {
        name: gain * curve(RECORDER_S) + constant + rng.normal(0.0, noise, len(RECORDER_S))
        for name, curve in curves.items()
    }
    return table({"time_s": RECORDER_S - offset_s, **values})


@pytest.mark.parametrize(
    ("offset_s", "truth"),
    [(0.0, {}), (-41.37, {}), (-599.0, {}), (5.0, {"gain": 1.852, "constant": 40.0})],
)
def test_offset_is_found_in_what_is_added(tmp_path: Path, offset_s: float, truth: dict[str, float]) -> None:
    """To a hundredth of a second, with its sign: truth's time plus offset; units and constants do not matter."""
    curves = {"ias_kt": wandering(1), "n1_pct": wandering(2)}
    found = clock_offset(flight(tmp_path, curves), recorder(curves, offset_s, **truth))

    assert found.offset_s == pytest.approx(offset_s, abs=0.01)
    assert found.correlation > 0.99
    assert found.names == ("ias_kt", "n1_pct")


def test_uncertainty_holds(tmp_path: Path) -> None:
    """With noise of a fifth of the curves the offset is within four sigma each time, and sigma is realistic."""
    misses = []
    for seed in range(12):
        curves = {"ias_kt": wandering(seed), "n1_pct": wandering(seed + 50), "ftit_c": wandering(seed + 100)}
        found = clock_offset(flight(tmp_path, curves, noise=0.3), recorder(curves, 12.3, noise=0.3), window_s=60)
        assert 0.01 < found.sigma_s < 0.3
        misses.append((found.offset_s - 12.3) / found.sigma_s)

    assert np.abs(misses).max() < 4
    assert 0.3 < np.std(misses) < 2.0


def test_needles_that_disagree_make_the_offset_less_certain(tmp_path: Path) -> None:
    """A needle that lags its sensor by two seconds increases sigma."""
    one, other = wandering(4), wandering(5)
    shown = flight(tmp_path, {"ias_kt": one, "itt_c": lambda time_s: other(time_s - 2.0)})
    found = clock_offset(shown, recorder({"ias_kt": one, "itt_c": other}, 0.0), window_s=60)

    assert 0.0 < found.offset_s < 2.0
    assert found.sigma_s > 0.5


@pytest.mark.parametrize(
    ("true", "says"),
    [
        (wandering(9), "nowhere like the flight's"),
        (lambda time_s: np.sin(6.2832 * time_s / 20.0), "match alike"),
        (np.zeros_like, "and changes"),
    ],
    ids=["another flight", "periodic", "standing"],
)
def test_what_does_not_tell_the_offset_is_refused(tmp_path: Path, true: Curve, says: str) -> None:
    """Curves that differ, are periodic, or constant: one sentence asks for the offset."""
    shown = {"ias_kt": wandering(1) if says.startswith("nowhere") else true}
    with pytest.raises(AccuracyError, match=says) as refused:
        clock_offset(flight(tmp_path, shown), recorder({"ias_kt": true}, 0.0), window_s=100)

    assert "--offset SECONDS" in str(refused.value)


@pytest.mark.parametrize(
    ("name", "offset_s", "window_s", "says"),
    [
        ("ias_kt", 12.0, 11, "at the end of the window of 11 s; look further with --window"),
        ("ias_kt", 5000.0, 60, "nothing in it overlaps the flight within 60 s"),
        ("heading_deg", 0.0, 60, "nothing in it overlaps"),
    ],
    ids=["window too small", "another day", "turns that cannot be counted"],
)
def test_offset_that_cannot_be_told_is_refused(
    tmp_path: Path, name: str, offset_s: float, window_s: float, says: str
) -> None:
    """Beyond the window, without overlapping curves, and with only a compass."""
    curves = {name: wandering(1)}
    with pytest.raises(AccuracyError, match=says):
        clock_offset(
            flight(tmp_path, curves, wraps=name == "heading_deg"), recorder(curves, offset_s), window_s=window_s
        )
