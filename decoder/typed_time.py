"""A time of a flight as people type it: seconds or a clock from its start, or UTC.

`90`, `90.5`, `1:30` and `0:01:30` are counted from the flight's first frame. What ends with Z, or has a date, is UTC:
`12:01:30Z`, `2018-05-04 12:01:30`, `2018-05-04T12:01:30.25Z`, `2018-05-04T14:01:30+02:00`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime
from decimal import Decimal

NS_PER_S = 1_000_000_000
NS_PER_DAY = 86_400 * NS_PER_S
EXAMPLES = "90, 1:30, 12:01:30Z or 2018-05-04T12:01:30Z"

_SECONDS = re.compile(r"\d+(\.\d*)?|\.\d+")
_CLOCK = re.compile(r"((?P<hours>\d+):)?(?P<minutes>\d+):(?P<seconds>[0-5]\d(\.\d*)?)(?P<utc>[Zz])?")
_DATE = re.compile(
    r"(?P<second>\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?)(?P<fraction>\.\d+)?(?P<zone>[Zz]|[+-]\d\d:?\d\d)?"
)


@dataclass(frozen=True, slots=True)
class TypedTime:
    """A moment of a flight, once its start is known.

    Attributes
    ----------
    ns
        Counted from the flight's start, from midnight UTC, or from the Unix epoch.
    since
        Which of them.
    """

    ns: int
    since: str

    def at_ns(self, began_ns: int) -> int:
        """The moment, ns since the Unix epoch, of a flight that began then; of a time of day, the first one after."""
        if self.since == "start":
            return began_ns + self.ns
        if self.since == "midnight":
            return began_ns + (self.ns - began_ns) % NS_PER_DAY
        return self.ns


def typed_time(text: str) -> TypedTime:
    """What somebody means.

    Raises
    ------
    ValueError
        If it is none of these.
    """
    text = text.strip()
    if _SECONDS.fullmatch(text):
        return TypedTime(_ns(text), "start")
    clock = _CLOCK.fullmatch(text)
    if clock is not None:
        return _on_clock(clock)
    date = _DATE.fullmatch(text)
    if date is None:
        raise ValueError(f"{text!r} is no time: {EXAMPLES}")
    try:
        moment = datetime.fromisoformat(date["second"] + (date["zone"] or "Z").upper())
    except ValueError as error:
        raise ValueError(f"{text!r} is no time: {error}") from error
    whole = round((moment - datetime(1970, 1, 1, tzinfo=UTC)).total_seconds())
    return TypedTime(whole * NS_PER_S + _ns(date["fraction"] or "0"), "epoch")


def _on_clock(clock: re.Match[str]) -> TypedTime:
    hours, minutes, rest_ns = int(clock["hours"] or 0), int(clock["minutes"]), _ns(clock["seconds"])
    if clock["utc"] is None:
        return TypedTime((hours * 3600 + minutes * 60) * NS_PER_S + rest_ns, "start")
    if clock["hours"] is None:  # 12:01Z is an hour and a minute
        hours, minutes, rest_ns = minutes, rest_ns // NS_PER_S, 0
    ns = (hours * 3600 + minutes * 60) * NS_PER_S + rest_ns
    if ns >= NS_PER_DAY:
        raise ValueError(f"{clock[0]!r} is no time of a day")
    return TypedTime(ns, "midnight")


def _ns(seconds: str) -> int:
    return int(Decimal(seconds) * NS_PER_S)
