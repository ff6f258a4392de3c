"""What a recording will be called, where it will lie, and what it will say about itself."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta

from flight_file.errors import FlightNotWrittenError
from flight_file.frame import ClockReading
from flight_file.segments import Plan, free_recording_name
from flight_file.session import Session
from recorder.config import RecorderConfig
from recorder.drivers import Wiring
from recorder.evidence import configured_signer
from recorder.host import Host

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def recording_name(start: ClockReading) -> str:
    """A name that sorts by time: `20180504T120000Z`."""
    return f"{_EPOCH + timedelta(microseconds=start.realtime_ns // 1000):%Y%m%dT%H%M%SZ}"


def plan_recording(
    config: RecorderConfig, host: Host, wiring: Wiring, *, attachments: Mapping[str, bytes], name: str | None
) -> Plan:
    """Directory, session and attachments of a recording that begins now.

    Parameters
    ----------
    attachments
        What the configuration attaches; if that is neither panel nor camera, what the source brings along goes with it.
    name
        Of the recording; its start time if None.

    Raises
    ------
    FlightNotWrittenError
        The directory cannot be made or listed.
    ConfigurationError
        The key to sign with cannot be used.
    """
    at = wiring.clock.read()
    directory = config.storage.directory
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = f"cannot be made ({error.strerror}); check storage.directory"
        raise FlightNotWrittenError(directory, reason=reason) from error
    identity = wiring.camera.identity
    session = Session(
        recording=free_recording_name(directory, name or recording_name(at)),
        started=at,
        clock=clock_name(wiring),
        boot_id=host.boot_id,
        host=host.name,
        camera_driver=identity.driver,
        camera_model=identity.model,
        camera_serial=identity.serial,
        versions=host.versions,
    )
    carried = {} if config.attach.panel or config.attach.camera else wiring.attachments
    return Plan(
        directory=directory,
        session=session,
        attachments={**carried, **attachments},
        segment_ns=round(config.storage.segment_s * 1e9),
        signer=configured_signer(config.evidence),
    )


def clock_name(wiring: Wiring) -> str:
    """What the session says about the clock."""
    return "system" if wiring.live else "simulated"
