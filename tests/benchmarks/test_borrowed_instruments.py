"""Instruments that others drew, filmed by our camera, are read right: one of four frames, panels drawn as by hand."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from benchmarks.real_pictures import BORROWED, Read, decode_source, reads
from fixtures.borrowed.dials import HANDS
from tests.programs import rows_of

VISIBLE = 0.05
"""Part of a needle's contrast that lights and needles over it took at most."""
VALUED, WITHIN = 0.9, 0.85
SOURCES = {Path(source.truth).parent.name: source for source in BORROWED}
ROWS = [(flight, name) for flight in SOURCES for name in [*(hand.name for _, hand in HANDS), "altitude_ft"]]

pytestmark = [pytest.mark.slow, pytest.mark.untraced, pytest.mark.xdist_group("borrowed")]


@dataclass(frozen=True, slots=True)
class Row:
    """One needle of one flight: its readings, and the part of the frames showing it that have a value."""

    read: Read
    visible_valued: float


class Flights:
    """The flights, each decoded when it is first asked for."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._known: dict[str, dict[str, Row]] = {}

    def rows(self, flight: str) -> dict[str, Row]:
        """What was read of a flight's committed frames, by needle."""
        if flight not in self._known:
            self._known[flight] = _decoded(flight, self._folder / flight)
        return self._known[flight]


def _decoded(flight: str, folder: Path) -> dict[str, Row]:
    source = replace(SOURCES[flight], pictures=f"borrowed/{flight}/*.jpg")
    decoded = decode_source(source, folder)
    truth = {row["file"]: row for row in rows_of(source.folder / source.truth)}
    shown = [truth[picture.name] for picture in decoded.pictures]
    rows = {}
    for read, series in zip(reads(decoded), decoded.series, strict=True):
        visible = np.array([_covered(row, read.needle) <= VISIBLE for row in shown])
        assert visible.any(), read.needle
        rows[read.needle] = Row(read, float(np.isfinite(series.value)[visible].mean()))
    return rows


def _covered(row: Mapping[str, str], name: str) -> float:
    """The covered part of a quantity's pointer; of several, the worst."""
    return max(float(row[f"{hand.name}_covered"]) for _, hand in HANDS if name in {hand.name, hand.shows})


@pytest.fixture(scope="module")
def flights() -> Iterator[Flights]:
    """All flights."""
    with TemporaryDirectory() as name:
        yield Flights(Path(name))


@pytest.mark.parametrize("flight", SOURCES)
def test_no_value_that_is_read_is_far_off(flights: Flights, flight: str) -> None:
    """Every value with the status read is within two percent of full scale, on every instrument and in every light."""
    rows = flights.rows(flight)

    assert {name: row.read.largest for name, row in rows.items() if row.read.gross} == {}
    assert sum(row.read.read for row in rows.values()) > len(rows) / 2


@pytest.mark.parametrize(("flight", "name"), ROWS)
def test_needle_that_can_be_seen_has_a_value(flights: Flights, flight: str, name: str) -> None:
    """In nine of ten frames at least in which nothing lies over it."""
    assert flights.rows(flight)[name].visible_valued >= VALUED


@pytest.mark.parametrize(("flight", "name"), ROWS)
def test_truth_lies_in_the_interval(flights: Flights, flight: str, name: str) -> None:
    """Of the values that there are, 85 % at least are within 1.96 sigma."""
    assert flights.rows(flight)[name].read.within_95 >= WITHIN
