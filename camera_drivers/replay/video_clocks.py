"""When a video was taken: what its clocks say, and which of them is believed.

None is believed unless somebody says so: a creation time is often local time that is labelled UTC, and the same in
every chapter; a timecode knows no day; a file's date is when it was copied.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from camera_drivers.errors import ReplayError
from flight_file.frame import NS_PER_S
from flight_file.session import UNKNOWN

CREATION, TIMECODE, FILE_DATE = "creation time", "timecode", "file date"
CLOCKS = {"creation": CREATION, "timecode": TIMECODE}
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_TIMECODE = re.compile(r"(\d\d):(\d\d):(\d\d)[:;](\d\d)")
_OFFSET = re.compile(r"([+-])(\d\d):(\d\d)")
_SIGMA_NS = NS_PER_S // 2  # of a clock that is read to a second


@dataclass(frozen=True, slots=True)
class Believed:
    """What somebody said of a video's time.

    Attributes
    ----------
    start
        When its first picture was taken, ISO 8601; None if nobody knows.
    clock
        Which of CLOCKS is believed; None for none.
    utc_offset
        By how much that clock, or `start`, is ahead of UTC, `+hh:mm`; None where it is UTC or says so itself.
    """

    start: str | None = None
    clock: str | None = None
    utc_offset: str | None = None


@dataclass(frozen=True, slots=True)
class Start:
    """When a video's time is 0: ns since 1970 with its standard deviation, and who says so (see `Session`)."""

    time_ns: int
    sigma_ns: int | None
    time_of_day: str


def started(believed: Believed, facts: Mapping[str, str], rate_hz: float, name: str) -> Start:
    """Find out when a video began.

    Parameters
    ----------
    facts
        What the file's clocks say, by name.
    rate_hz
        Of its pictures, for the last two digits of a timecode.

    Raises
    ------
    ReplayError
        The clock that is believed says nothing, or what was typed is no time.
    """
    ahead = _ahead(believed.utc_offset)
    if believed.start is not None and believed.clock is not None:
        raise ReplayError("--start and --clock both say when the video began; leave one out.")
    if believed.start is not None:
        return Start(_ns(_typed(believed.start, ahead)), _SIGMA_NS, "start")
    if believed.clock is None:
        if ahead is not None:
            raise ReplayError("--utc-offset says nothing by itself; give --start or --clock too.")
        return Start(0, None, UNKNOWN)
    said = facts.get(CLOCKS[believed.clock])
    if said is None or (believed.clock == "timecode" and CREATION not in facts):
        raise ReplayError(f"{name}: has no {CLOCKS[believed.clock]}; give --start, or leave --clock out.")
    moment = _creation(facts[CREATION], name) if CREATION in facts else _EPOCH
    if believed.clock == "timecode":
        moment = _by_timecode(moment, said, rate_hz, name)
    return Start(_ns(moment - (ahead or timedelta())), _SIGMA_NS, believed.clock)


def _ahead(offset: str | None) -> timedelta | None:
    if offset is None:
        return None
    match = _OFFSET.fullmatch(offset)
    if match is None:
        raise ReplayError(f"{offset!r} is no offset; write it like +02:00.")
    sign, hours, minutes = match.groups()
    return (1 if sign == "+" else -1) * timedelta(hours=int(hours), minutes=int(minutes))


def _typed(text: str, ahead: timedelta | None) -> datetime:
    try:
        moment = datetime.fromisoformat(text)
    except ValueError as error:
        raise ReplayError(f"{text!r} is no time; write it like 2026-05-04T09:30:00Z.") from error
    if (moment.tzinfo is None) != (ahead is not None):
        raise ReplayError(f"{text}: needs a Z, an offset, or --utc-offset, and only one of them.")
    moment = moment if ahead is None else moment.replace(tzinfo=UTC) - ahead
    if moment.astimezone(UTC) < _EPOCH:
        raise ReplayError(f"{text}: lies before 1970; write it like 2026-05-04T09:30:00Z.")
    return moment


def _creation(text: str, name: str) -> datetime:
    try:
        moment = datetime.fromisoformat(text)
    except ValueError as error:
        raise ReplayError(f"{name}: its creation time is {text!r}, which is no time; give --start.") from error
    return moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment


def _by_timecode(day: datetime, timecode: str, rate_hz: float, name: str) -> datetime:
    match = _TIMECODE.fullmatch(timecode)
    if match is None:
        raise ReplayError(f"{name}: its timecode is {timecode!r}, which is no time; give --start.")
    hours, minutes, seconds, frames = map(int, match.groups())
    midnight = day.replace(hour=0, minute=0, second=0, microsecond=0)
    return midnight + timedelta(hours=hours, minutes=minutes, seconds=seconds + frames / max(rate_hz, 1.0))


def _ns(moment: datetime) -> int:
    time_ns = (moment.astimezone(UTC) - _EPOCH) // timedelta(microseconds=1) * 1000
    if time_ns < 0:
        raise ReplayError(f"{moment.isoformat()} lies before 1970; give --start.")
    return time_ns


def disagreements(facts: Mapping[str, str]) -> str:
    """Say how far a video's clocks are apart, as far as they can be compared; empty if one is all there is."""
    creation, timecode = facts.get(CREATION), facts.get(TIMECODE)
    if creation is None or timecode is None or not _TIMECODE.fullmatch(timecode):
        return ""
    try:
        apart = datetime.fromisoformat(creation)
    except ValueError:
        return ""
    hours, minutes, seconds = (int(part) for part in timecode[:8].split(":"))
    apart_s = (hours * 3600 + minutes * 60 + seconds) - (apart.hour * 3600 + apart.minute * 60 + apart.second)
    return f"the timecode is {abs(apart_s)} s {'ahead of' if apart_s > 0 else 'behind'} the creation time"
