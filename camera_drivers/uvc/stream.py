"""The stream of one device: format, rate, controls, buffers; then picture by picture.

    open ──▶ is it a camera? ──▶ MJPEG of this size ──▶ rate ──▶ controls ──▶ buffers ──▶ streaming
                                                                                            │ ▲
                                                              wait ──▶ dequeue ──▶ copy ──▶ queue again

Time of a picture: the kernel stamps each buffer by CLOCK_MONOTONIC. V4L2 calls that the start of exposure; the driver
of UVC cameras takes the arrival of the first bytes, if the camera's own clock is not used. So mid-exposure is within
one frame's time of it, before or after, uniformly distributed.
"""

from __future__ import annotations

import ctypes
import errno
import math
from collections.abc import Callable
from contextlib import suppress

from camera_drivers.camera import CameraIdentity
from camera_drivers.clock import Clock, realtime_ns
from camera_drivers.errors import CameraError, CameraUnusableError
from camera_drivers.live.camera import LiveCamera
from camera_drivers.live.source import Missed, Picture
from camera_drivers.reporter import Reporter
from camera_drivers.uvc import v4l2
from camera_drivers.uvc.controls import STATE, set_controls
from camera_drivers.uvc.device import Device, KernelDevice, Region, failure
from camera_drivers.uvc.options import UvcSettings
from camera_drivers.uvc.v4l2 import Request
from camera_drivers.waiting import Notes
from flight_file.documents import SOI
from flight_file.frame import NS_PER_S, ClockReading

DRIVER = "uvc"
NOT_DELIVERED = "the kernel counted a picture that it did not deliver"
DAMAGED = "the kernel marked the picture as damaged"
NO_JPEG = "the picture is not a JPEG"
_FORMATS = ("MJPG", "JPEG")
_BUFFERS = 4
_NS_PER_US = 1000
_USUAL_RATE_HZ = 30  # if the camera does not say
_COUNTER = 2**32

OpenDevice = Callable[[str], Device]


def uvc_camera(
    options: UvcSettings, clock: Clock, reporter: Reporter, open_device: OpenDevice = KernelDevice.open
) -> LiveCamera:
    """Make the camera that the options describe; nothing is opened yet."""
    return LiveCamera(
        DRIVER,
        lambda _waiter, notes, missed: UvcSource(options, clock, notes, missed, open_device=open_device),
        options,
        clock,
        reporter,
        interval_s=options.interval_s,
    )


class UvcSource:
    """A streaming device; see `camera_drivers.live.source.Source`.

    Raises
    ------
    CameraNotFoundError
        There is no such device.
    CameraUnusableError
        It is not a camera, sends no JPEGs, or may not be opened.
    CameraError
        It cannot be used now.
    """

    def __init__(
        self, options: UvcSettings, clock: Clock, notes: Notes, missed: Missed, *, open_device: OpenDevice
    ) -> None:
        self._path = options.device
        self._clock = clock
        self._notes = notes
        self._stall_ns = round(options.stall_s * NS_PER_S)
        self._regions: list[Region] = []
        self._last: tuple[int, int] | None = None  # sequence and monotonic time of the last buffer
        self._missed = missed
        self._failed: CameraError | None = None
        try:
            self._device = open_device(options.device)
        except OSError as error:
            raise failure(self._path, "opening it", error) from error
        try:
            self.identity = self._set_up(options)
        except OSError as error:
            self.close()
            raise failure(self._path, "setting it up", error) from error
        except BaseException:
            self.close()
            raise

    def next_picture(self, wait_s: float) -> Picture | None:
        """Wait for the next buffer; see `Source`."""
        if self._failed is not None:
            raise self._failed
        try:
            if not self._device.wait(wait_s):
                return None
            buffer = v4l2.Buffer(type=v4l2.CAPTURE, memory=v4l2.MMAP)
            self._device.ioctl(Request.DQBUF, buffer)
            received = self._clock.read()
            encoded = self._regions[buffer.index][: buffer.bytesused]
            damaged = bool(buffer.flags & v4l2.BUFFER_ERROR)
        except OSError as error:
            if error.errno == errno.EAGAIN:  # another thread of the kernel was faster
                return None
            raise failure(self._path, "receiving a picture", error) from error
        try:
            self._device.ioctl(Request.QBUF, buffer)
        except OSError as error:  # it was unplugged just now; the picture is valid
            self._failed = failure(self._path, "receiving a picture", error)
        return self._picture(buffer, encoded, received, damaged=damaged)

    def close(self) -> None:
        """Stop the stream and release everything, so that a camera plugged in again gets its old name."""
        with suppress(OSError):
            self._device.ioctl(Request.STREAMOFF, ctypes.c_int(v4l2.CAPTURE))
        for region in self._regions:
            region.close()
        self._regions.clear()
        with suppress(OSError):
            self._device.close()

    def _picture(self, buffer: v4l2.Buffer, encoded: bytes, received: ClockReading, *, damaged: bool) -> Picture | None:
        self._count_gap(buffer.sequence, received.monotonic_ns)
        reason = DAMAGED if damaged else "" if encoded.startswith(SOI) else NO_JPEG
        if reason:
            self._missed.add(reason)
            return None
        taken_ns = self._taken_ns(buffer, received)
        return Picture(
            encoded=encoded,
            received=received,
            taken_ns=realtime_ns(taken_ns, received),
            sigma_ns=round(2 * self._frame_ns / math.sqrt(12)),
            number=buffer.sequence,
        )

    def _count_gap(self, sequence: int, now_ns: int) -> None:
        """Count the buffers that the kernel numbered but did not deliver, at most as many as there was time for."""
        last, self._last = self._last, (sequence, now_ns)
        if last is None:
            return
        gap = (sequence - last[0]) % _COUNTER - 1
        gap = min(gap, (now_ns - last[1]) // self._frame_ns) if gap < _COUNTER // 2 else 0
        if gap > 0:
            self._missed.add(NOT_DELIVERED, gap)

    def _taken_ns(self, buffer: v4l2.Buffer, received: ClockReading) -> int:
        """Estimate mid-exposure by the monotonic clock."""
        stamp_ns = int(buffer.timestamp.tv_sec) * NS_PER_S + int(buffer.timestamp.tv_usec) * _NS_PER_US
        monotonic = buffer.flags & v4l2.TIMESTAMP_MASK == v4l2.TIMESTAMP_MONOTONIC
        if monotonic and 0 <= received.monotonic_ns - stamp_ns <= self._stall_ns:
            return stamp_ns
        self._notes.say_once("clock", "the kernel's times of the pictures are unusable; their arrival is used")
        return received.monotonic_ns - self._frame_ns

    def _set_up(self, options: UvcSettings) -> CameraIdentity:
        device = self._device
        capability = v4l2.Capability()
        try:
            device.ioctl(Request.QUERYCAP, capability)
        except OSError as error:
            if error.errno == errno.EINVAL:
                error = OSError(errno.ENOTTY, error.strerror)
            raise failure(self._path, "asking what it is", error) from error
        own = capability.device_caps if capability.capabilities & v4l2.CAP_DEVICE_CAPS else capability.capabilities
        if not own & v4l2.CAP_VIDEO_CAPTURE or not own & v4l2.CAP_STREAMING:
            raise CameraUnusableError(
                f"{self._path}: takes no pictures (a camera may have several devices); name the one that ends in"
                " video-index0."
            )
        size_px = self._set_format(options.size_px)
        self._frame_ns = self._set_rate(options.rate_hz)
        set_controls(device, options, self._notes)
        self._start()
        note = f"{self._path}, {size_px[0]} x {size_px[1]} at {NS_PER_S / self._frame_ns:.3g} Hz"
        return CameraIdentity(DRIVER, model=_text(capability.card), note=note)

    def _set_format(self, wanted: tuple[int, int] | None) -> tuple[int, int]:
        offered = list(self._offered())
        code = next((code for code in _FORMATS if code in offered), None)
        if code is None:
            raise CameraUnusableError(
                f"{self._path}: sends no JPEGs ({', '.join(offered) or 'nothing'}); use a camera that offers MJPG."
            )
        chosen = v4l2.Format(type=v4l2.CAPTURE)
        pix = chosen.fmt.pix
        pix.width, pix.height = wanted or (0xFFFF, 0xFFFF)  # the largest available
        pix.pixelformat, pix.field = v4l2.fourcc(code), v4l2.FIELD_ANY
        self._device.ioctl(Request.S_FMT, chosen)
        if v4l2.letters(pix.pixelformat) not in _FORMATS:
            raise CameraUnusableError(f"{self._path}: gives {v4l2.letters(pix.pixelformat)} in place of JPEGs.")
        size_px = (pix.width, pix.height)
        if wanted and size_px != wanted:
            self._notes.say_once(
                STATE,
                f"size is not as wanted: the camera has {size_px[0]} x {size_px[1]}, not {wanted[0]} x {wanted[1]}",
            )
        return size_px

    def _offered(self) -> list[str]:
        codes: list[str] = []
        while True:
            described = v4l2.FormatDescription(index=len(codes), type=v4l2.CAPTURE)
            try:
                self._device.ioctl(Request.ENUM_FMT, described)
            except OSError as error:
                if error.errno != errno.EINVAL:
                    raise
                return codes
            codes.append(v4l2.letters(described.pixelformat))

    def _set_rate(self, wanted_hz: float | None) -> int:
        """Request a rate; return the camera's actual time per frame, ns."""
        parameters = v4l2.StreamParameters(type=v4l2.CAPTURE)
        capture = parameters.parm.capture
        try:
            self._device.ioctl(Request.G_PARM, parameters)
            if wanted_hz is not None and capture.capability & v4l2.CAP_TIMEPERFRAME:
                capture.timeperframe.numerator = 1000
                capture.timeperframe.denominator = round(wanted_hz * 1000)
                self._device.ioctl(Request.S_PARM, parameters)
        except OSError as error:
            if error.errno not in (errno.EINVAL, errno.ENOTTY):
                raise
        frame = capture.timeperframe
        known = frame.numerator and frame.denominator
        frame_ns = frame.numerator * NS_PER_S // frame.denominator if known else NS_PER_S // _USUAL_RATE_HZ
        has, asked = f"{NS_PER_S / max(frame_ns, 1):.3g}", None if wanted_hz is None else f"{wanted_hz:.3g}"
        if asked not in (None, has):  # 29.97 is 30
            self._notes.say_once(STATE, f"rate_hz is not as wanted: the camera has {has} Hz, not {asked} Hz")
        return max(frame_ns, 1)

    def _start(self) -> None:
        request = v4l2.RequestBuffers(count=_BUFFERS, type=v4l2.CAPTURE, memory=v4l2.MMAP)
        self._device.ioctl(Request.REQBUFS, request)
        for index in range(request.count):
            buffer = v4l2.Buffer(index=index, type=v4l2.CAPTURE, memory=v4l2.MMAP)
            self._device.ioctl(Request.QUERYBUF, buffer)
            self._regions.append(self._device.map(buffer.length, buffer.m.offset))
            self._device.ioctl(Request.QBUF, buffer)
        self._device.ioctl(Request.STREAMON, ctypes.c_int(v4l2.CAPTURE))


def _text(name: bytes) -> str:
    text = name.decode("utf-8", "replace")
    return "".join(letter if letter.isprintable() else "?" for letter in text).strip()
