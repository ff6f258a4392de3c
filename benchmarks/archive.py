"""What an archive of flights takes to decode and to keep: arithmetic on measured figures."""

from __future__ import annotations

import math
from dataclasses import dataclass

HOUR_S = 3600.0
DAY_S = 24 * HOUR_S
NIGHT_S = 10 * HOUR_S
MONTH_S = 30 * DAY_S


@dataclass(frozen=True, slots=True)
class Measured:
    """What one core of the machine at hand does with one flight.

    Attributes
    ----------
    frame_ms, flight_ms
        Processor time of decoding, for each frame and for each flight besides.
    decompress_ms
        The part of `frame_ms` that merely opens the pictures.
    frame_bytes, result_bytes
        For each frame: of the flight file, and of what is written (CSV, alignments, description).
    spread
        Processor time of several flights and rounds as a ratio to their mean, sorted; 1 on average.
    """

    frame_ms: float
    flight_ms: float
    decompress_ms: float
    frame_bytes: float
    result_bytes: float
    spread: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Archive:
    """Flights to decode."""

    flights: int
    flight_s: float
    rate_hz: float

    @property
    def frames_in_flight(self) -> float:
        """Frames of one flight."""
        return self.flight_s * self.rate_hz

    @property
    def frames(self) -> float:
        """Frames of all."""
        return self.flights * self.frames_in_flight


@dataclass(frozen=True, slots=True)
class Site:
    """Where they are decoded; `link_bps` is what one process gets of the network, `store_bps` what all get together."""

    link_bps: float
    store_bps: float


@dataclass(frozen=True, slots=True)
class Prices:
    """Assumed prices, US dollars."""

    core_hour: float
    terabyte_month: float
    million_reads: float
    million_writes: float


def core_s(measured: Measured, archive: Archive) -> float:
    """Processor time of the whole archive."""
    return (archive.frames * measured.frame_ms + archive.flights * measured.flight_ms) / 1e3


def fetch_s(measured: Measured, archive: Archive, site: Site) -> float:
    """How long one process waits for one flight's files, if its link is what limits it."""
    return archive.frames_in_flight * measured.frame_bytes * 8 / site.link_bps


def cores(measured: Measured, archive: Archive, within_s: float) -> int:
    """Cores that are busy all the time for so long."""
    return math.ceil(core_s(measured, archive) / within_s)


def processes(measured: Measured, archive: Archive, site: Site, within_s: float) -> int:
    """Processes that are needed: each fetches a flight before it decodes it, and leaves its core alone meanwhile."""
    each_s = core_s(measured, archive) / archive.flights + fetch_s(measured, archive, site)
    return math.ceil(archive.flights * each_s / within_s)


def stored_bytes(measured: Measured, archive: Archive) -> float:
    """The flight files of all flights."""
    return archive.frames * measured.frame_bytes


def network_bps(measured: Measured, archive: Archive, within_s: float) -> float:
    """What the store has to give, all the time."""
    return stored_bytes(measured, archive) * 8 / within_s


def least_s(measured: Measured, archive: Archive, site: Site, workers: int) -> float:
    """How long so many processes take: for their own work or, if that is longer, until the store has given all."""
    each_s = core_s(measured, archive) / archive.flights + fetch_s(measured, archive, site)
    return max(archive.flights * each_s / workers, stored_bytes(measured, archive) * 8 / site.store_bps)


def fed_cores(measured: Measured, bytes_per_s: float) -> float:
    """How many cores something feeds that gives so many bytes a second."""
    return bytes_per_s / (measured.frame_bytes / (measured.frame_ms / 1e3))


def decode_dollars(measured: Measured, archive: Archive, prices: Prices) -> float:
    """Processor time, and requests: its file and its mark are looked for, four files written."""
    requests = archive.flights * (4 * prices.million_reads + 4 * prices.million_writes) / 1e6
    return core_s(measured, archive) / HOUR_S * prices.core_hour + requests


def storage_dollars_month(measured: Measured, archive: Archive, prices: Prices) -> float:
    """Keeping the flight files for a month."""
    return stored_bytes(measured, archive) / 1e12 * prices.terabyte_month
