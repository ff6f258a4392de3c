"""One recording in work: what is written when. Driven by events that carry their own time, it knows no thread."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from flight_file.frame import ClockReading
from flight_file.reports import CameraStatus, Health
from flight_file.segments import FlightWriter
from recorder.capture import Drops
from recorder.frame_queue import Arrival
from recorder.journal import Journal

HEALTH_NS = 10_000_000_000

_NS_PER_S = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Gauges:
    """Where the values of a health message come from, beside the recording itself."""

    clock_name: str
    free_bytes: Callable[[], int | None]
    temperatures_c: Callable[[], dict[str, float]]
    queued: Callable[[], int | None]


class Recording:
    """Stores frames, and reports on itself about each 10 s and at the end.

    Raises
    ------
    FlightNotWrittenError
        From every method.
    """

    def __init__(
        self, writer: FlightWriter, *, gauges: Gauges, drops: Drops, journal: Journal, at: ClockReading
    ) -> None:
        self._writer = writer
        self._gauges = gauges
        self._drops = drops
        self._journal = journal
        self._reported_drops = 0
        self._health_at = at
        self._health_stored = 0
        self.first_ns: int | None = None
        self.last_ns: int | None = None

    @property
    def stored(self) -> int:
        """Frames handed to the writer so far."""
        return self._writer.stored

    def store(self, arrival: Arrival) -> None:
        """Store a frame."""
        self._writer.write_frame(arrival.frame, arrival.at)
        captured_ns = arrival.frame.captured_ns
        self.first_ns = captured_ns if self.first_ns is None else self.first_ns
        self.last_ns = captured_ns
        self._report(arrival.at)

    def tick(self, at: ClockReading) -> None:
        """Do what is due while no frame comes."""
        self._writer.tick(at)
        self._report(at)

    def finish(self, reason: str, at: ClockReading) -> list[Path]:
        """Write the last reports and close the last segment; gives all segments."""
        self._report_drops(at)
        self._writer.write_status(CameraStatus("finished", reason, dropped=self._dropped()), at)
        self._write_health(at)
        self._mirror_log(at)
        return self._writer.finish(reason, at)

    def abandon(self) -> None:
        """Leave everything as it is; for use after an error."""
        self._writer.abandon()

    def _dropped(self) -> int:
        return sum(self._drops.by_reason().values())

    def _report(self, at: ClockReading) -> None:
        self._report_drops(at)
        if at.monotonic_ns - self._health_at.monotonic_ns >= HEALTH_NS:
            self._write_health(at)
        self._mirror_log(at)

    def _report_drops(self, at: ClockReading) -> None:
        by_reason = self._drops.by_reason()
        dropped = sum(by_reason.values())
        if dropped == self._reported_drops:
            return
        self._reported_drops = dropped
        reason = "dropped: " + ", ".join(f"{count} because {why}" for why, count in sorted(by_reason.items()))
        self._writer.write_status(CameraStatus("recording", reason, dropped=dropped), at)
        self._journal.log.warning("frames_dropped", total=dropped, by_reason=by_reason)

    def _write_health(self, at: ClockReading) -> None:
        seconds = (at.monotonic_ns - self._health_at.monotonic_ns) / _NS_PER_S
        new = self.stored - self._health_stored
        health = Health(
            free_bytes=self._gauges.free_bytes(),
            frame_rate_hz=new / seconds if seconds > 0 else 0.0,
            stored=self.stored,
            dropped=self._dropped(),
            queued=self._gauges.queued(),
            clock=self._gauges.clock_name,
            clock_offset_ns=at.realtime_ns - at.monotonic_ns,
            drops_by_reason=self._drops.by_reason(),
            temperatures_c=self._gauges.temperatures_c(),
        )
        self._writer.write_health(health, at)
        self._health_at, self._health_stored = at, self.stored

    def _mirror_log(self, at: ClockReading) -> None:
        for line in self._journal.drain():
            self._writer.write_log(line, at)
