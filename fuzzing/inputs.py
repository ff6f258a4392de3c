"""What is put in: sound files in which any field may be hostile and any part be doubled, dropped, moved or damaged."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import yaml
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from hypothesis import assume
from hypothesis import strategies as st

from flight_file.documents import picture_header
from flight_file.reader import open_flight
from flight_file.records import MAGIC, RECORD_HEADER
from fuzzing.flights import COMPRESS, START_NS, Shot, sealed_flight, shot
from recorder.config import parse_config
from recorder.host import SimulatedClock, fixed_host
from recorder.journal import Journal
from recorder.run import record
from tests.jpegs import plain_picture
from tests.sounds import recorded, times_s
from tests.videos import film

FIXTURES = Path(__file__).parents[1] / "fixtures"
MOST_BYTES = 1_000_000  # of an input

Files = dict[str, bytes]

_PRIVATE_KEY = Ed25519PrivateKey.from_private_bytes(bytes(32))
KEY: Files = {
    "recorder.key": _PRIVATE_KEY.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    ),
    "recorder.key.pub": _PRIVATE_KEY.public_key().public_bytes(
        serialization.Encoding.PEM, serialization.PublicFormat.SubjectPublicKeyInfo
    ),
}
"""A box's key and its public half."""

HOSTILE_NUMBERS: tuple[Any, ...] = (
    *(-1, 0, 1, 2**31, 2**32 - 1, 2**53, 2**63 - 1, 2**63, 2**64, -(2**63), 10**18, 10**30, 253_402_300_800),
    *(0.5, -0.0, 1e-308, 1e308, 1e9, -1e12),
)
HOSTILE_TEXTS = (
    *("", "\0", "a" * 5000, "../up", "/no/such/folder", "two\nlines", "\x1b[2J", "é" * 300, "2018-99-99T99:99:99Z"),
    *("9999-12-31T23:59:59Z", "nan", "-inf", "1e999", "0" * 5000, "\U0001d518nicode", "CON", "name.mcap"),
)
HOSTILE = st.sampled_from((*HOSTILE_NUMBERS, *HOSTILE_TEXTS, None, True, [], {}, [[]], [1] * 2000))


@dataclass(frozen=True, slots=True)
class Fixture:
    """What the inputs begin with."""

    pictures: tuple[bytes, ...]
    panel: Mapping[str, Any]
    panel_picture: bytes


@cache
def fixture() -> Fixture:
    """The animation's panel, and three frames of it."""
    frames = open_flight([FIXTURES / "thesis_a1.mcap"]).sample_frames(3)
    panel = yaml.safe_load((FIXTURES / "panel.yaml").read_text(encoding="utf-8"))
    return Fixture(tuple(frame.encoded for frame in frames), panel, (FIXTURES / "panel.jpg").read_bytes())


@st.composite
def with_hostile_parts(draw: st.DrawFn, document: Any, most: int = 3) -> Any:  # noqa: ANN401 - any JSON
    """A document in which up to so many of its values, wherever they stand, are hostile, lacking or doubled."""
    for _ in range(draw(st.integers(0, most))):
        document = _changed(document, draw)
    return document


def _changed(document: Any, draw: st.DrawFn) -> Any:  # noqa: ANN401
    if isinstance(document, dict) and document and draw(st.integers(0, 9)):
        key = draw(st.sampled_from(sorted(document)))
        if not draw(st.integers(0, 9)):
            return {name: value for name, value in document.items() if name != key}
        return {**document, key: _changed(document[key], draw)}
    if isinstance(document, list) and document and draw(st.integers(0, 9)):
        place = draw(st.integers(0, len(document) - 1))
        if not draw(st.integers(0, 9)):
            return document * draw(st.sampled_from((2, 300)))
        return [*document[:place], _changed(document[place], draw), *document[place + 1 :]]
    return draw(HOSTILE)


PLAIN = (
    plain_picture(),
    plain_picture(progressive=True),
    *(plain_picture(kind) for kind in ("PNG", "BMP", "WEBP", "GIF")),
)


@st.composite
def pictures(draw: st.DrawFn) -> bytes:
    """A picture: of the cockpit or plain, perhaps claiming a size, with fill bytes, doubled scans, cut or damaged."""
    picture = draw(st.sampled_from((*fixture().pictures, *PLAIN, b"")))
    for change in draw(st.lists(st.sampled_from(_PICTURE_CHANGES), max_size=2)):
        picture = change(picture, draw)
    return picture


def _claiming(picture: bytes, draw: st.DrawFn) -> bytes:
    header, sides = picture_header(picture), st.sampled_from((0, 1, 8, 1024, 4096, 8192, 32_000, 65_535))
    if header is None or not picture.startswith(b"\xff\xd8"):
        return picture[:16] + draw(sides).to_bytes(4) + draw(sides).to_bytes(4) + picture[24:]
    at = header.height_at
    return picture[:at] + draw(sides).to_bytes(2) + draw(sides).to_bytes(2) + picture[at + 4 :]


def _filled(picture: bytes, draw: st.DrawFn) -> bytes:
    marker = draw(st.sampled_from((b"\xff\xc0", b"\xff\xc2", b"\xff\xda", b"\xff\xc4", b"\xff\xdb")))
    fill = draw(st.sampled_from((b"\xff", b"\xff" * 9000, b"stray", b"\xff\x00", b"\xff\xd0\xff\x01")))
    return picture.replace(marker, fill + marker, 1)


def _rescanned(picture: bytes, draw: st.DrawFn) -> bytes:
    at = picture.rfind(b"\xff\xda")
    return picture if at < 0 else picture[:-2] + picture[at:-2] * draw(st.sampled_from((1, 9, 30, 1000))) + picture[-2:]


def _cut(picture: bytes, draw: st.DrawFn) -> bytes:
    return picture[: draw(st.integers(0, len(picture)))]


def _damaged(content: bytes, draw: st.DrawFn) -> bytes:
    changed = bytearray(content)
    for place, value in draw(st.lists(st.tuples(st.integers(0, 2**20), st.integers(0, 255)), max_size=8)):
        if changed:
            changed[place % len(changed)] = value
    return bytes(changed)


_PICTURE_CHANGES: tuple[Callable[[bytes, st.DrawFn], bytes], ...] = (_claiming, _filled, _rescanned, _cut, _damaged)


@st.composite
def shots(draw: st.DrawFn, number: int) -> Shot:
    """A frame that is sound, or hostile in its record, its picture or its image's time."""
    sound = shot(number, fixture().pictures[number % 3])
    kind = draw(st.integers(0, 5))
    if kind == 0:
        return replace(sound, document=draw(with_hostile_parts(sound.document)))
    if kind == 1:
        return shot(number, draw(pictures()))
    if kind == 2:  # noqa: PLR2004 - a sixth
        times = st.sampled_from((-1, 0, 2**31, 2**62, -(2**63), 2**63 - 1))
        return replace(sound, seconds=draw(times), nanos=draw(st.sampled_from((0, -1, 2**31 - 1))))
    return sound


@st.composite
def panels(draw: st.DrawFn) -> Files:
    """A panel with its picture, either perhaps hostile."""
    panel = draw(st.one_of(st.just(fixture().panel), with_hostile_parts(fixture().panel)))
    picture = draw(st.one_of(st.just(fixture().panel_picture), st.just(fixture().panel_picture), pictures()))
    return {"panel.yaml": _yaml(panel), "panel.jpg": picture}


def _yaml(document: object) -> bytes:
    return yaml.safe_dump(document, allow_unicode=True).encode("utf-8", "surrogatepass")


@st.composite
def flights(draw: st.DrawFn) -> Files:
    """A flight whose seals fit, whatever is in it; then perhaps damaged, or with records moved."""
    count = draw(st.integers(0, 4))
    attachments = draw(st.one_of(st.just({}), panels()))
    if not draw(st.integers(0, 4)):
        attachments |= {draw(st.sampled_from(HOSTILE_TEXTS)): b"content"}
    names = ("recording", "segment", "started_realtime_ns", "chain", "camera_model", "version.python")
    counts = ("frames", "dropped", "ended_realtime_ns", "chain", "recovered_lost_before", "reason")
    content = sealed_flight(
        [draw(shots(number)) for number in range(count)],
        attachments,
        session=draw(_items(names)),
        end=draw(_items(counts)),
        compression=draw(st.sampled_from(sorted(COMPRESS))),
        per_chunk=draw(st.integers(1, 3)),
    )
    change = draw(st.sampled_from((None, None, None, _moved, _damaged, _cut)))
    return {"flight.mcap": content if change is None else change(content, draw)}


def _items(names: tuple[str, ...]) -> st.SearchStrategy[dict[str, str]]:
    values = st.sampled_from((*HOSTILE_TEXTS, *(str(number) for number in HOSTILE_NUMBERS)))
    return st.one_of(st.just({}), st.dictionaries(st.sampled_from(names), values, max_size=2))


def _moved(content: bytes, draw: st.DrawFn) -> bytes:
    records, at = [], len(MAGIC)
    while at + RECORD_HEADER.size <= len(content) - len(MAGIC):
        _, length = RECORD_HEADER.unpack_from(content, at)
        records.append(content[at : at + RECORD_HEADER.size + length])
        at += RECORD_HEADER.size + length
    if not records:
        return content
    place, other = (draw(st.integers(0, len(records) - 1)) for _ in range(2))
    records[place : place + 1] = [records[other]] * draw(st.sampled_from((0, 1, 2)))
    return MAGIC + b"".join(records) + MAGIC


CAMERA = {
    "model": "a camera",
    "picture_size": [1024, 768],
    "focal": {"pixels_per_radian": [200.0, 180.0, 0.5], "covariance": None, "range_mm": [4, 50]},
    "distortion": [{"focal_length_mm": 4.45, "k1": 0.01, "k2": -0.001}, {"focal_length_mm": 40, "k1": 0.0}],
}


@st.composite
def panels_on_a_flight(draw: st.DrawFn) -> Files:
    """A sound flight, and beside it a panel and a camera that are not."""
    sound = sealed_flight([shot(number, picture) for number, picture in enumerate(fixture().pictures)], {})
    return {
        "flight.mcap": sound,
        **draw(panels()),
        "camera.yaml": _yaml(draw(with_hostile_parts(CAMERA))),
    }


@st.composite
def recorder_configurations(draw: st.DrawFn) -> Files:
    """A replay of three pictures with a recorder.yaml in which anything may be hostile, and what it attaches likewise.

    The storage directory is drawn apart: a recorder makes the one that it is told, wherever that is.
    """
    document = draw(with_hostile_parts(_CONFIGURATION))
    if isinstance(document, dict):
        storage = document.get("storage")
        if isinstance(storage, dict):
            document = {**document, "storage": {**storage, "directory": draw(_DIRECTORIES)}}
        elif isinstance(storage, str):
            document = {**document, "storage": None}
    pictures = {f"pictures/{number}.jpg": picture for number, picture in enumerate(fixture().pictures)}
    return {
        "recorder.yaml": _yaml(document),
        **pictures,
        **draw(panels()),
        "camera.yaml": _yaml(draw(with_hostile_parts(CAMERA, 1))),
        **KEY,
    }


_OUT = "../out"
_CONFIGURATION = {
    "camera": {"driver": "replay", "path": "pictures", "rate_hz": 1, "pace": "fastest"},
    "storage": {
        "directory": "../out",
        "segment_s": 2,
        "segment_mib": 1,
        "keep_free_gib": 0,
        "keep_hours": 1,
        "max_hours": 2,
    },
    "attach": {"panel": "panel.yaml", "camera": "camera.yaml"},
    "evidence": {"key": "recorder.key"},
}
_ODD_DIRECTORIES: tuple[Any, ...] = (
    *(f"{_OUT}/{end}" for end in ("deep/in/it", "two\nlines", "\0", "a" * 5000)),
    *("panel.jpg", "panel.jpg/below", None, 5, [], {}, True),
)
_DIRECTORIES = st.one_of(st.just(_OUT), st.just(_OUT), st.just(_OUT), st.sampled_from(_ODD_DIRECTORIES))


@dataclass(frozen=True, slots=True)
class SignedFlight:
    """A finished segment of a recorder with `KEY`, checkpoints inside, and its signature."""

    content: bytes
    signature: bytes


@cache
def signed_flight() -> SignedFlight:
    """Of three frames, the same each time."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        for file, content in (("recorder.key", KEY["recorder.key"]), *enumerate(fixture().pictures)):
            path = folder / (file if isinstance(file, str) else f"{file}.jpg")
            path.write_bytes(content)
            path.chmod(0o600)
        document = {
            "camera": {"driver": "replay", "path": ".", "rate_hz": 1, "pace": "fastest"},
            "storage": {"directory": "flights", "keep_free_gib": 0},
            "evidence": {"key": "recorder.key"},
        }
        host = fixed_host(SimulatedClock(START_NS))
        (path,) = record(
            parse_config(document, base=folder), host=host, name="flight", journal=Journal(io.StringIO())
        ).paths
        return SignedFlight(path.read_bytes(), Path(f"{path}.sig").read_bytes())


@st.composite
def changed_signed_flights(draw: st.DrawFn) -> Files:
    """A signed segment that is not as it was signed: records moved, bytes changed, its end cut off."""
    signed = signed_flight()
    content = draw(st.sampled_from((_moved, _damaged, _cut)))(signed.content, draw)
    assume(content != signed.content)
    return {"flight_0000.mcap": content, "flight_0000.mcap.sig": signed.signature, **KEY}


@st.composite
def segments_in_work(draw: st.DrawFn) -> Files:
    """What a power cut left of it, perhaps with something done to it after: checkpoints moved, bytes changed."""
    whole = signed_flight().content
    content = whole[: -draw(st.integers(1, len(whole) * 3 // 4))]
    change = draw(st.sampled_from((None, _damaged, _moved)))
    return {"flight_0000.mcap.part": content if change is None else change(content, draw), **KEY}


@st.composite
def signatures(draw: st.DrawFn) -> Files:
    """A signed segment with something beside it that should be its signature: sound, damaged, or of another form."""
    signed = signed_flight()
    sound = signed.signature
    content = draw(st.one_of(st.just(sound), st.binary(max_size=300), st.just(sound * 1000), st.just(bytes(500_000))))
    return {"flight_0000.mcap": signed.content, "flight_0000.mcap.sig": _damaged(content, draw), **KEY}


@st.composite
def tables(draw: st.DrawFn) -> Files:
    """Flight data and a truth, with hostile fields; the description beside them likewise."""
    names = ["frame", "time_utc", "time_s", "speed_kt", "speed_kt_status", "speed_kt_score", "speed_kt_sigma"]
    files = {}
    for file in ("flight.csv", "truth.csv"):
        rows = [
            [number, f"2018-05-04T12:00:{number:02d}Z", number, number**2 % 91, "read", 0.9, 0.1]
            for number in range(30)
        ]
        changed = draw(with_hostile_parts([names, *rows]))
        lines = [line if isinstance(line, list) else [line] for line in changed] if isinstance(changed, list) else []
        text = "\n".join(",".join(map(str, line)) for line in lines)
        files[file] = _damaged(text.encode("utf-8", "surrogatepass"), draw)
    says = {"needles": {"speed_kt": {"unit": "kt", "scale_min": 0, "scale_max": 100, "wraps": None}}}
    return {**files, "flight.json": _json(draw(with_hostile_parts(says)))}


def _json(document: object) -> bytes:
    return json.dumps(document).encode()


@cache
def _film() -> bytes:
    """A film of two seconds with sound."""
    with TemporaryDirectory() as folder:
        sound = recorded(np.sin(2 * np.pi * 200 * times_s(2)))
        return film(Path(folder) / "film.mp4", sound=sound, size_px=(64, 48)).read_bytes()


@st.composite
def films(draw: st.DrawFn) -> Files:
    """A video file that is damaged, or breaks off."""
    changed = draw(st.sampled_from((_cut, _damaged, _damaged_index)))(_film(), draw)
    return {"film.mp4": changed}


def _damaged_index(content: bytes, draw: st.DrawFn) -> bytes:
    """Damage in the box that says where everything is: few bytes in a hundred are of it."""
    index = content.index(b"moov")
    return content[:index] + _damaged(content[index:], draw)


@st.composite
def photographs(draw: st.DrawFn) -> Files:
    """A folder of them."""
    return {f"photographs/{number}.jpg": draw(pictures()) for number in range(draw(st.integers(1, 3)))}
