"""A fleet in events: processes that fetch a flight over a shared network and then decode it, until none is left.

It knows what the arithmetic leaves out: flights of different lengths and speeds, processes that wait for each other's
downloads, and the last flights of the night, for which most processes have nothing to do.
"""

from __future__ import annotations

import heapq
import math
import random
from collections.abc import Iterator
from dataclasses import dataclass

from benchmarks.archive import Archive, Measured, Site

LENGTH_SIGMA = 0.5  # of the logarithm of a flight's length: two thirds are between 0.6 and 1.6 times the usual one


@dataclass(frozen=True, slots=True)
class Flight:
    """One to come: its size, and how long it takes a core."""

    bits: float
    decode_s: float


@dataclass(frozen=True, slots=True)
class Run:
    """How it went."""

    elapsed_s: float
    busy: float
    """Of all the processes' time, the part in which they decode."""


def drawn_flights(measured: Measured, archive: Archive, seed: int) -> Iterator[Flight]:
    """Flights of log-normal length, the archive's mean; their speeds are drawn from the measured ones."""
    lots = random.Random(seed)  # noqa: S311 - a simulation
    for _ in range(archive.flights):
        length = lots.lognormvariate(-(LENGTH_SIGMA**2) / 2, LENGTH_SIGMA)
        frames = archive.frames_in_flight * length
        decode_ms = (frames * measured.frame_ms + measured.flight_ms) * lots.choice(measured.spread)
        yield Flight(frames * measured.frame_bytes * 8, decode_ms / 1e3)


def simulate(flights: Iterator[Flight], site: Site, workers: int) -> Run:
    """Goes through the flights with so many processes.

    All downloads run at one rate, since the store is shared evenly; so a download ends when the bits that *each* has
    got since the beginning have grown by its size.
    """
    now_s, each_got_bits, decoded_s = 0.0, 0.0, 0.0
    fetching: list[tuple[float, float]] = []  # what each must have got when it ends, and then its decoding
    decoding: list[float] = []  # when each ends
    idle = workers
    while True:
        while idle and (flight := next(flights, None)) is not None:
            heapq.heappush(fetching, (each_got_bits + flight.bits, flight.decode_s))
            idle -= 1
        if not fetching and not decoding:
            return Run(now_s, decoded_s / (now_s * workers) if now_s else 0.0)
        rate_bps = min(site.link_bps, site.store_bps / len(fetching)) if fetching else 0.0
        fetched_s = now_s + (fetching[0][0] - each_got_bits) / rate_bps if fetching else math.inf
        if decoding and decoding[0] <= fetched_s:
            each_got_bits += rate_bps * (decoding[0] - now_s)
            now_s = heapq.heappop(decoding)
            idle += 1
        else:
            each_got_bits, decode_s = heapq.heappop(fetching)
            now_s = fetched_s
            decoded_s += decode_s
            heapq.heappush(decoding, now_s + decode_s)
