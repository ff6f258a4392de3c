"""A Video4Linux device: requests, buffers in shared memory, and waiting for a picture.

`Device` is the interface, for which tests have their own. `failure` explains an error of the kernel in a sentence.
"""

from __future__ import annotations

import ctypes
import errno
import fcntl
import mmap
import os
import select
import stat
from pathlib import Path
from typing import Protocol, Self

from camera_drivers.errors import CameraError, CameraNotFoundError, CameraUnusableError

GONE = frozenset({errno.ENODEV, errno.ENXIO, errno.ENOENT})
FORBIDDEN = frozenset({errno.EACCES, errno.EPERM})


class Region(Protocol):
    """Memory shared with the kernel."""

    def __getitem__(self, part: slice, /) -> bytes:
        """Copy a part."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


class Device(Protocol):
    """An open device; every method raises OSError as the kernel does."""

    def ioctl(self, request: int, argument: ctypes.Structure | ctypes.c_int) -> None:
        """Carry out a request, which reads and changes `argument`."""
        ...

    def map(self, length: int, offset: int) -> Region:
        """Share a buffer of so many bytes."""
        ...

    def wait(self, seconds: float) -> bool:
        """Wait until a buffer is filled; False if none was in time."""
        ...

    def close(self) -> None:
        """Close it."""
        ...


class KernelDevice:
    """A device file such as /dev/v4l/by-id/...-video-index0; raises OSError if it is not one or cannot be opened."""

    def __init__(self, path: str) -> None:
        if not stat.S_ISCHR(Path(path).stat().st_mode):
            raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
        self._fd = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        self._poll = select.poll()
        self._poll.register(self._fd, select.POLLIN)

    @classmethod
    def open(cls, path: str) -> Self:
        """Open the device file."""
        return cls(path)

    def ioctl(self, request: int, argument: ctypes.Structure | ctypes.c_int) -> None:
        """Carry out a request; Python repeats it if a signal came in between."""
        fcntl.ioctl(self._fd, request, argument)

    def map(self, length: int, offset: int) -> Region:
        """Share a buffer."""
        return mmap.mmap(self._fd, length, mmap.MAP_SHARED, mmap.PROT_READ | mmap.PROT_WRITE, offset=offset)

    def wait(self, seconds: float) -> bool:
        """Wait until a buffer is filled.

        Raises
        ------
        OSError
            EIO if the stream ended, as it does when the camera is unplugged.
        """
        for _, events in self._poll.poll(seconds * 1000):
            if events & select.POLLIN:
                return True
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return False

    def close(self) -> None:
        """Close it."""
        os.close(self._fd)


def failure(path: str, doing: str, error: OSError) -> CameraError:
    """Translate an error of the kernel; `doing` names what failed."""
    if error.errno in GONE:
        return CameraNotFoundError(
            f"{path}: no camera is there; plug it in, or correct camera.device (ls /dev/v4l/by-id lists them)."
        )
    if error.errno in FORBIDDEN:
        return CameraUnusableError(
            f"{path}: the recorder may not use it; put its user into the group video, or run systemd/install.sh with"
            " --driver uvc."
        )
    if error.errno == errno.EBUSY:
        return CameraError(f"{path}: another program uses the camera; end that program.")
    if error.errno == errno.ENOTTY:
        return CameraUnusableError(f"{path}: is no camera; name one of those that ls /dev/v4l/by-id lists.")
    return CameraError(f"{path}: {doing} failed ({error.strerror}); if it stays so, plug the camera in again.")
