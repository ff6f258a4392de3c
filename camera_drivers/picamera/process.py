"""rpicam-vid as a source of pictures: started, read from, and ended; a new connection starts another one.

    start ──▶ stdout: pictures ──┐
          └─▶ a pipe: metadata ──┴─▶ paired in order ──▶ picture with the sensor's time
          └─▶ stderr: its last words, for when it ends

The program writes a picture's metadata just after the picture, one record for each. If metadata do not come for a
second, the process's further metadata are ignored: pictures then have their arrival time.

When a picture was taken. `SensorTimestamp` is by the monotonic clock and tells when the first row's exposure ended and
its reading began. Rows are exposed and read one after the other, which takes at most `FrameDuration`; so the middle row
is exposed up to half of that later, with uniform probability. Source: picamera2 #821, libcamera's
control_ids_core.yaml, and measurements that its issues report; not measured by us.
"""

from __future__ import annotations

import math
import os
import re
import select
import shutil
import signal
import subprocess
from collections import deque
from collections.abc import Mapping
from contextlib import suppress

from camera_drivers.camera import CameraIdentity
from camera_drivers.clock import Clock, realtime_ns
from camera_drivers.errors import CameraError, CameraUnusableError
from camera_drivers.live.camera import LiveCamera
from camera_drivers.live.source import Missed, Picture
from camera_drivers.picamera.cutting import AccessUnitCutter, Cutter, JpegCutter, RecordCutter
from camera_drivers.picamera.options import PicameraSettings, arguments
from camera_drivers.reporter import Reporter
from camera_drivers.thresholds import CLOSE_S, SAY_S
from camera_drivers.waiting import Notes
from flight_file.frame import JPEG, NS_PER_S, ClockReading
from flight_file.thresholds import BLOCK_BYTES, MAX_SHOWN_CHARACTERS, MAX_SMALL_BYTES

DRIVER = "picamera"
_DIGITS = 18  # of a number of 64 bits, which libcamera's are
SKIPPED = "the sensor's times show a picture that did not come"
_NS_PER_US = 1000
_USUAL_FRAME_NS = NS_PER_S // 30  # rpicam-vid's default, if nothing is configured
_CUTTERS: Mapping[str, type[JpegCutter | AccessUnitCutter]] = {"mjpeg": JpegCutter, "h264": AccessUnitCutter}
_LOG_HEAD = re.compile(r"^(\[[^\]]*\]\s*)+")  # libcamera's time and thread


def picamera(options: PicameraSettings, clock: Clock, reporter: Reporter) -> LiveCamera:
    """Make the camera that the options describe; nothing is started yet."""
    return LiveCamera(
        DRIVER,
        lambda _waiter, notes, missed: PicameraSource(options, clock, notes, missed),
        options,
        clock,
        reporter,
        interval_s=options.interval_s,
    )


class PicameraSource:
    """One run of rpicam-vid; see `camera_drivers.live.source.Source`.

    Raises
    ------
    CameraUnusableError
        The program is not installed, or cannot be started.
    """

    def __init__(self, options: PicameraSettings, clock: Clock, notes: Notes, missed: Missed) -> None:
        self._options = options
        self._clock = clock
        self._notes = notes
        self._missed = missed
        self._cutter: Cutter = _CUTTERS[options.codec]()
        self._records = RecordCutter()
        self._pictures: deque[tuple[bytes, ClockReading]] = deque()
        self._metadata: deque[dict[str, str]] = deque()
        self._without_metadata = False
        self._words = b""
        self._ended = False
        self._last_sensor_ns: int | None = None
        self._last_frame_ns = 0
        self._process, self._metadata_fd = _started(options)
        streams = {self._process.stdout: self._read, self._process.stderr: self._hear}
        self._readers = {stream.fileno(): read for stream, read in streams.items() if stream is not None}
        self._readers[self._metadata_fd] = self._learn
        self._poll = select.poll()
        for descriptor in self._readers:
            self._poll.register(descriptor, select.POLLIN)
        self.identity = CameraIdentity(DRIVER, note=" ".join([options.program, *arguments(options, "...")]))

    def next_picture(self, wait_s: float) -> Picture | None:
        """Wait for the next picture; see `Source`."""
        if (picture := self._paired()) is not None:
            return picture
        if self._ended:
            raise CameraError(self._obituary())
        for descriptor, _ in self._poll.poll(wait_s * 1000):
            data = os.read(descriptor, BLOCK_BYTES)
            if not data:
                self._poll.unregister(descriptor)
            self._readers[descriptor](data)
        return self._paired()

    def close(self) -> None:
        """End the program, politely at first."""
        for number in (signal.SIGTERM, signal.SIGKILL):
            # What a script has started holds the camera, also where the script itself has ended.
            with suppress(OSError):
                os.killpg(self._process.pid, number)
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(CLOSE_S)
        for stream in (self._process.stdout, self._process.stderr):
            if stream is not None:
                stream.close()
        if self._metadata_fd >= 0:
            os.close(self._metadata_fd)
        self._metadata_fd = -1

    def _read(self, data: bytes) -> None:
        self._ended = self._ended or not data
        arrived = self._clock.read()
        self._pictures.extend((picture, arrived) for picture in self._cutter.feed(data))

    def _learn(self, data: bytes) -> None:
        found = self._records.feed(data)
        if not self._without_metadata:
            self._metadata.extend(found)

    def _hear(self, data: bytes) -> None:
        self._words = (self._words + data)[-MAX_SMALL_BYTES:]

    def _paired(self) -> Picture | None:
        """Return the oldest picture, once its metadata are there or given up."""
        if not self._pictures:
            return None
        if not self._metadata and not self._without_metadata and not self._ended:
            waited_ns = self._clock.read().monotonic_ns - self._pictures[0][1].monotonic_ns
            if waited_ns < SAY_S * NS_PER_S:
                return None
            self._without_metadata = True
            self._notes.say_once("clock", "rpicam-vid gives no times; the pictures' arrival is used")
        encoded, arrived = self._pictures.popleft()
        return self._picture(encoded, arrived, self._metadata.popleft() if self._metadata else {})

    def _picture(self, encoded: bytes, arrived: ClockReading, said: Mapping[str, str]) -> Picture:
        sensor_ns, exposure_ns = _whole(said, "SensorTimestamp"), (_whole(said, "ExposureTime") or 0) * _NS_PER_US
        frame_ns = (_whole(said, "FrameDuration") or 0) * _NS_PER_US or self._frame_ns()
        delay_ns = None if sensor_ns is None else arrived.monotonic_ns - sensor_ns
        if sensor_ns is not None and delay_ns is not None and 0 <= delay_ns <= self._options.stall_s * NS_PER_S:
            number, taken_ns = sensor_ns, sensor_ns - exposure_ns // 2 + frame_ns // 4
            sigma_ns = round(frame_ns / 2 / math.sqrt(12))
            self._count_skipped(sensor_ns, frame_ns)
        else:
            if sensor_ns is not None:
                self._notes.say_once("clock", "the sensor's times are unusable; the pictures' arrival is used")
            # Exposure, processing and encoding take about the time of two frames.
            number, taken_ns = arrived.monotonic_ns, arrived.monotonic_ns - frame_ns
            sigma_ns = round(2 * frame_ns / math.sqrt(12))
        return Picture(
            encoded=encoded,
            received=arrived,
            taken_ns=realtime_ns(taken_ns, arrived),
            sigma_ns=sigma_ns,
            number=number,
            format=JPEG if self._options.codec == "mjpeg" else self._options.codec,
            size_px=self._options.size_px,
            exposure_s=exposure_ns / NS_PER_S or None,
        )

    def _count_skipped(self, sensor_ns: int, frame_ns: int) -> None:
        """Count the pictures for which there was time since the last one, at the slower of the two rates."""
        last_ns, slower_ns = self._last_sensor_ns, max(frame_ns, self._last_frame_ns)
        self._last_sensor_ns, self._last_frame_ns = sensor_ns, frame_ns
        skipped = 0 if last_ns is None else round((sensor_ns - last_ns) / slower_ns) - 1
        if skipped > 0:
            self._missed.add(SKIPPED, skipped)

    def _frame_ns(self) -> int:
        return round(NS_PER_S / self._options.rate_hz) if self._options.rate_hz else _USUAL_FRAME_NS

    def _obituary(self) -> str:
        """Say why the program ended, by its own last words."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(CLOSE_S)
        lines = [_LOG_HEAD.sub("", line) for line in self._words.decode("utf-8", "replace").splitlines() if line]
        last = next((line for line in reversed(lines) if "ERROR" in line), lines[-1] if lines else "it said nothing")
        said = "".join(letter if letter.isprintable() else " " for letter in last)[:MAX_SHOWN_CHARACTERS].strip()
        return (
            f"{self._options.program} ended (exit code {self._process.returncode}): {said}; it is started again, and if"
            " that does not help, check the camera's cable."
        )


def _started(options: PicameraSettings) -> tuple[subprocess.Popen[bytes], int]:
    """Start it; return it and where its metadata can be read."""
    program = shutil.which(options.program)
    if program is None:
        raise CameraUnusableError(
            f"camera.program: there is no {options.program}; install it: apt-get install rpicam-apps-lite"
        )
    try:
        reading, writing = os.pipe()
    except OSError as error:
        raise _not_started(program, error) from error
    try:
        command = [program, *arguments(options, f"/dev/fd/{writing}")]
        process = subprocess.Popen(  # noqa: S603 - what recorder.yaml names
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            bufsize=0,
            pass_fds=(writing,),
            start_new_session=True,  # Ctrl-C is meant for the recorder, which ends it and what it started
        )
    except OSError as error:
        os.close(reading)
        raise _not_started(program, error) from error
    finally:
        os.close(writing)
    return process, reading


def _not_started(program: str, error: OSError) -> CameraUnusableError:
    return CameraUnusableError(f"camera.program: {program} cannot be started ({error.strerror}).")


def _whole(said: Mapping[str, str], name: str) -> int | None:
    text = said.get(name, "").strip()
    return int(text) if text.isascii() and text.isdigit() and len(text) <= _DIGITS else None
