"""One recording in work: what is written when. Driven by events that carry their own time, it knows no thread."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from flight_file.frame import ClockReading
from flight_file.reports import CameraStatus, Health
from recorder.drops import Drops
from recorder.frame_queue import Arrival, Notice
from recorder.journal import Journal
from recorder.store import Store
from recorder.wall_clock import WallClock, in_words

HEALTH_NS = 10_000_000_000

_DROPS_NS = 1_000_000_000  # a camera that outruns its disk by 30 pictures a second is news once a second
_NS_PER_S = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Gauges:
    """Where the values of a health message come from, beside the recording itself."""

    clock_state: Callable[[], str]
    free_bytes: Callable[[], int | None]
    temperatures_c: Callable[[], dict[str, float]]
    queued: Callable[[], int | None]


class Recording:
    """Stores frames and news of the camera, and reports on itself about each 10 s and at the end.

    Raises
    ------
    FlightNotWrittenError
        From every method, if the store does not endure.
    """

    def __init__(self, store: Store, *, gauges: Gauges, drops: Drops, journal: Journal, at: ClockReading) -> None:
        self._store = store
        self._gauges = gauges
        self._drops = drops
        self._journal = journal
        self._wall_clock = WallClock()
        self._reported_drops = 0
        self._drops_at_ns: int | None = None
        self._health_at = at
        self._health_stored = 0
        self.rate_hz = 0.0

    def store(self, arrival: Arrival) -> None:
        """Store a frame."""
        self._check_wall_clock(arrival.at)
        self._store.put(arrival.frame, arrival.at)
        self._report(arrival.at)

    def note(self, notice: Notice) -> None:
        """Store news of the camera."""
        status = replace(notice.status, dropped=self._drops.total)
        if notice.identity is not None:
            self._store.name_camera(model=notice.identity.model, serial=notice.identity.serial)
        log = self._journal.log.warning if status.state == "lost" else self._journal.log.info
        log("camera_status", state=status.state, reason=status.reason)
        self._store.put(status, notice.at)

    def say_lost_notices(self, count: int) -> None:
        """So much news of the camera found no room in the queue."""
        if count:
            self._journal.log.warning("camera_status_lost", count=count)

    def tick(self, at: ClockReading) -> None:
        """Do what is due while no frame comes."""
        self._check_wall_clock(at)
        self._store.tick(at)
        self._report(at)

    def finish(self, reason: str, at: ClockReading) -> None:
        """Write the last reports and close the last segment."""
        self._report_drops(at)
        self._store.put(CameraStatus("finished", reason, dropped=self._drops.total), at)
        self._write_health(at)
        self._mirror_log(at)
        self._store.finish(reason, at)

    def _report(self, at: ClockReading) -> None:
        if self._drops_at_ns is None or at.monotonic_ns - self._drops_at_ns >= _DROPS_NS:
            self._report_drops(at)
        if at.monotonic_ns - self._health_at.monotonic_ns >= HEALTH_NS:
            self._write_health(at)
            self._store.make_room()
        self._mirror_log(at)

    def _report_drops(self, at: ClockReading) -> None:
        by_reason = self._drops.by_reason()
        dropped = sum(by_reason.values())
        if dropped == self._reported_drops:
            return
        self._reported_drops, self._drops_at_ns = dropped, at.monotonic_ns
        reason = "dropped: " + ", ".join(f"{count} because {why}" for why, count in sorted(by_reason.items()))
        self._store.remark(reason, at)
        self._journal.log.warning("frames_dropped", total=dropped, by_reason=by_reason)

    def _check_wall_clock(self, at: ClockReading) -> None:
        jump_ns = self._wall_clock.jump_ns(at)
        if jump_ns:
            self._store.remark(in_words(jump_ns), at)
            self._journal.log.warning("wall_clock_set", by_s=jump_ns / _NS_PER_S)

    def _write_health(self, at: ClockReading) -> None:
        seconds = (at.monotonic_ns - self._health_at.monotonic_ns) / _NS_PER_S
        new = self._store.stored - self._health_stored
        self.rate_hz = new / seconds if seconds > 0 else 0.0
        health = Health(
            free_bytes=self._gauges.free_bytes(),
            frame_rate_hz=self.rate_hz,
            stored=self._store.stored,
            dropped=self._drops.total,
            queued=self._gauges.queued(),
            clock=self._gauges.clock_state(),
            clock_offset_ns=at.realtime_ns - at.monotonic_ns,
            drops_by_reason=self._drops.by_reason(),
            temperatures_c=self._gauges.temperatures_c(),
        )
        self._store.put(health, at)
        self._health_at, self._health_stored = at, self._store.stored

    def _mirror_log(self, at: ClockReading) -> None:
        for line in self._journal.drain():
            self._store.put(line, at)
