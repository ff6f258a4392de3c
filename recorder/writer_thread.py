"""The writer's thread: takes frames and notices from the queue and has them stored, in order.

It is a thread of its own, so that a disk that hangs cannot keep the process from hearing a signal. `Recording` decides
what is written when; it is driven by events that carry their own time, and knows no thread.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

from flight_file.errors import FlightNotWrittenError
from flight_file.frame import CONNECTION_STATES, NS_PER_S, CameraStatus, ClockReading, Health
from recorder.capture import Wiring
from recorder.errors import RecorderError
from recorder.frame_queue import NO_MEMORY, Arrival, Drops, Ended, FrameQueue, Item, Notice
from recorder.host import WallClock, jump_in_words
from recorder.journal import Journal
from recorder.segment_store import Remark, SegmentStore
from recorder.supervision import Heartbeats, Stop
from recorder.thresholds import FIRST_WORD_S, HEALTH_S, LOOK_S, PATIENCE_S, QUEUE_FRAMES, TICK_S


@dataclass(frozen=True, slots=True)
class Gauges:
    """Sources of a health message's values, beside the recording itself."""

    clock_state: Callable[[], str]
    free_bytes: Callable[[], int | None]
    temperatures_c: Callable[[], dict[str, float]]
    queued: Callable[[], int | None]


class Recording:
    """Stores frames and news of the camera, and its own health reports about every 10 s and at the end.

    Attributes
    ----------
    rate_hz
        Frames a second at this moment; a health report has the mean since the one before.

    Raises
    ------
    FlightNotWrittenError
        From every method, unless the store retries without limit.
    """

    def __init__(
        self, store: SegmentStore, *, gauges: Gauges, drops: Drops, journal: Journal, at: ClockReading
    ) -> None:
        self._store = store
        self._gauges = gauges
        self._drops = drops
        self._journal = journal
        self._wall_clock = WallClock()
        self._reported_drops = 0
        self._drops_at_ns: int | None = None
        self._health_at = at
        self._health_stored = 0
        self._arrivals_ns: deque[int] = deque(maxlen=QUEUE_FRAMES)
        self.rate_hz = 0.0

    def store(self, arrival: Arrival) -> None:
        """Store a frame, or count it as dropped if no reader would find it."""
        objection, accepted = arrival.frame.objection, self._store.accepted
        try:
            self._check_wall_clock(arrival.at)
            if not objection:
                self._store.put(arrival.frame, arrival.at)
        except MemoryError:
            if self._store.accepted == accepted:
                self._drops.add(NO_MEMORY)
            raise
        if objection:
            self._drops.add(objection)
        else:
            self._arrivals_ns.append(arrival.at.monotonic_ns)
        self._report(arrival.at)

    def note(self, notice: Notice) -> None:
        """Store news of the camera."""
        status = replace(notice.status, dropped=self._drops.total)
        if notice.identity is not None:
            self._store.name_camera(model=notice.identity.model, serial=notice.identity.serial)
        log = self._journal.log.warning if status.state == "lost" else self._journal.log.info
        log("camera_status", state=status.state, reason=status.reason)
        self._store.put(status if status.state in CONNECTION_STATES else Remark(status), notice.at)

    def say_no_memory(self) -> None:
        """Log that something could not be done; a frame that this cost is counted already."""
        self._journal.log.error("out_of_memory")

    def say_lost_notices(self, count: int) -> None:
        """Log how many notices of the camera found no room in the queue."""
        if count:
            self._journal.log.warning("camera_status_lost", count=count)

    def tick(self, at: ClockReading) -> None:
        """Check the clock and report; to be called while no frame comes."""
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
        self.rate_hz = self._rate_of_now_hz(at)
        if self._drops_at_ns is None or at.monotonic_ns - self._drops_at_ns >= TICK_S * NS_PER_S:
            self._report_drops(at)
        if at.monotonic_ns - self._health_at.monotonic_ns >= HEALTH_S * NS_PER_S:
            self._write_health(at)
            self._store.make_room()
        self._mirror_log(at)

    def _rate_of_now_hz(self, at: ClockReading) -> float:
        arrivals_ns = self._arrivals_ns
        while arrivals_ns and at.monotonic_ns - arrivals_ns[0] > HEALTH_S * NS_PER_S:
            arrivals_ns.popleft()
        span_ns = arrivals_ns[-1] - arrivals_ns[0] if arrivals_ns else 0
        return (len(arrivals_ns) - 1) * NS_PER_S / span_ns if span_ns > 0 else 0.0

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
            self._store.remark(jump_in_words(jump_ns), at)
            self._journal.log.warning("wall_clock_set", by_s=jump_ns / NS_PER_S)

    def _write_health(self, at: ClockReading) -> None:
        seconds = (at.monotonic_ns - self._health_at.monotonic_ns) / NS_PER_S
        new = self._store.stored - self._health_stored
        health = Health(
            free_bytes=self._gauges.free_bytes(),
            frame_rate_hz=max(new, 0) / seconds if seconds > 0 else 0.0,
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


class WriterThread(threading.Thread):
    """Stores everything until the queue ends; it is a daemon thread, since the disk may hang.

    Attributes
    ----------
    done
        Set at the end; then `result` returns how it ended, or raises.
    """

    def __init__(
        self,
        recording: Recording,
        store: SegmentStore,
        *,
        queue: FrameQueue,
        wiring: Wiring,
        stop: Stop,
        heartbeats: Heartbeats,
    ) -> None:
        super().__init__(name="writer", daemon=True)
        self._recording = recording
        self._store = store
        self._queue = queue
        self._wiring = wiring
        self._stop_request = stop
        self._heartbeats = heartbeats
        self._patience_s = PATIENCE_S
        self._in_hand: Item | None = None
        self._ended: Ended | None = None
        self._failure: FlightNotWrittenError | None = None
        self.done = threading.Event()

    def run(self) -> None:
        """Store; an unexpected exception goes to stderr with its traceback."""
        try:
            first = self._first_word() if self._wiring.live else None
            ended = self._until_end(first)
            self._finish(ended)
            self._ended = ended
        except FlightNotWrittenError as failure:
            self._failure = failure
        finally:
            if self._ended is None:
                self._stop_request.request("the disk failed")
                self._store.abandon()
            self.done.set()

    def result(self) -> Ended:
        """Return how the recording ended.

        Raises
        ------
        FlightNotWrittenError
            The disk failed.
        RecorderError
            The thread crashed.
        """
        if self._failure is not None:
            raise self._failure
        if self._ended is None:
            raise RecorderError("The writer's thread crashed; its traceback is above, please report it.")
        return self._ended

    def _first_word(self) -> Item | None:
        # Wait for the camera's name, which every segment carries; but a frame that comes first does not wait for it.
        waited_s = 0.0
        while waited_s < FIRST_WORD_S and not self._stop_request.is_requested:
            self._heartbeats.disk()
            item = self._queue.take(TICK_S)
            if item is not None:
                return item
            waited_s += TICK_S
        return None

    def _until_end(self, first: Item | None) -> Ended:
        self._in_hand = first
        while True:
            try:
                ended = self._step()
            except MemoryError:
                if not self._wiring.live:
                    raise
                ended = None
                self._stop_request.event.wait(LOOK_S)
                self._recording.say_no_memory()
            if ended is not None:
                return ended

    def _step(self) -> Ended | None:
        """Store the next item, if there is one."""
        self._heartbeats.disk()
        if not self._has_open_segment():
            return None
        if self._in_hand is None:
            self._in_hand = self._queue.take(TICK_S)
        self._recording.say_lost_notices(self._queue.take_lost_notices())
        if isinstance(self._in_hand, Ended):
            return self._in_hand
        item, self._in_hand = self._in_hand, None
        return self._handle(item)

    def _finish(self, ended: Ended) -> None:
        """Close the last segment, however long the disk fails, unless somebody has asked to stop."""
        try:
            self._recording.finish(ended.reason, ended.at)
        except FlightNotWrittenError:
            if not self._wiring.live or self._stop_request.is_requested:
                raise
        else:
            return
        while not self._store.is_finished:
            self._heartbeats.disk()
            if self._has_open_segment():
                with suppress(FlightNotWrittenError):
                    self._store.finish(ended.reason, self._wiring.clock.read())

    def _handle(self, item: Arrival | Notice | None) -> Ended | None:
        if isinstance(item, Arrival):
            self._recording.store(item)
        elif isinstance(item, Notice):
            self._recording.note(item)
        else:
            return self._idle()
        return None

    def _idle(self) -> Ended | None:
        now = self._wiring.clock.read()
        if self._wiring.live:
            self._recording.tick(now)
        if self._stop_request.is_requested:
            self._patience_s -= TICK_S
            if self._patience_s <= 0:
                return Ended(f"{self._stop_request.reason}; the camera did not answer", now)
        return None

    def _has_open_segment(self) -> bool:
        clock = self._wiring.clock
        if self._store.is_open or self._store.open(clock.read()):
            return True
        if self._stop_request.is_requested:
            if not self._store.try_now(clock.read()) and self._store.trouble is not None:
                raise self._store.trouble.failure
        else:
            clock.wait_until(clock.read().monotonic_ns + round(LOOK_S * NS_PER_S), self._stop_request.event)
        return False
