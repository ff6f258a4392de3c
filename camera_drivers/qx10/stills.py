"""Taking one still: the camera is made ready, one shot is taken, and its picture is fetched.

              due
               │
               ▼                        refused
          ┌─ ready? ──IDLE──▶ shoot ──────────────▶ not taken: reported, the next one is due
          │    ▲                │ │ └─no answer─▶ search ──nothing──▶ lost: reported, the next one is due
          └────┘                │ └─not finished─▶ await ─┐  │
     not within ready_s:        │ address                 │  │ address
     CameraError                ▼                         │  │
                              fetch ◀─────────────────────┴──┘
                                │ │
                          whole │ └─not whole─▶ fetch again ──▶ whole: frame, not whole: lost
                                ▼
                              frame

A shot without an answer may have been taken, so it is never repeated: its picture is looked for in what the camera
reports, and otherwise it is lost, with a reason. If a picture comes twice with the same damage, the camera has no
better one; it is kept and the damage reported, since part of a panel is better than nothing.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from camera_drivers.clock import Clock
from camera_drivers.errors import CameraError, CameraRefusedError, CameraSilentError, CameraUnreachableError
from camera_drivers.jpeg import jpeg_facts
from camera_drivers.qx10.addresses import BadUrlError, at_host, host_of
from camera_drivers.qx10.events import ERROR, IDLE, Events
from camera_drivers.qx10.picture import fault_of
from camera_drivers.qx10.remote_api import Code, RemoteApi
from camera_drivers.thresholds import AGAIN_S, MAX_DOWNLOADS, MAX_FAILURES, MAX_SHOTS, REST_S
from camera_drivers.waiting import Notes, Stopped
from flight_file.frame import ClockReading, HostTimes

NO_ADDRESS = "no usable answer to the shot"
STOPPED = "stopped before the picture was there"

_OK = 200

# Codes with which no picture was taken. After any other it may have been.
_NOT_TAKEN = frozenset({3, 4, 5, 7, 8, 9, 10, 11, 12, 13, 14, 15, 401, 403, 404, 406, 413, 414, 501, 503}) | {
    Code.SHOOTING_FAILED,
    Code.NOT_READY,
}


@dataclass(frozen=True, slots=True)
class Shot:
    """A picture, and the box's clocks while it was fetched."""

    jpeg: bytes
    times: HostTimes


class NotTakenError(CameraError):
    """The camera refused to take a picture."""


class PictureLostError(CameraError):
    """A picture was, or may have been, taken but cannot be fetched; the message is the reason."""


class Stills:
    """Takes stills with one camera.

    Parameters
    ----------
    earlier
        Addresses of pictures that no shot to come can have made, by the camera's own address; it is kept over all
        connections, since the camera still tells of the last picture on a new one.
    """

    def __init__(self, api: RemoteApi, events: Events, clock: Clock, notes: Notes, earlier: deque[str]) -> None:
        self._api = api
        self._events = events
        self._clock = clock
        self._notes = notes
        self._waiter = api.link.waiter
        self._limits = api.link.limits
        self._asked = clock.read()
        self._earlier = earlier

    def take(self) -> Shot:
        """Take one picture.

        Raises
        ------
        NotTakenError
            The camera refused; nothing is lost.
        PictureLostError
            There may be a picture that cannot be fetched.
        CameraError
            The camera cannot be used until it is connected again.
        Stopped
            Stopping was asked for; if a picture was on its way, it is lost.
        """
        self.wait_until_ready()
        self._waiter.check()
        # Somebody pressed the button, or the search for an earlier shot ended before this was announced.
        for url in self._events.pictures:
            self._remember(url)
        try:
            url = self._shoot()
            answered = self._clock.read()
            jpeg = self._fetch(url)
        except Stopped as stopped:
            raise PictureLostError(STOPPED) from stopped
        return Shot(jpeg, HostTimes(before_request=self._asked, after_answer=answered, downloaded=self._clock.read()))

    def wait_until_ready(self) -> None:
        """Wait until the camera is idle.

        Raises
        ------
        CameraError
            It does not become idle in time, or does not say.
        """
        start = self._clock.read()
        silences = 0
        while (status := self._status()) != IDLE:
            silences = 0 if status else silences + 1
            if silences >= MAX_FAILURES:
                raise CameraError("The camera does not say how it is; it will be connected again.")
            if status == ERROR:
                self._notes.say_once("error", "the camera reports an error: it may be too hot, or lack its card")
            if _seconds(start, self._clock.read()) >= self._limits.ready_s:
                raise CameraError(f"The camera is not ready but {status or 'silent'}; it will be connected again.")
            self._waiter.pause(f"the camera is {status or 'silent'}", AGAIN_S)

    def _status(self) -> str | None:
        try:
            return self._events.ask(self._api).status
        except (CameraRefusedError, CameraSilentError):
            return None

    def _shoot(self) -> str:
        try:
            return _url(self._insist_on_shot())
        except CameraRefusedError as error:
            if error.code in _NOT_TAKEN:
                raise NotTakenError(str(error)) from error
            if error.code == Code.NOT_FINISHED:
                return self._await()
            problem = NO_ADDRESS
        except CameraSilentError as error:
            problem = error.problem
        return self._search(problem)

    def _insist_on_shot(self) -> list[object]:
        """Shoot; retry only if the camera says that it was not ready, so that nothing was taken."""
        for _ in range(MAX_SHOTS - 1):
            try:
                return self._ask_for_shot()
            except CameraRefusedError as error:
                if error.code != Code.NOT_READY:
                    raise
            self._waiter.pause("the camera is not ready", REST_S)
            self.wait_until_ready()
        return self._ask_for_shot()

    def _ask_for_shot(self) -> list[object]:
        self._asked = self._clock.read()
        return self._api.call("actTakePicture", limit_s=self._limits.shot_s)

    def _await(self) -> str:
        start = self._clock.read()
        while _seconds(start, self._clock.read()) < self._limits.exposure_s:
            try:
                return _url(self._api.call("awaitTakePicture", limit_s=self._limits.shot_s))
            except CameraRefusedError as error:
                if error.code != Code.NOT_FINISHED:
                    raise PictureLostError("the camera gave no address for a picture that it took") from error
            except CameraUnreachableError as error:
                raise PictureLostError(error.problem) from error
            except CameraSilentError:
                pass  # the next question may be answered
            self._waiter.pause("the picture is not finished", AGAIN_S)
        raise PictureLostError("the camera did not finish a picture")

    def _search(self, problem: str) -> str:
        """Wait for the address of a picture that may have been taken."""
        room = self._events.state.room
        try:
            self.wait_until_ready()
            for url in reversed(self._events.pictures):
                if self._own(url) not in self._earlier:
                    return url
            url = _url(self._api.call("awaitTakePicture"))
        except CameraRefusedError as error:
            left = self._events.state.room
            taken = room is not None and left is not None and left < room
            raise PictureLostError(f"{problem}, though it was taken" if taken else problem) from error
        except CameraError as error:
            raise PictureLostError(problem) from error
        if self._own(url) in self._earlier:  # it is the picture before
            raise PictureLostError(problem)
        return url

    def _fetch(self, url: str) -> bytes:
        if _is_foreign(url, self._api.link.host):
            self._notes.say_once("address", "the camera names another host for a picture; only its own is called")
        self._remember(url)
        broken: list[bytes] = []
        for number in range(MAX_DOWNLOADS):
            if number:
                self._waiter.pause("the download is tried again", REST_S)
            jpeg, problem = self._download(url)
            if not problem:
                return jpeg
            broken.append(jpeg)
        if broken[0] == broken[1] and jpeg_facts(jpeg).width_px is not None:
            self._notes.say("damaged", f"{problem}, and stays so; it is kept")
            return jpeg
        raise PictureLostError(problem)

    def _remember(self, url: str) -> None:
        own = self._own(url)
        if own not in self._earlier:
            self._earlier.append(own)

    def _own(self, url: str) -> str:
        """Put the camera's address into a URL, since it names several; what is no URL stays as it is."""
        try:
            return at_host(url, self._api.link.host)
        except BadUrlError:
            return url

    def _download(self, url: str) -> tuple[bytes, str]:
        try:
            answer = self._api.link.get(
                "download", url, max_bytes=self._limits.picture_bytes, limit_s=self._limits.download_s
            )
        except (CameraUnreachableError, CameraSilentError) as error:
            return b"", error.problem
        if answer.status != _OK:
            return b"", "the camera refused the download"
        return answer.body, fault_of(answer.body)


def _url(result: list[object]) -> str:
    """Parse the address in the answer to a shot: a list with one address."""
    first = result[0] if result else None
    url = first[0] if isinstance(first, list) and first else first
    if not isinstance(url, str) or not url:
        raise CameraSilentError("actTakePicture", "the answer names no picture")
    return url


def _is_foreign(url: str, host: str) -> bool:
    try:
        return host_of(url) != host
    except BadUrlError:
        return True


def _seconds(start: ClockReading, end: ClockReading) -> float:
    return (end.monotonic_ns - start.monotonic_ns) / 1e9
