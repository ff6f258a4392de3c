"""The telemetry of a GoPro's film: positions with their times by the film's own clock, and the GPS time.

A payload spans about a second of the film, as its track says; its samples are spread evenly over it, as the format
defines. The camera's own stamps (`STMP`) are not used: GoPro made them for itself, and not all files have them.

Reliability of the receiver's time:

- `GPS9` (HERO11 on) has a time for each sample, `GPSU` before it one for a payload. GoPro says that it belongs to the
  first; but in its own sample the steps from one to the next do not follow the number of samples between, and users
  find cameras up to a second apart. So it is taken for the first, and sigma includes a uniform error over a payload.
- Both are taken for UTC, which the format says of `GPSU`; of `GPS9` it says nothing. A receiver that has not received a
  new leap second yet, which takes up to 12.5 minutes of good reception, is up to 18 s off, and nothing in the file
  shows it. So the other clocks are reported too, with their differences.
- Single times are stale or wrong: in GoPro's public sample the first is 1.4 s late. The median over all with a fix is
  used; sigma is their spread (from the median absolute deviation), plus the uncertainty above.

Sources: github.com/gopro/gpmf-parser, its documents and its threads on times; GoPro's public sample, measured.
"""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from statistics import median

from av.container import InputContainer
from av.stream import Discard

from camera_drivers.replay.gpmf import DEVICE, GpsSample, Payload, parse
from camera_drivers.replay.video_clocks import GpsClock
from camera_drivers.thresholds import MAX_ANSWER_BYTES, MAX_PARTS
from flight_file.frame import MAX_TIME_NS, NO_FIX, NS_PER_S, GpsFix
from flight_file.untrusted import open_regular

_BOX = struct.Struct(">I4s")
_LARGE = struct.Struct(">Q")
_MAD_TO_SIGMA = 1.4826
_UNIFORM = 12**-0.5
"""Standard deviation of what may be anywhere in a span, by the span."""


@dataclass(frozen=True, slots=True)
class TimedPayload:
    """A payload, its track, and its time by the film's clock: start and length, ns."""

    track: int
    start_ns: int
    length_ns: int
    payload: Payload

    def samples(self) -> Iterator[tuple[int, GpsSample]]:
        """Iterate over the samples, each with its time by the film's clock, ns."""
        samples = self.payload.samples
        for place, sample in enumerate(samples):
            yield self.start_ns + self.length_ns * place // len(samples), sample


@dataclass(frozen=True, slots=True)
class Telemetry:
    """Summary of a film's telemetry.

    Attributes
    ----------
    payloads, damaged
        How many there are, and how many parts of them could not be read.
    samples, positions
        Number of samples from the receiver, and of those with a position.
    has_gps
        Whether there is a receiver.
    dops
        Smallest and largest dilution of precision; None if not reported.
    clock
        The receiver's time; None if it never had one.
    readout_s
        From the sensor's first row to its last.
    device
        The camera's name.
    """

    payloads: int = 0
    damaged: int = 0
    samples: int = 0
    positions: int = 0
    has_gps: bool = False
    dops: tuple[float, float] | None = None
    clock: GpsClock | None = None
    readout_s: float | None = None
    device: str = ""

    def facts(self) -> dict[str, str]:
        """Describe it in words, for the session; empty for a film without telemetry."""
        said = {"GPS": self._gps() if self.payloads else ""}
        if self.readout_s is not None:
            said["read-out"] = f"{1000 * self.readout_s:.1f} ms from the sensor's first row to its last"
        if self.damaged:
            said["telemetry"] = f"{self.damaged} parts of it cannot be read and are left out"
        return {name: text for name, text in said.items() if text}

    def _gps(self) -> str:
        if not self.has_gps:
            return "none: this camera records no position"
        if not self.positions:
            return "no fix: the receiver never knew where it was"
        with_fix = f"{self.positions} positions, {self.samples - self.positions} samples without a fix"
        return (
            with_fix if self.dops is None else f"{with_fix}, precision (DOP) {self.dops[0]:.1f} to {self.dops[1]:.1f}"
        )


def payloads(container: InputContainer) -> Iterator[TimedPayload]:
    """Iterate over the payloads of a film's telemetry track; of none if it has none.

    Raises
    ------
    av.error.FFmpegError
        If the file cannot be read.
    """
    tracks = [stream for stream in container.streams if stream.type == "data"]
    for stream in container.streams:
        stream.discard = Discard.default if stream in tracks else Discard.all
    chosen: int | None = None
    for packet in container.demux(tracks) if tracks else ():
        data = bytes(packet)
        if chosen is None and data.startswith(DEVICE):
            chosen = packet.stream_index
        if chosen is not None and packet.stream_index == chosen and data:
            is_whole = packet.pts is not None and not packet.is_corrupt
            start_ns, length_ns = (
                round((ticks or 0) * (packet.time_base or Fraction(0)) * NS_PER_S)
                for ticks in (packet.pts, packet.duration)
            )
            yield TimedPayload(chosen, start_ns, length_ns, parse(data) if is_whole else Payload(damaged=1))


class Fixes:
    """The positions of a film, payload by payload: each payload goes with the first picture not older than it.

    Parameters
    ----------
    timed
        The film's payloads.
    number
        Index of the original, from 0.
    offset_ns
        Time by the frames' clock when its own time is 0.
    """

    def __init__(self, timed: Iterator[TimedPayload], number: int, offset_ns: int) -> None:
        self._payloads = timed
        self._next = next(self._payloads, None)
        self._number = number
        self._offset_ns = offset_ns

    def up_to(self, time_ns: int) -> tuple[GpsFix, ...]:
        """Take those whose payloads begin up to a time of the film; a time at which there is no flight has none."""
        fixes: list[GpsFix] = []
        while self._next is not None and self._next.start_ns <= time_ns:
            times = ((self._offset_ns + at_ns, at_ns, sample) for at_ns, sample in self._next.samples())
            fixes += [
                GpsFix(
                    captured_ns,
                    self._number,
                    at_ns,
                    sample.fix,
                    sample.latitude_deg,
                    sample.longitude_deg,
                    sample.altitude_m,
                    sample.speed_mps,
                    sample.speed_3d_mps,
                    sample.dop,
                    sample.utc_ns,
                )
                for captured_ns, at_ns, sample in times
                if 0 <= captured_ns <= MAX_TIME_NS
            ]
            self._next = next(self._payloads, None)
        return tuple(fixes)


def summarized(path: Path, container: InputContainer) -> Telemetry:
    """Read all of a film's telemetry once.

    Raises
    ------
    OSError, av.error.FFmpegError
        If the file cannot be read.
    """
    of_file = parse(of_camera(path))
    count, listed, damaged, samples, positions, has_gps = 0, 0, of_file.damaged, 0, 0, False
    readout_s, device = of_file.readout_s, ""
    dops: list[float] = []
    times: list[tuple[int, int]] = []
    for timed in payloads(container):
        payload = timed.payload
        count += 1
        listed = len(container.streams[timed.track].index_entries)
        damaged += payload.damaged
        has_gps = has_gps or payload.has_gps
        readout_s, device = readout_s or payload.readout_s, device or payload.device
        samples += len(payload.samples)
        positions += sum(sample.fix != NO_FIX for sample in payload.samples)
        known = [sample.dop for sample in payload.samples if sample.dop is not None]
        dops = [min(dops + known), max(dops + known)] if known else dops
        times += times_of(timed)
    return Telemetry(
        count,
        damaged + max(0, listed - count),
        samples,
        positions,
        has_gps,
        (dops[0], dops[1]) if dops else None,
        clock_of(times),
        readout_s,
        device,
    )


def times_of(timed: TimedPayload) -> Iterator[tuple[int, int]]:
    """Iterate over the receiver's times: when the film's time is 0, and the length of the uncertainty, ns."""
    payload = timed.payload
    span_ns = timed.length_ns // len(payload.samples) if payload.times_each and payload.samples else timed.length_ns
    for at_ns, sample in timed.samples():
        if sample.fix != NO_FIX and sample.utc_ns is not None and 0 <= sample.utc_ns - at_ns <= MAX_TIME_NS:
            yield sample.utc_ns - at_ns, span_ns


def clock_of(times: list[tuple[int, int]]) -> GpsClock | None:
    """Find the time most agree on; each gives when the film's time is 0, and the length of its uncertainty, ns."""
    if not times:
        return None
    zero_ns = round(median(zero for zero, _ in times))
    spread_ns = _MAD_TO_SIGMA * median(abs(zero - zero_ns) for zero, _ in times)
    doubt_ns = _UNIFORM * median(span for _, span in times)
    apart = sum(2 * abs(zero - zero_ns) > NS_PER_S for zero, _ in times)
    return GpsClock(zero_ns, round(math.hypot(spread_ns, doubt_ns)), len(times), apart)


def of_camera(path: Path) -> bytes:
    """Read an MP4's constant data on its camera: the box moov/udta/GPMF; empty if it has none.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    descriptor = open_regular(path)
    try:
        span = (0, os.fstat(descriptor).st_size)
        for name in (b"moov", b"udta", b"GPMF"):
            found = _box(descriptor, name, *span)
            if found is None:
                return b""
            span = found
        start, end = span
        return os.pread(descriptor, min(end - start, MAX_ANSWER_BYTES + 1), start)
    finally:
        os.close(descriptor)


def _box(descriptor: int, name: bytes, start: int, end: int) -> tuple[int, int] | None:
    """Find a box between two offsets of a file: where its content begins and ends."""
    for _ in range(MAX_PARTS):
        head = os.pread(descriptor, _BOX.size + _LARGE.size, start)
        if len(head) < _BOX.size:
            return None
        length, found = _BOX.unpack_from(head)
        content = start + _BOX.size
        if length == 1 and len(head) == _BOX.size + _LARGE.size:
            (length,) = _LARGE.unpack_from(head, _BOX.size)
            content += _LARGE.size
        elif length == 0:
            length = end - start
        if length < content - start or start + length > end:
            return None
        if found == name:
            return content, start + length
        start += length
    return None
