"""Parse attachments, YAML documents and pictures' headers, within limits checked before memory is allocated.

A YAML document may come from anyone, even inside a flight file. So its cost is limited first: its depth, and its number
of values with aliases expanded. Anything that would be read differently from how it looks is refused: a repeated key,
a tag for anything but plain values, or a number that a leading 0 makes octal. A date stays text, so a file may be
called `2018-05-04`, or `2018-13-45`; so do `1:30`, which older YAML takes for 90, and `off`.

A JPEG's markers are followed as by libjpeg, through fill bytes and stray ones, so that no picture is larger than found
here. Sources: ITU-T T.81 annex B; PNG (third edition) 11.2.1; RFC 9649 and RFC 6386 (WebP).
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import yaml

from flight_file.errors import NotYamlError
from flight_file.thresholds import (
    JPEG_PIXELS_PER_BYTE,
    MAX_PIXELS,
    MAX_SCANS,
    MAX_SHOWN_CHARACTERS,
    MAX_SIDE_PX,
    MAX_YAML_BYTES,
    MAX_YAML_DEPTH,
    MAX_YAML_DIGITS,
    MAX_YAML_VALUES,
    PIXELS_ALWAYS_TRIED,
    PNG_PIXELS_PER_BYTE,
)

SOI, EOI = b"\xff\xd8", b"\xff\xd9"
SOS = 0xDA
SOF = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # these three are DHT, JPG and DAC
ALONE = frozenset(range(0xD0, 0xD8)) | {0x01}  # RSTn, TEM: no length follows

_SEQUENTIAL = frozenset((0xC0, 0xC1))
_SIZE = struct.Struct(">BHHB")  # bits per sample, height, width, components
_COEFFICIENT_BYTES = 2
_HEIGHT_AT = 5  # behind the marker, the length and the bits per sample
_HEAD = struct.Struct(">BBH")  # FF, what kind of segment it is, its length without these two bytes of marker
_PNG = struct.Struct(">8s4x4sIIBB")  # signature, length of the first chunk, its name, width, height, depth, colour
_PNG_HEIGHT_AT = 20
_PNG_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
PNG_START = b"\x89PNG\r\n\x1a\n"
WEBP = re.compile(rb"RIFF.{4}WEBP", re.DOTALL)
_HEIF = frozenset((b"heic", b"heix", b"hevc", b"heim", b"heis", b"mif1", b"msf1", b"avif"))
_WEBP_BYTES = 30  # RIFF's head, a chunk's head, and its size
_KINDS = ("null", "bool", "int", "float", "str", "seq", "map")
_TAGS = {f"tag:yaml.org,2002:{kind}": kind for kind in _KINDS}
_NUMBERS = ("int", "float")
_TEXT = "tag:yaml.org,2002:str"
_WORDS = frozenset(("yes", "no", "on", "off"))
_OCTAL = re.compile(r"[-+]?0[0-7_]+")


@dataclass(frozen=True, slots=True)
class PictureHeader:
    """Size in pixels, before any EXIF orientation.

    Attributes
    ----------
    height_at
        Offset of the height in the file.
    is_sequential
        Whether all rows are in the file, from top to bottom.
    scans
        Number of passes over its pixels.
    stored_bytes
        Size of its pixels before compression, if that limits more than their number does.
    buffered_bytes
        Most memory taken while it is decoded: all coefficients of a JPEG in several scans; 0 for one that is decoded
        row by row.
    """

    height_px: int
    width_px: int
    height_at: int
    is_sequential: bool
    scans: int = 1
    stored_bytes: int = 0
    buffered_bytes: int = 0

    def objection(self, size_bytes: int) -> str:
        """Say why a file of this size must not be decompressed, as a sentence without full stop; empty if it may."""
        pixels = self.height_px * self.width_px
        pixels_per_byte = PNG_PIXELS_PER_BYTE if self.stored_bytes else JPEG_PIXELS_PER_BYTE
        if pixels > max(PIXELS_ALWAYS_TRIED, size_bytes * pixels_per_byte):
            return (
                f"the picture is damaged, cut short or empty: it says that it is {self.width_px} x {self.height_px},"
                f" but has {size_bytes} bytes"
            )
        if pixels > MAX_PIXELS or max(self.height_px, self.width_px) > MAX_SIDE_PX:
            return (
                f"the picture is {self.width_px} x {self.height_px}; make it smaller, to {MAX_PIXELS // 10**6} million"
                f" pixels or fewer, and no side above {MAX_SIDE_PX}"
            )
        if self.stored_bytes > 4 * MAX_PIXELS:
            return f"the picture takes {self.stored_bytes // 10**6} MB; save it with 8 bits for each colour"
        if self.scans > MAX_SCANS:
            return f"the picture is coded in {self.scans} scans; save it as a plain JPEG"
        return ""


def is_heif(head: bytes) -> bool:
    """Whether a file that begins so is a picture in HEIF (HEIC, AVIF), as telephones make."""
    return head[4:8] == b"ftyp" and head[8:12] in _HEIF


def picture_header(encoded: bytes) -> PictureHeader | None:
    """Parse the header of a JPEG, PNG or WebP; None for another file, or one damaged before it states its size."""
    if encoded.startswith(SOI):
        return _jpeg_header(encoded)
    if encoded.startswith(PNG_START) and len(encoded) >= _PNG.size:
        return _png_header(encoded)
    if WEBP.match(encoded) and len(encoded) >= _WEBP_BYTES:
        return _webp_header(encoded)
    return None


def _webp_header(encoded: bytes) -> PictureHeader | None:
    kind = encoded[12:16]
    if kind == b"VP8X":
        width = int.from_bytes(encoded[24:27], "little") + 1
        height = int.from_bytes(encoded[27:30], "little") + 1
    elif kind == b"VP8 " and encoded[23:26] == b"\x9d\x01\x2a":
        width, height = (int.from_bytes(encoded[at : at + 2], "little") & 0x3FFF for at in (26, 28))
    elif kind == b"VP8L" and encoded[20] == 0x2F:  # noqa: PLR2004 - its signature
        bits = int.from_bytes(encoded[21:25], "little")
        width, height = (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    else:
        return None
    return PictureHeader(height, width, 0, False, stored_bytes=4 * height * width) if height and width else None


def _png_header(encoded: bytes) -> PictureHeader | None:
    _, kind, width, height, depth, colour = _PNG.unpack_from(encoded)
    if kind != b"IHDR" or not height or not width:
        return None
    stored_bytes = height * width * depth * _PNG_CHANNELS.get(colour, 1) // 8
    return PictureHeader(height, width, _PNG_HEIGHT_AT, False, stored_bytes=stored_bytes)


def _jpeg_header(encoded: bytes) -> PictureHeader | None:
    components = 0
    height = width = at = kind = 0
    for marker, start, end in jpeg_segments(encoded):
        if marker in SOF and not components:
            if end - start < _SIZE.size:
                return None
            _, height, width, components = _SIZE.unpack_from(encoded, start)
            at, kind = start - 4 + _HEIGHT_AT, marker
        elif marker == SOS and components:
            if not height or not width:
                return None
            several = kind not in _SEQUENTIAL or start == end or encoded[start] < components
            scans = encoded.count(_SCAN_START, start - 4) if several else 1
            buffered_bytes = _COEFFICIENT_BYTES * height * width * components if several else 0
            is_sequential = kind in _SEQUENTIAL and encoded.endswith(EOI)
            return PictureHeader(height, width, at, is_sequential, scans, buffered_bytes=buffered_bytes)
    return PictureHeader(height, width, at, False) if height and width else None


_SCAN_START = bytes((0xFF, SOS))


def jpeg_segments(encoded: bytes) -> Iterator[tuple[int, int, int]]:
    """Iterate over marker, start and end of the content of each segment, up to and including the first scan's head.

    A truncated segment ends the walk.
    """
    at, last = len(SOI), len(encoded) - _HEAD.size
    while at <= last:
        first, marker, length = _HEAD.unpack_from(encoded, at)
        if first != 0xFF:  # noqa: PLR2004 - the first byte of every marker; others are strays
            at = encoded.find(b"\xff", at)
            if at < 0:
                return
        elif marker == 0xFF:  # noqa: PLR2004 - a fill byte
            at += 1
        elif marker == 0 or marker in ALONE:
            at += 2
        elif marker == EOI[1] or length < 2 or at + 2 + length > len(encoded):  # noqa: PLR2004 - the length's own bytes
            return
        else:
            yield marker, at + 4, at + 2 + length
            if marker == SOS:
                return
            at += 2 + length


def parse_yaml(text: bytes | str) -> Any:  # noqa: ANN401 - it is whatever the text says
    """Parse a YAML text into None, bool, int, float, str, and lists and dicts of these.

    Raises
    ------
    NotYamlError
        With the line, if known.
    """
    if len(text) > MAX_YAML_BYTES:
        raise NotYamlError("is larger than 1 MiB; shorten it")
    loader = None
    try:
        loader = _Loader(text)
        return loader.get_single_data()
    except yaml.reader.ReaderError as error:
        raise NotYamlError("is not YAML (it is not UTF-8 text); correct it") from error
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        raise _not_yaml(error.problem or error.context or "", mark) from error
    except (ValueError, OverflowError) as error:  # PyYAML converts escapes and versions to numbers unchecked
        mark = None if loader is None else loader.get_mark()
        raise _not_yaml("an escape or a version is out of range", mark) from error


def _not_yaml(problem: str, mark: yaml.Mark | None) -> NotYamlError:
    shown = problem if len(problem) <= MAX_SHOWN_CHARACTERS else problem[:MAX_SHOWN_CHARACTERS] + "..."
    return NotYamlError(f"is not YAML ({shown}); correct it", line=None if mark is None else mark.line + 1)


class _RefusedError(yaml.MarkedYAMLError):
    """YAML that we do not accept; derived from PyYAML's errors, so that PyYAML passes it on."""

    def __init__(self, problem: str, mark: yaml.Mark) -> None:
        super().__init__(problem=problem, problem_mark=mark)


class _Loader(yaml.SafeLoader):
    """PyYAML's loader with limits on composing nodes, which is before values are made of them."""

    yaml_implicit_resolvers = {  # noqa: RUF012 - PyYAML's way
        first: [(tag, pattern) for tag, pattern in resolvers if not tag.endswith(":timestamp")]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def __init__(self, text: bytes | str) -> None:
        super().__init__(text)
        self._level = 0
        self._values = 0
        self._heights: dict[int, int] = {}
        self._sizes: dict[int, int] = {}

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:  # noqa: ANN401 - PyYAML's
        """Compose the next node within the limits."""
        is_alias = self.check_event(yaml.AliasEvent)
        mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
        before = self._values
        self._count(1, 1, mark)
        self._level += 1
        node = super().compose_node(parent, index)
        self._level -= 1
        if node is None:
            return None
        if is_alias:
            if id(node) not in self._sizes:
                raise _RefusedError("an alias stands for something that contains it", mark)
            self._count(self._sizes[id(node)], self._heights[id(node)], mark)
        else:
            self._sizes[id(node)] = self._values - before
            self._heights[id(node)] = 1 + max((self._heights[id(child)] for child in _children(node)), default=0)
        return node

    def _count(self, values: int, height: int, mark: yaml.Mark) -> None:
        self._values += values
        if self._values > MAX_YAML_VALUES:
            raise _RefusedError(f"it holds more than {MAX_YAML_VALUES} values", mark)
        if self._level + height > MAX_YAML_DEPTH:
            raise _RefusedError(f"it nests deeper than {MAX_YAML_DEPTH} levels", mark)

    def compose_scalar_node(self, anchor: dict[Any, yaml.Node]) -> yaml.ScalarNode:
        """Compose a scalar: plain text, or a number of bounded length."""
        node = super().compose_scalar_node(anchor)
        if any("\ud800" <= character <= "\udfff" for character in node.value):
            raise _RefusedError("half of a surrogate pair is no character", node.start_mark)
        kind = _TAGS.get(node.tag)
        if kind in _NUMBERS and len(node.value) > MAX_YAML_DIGITS:
            raise _RefusedError(f"a number has more than {MAX_YAML_DIGITS} digits", node.start_mark)
        if kind == "int" and _OCTAL.fullmatch(node.value):
            raise _RefusedError(f"{node.value} is octal; write it without the 0 in front", node.start_mark)
        if (kind in _NUMBERS and ":" in node.value) or (kind == "bool" and node.value.lower() in _WORDS):
            node.tag = _TEXT
        return node

    def compose_mapping_node(self, anchor: dict[Any, yaml.Node]) -> yaml.MappingNode:
        """Compose a mapping in which no key occurs twice."""
        node = super().compose_mapping_node(anchor)
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise _RefusedError("a key is neither text nor a number", key.start_mark)
            if key.value in seen:
                raise _RefusedError(f"the key {key.value!r} stands twice", key.start_mark)
            seen.add(key.value)
        return node

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:  # noqa: ANN401, FBT001, FBT002 - PyYAML's
        """Construct a node's value if it is plain and fits its tag."""
        kind = _TAGS.get(node.tag)
        if kind is None:
            raise _RefusedError(f"the tag {node.tag!r} stands for no plain value", node.start_mark)
        try:
            return super().construct_object(node, deep)
        except (ValueError, LookupError, OverflowError) as error:
            raise _RefusedError(f"{str(node.value)[:MAX_YAML_DIGITS]!r} is no {kind}", node.start_mark) from error


def _children(node: yaml.Node) -> list[yaml.Node]:
    if isinstance(node, yaml.MappingNode):
        return [part for pair in node.value for part in pair]
    return list(node.value) if isinstance(node, yaml.SequenceNode) else []
