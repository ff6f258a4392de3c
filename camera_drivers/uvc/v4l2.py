"""The part of Video4Linux2 needed to receive JPEGs: structures, requests, and their constants.

Layouts are the C compiler's for this machine; tests compare them with the kernel's own header where there is a
compiler. A request's number is direction << 30 | size << 16 | 'V' << 8 | number. Source: linux/videodev2.h and
linux/v4l2-controls.h, which are the kernel's interface to programs and do not change.
"""

from __future__ import annotations

import ctypes
from enum import IntEnum

CAPTURE = 1  # enum v4l2_buf_type
MMAP = 1  # enum v4l2_memory
FIELD_ANY = 0

CAP_VIDEO_CAPTURE = 0x1
CAP_STREAMING = 0x0400_0000
CAP_DEVICE_CAPS = 0x8000_0000
CAP_TIMEPERFRAME = 0x1000

BUFFER_ERROR = 0x40
TIMESTAMP_MASK = 0xE000
TIMESTAMP_MONOTONIC = 0x2000

CONTROL_DISABLED = 0x1

_U32 = ctypes.c_uint32
_S32 = ctypes.c_int32


class Control(IntEnum):
    """V4L2_CID_*: the controls that a camera may have."""

    AUTO_WHITE_BALANCE = 0x0098090C
    GAIN = 0x00980913
    POWER_LINE_FREQUENCY = 0x00980918
    WHITE_BALANCE_TEMPERATURE = 0x0098091A
    EXPOSURE_AUTO = 0x009A0901
    EXPOSURE_ABSOLUTE = 0x009A0902
    FOCUS_ABSOLUTE = 0x009A090A
    FOCUS_AUTO = 0x009A090C


def fourcc(code: str) -> int:
    """Convert a pixel format's four letters to its number."""
    return int.from_bytes(code.encode("ascii"), "little")


def letters(number: int) -> str:
    """Convert a pixel format's number to its four letters, with dots for other characters."""
    return "".join(chr(byte) if chr(byte).isprintable() else "." for byte in number.to_bytes(4, "little"))


class Capability(ctypes.Structure):
    """struct v4l2_capability."""

    _fields_ = (
        ("driver", ctypes.c_char * 16),
        ("card", ctypes.c_char * 32),
        ("bus_info", ctypes.c_char * 32),
        ("version", _U32),
        ("capabilities", _U32),
        ("device_caps", _U32),
        ("reserved", _U32 * 3),
    )


class FormatDescription(ctypes.Structure):
    """struct v4l2_fmtdesc."""

    _fields_ = (
        ("index", _U32),
        ("type", _U32),
        ("flags", _U32),
        ("description", ctypes.c_char * 32),
        ("pixelformat", _U32),
        ("mbus_code", _U32),
        ("reserved", _U32 * 3),
    )


class PixFormat(ctypes.Structure):
    """struct v4l2_pix_format."""

    _fields_ = tuple(
        (name, _U32)
        for name in (
            "width",
            "height",
            "pixelformat",
            "field",
            "bytesperline",
            "sizeimage",
            "colorspace",
            "priv",
            "flags",
            "ycbcr_enc",
            "quantization",
            "xfer_func",
        )
    )


class _AnyFormat(ctypes.Union):
    _fields_ = (("pix", PixFormat), ("raw_data", ctypes.c_uint8 * 200), ("aligned", ctypes.c_void_p))


class Format(ctypes.Structure):
    """struct v4l2_format."""

    _fields_ = (("type", _U32), ("fmt", _AnyFormat))


class Fraction(ctypes.Structure):
    """struct v4l2_fract, seconds where it is a time."""

    _fields_ = (("numerator", _U32), ("denominator", _U32))


class CaptureParameters(ctypes.Structure):
    """struct v4l2_captureparm."""

    _fields_ = (
        ("capability", _U32),
        ("capturemode", _U32),
        ("timeperframe", Fraction),
        ("extendedmode", _U32),
        ("readbuffers", _U32),
        ("reserved", _U32 * 4),
    )


class _AnyParameters(ctypes.Union):
    _fields_ = (("capture", CaptureParameters), ("raw_data", ctypes.c_uint8 * 200))


class StreamParameters(ctypes.Structure):
    """struct v4l2_streamparm."""

    _fields_ = (("type", _U32), ("parm", _AnyParameters))


class RequestBuffers(ctypes.Structure):
    """struct v4l2_requestbuffers."""

    _fields_ = (
        ("count", _U32),
        ("type", _U32),
        ("memory", _U32),
        ("capabilities", _U32),
        ("flags", ctypes.c_uint8),
        ("reserved", ctypes.c_uint8 * 3),
    )


class _Timeval(ctypes.Structure):
    _fields_ = (("tv_sec", ctypes.c_long), ("tv_usec", ctypes.c_long))


class _Timecode(ctypes.Structure):
    _fields_ = (
        ("type", _U32),
        ("flags", _U32),
        ("frames", ctypes.c_uint8),
        ("seconds", ctypes.c_uint8),
        ("minutes", ctypes.c_uint8),
        ("hours", ctypes.c_uint8),
        ("userbits", ctypes.c_uint8 * 4),
    )


class _Memory(ctypes.Union):
    _fields_ = (("offset", _U32), ("userptr", ctypes.c_ulong), ("planes", ctypes.c_void_p), ("fd", _S32))


class Buffer(ctypes.Structure):
    """struct v4l2_buffer."""

    _fields_ = (
        ("index", _U32),
        ("type", _U32),
        ("bytesused", _U32),
        ("flags", _U32),
        ("field", _U32),
        ("timestamp", _Timeval),
        ("timecode", _Timecode),
        ("sequence", _U32),
        ("memory", _U32),
        ("m", _Memory),
        ("length", _U32),
        ("reserved2", _U32),
        ("request_fd", _S32),
    )


class ControlValue(ctypes.Structure):
    """struct v4l2_control."""

    _fields_ = (("id", _U32), ("value", _S32))


class ControlQuery(ctypes.Structure):
    """struct v4l2_queryctrl."""

    _fields_ = (
        ("id", _U32),
        ("type", _U32),
        ("name", ctypes.c_char * 32),
        ("minimum", _S32),
        ("maximum", _S32),
        ("step", _S32),
        ("default_value", _S32),
        ("flags", _U32),
        ("reserved", _U32 * 2),
    )


_WRITE, _READ = 1, 2


def _request(direction: int, number: int, argument: type[ctypes.Structure | ctypes.c_int]) -> int:
    return direction << 30 | ctypes.sizeof(argument) << 16 | ord("V") << 8 | number


class Request(IntEnum):
    """VIDIOC_*: the requests to a device."""

    QUERYCAP = _request(_READ, 0, Capability)
    ENUM_FMT = _request(_READ | _WRITE, 2, FormatDescription)
    S_FMT = _request(_READ | _WRITE, 5, Format)
    REQBUFS = _request(_READ | _WRITE, 8, RequestBuffers)
    QUERYBUF = _request(_READ | _WRITE, 9, Buffer)
    QBUF = _request(_READ | _WRITE, 15, Buffer)
    DQBUF = _request(_READ | _WRITE, 17, Buffer)
    STREAMON = _request(_WRITE, 18, ctypes.c_int)
    STREAMOFF = _request(_WRITE, 19, ctypes.c_int)
    G_PARM = _request(_READ | _WRITE, 21, StreamParameters)
    S_PARM = _request(_READ | _WRITE, 22, StreamParameters)
    G_CTRL = _request(_READ | _WRITE, 27, ControlValue)
    S_CTRL = _request(_READ | _WRITE, 28, ControlValue)
    QUERYCTRL = _request(_READ | _WRITE, 36, ControlQuery)
