"""What a recording will be called, where it will lie, and what it will say about itself."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

from flight_file.errors import FlightNotWrittenError
from flight_file.frame import ClockReading
from flight_file.segments import Plan, free_recording_name, parse_segment_name, segment_path
from flight_file.session import Session
from flight_file.signature import Signer
from flight_file.writer import PART_SUFFIX
from recorder.drivers import Wiring
from recorder.host import Host
from recorder.settings import RecorderConfig

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_LAST_S = 253_402_300_799  # 9999-12-31T23:59:59Z
_NAME_FORMAT = "%Y%m%dT%H%M%SZ"
_NAME = re.compile(r"(\d{8}T\d{6}Z)(-\d+)?")
_NS_PER_S = 1_000_000_000


def recording_name(start: ClockReading) -> str:
    """A name that sorts by time: `20180504T120000Z`."""
    return _name_of(start.realtime_ns // _NS_PER_S)


def newest_recording_name(directory: Path, start: ClockReading) -> str:
    """A name that sorts after those of all recordings that are there, even if the wall clock went back by years.

    It is the start's time, or a second after the newest that is there. Only the name pretends: the times inside are
    what the clocks said.

    Raises
    ------
    FlightNotWrittenError
        The directory cannot be listed.
    """
    seconds = start.realtime_ns // _NS_PER_S
    try:
        names = [path.name for path in directory.iterdir()]
    except OSError as error:
        reason = f"cannot be listed ({error.strerror}); check storage.directory"
        raise FlightNotWrittenError(directory, reason=reason) from error
    taken = [taken_s for name in names if (taken_s := _seconds_of(name)) is not None]
    return free_recording_name(directory, _name_of(max([seconds, *(taken_s + 1 for taken_s in taken)])))


def plan_recording(
    config: RecorderConfig,
    host: Host,
    wiring: Wiring,
    *,
    attachments: Mapping[str, bytes],
    name: str | None,
    signer: Signer | None = None,
) -> Plan:
    """Directory, session and attachments of a recording that begins now.

    Parameters
    ----------
    attachments
        What the configuration attaches; if that is neither panel nor camera, what the source brings along goes with it.
    name
        Of the recording; its start time if None.
    signer
        Signs each finished segment; None for no signatures.

    Raises
    ------
    FlightNotWrittenError
        The directory cannot be made or listed.
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
        recording=_free_name(directory, at, wiring, name),
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
        segment_ns=round(config.storage.segment_s * _NS_PER_S),
        segment_bytes=round(config.storage.segment_mib * 2**20),
        signer=signer,
    )


def with_free_number(plan: Plan) -> Plan:
    """The plan with the first segment number, from its own on, under which there is nothing.

    Raises
    ------
    FlightNotWrittenError
        The directory cannot be listed.
    """
    recording, segment = plan.session.recording, plan.session.segment
    try:
        names = {path.name for path in plan.directory.iterdir()}
    except OSError as error:
        reason = f"cannot be listed ({error.strerror}); bring the disk back"
        raise FlightNotWrittenError(plan.directory, reason=reason) from error
    while {(name := segment_path(plan.directory, recording, segment).name), name + PART_SUFFIX} & names:
        segment += 1
    return replace(plan, session=replace(plan.session, segment=segment))


def clock_name(wiring: Wiring) -> str:
    """What the session says about the clock."""
    return "system" if wiring.live else "simulated"


def _free_name(directory: Path, at: ClockReading, wiring: Wiring, name: str | None) -> str:
    if name is None and wiring.live:
        return newest_recording_name(directory, at)
    return free_recording_name(directory, name or recording_name(at))


def _name_of(seconds: int) -> str:
    return f"{_EPOCH + timedelta(seconds=min(max(seconds, 0), _LAST_S)):{_NAME_FORMAT}}"


def _seconds_of(name: str) -> int | None:
    """When a recording with this file name began; None if it is no recording's."""
    parsed = parse_segment_name(Path(name))
    match = _NAME.fullmatch(parsed[0]) if parsed else None
    if match is None:
        return None
    try:
        moment = datetime.strptime(match[1], _NAME_FORMAT).replace(tzinfo=UTC)
    except ValueError:
        return None
    return (moment - _EPOCH) // timedelta(seconds=1)
