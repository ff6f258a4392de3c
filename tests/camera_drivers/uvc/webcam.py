"""A USB camera as the kernel shows it to a program: a device that answers requests and fills shared buffers.

It stands at the boundary of `camera_drivers.uvc.device.Device`: what it is asked and answers are the kernel's own
structures. Its time is a clock that moves while somebody waits for it.
"""

from __future__ import annotations

import ctypes
import errno
import os
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NoReturn

from camera_drivers.clock import Clock
from camera_drivers.uvc import v4l2
from camera_drivers.uvc.v4l2 import Control, Request
from flight_file.frame import NS_PER_S
from recorder.host import SimulatedClock

START_NS = 1_525_435_200_000_000_000
PATH = "/dev/v4l/by-id/usb-Double-video-index0"
BUFFER_BYTES = 65_536
HELD_BY: dict[int, tuple[int, int]] = {
    Control.EXPOSURE_ABSOLUTE: (Control.EXPOSURE_AUTO, 1),
    Control.FOCUS_ABSOLUTE: (Control.FOCUS_AUTO, 0),
}
Step = Callable[["Webcam"], None]


def refuse(number: int) -> NoReturn:
    """Fail as the kernel does."""
    raise OSError(number, os.strerror(number))


@dataclass
class Webcam:
    """The camera; `open` is what its driver opens it by.

    Attributes
    ----------
    steps
        What happens while somebody waits for a picture, one step each wait; then nothing happens any more.
    controls
        By number: smallest, largest, and present value.
    """

    clock: Clock = field(default_factory=lambda: SimulatedClock(START_NS))
    formats: tuple[str, ...] = ("YUYV", "MJPG")
    sizes: tuple[tuple[int, int], ...] = ((640, 480), (1280, 720), (1920, 1080))
    rates_hz: tuple[int, ...] = (5, 10, 30)
    capabilities: int = v4l2.CAP_VIDEO_CAPTURE | v4l2.CAP_STREAMING
    controls: dict[int, list[int]] = field(
        default_factory=lambda: {
            Control.EXPOSURE_AUTO: [0, 3, 3],
            Control.EXPOSURE_ABSOLUTE: [3, 2047, 250],
            Control.FOCUS_AUTO: [0, 1, 1],
            Control.FOCUS_ABSOLUTE: [0, 250, 0],
            Control.GAIN: [0, 255, 64],
            Control.POWER_LINE_FREQUENCY: [0, 2, 2],
        }
    )
    steps: deque[Step] = field(default_factory=deque)
    refusing: set[int] = field(default_factory=set)
    refused_requests: set[int] = field(default_factory=set)
    opening: list[int] = field(default_factory=list)
    plugged: bool = True
    rate_hz: int = 30
    sequence: int = 0
    opened: list[OpenedWebcam] = field(default_factory=list)

    def open(self, path: str) -> OpenedWebcam:
        """Open it, unless it is unplugged, or an error is to come first."""
        assert path == PATH
        if self.opening:
            refuse(self.opening.pop(0))
        if not self.plugged:
            refuse(errno.ENOENT)
        self.sequence = 0
        self.opened.append(OpenedWebcam(self))
        return self.opened[-1]

    def shoots(self, *jpegs: bytes, skipping: int = 0, flags: int = 0, late_ns: int = 5_000_000) -> None:
        """Deliver pictures, each a frame's time after the one before, after so many that nobody gets."""
        for jpeg in jpegs:
            self.steps.append(lambda camera, jpeg=jpeg: camera.deliver(jpeg, skipping, flags, late_ns))

    def deliver(self, jpeg: bytes, skipping: int, flags: int, late_ns: int) -> None:
        """Fill the next buffer; the stamp is `late_ns` before it is full."""
        frames = 1 + skipping
        self.clock.wait_until(
            self.clock.read().monotonic_ns + frames * NS_PER_S // self.rate_hz + late_ns, threading.Event()
        )
        self.sequence += skipping
        stamp_ns = self.clock.read().monotonic_ns - late_ns
        self.opened[-1].fill(jpeg, self.sequence, flags or v4l2.TIMESTAMP_MONOTONIC, stamp_ns)
        self.sequence += 1

    def sleep(self, duration_ns: int) -> None:
        """Let the clock's time pass."""
        self.clock.wait_until(self.clock.read().monotonic_ns + duration_ns, threading.Event())

    def unplug(self) -> None:
        """Pull the plug, and forget what was set."""
        self.plugged = False


class OpenedWebcam:
    """One opening of it."""

    def __init__(self, camera: Webcam) -> None:
        self._camera = camera
        self._memory: list[bytearray] = []
        self._queued: deque[int] = deque()
        self._filled: deque[v4l2.Buffer] = deque()
        self.size: tuple[int, int] | None = None
        self.code = ""
        self.streaming = False
        self.closed = False
        self.mapped = 0

    def fill(self, jpeg: bytes, sequence: int, flags: int, stamp_ns: int) -> None:
        """Put a picture into the next buffer that the program gave."""
        assert self.streaming
        index = self._queued.popleft()
        self._memory[index][: len(jpeg)] = jpeg
        filled = v4l2.Buffer(index=index, bytesused=len(jpeg), flags=flags, sequence=sequence)
        filled.timestamp.tv_sec, filled.timestamp.tv_usec = divmod(stamp_ns // 1000, 1_000_000)
        self._filled.append(filled)

    def wait(self, seconds: float) -> bool:
        """The next step, or time that passes."""
        if self._camera.steps:
            self._camera.steps.popleft()(self._camera)
        else:
            self._camera.clock.wait_until(
                self._camera.clock.read().monotonic_ns + round(seconds * NS_PER_S), threading.Event()
            )
        if not self._camera.plugged:
            refuse(errno.EIO)
        return bool(self._filled)

    def map(self, length: int, offset: int) -> OpenedWebcam.Region:
        """Share a buffer."""
        assert length == BUFFER_BYTES
        self.mapped += 1
        return OpenedWebcam.Region(self, self._memory[offset // BUFFER_BYTES])

    class Region:
        """A shared buffer."""

        def __init__(self, device: OpenedWebcam, memory: bytearray) -> None:
            self._device = device
            self._memory = memory

        def __getitem__(self, part: slice) -> bytes:
            """Copy a part."""
            return bytes(self._memory[part])

        def close(self) -> None:
            """Give it back."""
            self._device.mapped -= 1

    def close(self) -> None:
        """Close it."""
        self.closed = True

    def ioctl(self, request: int, argument: ctypes.Structure | ctypes.c_int) -> None:
        """Answer as the kernel's drivers do."""
        if not self._camera.plugged or request in self._camera.refused_requests:
            refuse(errno.ENODEV)
        answers: dict[int, Callable[[Any], None]] = {
            Request.QUERYCAP: self._capability,
            Request.ENUM_FMT: self._format,
            Request.S_FMT: self._set_format,
            Request.G_PARM: self._parameters,
            Request.S_PARM: self._set_parameters,
            Request.REQBUFS: self._buffers,
            Request.QUERYBUF: self._buffer,
            Request.QBUF: lambda buffer: self._queued.append(buffer.index),
            Request.DQBUF: self._dequeue,
            Request.STREAMON: lambda _kind: setattr(self, "streaming", True),
            Request.STREAMOFF: lambda _kind: setattr(self, "streaming", False),
            Request.QUERYCTRL: self._control,
            Request.G_CTRL: lambda held: setattr(held, "value", self._camera.controls[held.id][2]),
            Request.S_CTRL: self._set_control,
        }
        answers[request](argument)

    def _capability(self, told: v4l2.Capability) -> None:
        told.card = b"Double \xe2\x84\xa2 Cam"
        told.capabilities, told.device_caps = 0xFFFFFFFF, self._camera.capabilities

    def _format(self, told: v4l2.FormatDescription) -> None:
        if told.index >= len(self._camera.formats):
            refuse(errno.EINVAL)
        told.pixelformat = v4l2.fourcc(self._camera.formats[told.index])

    def _set_format(self, told: v4l2.Format) -> None:
        pix = told.fmt.pix
        self.size = min(self._camera.sizes, key=lambda size: abs(size[0] - pix.width) + abs(size[1] - pix.height))
        self.code = v4l2.letters(pix.pixelformat)
        pix.width, pix.height = self.size

    def _parameters(self, told: v4l2.StreamParameters) -> None:
        told.parm.capture.capability = v4l2.CAP_TIMEPERFRAME
        told.parm.capture.timeperframe = v4l2.Fraction(1, self._camera.rate_hz)

    def _set_parameters(self, told: v4l2.StreamParameters) -> None:
        wanted = told.parm.capture.timeperframe
        wanted_hz = wanted.denominator / wanted.numerator
        self._camera.rate_hz = min(self._camera.rates_hz, key=lambda rate: abs(rate - wanted_hz))
        self._parameters(told)

    def _buffers(self, told: v4l2.RequestBuffers) -> None:
        self._memory = [bytearray(BUFFER_BYTES) for _ in range(told.count)]

    def _buffer(self, told: v4l2.Buffer) -> None:
        told.length, told.m.offset = BUFFER_BYTES, told.index * BUFFER_BYTES

    def _dequeue(self, told: v4l2.Buffer) -> None:
        if not self._filled:
            refuse(errno.EAGAIN)
        ctypes.pointer(told)[0] = self._filled.popleft()

    def _control(self, told: v4l2.ControlQuery) -> None:
        if told.id not in self._camera.controls:
            refuse(errno.EINVAL)
        told.minimum, told.maximum, _ = self._camera.controls[told.id]

    def _set_control(self, told: v4l2.ControlValue) -> None:
        # As UVC cameras do: what is automatic cannot be set by hand.
        switch, manual = HELD_BY.get(told.id, (0, 0))
        if self._camera.controls.get(switch, [0, 0, manual])[2] != manual or told.id in self._camera.refusing:
            refuse(errno.EACCES)
        self._camera.controls[told.id][2] = told.value
