"""GoPro's telemetry (GPMF), as far as it concerns place and time: GPS, and the sensor's read-out time.

A payload is a row of entries, big-endian, each filled up to a whole number of four bytes:

| bytes | what                                                                             |
| ----- | -------------------------------------------------------------------------------- |
| 4     | key, ASCII                                                                       |
| 1     | type of the values, a letter (`TYPES`); 0: the content is entries itself         |
| 1     | size of a sample, bytes                                                          |
| 2     | number of samples                                                                |

`DEVC` is a device; in it `STRM` is a stream, which first says how its samples are meant:

| key    | what                                                                              |
| ------ | --------------------------------------------------------------------------------- |
| `SCAL` | by what values are divided: one number for all fields, or one for each            |
| `TYPE` | of a sample of fields that differ (type `?`): their types                         |
| `GPS5` | latitude, longitude (degrees), altitude (m), speed over ground and in space (m/s) |
| `GPSF` | fix of all of these: 0 none, 2 without altitude, 3 with it                        |
| `GPSP` | their dilution of precision, hundredths                                           |
| `GPSU` | UTC of one of them, `yymmddhhmmss.sss`                                            |
| `GPS9` | as `GPS5`, then days since 2000, seconds since midnight, precision, fix of each   |
| `SROT` | read-out time, ms: of the device, or of each picture                              |

Sources: github.com/gopro/gpmf-parser, its documents; `DVNM` and `SROT` as in GoPro's public sample.

A payload is not trusted. Malformed parts are skipped and counted; nothing is raised. The format nests two levels deep,
and deeper levels are ignored.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import partial
from itertools import islice

from camera_drivers.thresholds import MAX_ANSWER_BYTES, MAX_PARTS
from flight_file.frame import FIX_2D, FIX_3D, MAX_TIME_NS, MOST_OF_A_FIX, NO_FIX
from flight_file.thresholds import MAX_SHOWN_CHARACTERS

DEVICE = b"DEVC"
TYPES = {"b": "b", "B": "B", "s": "h", "S": "H", "l": "i", "L": "I", "j": "q", "J": "Q", "f": "f", "d": "d"}
_HEAD = struct.Struct(">4sBBH")
_UNIT_BYTES = 4
_COMPLEX = "?"
_FIELDS = re.compile(r"([A-Za-z])(?:\[(\d{1,3})\])?")
_MOMENT = re.compile(rb"(\d\d)(\d\d)(\d\d)(\d\d)(\d\d)(\d\d)\.(\d\d\d)")
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_DAYS = (datetime(2000, 1, 1, tzinfo=UTC) - _EPOCH).days
_DAY_S, _NS_PER_MS = 86_400, 1_000_000
_POLE_DEG, _HALF_TURN_DEG = 90.0, 180.0
_HIGHEST_M, _FASTEST_MPS, _WORST_DOP = MOST_OF_A_FIX


class _DamagedError(ValueError):
    """An entry that violates the format; it is counted."""


@dataclass(frozen=True, slots=True)
class GpsSample:
    """What a receiver reported at one moment; None where it reported nothing or has no fix.

    Attributes
    ----------
    fix
        NO_FIX, FIX_2D (no altitude) or FIX_3D.
    speed_mps, speed_3d_mps
        Over ground, and in space.
    dop
        Dilution of precision: below 5 is good.
    utc_ns
        Since the Unix epoch, by the receiver.
    """

    fix: int = NO_FIX
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    altitude_m: float | None = None
    speed_mps: float | None = None
    speed_3d_mps: float | None = None
    dop: float | None = None
    utc_ns: int | None = None


@dataclass(frozen=True, slots=True)
class Payload:
    """What one payload of telemetry says.

    Attributes
    ----------
    samples
        Of the GPS, in their order.
    times_each
        Whether each sample has a time of its own; otherwise one time belongs to an unknown one, and the first has it.
    has_gps
        Whether there is a GPS, with or without samples.
    readout_s
        Read-out time of the sensor from the first row to the last, s.
    device
        The camera's name.
    damaged
        How many parts of it could not be read.
    """

    samples: tuple[GpsSample, ...] = ()
    times_each: bool = False
    has_gps: bool = False
    readout_s: float | None = None
    device: str = ""
    damaged: int = 0


@dataclass(frozen=True, slots=True)
class _Entry:
    key: bytes
    kind: int
    size: int
    repeat: int
    content: memoryview

    def has_nested(self, key: bytes) -> bool:
        return self.key == key and not self.kind


def parse(payload: bytes) -> Payload:
    """Parse a payload, or a file's constant data on its camera; raises nothing."""
    reading = _Reading()
    if len(payload) > MAX_ANSWER_BYTES:
        return Payload(damaged=1)
    for device in reading.entries(memoryview(payload)):
        for item in reading.entries(device.content) if device.has_nested(DEVICE) else ():
            reading.take_item(item)
    return reading.found()


class _Reading:
    """A payload being read."""

    def __init__(self) -> None:
        self._samples: dict[bytes, list[GpsSample]] = {}
        self._readout_s: float | None = None
        self._device = ""
        self._damaged = 0

    def found(self) -> Payload:
        """Gather what was found; GPS9 goes before GPS5, whose samples it repeats."""
        best = next((key for key in (b"GPS9", b"GPS5") if self._samples.get(key)), b"")
        samples = self._samples.get(best, [])
        return Payload(
            tuple(samples), best == b"GPS9", bool(self._samples), self._readout_s, self._device, self._damaged
        )

    def entries(self, content: memoryview) -> Iterator[_Entry]:
        """Iterate over entries up to the end, or to the first with an impossible length."""
        at = 0
        while at < len(content):
            if len(content) - at < _HEAD.size:
                self._damaged += any(content[at:])
                return
            key, kind, size, repeat = _HEAD.unpack_from(content, at)
            if not any(key):  # padded with zeros
                return
            start, length = at + _HEAD.size, size * repeat
            if not key.isascii() or start + length > len(content):
                self._damaged += 1
                return
            yield _Entry(key, kind, size, repeat, content[start : start + length])
            at = start + -(-length // _UNIT_BYTES) * _UNIT_BYTES

    def take_item(self, item: _Entry) -> None:
        """Take an item of a device: a stream, its name, or what applies to all of it."""
        if item.has_nested(b"STRM"):
            told: dict[bytes, _Entry] = {}
            for entry in self.entries(item.content):
                if not self._take(entry, told):
                    told[entry.key] = entry
        elif item.key == b"DVNM":
            self._device = self._device or str(item.content[:MAX_SHOWN_CHARACTERS], "latin-1").strip("\0 ")
        else:
            self._take(item, {})

    def _take(self, entry: _Entry, told: Mapping[bytes, _Entry]) -> bool:
        """Take an entry if it has data of interest; return whether it has."""
        try:
            if entry.key in (b"GPS5", b"GPS9"):
                self._samples.setdefault(entry.key, []).extend(self._positions(entry, told))
            elif entry.key == b"SROT":
                self._readout_s = self._readout_s or _readout_s(entry, told)
            else:
                return False
        except _DamagedError:
            self._damaged += 1
        return True

    def _positions(self, entry: _Entry, told: Mapping[bytes, _Entry]) -> list[GpsSample]:
        if len(self._samples[entry.key]) + entry.repeat > MAX_PARTS:
            raise _DamagedError("more samples than a receiver gives")
        rows = _rows(entry, told) if entry.repeat else []
        if entry.key == b"GPS9":
            return [self._whole(_of_gps9, row) for row in rows]
        fix, dop = (_number(told.get(key)) for key in (b"GPSF", b"GPSP"))
        utc_ns = _utc_ns(told.get(b"GPSU"))
        self._damaged += bool(rows and fix and utc_ns is None)  # without a fix a time may be missing
        of_all = partial(_sample, fix=fix, dop=None if dop is None else dop / 100)
        return [self._whole(partial(of_all, utc_ns=None if place else utc_ns), row) for place, row in enumerate(rows)]

    def _whole(self, sample: Callable[[tuple[float, ...]], GpsSample], row: tuple[float, ...]) -> GpsSample:
        """Make a sample, without a fix if the row is malformed, so that the others keep their places."""
        try:
            return sample(row)
        except _DamagedError:
            self._damaged += 1
            return GpsSample()


def _rows(entry: _Entry, told: Mapping[bytes, _Entry]) -> list[tuple[float, ...]]:
    """Read an entry's samples in their units."""
    layout = struct.Struct(">" + _letters(entry, told))
    if layout.size != entry.size or not entry.repeat:
        raise _DamagedError("samples are not as large as their fields")
    rows = list(layout.iter_unpack(entry.content))
    scale = told.get(b"SCAL")
    if scale is None:
        return rows
    divisors = [value for row in _rows(scale, {}) for value in row]
    divisors = divisors * len(rows[0]) if len(divisors) == 1 else divisors
    if len(divisors) != len(rows[0]) or not all(divisors):
        raise _DamagedError("what samples are divided by does not fit them")
    return [tuple(value / divisor for value, divisor in zip(row, divisors, strict=True)) for row in rows]


def _letters(entry: _Entry, told: Mapping[bytes, _Entry]) -> str:
    """Say what an entry's samples are made of, in the letters of `struct`."""
    kind = chr(entry.kind)
    if kind == _COMPLEX:
        given = told.get(b"TYPE")
        text = "" if given is None else str(given.content, "latin-1").rstrip("\0 ")
        fields = _FIELDS.findall(text)
        if not fields or any(letter not in TYPES for letter, _ in fields) or _FIELDS.sub("", text):
            raise _DamagedError("fields of no known type")
        letters = "".join(islice((TYPES[letter] for letter, many in fields for _ in range(int(many or 1))), entry.size))
    elif kind in TYPES:
        letters = TYPES[kind] * (entry.size // struct.calcsize(">" + TYPES[kind]))
    else:
        raise _DamagedError("a type that no number has")
    if not letters:
        raise _DamagedError("samples without fields")
    return letters


def _number(entry: _Entry | None) -> float | None:
    return None if entry is None else _rows(entry, {})[0][0]


def _readout_s(entry: _Entry, told: Mapping[bytes, _Entry]) -> float:
    readout_s = _rows(entry, told)[0][0] / 1000
    if not 0 < readout_s < 1:
        raise _DamagedError("no sensor is read out so")
    return readout_s


def _of_gps9(row: tuple[float, ...]) -> GpsSample:
    if len(row) != 9 or not all(map(math.isfinite, row)):  # noqa: PLR2004 - as its name says
        raise _DamagedError("no sample of nine numbers")
    *where, days, seconds, dop, fix = row
    if not (days >= 0 and 0 <= seconds <= _DAY_S):
        raise _DamagedError("no time that can be")
    utc_ns = (_DAYS + int(days)) * _DAY_S * 10**9 + round(seconds * 1000) * _NS_PER_MS
    if utc_ns > MAX_TIME_NS:
        raise _DamagedError("no time that a flight is at")
    return _sample(tuple(where), fix=fix, dop=dop, utc_ns=utc_ns)


def _sample(where: tuple[float, ...], *, fix: float | None, dop: float | None, utc_ns: int | None) -> GpsSample:
    """Make a sample; one at 0, 0 was taken before there was a fix, whatever its payload says."""
    if len(where) != 5 or not all(map(math.isfinite, where)):  # noqa: PLR2004 - as GPS5's name says
        raise _DamagedError("no sample of five numbers")
    latitude_deg, longitude_deg, altitude_m, speed_mps, speed_3d_mps = where
    if fix not in (FIX_2D, FIX_3D) or (latitude_deg == 0 and longitude_deg == 0):
        return GpsSample()
    if abs(latitude_deg) > _POLE_DEG or abs(longitude_deg) > _HALF_TURN_DEG or abs(altitude_m) > _HIGHEST_M:
        raise _DamagedError("no place on Earth")
    if not (0 <= speed_mps <= _FASTEST_MPS and 0 <= speed_3d_mps <= _FASTEST_MPS):
        raise _DamagedError("no speed that a receiver has")
    dop = dop if dop is not None and 0 < dop <= _WORST_DOP else None
    flat = GpsSample(FIX_2D, latitude_deg, longitude_deg, None, speed_mps, None, dop, utc_ns)
    if fix == FIX_2D:
        return flat
    return GpsSample(FIX_3D, latitude_deg, longitude_deg, altitude_m, speed_mps, speed_3d_mps, dop, utc_ns)


def _utc_ns(entry: _Entry | None) -> int | None:
    match = None if entry is None else _MOMENT.fullmatch(bytes(entry.content).rstrip(b"\0 "))
    if match is None:
        return None
    year, month, day, hour, minute, second, millisecond = map(int, match.groups())
    try:
        moment = datetime(2000 + year, month, day, hour, minute, second, millisecond * 1000, tzinfo=UTC)
    except ValueError:
        return None
    return (moment - _EPOCH) // timedelta(microseconds=1) * 1000
