"""docs/scale.md: its arithmetic is that of the functions, and the simulation agrees with it."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks import archive
from benchmarks.archive import Archive, Measured, Prices, Site
from benchmarks.fleet_simulation import drawn_flights, simulate
from benchmarks.scale import CASES, YEAR, measured_in, page, scaled

PAGE = Path(__file__).parents[2] / "docs" / "scale.md"

# Round figures: a flight of an hour is 14,400 frames, 1.152 GB, 43.2 s + 0.8 s of a core.
ROUND = Measured(
    frame_ms=3.0, flight_ms=800.0, decompress_ms=1.0, frame_bytes=80_000.0, result_bytes=1000.0, spread=(0.9, 1.0, 1.1)
)
HOURS = Archive(flights=1000, flight_s=3600.0, rate_hz=4.0)
FAST = Site(link_bps=1e9, store_bps=1e15)


def test_page_follows_from_its_measurements() -> None:
    """Written anew from the measurements that stand in it, the page is the same to the letter."""
    text = PAGE.read_text(encoding="utf-8")
    (where,) = re.findall(r"^Written by `python -m benchmarks\.scale --write`\. (.*)$", text, re.MULTILINE)

    assert page(measured_in(text), where) == text


def test_arithmetic_is_that_of_the_back_of_an_envelope() -> None:
    """Figures that can be worked out by hand."""
    assert YEAR.frames == 1.44e11
    assert archive.core_s(ROUND, HOURS) == pytest.approx(44_000)
    assert archive.cores(ROUND, HOURS, 4400) == 10
    assert archive.stored_bytes(ROUND, HOURS) == pytest.approx(1.152e12)
    assert archive.network_bps(ROUND, HOURS, 9216) == pytest.approx(1e9)
    assert archive.fetch_s(ROUND, HOURS, FAST) == pytest.approx(9.216)
    assert archive.processes(ROUND, HOURS, FAST, 5321.6) == 10
    assert archive.fed_cores(ROUND, 80e6 / 3) == pytest.approx(1)
    assert archive.least_s(ROUND, HOURS, replace(FAST, store_bps=1e9), 1000) == pytest.approx(9216)
    prices = Prices(core_hour=0.09, terabyte_month=20.0, million_reads=1.0, million_writes=4.0)
    assert archive.decode_dollars(ROUND, HOURS, prices) == pytest.approx(44_000 / archive.HOUR_S * 0.09 + 0.02)
    assert archive.storage_dollars_month(ROUND, HOURS, prices) == pytest.approx(23.04)


def test_one_process_takes_the_sum_of_its_flights() -> None:
    """With nobody to share with, a simulated run is fetching and decoding, one after the other."""
    flights = list(drawn_flights(ROUND, HOURS, 1))
    run = simulate(iter(flights), FAST, 1)
    decoding_s = sum(flight.decode_s for flight in flights)

    assert run.elapsed_s == pytest.approx(decoding_s + sum(flight.bits for flight in flights) / 1e9)
    assert run.busy == pytest.approx(decoding_s / run.elapsed_s)


def test_store_is_shared() -> None:
    """With so many processes that the store is the limit, a run ends when the last bytes have come and are decoded."""
    flights = list(drawn_flights(ROUND, HOURS, 2))
    run = simulate(iter(flights), replace(FAST, store_bps=1e9), 500)

    all_given_s = sum(flight.bits for flight in flights) / 1e9
    assert all_given_s < run.elapsed_s < all_given_s + max(flight.decode_s for flight in flights) + 1


@pytest.mark.parametrize("name", CASES)
def test_simulation_agrees_with_the_arithmetic(name: str) -> None:
    """Whole fleets take what the arithmetic says, at most a tenth longer: its end, and shared downloads."""
    part, site, workers = scaled(ROUND, *CASES[name])
    run = simulate(drawn_flights(ROUND, part, 3), site, workers)

    assert 0.98 < run.elapsed_s / archive.least_s(ROUND, part, site, workers) < 1.1


def test_cases_are_what_they_are_called() -> None:
    """A night has ten hours, a month thirty days."""
    assert (archive.NIGHT_S, archive.MONTH_S) == (36_000, 2_592_000)
