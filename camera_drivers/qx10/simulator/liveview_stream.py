"""The simulated liveview: packets as the camera sends them, rounded up with junk, and with the faults of a stream."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

from camera_drivers.qx10.simulator.model import CameraModel

RATE_HZ = 15.0
ROUND_BYTES = 128

_JUNK = b"\xff\x01\x00\x00\x00\x00\x00\x00\x24\x35\x68\x79\x00\x10\x00\x00" * 3
_STALL_S = 3600.0  # longer than anybody waits


def packet(number: int, timestamp_ms: int, jpeg: bytes) -> bytes:
    """A packet with a picture: the payload is rounded up, and what is too much is junk."""
    payload = jpeg + b"\xa5" * (-len(jpeg) % ROUND_BYTES)
    common = b"\xff\x01" + (number % 65536).to_bytes(2, "big") + (timestamp_ms % 2**32).to_bytes(4, "big")
    sizes = len(payload).to_bytes(3, "big") + b"\x00"
    return common + b"\x24\x35\x68\x79" + sizes + bytes(120) + payload


def information_packet(number: int) -> bytes:
    """A packet without a picture, of the kind that tells where faces are."""
    frame = bytes(16)
    head = b"\xff\x02" + (number % 65536).to_bytes(2, "big") + bytes(4) + b"\x24\x35\x68\x79"
    sizes = len(frame).to_bytes(3, "big") + b"\x04"
    return head + sizes + b"\x01\x00\x00\x01\x00\x10" + bytes(114) + frame + bytes(4)


def stream(model: CameraModel, due: Callable[[], frozenset[str]]) -> Iterator[bytes]:
    """Packets for as long as somebody takes them."""
    number = 0
    while True:
        faults = due()
        if "liveview_restart" in faults:
            return
        if "liveview_stall" in faults:
            _stall(model)
            return
        if "liveview_junk" in faults:
            yield _JUNK + information_packet(number)
        yield packet(number, round(number * 1000 / RATE_HZ), model.live_picture())
        number += 1
        time.sleep(1 / RATE_HZ)


def _stall(model: CameraModel) -> None:
    for _ in range(round(_STALL_S * RATE_HZ)):
        time.sleep(1 / RATE_HZ)
        if not model.liveview:
            return
