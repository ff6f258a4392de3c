"""Puts a recording's parts together from the configuration, the machine and the camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from flight_file.reports import CameraStatus
from flight_file.salvage import recover_segment
from flight_file.segments import Plan
from flight_file.signature import Signer
from recorder.drivers import Wiring
from recorder.drops import Drops
from recorder.frame_queue import FrameQueue
from recorder.host import Host
from recorder.journal import Journal
from recorder.plan import clock_name, plan_recording
from recorder.recording import Gauges, Recording
from recorder.retention import Retention, Rules
from recorder.salvage import Salvager, files_in_work
from recorder.settings import RecorderConfig
from recorder.store import Store

_NS_PER_HOUR = 3600 * 1_000_000_000


@dataclass(frozen=True, slots=True)
class Assembly:
    """What all parts of one recording are made from."""

    config: RecorderConfig
    host: Host
    wiring: Wiring
    journal: Journal
    drops: Drops
    queue: FrameQueue
    signer: Signer | None

    def store(self, *, attachments: Mapping[str, bytes], name: str | None, salvager: Salvager | None) -> Store:
        """Where everything goes.

        Parameters
        ----------
        attachments
            What the configuration attaches.
        name
            Of the recording; its start time if None.
        salvager
            Gets what is left in work; None to leave it alone.
        """

        def plan() -> Plan:
            made = plan_recording(
                self.config, self.host, self.wiring, attachments=attachments, name=name, signer=self.signer
            )
            for path in files_in_work(made.directory) if salvager else []:
                left_behind(path)
            return made

        def left_behind(path: Path) -> None:
            if salvager is not None:
                salvager.submit(path)

        return Store(
            plan,
            status=self._first_status(),
            retention=self._retention(),
            endures=self.wiring.live,
            drops=self.drops,
            journal=self.journal,
            left_behind=left_behind,
        )

    def salvager(self) -> Salvager | None:
        """Who finishes what is left in work, at work already; None for a fast replay, which leaves it alone."""
        if not self.wiring.live:
            return None

        def recover(path: Path) -> str:
            return recover_segment(path, at=self.host.clock.read(), signer=self.signer).outcome.value

        salvager = Salvager(recover, free_bytes=self.host.free_bytes, journal=self.journal)
        salvager.start()
        return salvager

    def gauges(self) -> Gauges:
        """What the health reports show."""
        live = self.wiring.live
        return Gauges(
            clock_state=self.host.clock_state if live else lambda: clock_name(self.wiring),
            free_bytes=lambda: self.host.free_bytes(self.config.storage.directory),
            temperatures_c=lambda: dict(self.host.temperatures_c()),
            # A camera that waits for the disk fills the queue as the threads happen to run; that is no news about the
            # flight.
            queued=lambda: len(self.queue) if live else None,
        )

    def _retention(self) -> Retention:
        storage = self.config.storage
        rules = Rules(
            reserve_bytes=round(storage.keep_free_gib * 2**30),
            keep_ns=round(storage.keep_hours * _NS_PER_HOUR),
            max_ns=None if storage.max_hours is None else round(storage.max_hours * _NS_PER_HOUR),
        )
        return Retention(storage.directory, rules, free_bytes=self.host.free_bytes, journal=self.journal)

    def _first_status(self) -> CameraStatus:
        identity = self.wiring.camera.identity
        words = f"{identity.driver}: {identity.note}" if identity.note else identity.driver
        return CameraStatus("connecting" if self.wiring.live else "connected", words)


def in_one_line(store: Store, recording: Recording, drops: Drops) -> str:
    """How it goes, for `systemctl status`."""
    trouble, status = store.trouble, store.status
    if trouble is not None:
        return f"The disk fails, the newest pictures wait in memory: {trouble.failure}"
    lost = f", {drops.total} lost" if drops.total else ""
    why = f" ({status.reason})" if status.reason else ""
    return f"{store.stored} pictures stored, {recording.rate_hz:.1f} Hz{lost}; camera {status.state}{why}"
