"""When a video was taken: its clocks, and which of them is trusted.

None is trusted unless a person says so: a creation time is often local time labelled UTC, and the same in every
chapter; a timecode has no date; a file's date is when it was copied; a GPS receiver may lack leap seconds (see
`telemetry`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

from camera_drivers.errors import ReplayError
from flight_file.frame import NS_PER_S
from flight_file.session import UNKNOWN

CREATION, TIMECODE, FILE_DATE, GPS = "creation time", "timecode", "file date", "GPS time"
CLOCKS = {"creation": CREATION, "timecode": TIMECODE, "gps": GPS}
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_TIMECODE = re.compile(r"([01]\d|2[0-3]):([0-5]\d):([0-5]\d)[:;](\d\d)")  # a counter that runs on past a day is no time
_OFFSET = re.compile(r"([+-])(\d\d):(\d\d)")
_SIGMA_NS = NS_PER_S // 2  # of a clock read to a second


@dataclass(frozen=True, slots=True)
class Believed:
    """A person's statement on a video's time.

    Attributes
    ----------
    start
        When its first picture was taken, ISO 8601; None if unknown.
    clock
        Which of CLOCKS is trusted; None for none.
    utc_offset
        By how much that clock, or `start`, is ahead of UTC, `+hh:mm`; None if it is UTC or states its offset itself.
    """

    start: str | None = None
    clock: str | None = None
    utc_offset: str | None = None


@dataclass(frozen=True, slots=True)
class Start:
    """When a video's time is 0: ns since 1970 with standard deviation, and the source (see `Session`)."""

    time_ns: int
    sigma_ns: int | None
    time_of_day: str


@dataclass(frozen=True, slots=True)
class GpsClock:
    """The time by a GPS receiver.

    Attributes
    ----------
    zero_ns
        When the film's time is 0: UTC since the Unix epoch.
    sigma_ns
        Standard deviation of one of its times.
    times, apart
        Number of times whose median it is, and how many of them are more than half a second off.
    """

    zero_ns: int
    sigma_ns: int
    times: int
    apart: int

    @property
    def moment(self) -> datetime:
        """The film's time 0, to a microsecond."""
        return _EPOCH + timedelta(microseconds=self.zero_ns / 1000)

    @property
    def fact(self) -> str:
        """In words, for the session."""
        off = f", {self.apart} of them more than 0.5 s off" if self.apart else ""
        said = f"{self.moment:%Y-%m-%dT%H:%M:%S}.{self.moment.microsecond // 1000:03d}Z at the film's time 0"
        return f"{said}, sigma {self.sigma_ns / NS_PER_S:.2f} s, by {self.times} times{off}"


def gps_of_chapters(clocks: Sequence[GpsClock | None], begins_ns: Sequence[int]) -> GpsClock | None:
    """Choose a recording's GPS time: that of the first chapter that has one, carried back to the beginning.

    Parameters
    ----------
    clocks
        Of each chapter, for that chapter.
    begins_ns
        When each chapter begins, by the recording's own clock.
    """
    for clock, begin_ns in zip(clocks, begins_ns, strict=True):
        if clock is not None:
            return replace(clock, zero_ns=clock.zero_ns - begin_ns)
    return None


def shift_of_chapter(own: GpsClock, first: GpsClock, begin_ns: int) -> str:
    """Describe how far a chapter's GPS time is from the recording's at that moment; empty if it is the same."""
    shift_s = (own.zero_ns - begin_ns - first.zero_ns) / NS_PER_S
    if not begin_ns or not round(shift_s, 2):
        return ""
    return f"; {abs(shift_s):.2f} s {'ahead of' if shift_s > 0 else 'behind'} the chapters before"


def started(
    believed: Believed, facts: Mapping[str, str], rate_hz: float, name: str, gps: GpsClock | None = None
) -> Start:
    """Find out when a video began.

    Parameters
    ----------
    facts
        The file's clocks, by name.
    gps
        Its GPS time; None if it has none, or never had a fix.
    rate_hz
        Of its pictures, for the last two digits of a timecode.

    Raises
    ------
    ReplayError
        The trusted clock says nothing, or the typed text is not a time.
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
    if believed.clock == "gps":
        return _by_gps(gps, ahead, facts, name)
    said = facts.get(CLOCKS[believed.clock])
    if said is None or (believed.clock == "timecode" and CREATION not in facts):
        raise ReplayError(f"{name}: has no {CLOCKS[believed.clock]}; give --start, or leave --clock out.")
    moment = _creation(facts[CREATION], name) if CREATION in facts else _EPOCH
    if believed.clock == "timecode":
        moment = _by_timecode(moment, said, rate_hz, name)
    return Start(_ns(moment - (ahead or timedelta())), _SIGMA_NS, believed.clock)


def _by_gps(gps: GpsClock | None, ahead: timedelta | None, facts: Mapping[str, str], name: str) -> Start:
    if ahead is not None:
        raise ReplayError("GPS time is UTC; leave --utc-offset out.")
    if gps is None or gps.zero_ns < 0:
        why = facts.get("GPS", "it has no telemetry")
        raise ReplayError(f"{name}: has no {GPS} ({why}); give --start, or leave --clock out.")
    return Start(gps.zero_ns, gps.sigma_ns, "gps")


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


def disagreements(facts: Mapping[str, str], gps: GpsClock | None = None, typed_ns: int | None = None) -> str:
    """Describe how far a video's clocks are apart, as far as they can be compared; empty if there is only one.

    Parameters
    ----------
    gps
        Its GPS time.
    typed_ns
        When its time is 0 by what a person typed; None if nothing was typed.
    """
    timecode = _TIMECODE.fullmatch(facts.get(TIMECODE, ""))
    try:
        creation = _creation(facts[CREATION], "")
    except (KeyError, ReplayError):
        creation = None
    said = []
    if timecode is not None and creation is not None:
        said.append(_apart("timecode", _of_day_s(timecode, creation), "creation time"))
    if gps is not None and creation is not None:
        said.append(_apart(GPS, (gps.moment - creation).total_seconds(), "creation time"))
    elif gps is not None and timecode is not None:
        said.append(_apart("timecode", _of_day_s(timecode, gps.moment), GPS))
    if gps is not None and typed_ns is not None:
        said.append(_apart("time that was typed", (typed_ns - gps.zero_ns) / NS_PER_S, GPS))
    return "; ".join(said)


def _of_day_s(timecode: re.Match[str], other: datetime) -> float:
    """Return how far a timecode is ahead of another clock's time of day, s."""
    hours, minutes, seconds = (int(part) for part in timecode.groups()[:3])
    return float((hours - other.hour) * 3600 + (minutes - other.minute) * 60 + seconds - other.second)


def _apart(clock: str, apart_s: float, other: str) -> str:
    """Describe how far a clock is from another; beyond an hour, a time zone may be the reason."""
    if not round(apart_s, 1):
        return f"the {clock} and the {other} agree"
    minutes, seconds = divmod(abs(round(apart_s, 1)), 60)
    hours, minutes = divmod(int(minutes), 60)
    days, hours = divmod(hours, 24)
    far = f"{f'{days} d ' if days else ''}{hours} h {minutes} min {round(seconds, 1):g} s"
    far = far if days or hours else f"{abs(round(apart_s, 1)):g} s"
    return f"the {clock} is {far} {'ahead of' if apart_s > 0 else 'behind'} the {other}"
