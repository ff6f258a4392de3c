"""Our structures and requests are the kernel's, as a C compiler sees them in its own header."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from camera_drivers.uvc import v4l2

STRUCTURES: dict[str, type[ctypes.Structure]] = {
    "v4l2_capability": v4l2.Capability,
    "v4l2_fmtdesc": v4l2.FormatDescription,
    "v4l2_pix_format": v4l2.PixFormat,
    "v4l2_format": v4l2.Format,
    "v4l2_fract": v4l2.Fraction,
    "v4l2_captureparm": v4l2.CaptureParameters,
    "v4l2_streamparm": v4l2.StreamParameters,
    "v4l2_requestbuffers": v4l2.RequestBuffers,
    "v4l2_buffer": v4l2.Buffer,
    "v4l2_control": v4l2.ControlValue,
    "v4l2_queryctrl": v4l2.ControlQuery,
}
OURS = {"mbus_code", "capabilities", "flags", "reserved", "request_fd"}  # younger than some headers; sizes hold them
CONSTANTS = {
    "V4L2_BUF_TYPE_VIDEO_CAPTURE": v4l2.CAPTURE,
    "V4L2_MEMORY_MMAP": v4l2.MMAP,
    "V4L2_FIELD_ANY": v4l2.FIELD_ANY,
    "V4L2_CAP_VIDEO_CAPTURE": v4l2.CAP_VIDEO_CAPTURE,
    "V4L2_CAP_STREAMING": v4l2.CAP_STREAMING,
    "V4L2_CAP_DEVICE_CAPS": v4l2.CAP_DEVICE_CAPS,
    "V4L2_CAP_TIMEPERFRAME": v4l2.CAP_TIMEPERFRAME,
    "V4L2_BUF_FLAG_ERROR": v4l2.BUFFER_ERROR,
    "V4L2_BUF_FLAG_TIMESTAMP_MASK": v4l2.TIMESTAMP_MASK,
    "V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC": v4l2.TIMESTAMP_MONOTONIC,
    "V4L2_CTRL_FLAG_DISABLED": v4l2.CONTROL_DISABLED,
    "V4L2_PIX_FMT_MJPEG": v4l2.fourcc("MJPG"),
    **{f"V4L2_CID_{control.name}": int(control) for control in v4l2.Control},
    **{f"VIDIOC_{request.name}": int(request) for request in v4l2.Request},
}


def expressions() -> Iterator[tuple[str, int]]:
    """C expressions, and what they are by our own description."""
    for name, structure in STRUCTURES.items():
        yield f"sizeof(struct {name})", ctypes.sizeof(structure)
        for field, *_ in structure._fields_:
            if field not in OURS:
                yield f"offsetof(struct {name}, {field})", getattr(structure, field).offset
    yield from CONSTANTS.items()


def test_structures_requests_and_numbers_are_the_kernels(tmp_path: Path) -> None:
    """Sizes, places of members, requests and constants, on this machine."""
    if shutil.which("gcc") is None or not Path("/usr/include/linux/videodev2.h").exists():
        pytest.skip("no gcc with linux-libc-dev on this machine")
    ours = dict(expressions())
    lines = "\n".join(f'printf("%llu\\n", (unsigned long long)({expression}));' for expression in ours)
    program = f"#include <stddef.h>\n#include <stdio.h>\n#include <linux/videodev2.h>\nint main(void) {{\n{lines}\n}}\n"
    (tmp_path / "layout.c").write_text(program)
    subprocess.run(["gcc", "-o", tmp_path / "layout", tmp_path / "layout.c"], check=True)
    said = subprocess.run([tmp_path / "layout"], capture_output=True, text=True, check=True).stdout.split()

    assert dict(zip(ours, map(int, said), strict=True)) == ours
