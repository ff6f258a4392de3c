"""The plan of a recording: its name, directory, attachments and signer.

Every segment carries panel.yaml with its pictures, camera.yaml and recorder.yaml. The panel is not interpreted here,
only searched for the pictures it names: every value of a key `picture`, at any depth.
"""

from __future__ import annotations

import errno
import os
import re
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from flight_file.errors import FlightNotReadableError, FlightNotWrittenError, KeyFileError
from flight_file.files import claimed
from flight_file.flight_writer import Plan
from flight_file.frame import NS_PER_S, ClockReading
from flight_file.session import (
    BEGUN_SUFFIX,
    PART_SUFFIX,
    Session,
    free_recording_name,
    is_left_over,
    parse_segment_name,
    segment_path,
)
from flight_file.signature import Signer, load_signer
from flight_file.untrusted import leads_out, read_named_in, read_regular, regular_names
from recorder.capture import Wiring
from recorder.config import AttachSettings, EvidenceSettings, RecorderConfig, checked_yaml
from recorder.errors import ConfigurationError
from recorder.host import Host
from recorder.marks import make_marks_folder
from recorder.thresholds import ATTACHMENTS_BYTES

PANEL = "panel.yaml"
CAMERA = "camera.yaml"
CONFIGURATION = "recorder.yaml"
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_LAST_S = 253_402_300_799  # 9999-12-31T23:59:59Z
_NAME_FORMAT = "%Y%m%dT%H%M%SZ"
_NAME = re.compile(r"(\d{8}T\d{6}Z)(-\d+)?", re.ASCII)
_TAKEN_BY = ("", PART_SUFFIX, BEGUN_SUFFIX)
_WRONG_NAME = (errno.ENAMETOOLONG, errno.ENOTDIR, errno.ELOOP, errno.EINVAL)


def gather_attachments(settings: AttachSettings, configuration: bytes) -> dict[str, bytes]:
    """Read the files to attach, by attachment name.

    Parameters
    ----------
    settings
        The files to attach.
    configuration
        Bytes of recorder.yaml; empty for a recording without one.

    Raises
    ------
    ConfigurationError
        A file cannot be read or is not YAML, the files are too large, or a panel names a picture outside its folder.
    """
    attachments: dict[str, bytes] = {}
    if settings.panel is not None:
        _add(attachments, PANEL, settings.panel, "attach.panel")
        for name in sorted(set(_pictures(checked_yaml(attachments[PANEL], settings.panel)))):
            _add_picture(attachments, name, settings.panel)
    if settings.camera is not None:
        _add(attachments, CAMERA, settings.camera, "attach.camera")
        checked_yaml(attachments[CAMERA], settings.camera)
    if configuration:
        attachments[CONFIGURATION] = configuration
    return attachments


def _pictures(node: Any) -> Iterator[str]:  # noqa: ANN401 - a YAML document
    if isinstance(node, dict):
        for key, value in node.items():
            if key == "picture" and isinstance(value, str):
                yield value
            else:
                yield from _pictures(value)
    elif isinstance(node, list):
        for value in node:
            yield from _pictures(value)


def _add_picture(attachments: dict[str, bytes], name: str, panel: Path) -> None:
    # The name is the attachment's name too: it has to mean the same wherever the flight is unpacked.
    if leads_out(name) or name in (PANEL, CAMERA, CONFIGURATION):
        raise ConfigurationError(f"{panel}: picture {name!r} must lie in the panel's folder or below; move it there.")
    with _failures_of(panel.parent / name, "attach.panel"):
        attachments[name] = read_named_in(panel, name, limit_bytes=_left_bytes(attachments))


def _add(attachments: dict[str, bytes], name: str, path: Path, setting: str) -> None:
    with _failures_of(path, setting):
        attachments[name] = read_regular(path, limit_bytes=_left_bytes(attachments))


def _left_bytes(attachments: Mapping[str, bytes]) -> int:
    return ATTACHMENTS_BYTES - sum(map(len, attachments.values()))


@contextmanager
def _failures_of(path: Path, setting: str) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        if error.errno == errno.EFBIG:
            problem = f"{setting}: with {path} the attachments are larger than 64 MiB; attach smaller files."
            raise ConfigurationError(problem) from error
        reason = f"cannot be read ({error.strerror}); check its name and permissions, and that its disk is there"
        raise ConfigurationError(f"{setting}: {path} {reason}.") from error


def configured_signer(settings: EvidenceSettings) -> Signer | None:
    """Load the key that signs finished segments; None if none is configured.

    Raises
    ------
    ConfigurationError
        The key cannot be read, or is not a key.
    """
    if settings.key is None:
        return None
    try:
        return load_signer(settings.key)
    except KeyFileError as error:
        raise ConfigurationError(f"evidence.key: {error}") from error


def recording_name(start: ClockReading) -> str:
    """Name a recording so that names sort by time: `20180504T120000Z`."""
    return _name_of(start.realtime_ns // NS_PER_S)


def newest_recording_name(directory: Path, start: ClockReading) -> str:
    """Name a recording so that it sorts after all others, even if the wall clock went back by years.

    It is named by the time of its start, or a second after the newest recording in the directory. Only the name is
    adjusted: the times inside are the clocks' own.

    Raises
    ------
    FlightNotWrittenError
        The directory cannot be listed.
    """
    seconds = start.realtime_ns // NS_PER_S
    try:
        names = _names(directory)
    except OSError as error:
        reason = f"cannot be listed ({error.strerror}); check storage.directory"
        raise FlightNotWrittenError(directory, reason=reason) from error
    by_time = sorted(names, reverse=True)  # these names sort so; others among them are skipped
    newest_s = next((taken_s for name in by_time if (taken_s := _seconds_of(name)) is not None), seconds - 1)
    return free_recording_name(directory, _name_of(max(seconds, newest_s + 1)))


def plan_recording(
    config: RecorderConfig,
    host: Host,
    wiring: Wiring,
    *,
    attachments: Mapping[str, bytes],
    name: str | None,
    signer: Signer | None = None,
) -> Plan:
    """Plan directory, session and attachments of a recording that begins now.

    Parameters
    ----------
    attachments
        What the configuration attaches; if that is neither panel nor camera, the source's attachments are added.
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
        raise FlightNotWrittenError(directory, reason=_why_not_made(error)) from error
    if wiring.live:
        # No error here: a full disk that has no room for this folder still has old recordings to delete, and `recorder
        # mark` reports it if the folder cannot be used.
        with suppress(OSError):
            make_marks_folder(directory)
    _remove_left_over(directory)
    carried = {} if config.attach.panel or config.attach.camera else wiring.attachments
    return Plan(
        directory=directory,
        session=_session(_free_name(directory, at, wiring, name), at, host, wiring),
        attachments={**carried, **attachments},
        segment_ns=round(config.storage.segment_s * NS_PER_S),
        segment_bytes=round(config.storage.segment_mib * 2**20),
        segment_frames=config.storage.segment_frames,
        signer=signer,
    )


def _why_not_made(error: OSError) -> str:
    if error.errno == errno.EEXIST:  # what was there at the start was no file: a link to a disk that is missing
        return f"cannot be made: {error.filename} leads to nothing that is there; bring the disk it leads to"
    return f"cannot be made ({error.strerror}); check storage.directory"


def _session(recording: str, at: ClockReading, host: Host, wiring: Wiring) -> Session:
    """Make the session: what is recorded, since when, by which machine and camera."""
    identity = wiring.camera.identity
    return Session(
        recording=recording,
        started=at,
        clock=clock_name(wiring),
        boot_id=host.boot_id,
        host=host.name,
        camera_driver=identity.driver,
        camera_model=identity.model,
        camera_serial=identity.serial,
        versions=host.versions,
        time_of_day=identity.time_of_day,
        originals=identity.originals,
    )


def refuse_wrong_directory(directory: Path) -> None:
    """Raise ConfigurationError if the recordings can never go there; a missing disk may still be mounted."""
    try:
        if stat.S_ISDIR(directory.stat().st_mode):
            return
        reason = "is no directory"
    except OSError as error:
        if error.errno not in _WRONG_NAME:
            return
        reason = f"cannot be a directory: {_why_never(directory, error)}"
    raise ConfigurationError(f"storage.directory: {directory} {reason}; name one where recordings can go.")


def _why_never(directory: Path, error: OSError) -> str:
    """Say in words why a path can be no directory: which of the names on the way is no directory, or a circle."""
    for part in reversed(directory.parents):
        try:
            if not stat.S_ISDIR(part.stat().st_mode):
                return f"{part}, on the way there, is none"
        except OSError as on_the_way:
            if on_the_way.errno != errno.ELOOP:
                break
            return f"{part}, on the way there, is a link that leads in a circle"
    return "it is a link that leads in a circle" if error.errno == errno.ELOOP else f"{error.strerror}"


def with_free_number(plan: Plan) -> Plan:
    """Advance the plan to the first segment number that is free.

    Raises
    ------
    FlightNotWrittenError
        The directory cannot be listed.
    """
    recording, segment = plan.session.recording, plan.session.segment
    try:
        names = set(_names(plan.directory))
    except OSError as error:
        reason = f"cannot be listed ({error.strerror}); bring the disk back"
        raise FlightNotWrittenError(plan.directory, reason=reason) from error
    while {segment_path(plan.directory, recording, segment).name + end for end in _TAKEN_BY} & names:
        segment += 1
    return replace(plan, session=replace(plan.session, segment=segment))


def with_free_name(plan: Plan) -> Plan:
    """Rename the plan's recording if another recorder, started in the same second, was faster.

    Raises
    ------
    FlightNotWrittenError
        The directory cannot be listed.
    """
    match = _NAME.fullmatch(plan.session.recording)
    recording = free_recording_name(plan.directory, match[1] if match else plan.session.recording)
    return replace(plan, session=replace(plan.session, recording=recording))


def clock_name(wiring: Wiring) -> str:
    """Return what the session says about the clock."""
    return "system" if wiring.live else "simulated"


def _free_name(directory: Path, at: ClockReading, wiring: Wiring, name: str | None) -> str:
    if name is None and wiring.live:
        return newest_recording_name(directory, at)
    return free_recording_name(directory, name or recording_name(at))


def _remove_left_over(directory: Path) -> None:
    """Remove what a power cut left of segments without a picture, recoveries, signatures; not what is written just now.

    A recovery begins anew; but its file may be deleted before there is room for that, and then nothing else would ever
    remove what is left.
    """
    with suppress(OSError):
        for path in (directory / name for name in regular_names(directory) if is_left_over(name)):
            with suppress(FlightNotReadableError, OSError), claimed(path) as ours:
                if ours:
                    path.unlink()


def _names(directory: Path) -> list[str]:
    with os.scandir(directory) as entries:
        return [entry.name for entry in entries]


def _name_of(seconds: int) -> str:
    return f"{_EPOCH + timedelta(seconds=min(max(seconds, 0), _LAST_S)):{_NAME_FORMAT}}"


def _seconds_of(name: str) -> int | None:
    """Parse when a recording of this file name began; None for another file's name."""
    parsed = parse_segment_name(Path(name))
    match = _NAME.fullmatch(parsed[0]) if parsed else None
    if match is None:
        return None
    try:
        moment = datetime.strptime(match[1], _NAME_FORMAT).replace(tzinfo=UTC)
    except ValueError:
        return None
    return (moment - _EPOCH) // timedelta(seconds=1)
