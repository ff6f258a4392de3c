"""The simulated camera's faults, by name.

A fault has a place: a recurring event, such as a shot or a download. It is ordered for one of these, counted from the
start, or for the next one.
"""

from __future__ import annotations

import threading
from collections import Counter
from dataclasses import dataclass

SHOT, DOWNLOAD, DESCRIPTION, STREAM, SEARCH = "shot", "download", "description", "stream", "search"


class UnknownFaultError(ValueError):
    """A fault is unknown, or not given as NAME or NAME@NUMBER."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A way to misbehave.

    Attributes
    ----------
    place
        What it happens to.
    what
        What happens, in words.
    """

    name: str
    place: str
    what: str


_TABLE = (
    Fault("lost_answer", SHOT, "the picture is taken, the connection is cut before the answer"),
    Fault("delayed", SHOT, "the picture is taken, the answer comes late"),
    Fault("dripping", SHOT, "the picture is taken, the answer comes byte by byte"),
    Fault("empty_answer", SHOT, "the picture is taken, the answer is empty"),
    Fault("not_json", SHOT, "the picture is taken, the answer is no JSON"),
    Fault("wrong_id", SHOT, "the picture is taken, the answer belongs to another question"),
    Fault("http_500", SHOT, "HTTP status 500, no picture"),
    Fault("http_503", SHOT, "HTTP status 503, no picture"),
    Fault("error_1", SHOT, "error 1, no picture"),
    Fault("error_403", SHOT, "error 403 though the call is listed, no picture"),
    Fault("error_40400", SHOT, "error 40400, no picture: it could not focus"),
    Fault("error_40401", SHOT, "error 40401, no picture: not ready"),
    Fault("error_40403", SHOT, "error 40403: the picture takes longer than the answer"),
    Fault("zero_host", SHOT, "the picture's address names the host 0.0.0.0"),
    Fault("foreign_host", SHOT, "the picture's address names a stranger's host"),
    Fault("reboot", SHOT, "the camera is gone instead of an answer, and comes back as after switching it on"),
    Fault("overheat", SHOT, "after the picture the camera reports an error, is gone, and comes back"),
    Fault("silent", SHOT, "for a while nothing is answered at all"),
    Fault("another_clock", SHOT, "as reboot, and the camera's clock is years behind"),
    Fault("drop_mid_download", DOWNLOAD, "the connection is cut in the middle of the picture"),
    Fault("cut_short", DOWNLOAD, "the picture ends in the middle, as announced"),
    Fault("damaged", DOWNLOAD, "the picture's tables are garbage"),
    Fault("without_exif", DOWNLOAD, "the picture has no EXIF"),
    Fault("without_length", DOWNLOAD, "the picture's length is not announced"),
    Fault("refused_download", DOWNLOAD, "HTTP status 404 instead of the picture"),
    Fault("huge_picture", DOWNLOAD, "a gigabyte instead of the picture"),
    Fault("huge_description", DESCRIPTION, "a gigabyte instead of the description"),
    Fault("liveview_junk", STREAM, "junk between the packets"),
    Fault("liveview_stall", STREAM, "the stream stops coming"),
    Fault("liveview_restart", STREAM, "the stream ends"),
    Fault("stranger", SEARCH, "strangers answer too, and first"),
)

FAULTS: dict[str, Fault] = {fault.name: fault for fault in _TABLE}
"""By name."""


class FaultSchedule:
    """The schedule of faults; used by several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._happened: Counter[str] = Counter()
        self._orders: dict[tuple[str, int], set[str]] = {}

    def order(self, name: str, *, at: int | None = None) -> None:
        """Schedule a fault.

        Parameters
        ----------
        name
            One of `FAULTS`.
        at
            At which one of its place, counted from 1 at the start; the next one if None.

        Raises
        ------
        UnknownFaultError
            There is no such fault.
        """
        if name not in FAULTS:
            raise UnknownFaultError(f"There is no fault {name!r}; there are {', '.join(FAULTS)}.")
        place = FAULTS[name].place
        with self._lock:
            number = self._happened[place] + 1 if at is None else at
            self._orders.setdefault((place, number), set()).add(name)

    def order_as_text(self, text: str) -> None:
        """Order a fault given as `NAME` or `NAME@NUMBER`; raises UnknownFaultError."""
        name, separator, number = text.partition("@")
        if separator and not (number.isascii() and number.isdigit() and int(number) > 0):
            raise UnknownFaultError(f"{text!r} is no fault; write NAME, or NAME@NUMBER counted from 1.")
        self.order(name, at=int(number) if separator else None)

    def due(self, place: str) -> frozenset[str]:
        """Return the faults that are due at this event."""
        with self._lock:
            self._happened[place] += 1
            return frozenset(self._orders.pop((place, self._happened[place]), ()))
