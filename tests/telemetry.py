"""GoPro's telemetry made from its public format: entries, streams, payloads, and films that carry them."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from fractions import Fraction
from pathlib import Path

import av

SCALE5 = (10_000_000, 10_000_000, 1000, 1000, 100)
PLACE = (47.5, 8.25, 600.0, 50.0, 50.5)
"""Latitude, longitude, altitude, speed over ground and in space."""
BEGAN = datetime(2026, 5, 4, 9, 30, tzinfo=UTC)


def entry(key: str, kind: str, size: int, content: bytes, repeat: int | None = None) -> bytes:
    """One entry, filled up to four bytes."""
    many = len(content) // size if repeat is None else repeat
    head = struct.pack(">4sBBH", key.encode(), ord(kind) if kind else 0, size, many)
    return head + content + bytes(-len(content) % 4)


def nest(key: str, *entries: bytes) -> bytes:
    """An entry that holds entries."""
    content = b"".join(entries)
    return entry(key, "", 1, content) if len(content) < 65536 else entry(key, "", 4, content)


def gps5(
    rows: Sequence[Sequence[float]], moment: datetime | bytes | None, *, fix: int = 3, precision: int = 150
) -> bytes:
    """A stream as cameras before HERO11 write it: one time, fix and precision for all samples."""
    said = (
        f"{moment:%y%m%d%H%M%S}.{moment.microsecond // 1000:03d}".encode() if isinstance(moment, datetime) else moment
    )
    values = [struct.pack(">5i", *(round(value * by) for value, by in zip(row, SCALE5, strict=True))) for row in rows]
    return nest(
        "STRM",
        entry("STNM", "c", 1, b"GPS (Lat., Long., Alt., 2D speed, 3D speed)"),
        entry("GPSF", "L", 4, struct.pack(">I", fix)),
        b"" if said is None else entry("GPSU", "U", 16, said),
        entry("GPSP", "S", 2, struct.pack(">H", precision)),
        entry("SCAL", "l", 4, struct.pack(">5i", *SCALE5)),
        entry("GPS5", "l", 20, b"".join(values)),
    )


def gps9(
    rows: Sequence[Sequence[float]], moments: Sequence[datetime], *, fix: int = 3, precision: float = 1.5
) -> bytes:
    """A stream as cameras from HERO11 on write it: each sample with its own."""
    scale = (*SCALE5, 1, 1000, 100, 1)
    samples = b""
    for row, moment in zip(rows, moments, strict=True):
        midnight = moment.replace(hour=0, minute=0, second=0, microsecond=0)
        days = (midnight - datetime(2000, 1, 1, tzinfo=UTC)).days
        own = (*row, days, (moment - midnight).total_seconds(), precision, fix)
        samples += struct.pack(">7i2H", *(round(value * by) for value, by in zip(own, scale, strict=True)))
    return nest(
        "STRM",
        entry("TYPE", "c", 1, b"lllllllSS"),
        entry("SCAL", "l", 4, struct.pack(">9i", *scale)),
        entry("GPS9", "?", 32, samples),
    )


def device(*streams: bytes) -> bytes:
    """A payload of a camera."""
    return nest("DEVC", entry("DVID", "L", 4, struct.pack(">I", 1)), entry("DVNM", "c", 1, b"GoPro Max"), *streams)


def readout(milliseconds: float) -> bytes:
    """How long the sensor takes to be read out."""
    return entry("SROT", "f", 4, struct.pack(">f", milliseconds))


def flown(at_s: float) -> tuple[float, float, float, float, float]:
    """Where an aircraft is that flies north-east at 50 m/s and climbs at 2 m/s."""
    return PLACE[0] + 0.0003 * at_s, PLACE[1] + 0.0003 * at_s, PLACE[2] + 2.0 * at_s, 50.0, 50.04


def flight_payloads(
    seconds: int, *, began: datetime = BEGAN, lost: Sequence[int] = (), rate_hz: int = 10
) -> list[bytes]:
    """Telemetry of a flight that began then, a payload a second; none of these seconds has a fix."""
    return [
        device(
            gps5(
                [flown(second + place / rate_hz) for place in range(rate_hz)],
                began + timedelta(seconds=second),
                fix=0 if second in lost else 3,
            )
        )
        for second in range(seconds)
    ]


def with_telemetry(source: Path, target: Path, payloads: Sequence[bytes], *, of_camera: bytes = b"") -> Path:
    """Copy a film with a track of telemetry beside it, a payload a second, and what it says of its camera."""
    with av.open(str(source)) as given, av.open(str(target), "w") as made:
        stream = given.streams.video[0]
        made.metadata.update(given.metadata)
        copy = made.add_stream_from_template(stream)
        track = made.add_data_stream("bin_data")
        track.time_base = Fraction(1, 1000)
        for packet in given.demux(stream):
            if packet.size:
                packet.stream = copy
                made.mux(packet)
        for second, payload in enumerate(payloads):
            own = av.Packet(payload)
            own.stream, own.time_base = track, Fraction(1, 1000)
            own.pts = own.dts = 1000 * second
            own.duration = 1000
            made.mux(own)
    if of_camera:
        box = _box(b"udta", _box(b"GPMF", of_camera))
        data = bytearray(target.read_bytes())
        at = data.rindex(b"moov") - 4  # at the end, so that no offset in it changes
        length = int.from_bytes(data[at : at + 4], "big")
        assert at + length == len(data)
        udta = data.find(b"udta", at)
        if udta > 0:
            data[udta : udta + 4] = b"free"
        data[at : at + 4] = (length + len(box)).to_bytes(4, "big")
        target.write_bytes(bytes(data) + box)
    return target


def _box(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I4s", 8 + len(content), name) + content
