"""The driver of the Sony DSC-QX10.

                     ┌────────────────────────── CameraError: the user closes it and enters again ◀──┐
                     ▼                                                                               │
    away ──enter──▶ connecting ──▶ connected ──▶ waiting until due ──▶ taking ──frame──▶ waiting ... │
                     │                              │   ▲               │ │                          │
                     │                              │   └─refused, lost─┘ └─gone, or refused too often┤
                     └──────────────────────────────┴───────────────────────────────────────────────┘
                                               stop: None, within a second

Connecting is in `connection`, taking in `stills` or `liveview`. The very same picture for `frozen_s` is a CameraError,
too, raised after that picture was handed over. The driver's user enters it again without limit; the
driver itself never tries to connect twice. The count of frames continues over all connections, and nothing is reported
twice.
"""

from __future__ import annotations

import threading
from collections import deque
from types import TracebackType
from typing import Self

from camera_drivers.camera import CameraIdentity
from camera_drivers.clock import Clock
from camera_drivers.errors import CameraError
from camera_drivers.exif import exif_time_ns
from camera_drivers.live.frozen import FrozenWatch
from camera_drivers.qx10.camera_clock import CameraClock
from camera_drivers.qx10.connection import DRIVER, Connection, connect
from camera_drivers.qx10.events import ERROR
from camera_drivers.qx10.liveview import Liveview
from camera_drivers.qx10.options import Qx10Settings
from camera_drivers.qx10.picture import FrameMaker
from camera_drivers.qx10.settings import Setter
from camera_drivers.qx10.stills import NotTakenError, PictureLostError, Shot, Stills
from camera_drivers.qx10.zoom import Zoom
from camera_drivers.reporter import Reporter
from camera_drivers.thresholds import MAX_FAILURES, REMEMBERED_PICTURES, REST_S
from camera_drivers.waiting import Notes, Stopped, Waiter
from flight_file.frame import NS_PER_S, Frame


class Qx10Camera:
    """The driver of one QX10.

    Parameters
    ----------
    clock
        The box's; it must be a clock that really waits.
    reporter
        Hears what happens beside the pictures.
    """

    def __init__(self, options: Qx10Settings, clock: Clock, reporter: Reporter) -> None:
        self._options = options
        self._clock = clock
        self._reporter = reporter
        self._notes = Notes(reporter)
        self._camera_clock = CameraClock(clock, reporter)
        self._frames = FrameMaker()
        self._earlier: deque[str] = deque(maxlen=REMEMBERED_PICTURES)
        self._due_ns = 0
        self._refusals = 0
        self._frozen = FrozenWatch(options.limits.frozen_s, self._notes)
        self._trouble: CameraError | None = None
        self._waiter = Waiter(clock, reporter)
        self._session: _Session | None = None
        self.identity = CameraIdentity(DRIVER)

    def __enter__(self) -> Self:
        """Find the camera and set it up.

        Raises
        ------
        CameraError
            It cannot be found or reached.
        CameraUnusableError
            The configuration is of no use.
        """
        self._waiter = Waiter(self._clock, self._reporter)
        connection = connect(self._options, self._clock, self._waiter)
        self.identity = connection.identity
        self._refusals, self._trouble = 0, None
        stills = Stills(connection.api, connection.events, self._clock, self._notes, self._earlier)
        self._session = _Session(connection, self._options, self._clock, self._camera_clock, self._notes, stills=stills)
        try:
            self._session.prepare()
        except BaseException:
            self._leave()
            raise
        self._notes.say("connected", f"{self.identity.model or 'a camera'}: {self.identity.note}")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None, /
    ) -> None:
        """Leave the camera as it is, without a call that might hang."""
        self._leave()

    def next_frame(self, stop: threading.Event) -> Frame | None:
        """Take or fetch the next picture; return None soon after `stop` is set.

        Raises
        ------
        CameraError
            The camera has to be connected again.
        """
        session = self._session
        if session is None:
            raise CameraError("The camera is not connected; enter it first.")
        if self._trouble is not None:
            raise self._trouble
        self._waiter.stop = stop
        try:
            frame = self._still(session) if session.liveview is None else self._live(session, session.liveview)
        except Stopped:
            return None
        self._trouble = self._frozen.look((frame.sha256,), self._clock.read().monotonic_ns, frame.sequence)
        return frame

    def _live(self, session: _Session, liveview: Liveview) -> Frame:
        picture = liveview.next_picture()
        return self._frames.frame(picture.jpeg, picture.times, zoom_position=session.zoom_position, taken=picture.taken)

    def _still(self, session: _Session) -> Frame:
        while True:
            session.adjust()
            self._wait_until_due(session)
            try:
                shot = session.stills.take()
            except NotTakenError as error:
                self._refused(error)
            except PictureLostError as error:
                self._frames.skip()
                self._reporter.lost(str(error))
            else:
                self._refusals = 0
                return self._finished(session, shot)

    def _finished(self, session: _Session, shot: Shot) -> Frame:
        frame = self._frames.frame(shot.jpeg, shot.times, zoom_position=session.zoom_position)
        session.learn(frame)
        return frame

    def _refused(self, error: NotTakenError) -> None:
        self._notes.say("refused", f"no picture was taken: {error}")
        self._refusals += 1
        if self._refusals >= MAX_FAILURES:
            raise CameraError(f"No picture was taken {MAX_FAILURES} times in a row: {error}") from error
        self._waiter.pause("the camera refused a picture", REST_S)

    def _wait_until_due(self, session: _Session) -> None:
        """Wait for the next shot: they are due at equal intervals, and a missed one is not made up for."""
        now_ns = self._clock.read().monotonic_ns
        due_ns = max(self._due_ns, now_ns) if session.zoom.settled else now_ns
        while now_ns < due_ns:
            session.look()
            self._waiter.until("the next picture is not due yet", min(due_ns, now_ns + NS_PER_S))
            now_ns = self._clock.read().monotonic_ns
        self._due_ns = due_ns + round(self._options.interval_s * NS_PER_S)

    def _leave(self) -> None:
        session, self._session = self._session, None
        if session is not None:
            # Leaving waits neither for the camera nor on the request to stop.
            self._waiter.stop = threading.Event()
            session.close()


class _Session:
    """The parts that belong to one connection."""

    def __init__(
        self,
        connection: Connection,
        options: Qx10Settings,
        clock: Clock,
        camera_clock: CameraClock,
        notes: Notes,
        *,
        stills: Stills,
    ) -> None:
        api, events = connection.api, connection.events
        self._connection = connection
        self._options = options
        self._notes = notes
        self._camera_clock = camera_clock
        self.zoom = Zoom(api, events, notes, options.zoom)
        self.stills = stills
        self.liveview = Liveview(api, clock, notes) if options.mode == "liveview" else None
        self._status: str | None = None
        self._unseen: list[float | None] = []

    @property
    def zoom_position(self) -> float | None:
        """The zoom position, 0 to 100 percent, if the camera says."""
        return self._connection.events.state.zoom_position

    def prepare(self) -> None:
        """Set the clock, everything else, and the zoom."""
        api = self._connection.api
        self.stills.wait_until_ready()
        if self._options.set_clock:
            self._camera_clock.set(api, self._notes)
        offered = Setter(api, self._notes).apply(self._options)
        needed = "startLiveview" if self.liveview else "actTakePicture"
        if needed not in offered:
            raise CameraError(f"The camera does not offer {needed} in its present mode; it will be connected again.")
        if "actZoom" in offered:
            self.zoom.start()
        if self.liveview:
            self.zoom.take_notice(None)  # liveview pictures have no EXIF
        self.stills.wait_until_ready()

    def look(self) -> None:
        """Report a camera error that the watcher noticed between two pictures."""
        status = self._connection.events.state.status
        if status == ERROR != self._status:
            self._notes.say("error", "the camera reports an error: it may be too hot, or lack its card")
        self._status = status

    def learn(self, frame: Frame) -> None:
        """Learn from a picture about clock and zoom."""
        shown_ns = exif_time_ns(frame.exif.datetime)
        if shown_ns is not None:
            times = frame.times
            took_ns = times.after_answer.monotonic_ns - times.before_request.monotonic_ns
            latest_ns = times.after_answer.realtime_ns
            self._camera_clock.compare(shown_ns, latest_ns - took_ns, latest_ns)
        self._unseen = [frame.exif.focal_length_mm]

    def adjust(self) -> None:
        """Make the adjustments that the last picture calls for; after it was handed over, since this may fail."""
        while self._unseen:
            self.zoom.take_notice(self._unseen.pop())

    def close(self) -> None:
        """Leave the camera alone."""
        if self._connection.watcher is not None:
            self._connection.watcher.stop()
        if self.liveview is not None:
            self.liveview.close()
