"""What people attach is taken; YAML and pictures that would cost too much are refused before memory is taken."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from flight_file import documents
from flight_file.documents import SOS, parse_yaml, picture_header
from flight_file.errors import NotYamlError
from flight_file.thresholds import MAX_PIXELS, MAX_SCANS, MAX_YAML_BYTES, MAX_YAML_DEPTH
from flight_file.untrusted import read_yaml_file
from tests.jpegs import plain_picture

SCALARS = (
    st.none()
    | st.booleans()
    | st.integers(-(10**18), 10**18)
    | st.floats(allow_nan=False)
    | st.text(st.characters(exclude_categories=["Cs", "Cc"]))
)
DOCUMENTS = st.recursive(
    SCALARS, lambda part: st.lists(part, max_size=4) | st.dictionaries(st.text("abc_", min_size=1), part), max_leaves=20
)
NESTED_BOMB = "a0: &a0 [x, x]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 30))
MERGED_BOMB = "a0: &a0 {x: 1}\n" + "".join(f"a{i}: &a{i} {{<<: [*a{i - 1}, *a{i - 1}]}}\n" for i in range(1, 30))
DEEP_ALIASES = "a0: &a0 []\n" + "".join(f"a{i}: &a{i} [*a{i - 1}]\n" for i in range(1, MAX_YAML_DEPTH + 1))
SIDE_PX = 32_000
SIZE_BYTES = 16 * 2**20  # of a file that could hold as much


@given(DOCUMENTS)
def test_what_is_written_is_read(document: object) -> None:
    """Whatever PyYAML writes of plain values."""
    assert parse_yaml(yaml.safe_dump(document, allow_unicode=True)) == document


def test_aliases_and_merges_are_taken() -> None:
    """As long as they stand for little; a key of its own takes the place of a merged one. Dates stay text."""
    assert parse_yaml("[2018-05-04, 2018-13-45]") == ["2018-05-04", "2018-13-45"]
    assert parse_yaml("a: &a {x: 1, y: 2}\nb: *a\nc: {<<: *a, y: 3}") == {
        "a": {"x": 1, "y": 2},
        "b": {"x": 1, "y": 2},
        "c": {"x": 1, "y": 3},
    }


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a: 1\nb: [", r"line 2 is not YAML"),
        (b"\xff\xfe\x00\xd8", r"^is not YAML \(it is not UTF-8 text\)"),
        (b"a: \x00", r"^is not YAML"),
        ("a: 1\nb: 2\na: 3", r"line 3 .*the key 'a' stands twice"),
        ("? [a]\n: b", r"a key is neither text nor a number"),
        ("a: !!python/object/apply:os.system [id]", r"line 1 .*stands for no plain value"),
        ("a: !!int abc", r"'abc' is no int"),
        ("a: !!bool perhaps", r"'perhaps' is no bool"),
        ("a: !!int ''", r"'' is no int"),
        ("a: !!binary aaa", r"stands for no plain value"),
        ("a: " + "9" * 5000, r"a number has more than 64 digits"),
        ('a: "\\UFFFFFFFF"', r"out of range"),
        ('a: "\\U00110000"', r"out of range"),
        (f"%YAML 1.{'9' * 5000}\n--- a", r"out of range"),
        ('a: "\\uD800"', r"half of a surrogate pair"),
        ("[" * 100_000, r"deeper than 32 levels"),
        ("- " * 100_000, r"deeper than 32 levels"),
        (DEEP_ALIASES, r"deeper than 32 levels"),
        ("a: &a [*a]", r"contains it"),
        ("a: &a {b: *a}", r"contains it"),
        (NESTED_BOMB, r"more than 5000 values"),
        (MERGED_BOMB, r"more than 5000 values"),
        ("[" + "1," * 5001 + "]", r"more than 5000 values"),
        ("#" * (MAX_YAML_BYTES + 1), r"larger than 1 MiB"),
        ("a: *b", r"undefined alias"),
        ("a: " + "!" + "x" * 10_000 + " 1", r"line 1 .{0,200}$"),
    ],
    ids=lambda value: repr(value)[:30],
)
def test_what_is_not_taken_is_one_sentence(monkeypatch: pytest.MonkeyPatch, text: str | bytes, sentence: str) -> None:
    """Where, what is wrong, and no longer than a line."""
    monkeypatch.setattr(documents, "MAX_YAML_VALUES", 5000)
    with pytest.raises(NotYamlError, match=sentence) as caught:
        parse_yaml(text)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 240


@given(
    st.binary(max_size=60)
    | st.lists(
        st.sampled_from(
            ["a", "1", ":", " ", "\n", "- ", "[", "]", "{", "}", ",", "&a ", "*a", "!!int ", "!!map ", "? ", "<<: ",
             "'", '"', "\\x", "%YAML 1.1\n", "---\n", "#", "2018-13-45", ".inf", "!", "\ud800", "\x00", "0x", "="]
        ),
        max_size=30,
    ).map("".join)
)  # fmt: skip
def test_anything_is_a_document_or_refused(content: str | bytes) -> None:
    """Nothing else results, whatever the input."""
    try:
        parse_yaml(content)
    except NotYamlError as error:
        assert "\n" not in str(error)  # noqa: PT017 - both ends are right


def test_what_is_no_regular_file_is_not_waited_for(tmp_path: Path) -> None:
    """A FIFO, a device without end, a directory, a link that leads to itself, a file that is too large."""
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "large").write_bytes(bytes(MAX_YAML_BYTES + 1))

    for path in (tmp_path / "fifo", Path("/dev/zero"), tmp_path, tmp_path / "loop", tmp_path / "large", Path("a\0b")):
        with pytest.raises(OSError, match=r".") as caught:
            read_yaml_file(path)
        assert caught.value.strerror


def first_size(jpeg: bytes) -> int:
    """Where the segment that says the size begins."""
    return jpeg.index(b"\xff\xc0")


def claiming(picture: bytes, side_px: int) -> bytes:
    """A picture whose header says that it is so large."""
    header = picture_header(picture)
    assert header is not None
    if picture.startswith(b"\x89PNG"):
        return picture[:16] + side_px.to_bytes(4) * 2 + picture[24:]
    return picture[: header.height_at] + side_px.to_bytes(2) * 2 + picture[header.height_at + 4 :]


@pytest.mark.parametrize("kind", ["JPEG", "PNG"])
@pytest.mark.parametrize("options", [{}, {"progressive": True, "optimize": True}], ids=str)
def test_size_is_what_is_decompressed(kind: str, options: dict[str, object]) -> None:
    """Width and height, and nothing to object to."""
    picture = plain_picture(kind, **options)
    header = picture_header(picture)

    assert header is not None
    assert (header.width_px, header.height_px, header.objection(len(picture))) == (64, 48, "")


@given(filling=st.binary(max_size=20), fills=st.integers(0, 20))
def test_nothing_between_markers_hides_the_size(filling: bytes, fills: int) -> None:
    """Stray and fill bytes before a marker are passed over as OpenCV passes over them."""
    jpeg = plain_picture()
    at = first_size(jpeg)
    hidden = jpeg[:at] + filling.replace(b"\xff", b"") + b"\xff" * fills + jpeg[at:]
    seen = cv2.imdecode(np.frombuffer(hidden, np.uint8), cv2.IMREAD_GRAYSCALE)
    header = picture_header(hidden)

    assert seen is None or (header is not None and seen.shape == (header.height_px, header.width_px))


@pytest.mark.parametrize("before", [b"", b"\xff", b"\xff" * 1000, b"stray", b"\xff\x00", b"\xff\xd0", b"\xff\x01"])
def test_large_picture_is_refused_whatever_stands_before_its_size(before: bytes) -> None:
    """A gigapixel is one sentence, in a PNG too."""
    jpeg = claiming(plain_picture(), SIDE_PX)
    at = first_size(jpeg)
    for picture in (jpeg[:at] + before + jpeg[at:], claiming(plain_picture("PNG"), SIDE_PX)):
        header = picture_header(picture)

        assert header is not None
        assert "32000 x 32000" in header.objection(SIZE_BYTES)
        assert "damaged, cut short or empty" in header.objection(1000)


def test_picture_at_the_limit_is_taken() -> None:
    """And one row more is not."""
    side_px = round(MAX_PIXELS**0.5)
    for more, is_taken in ((0, True), (1, False)):
        header = picture_header(claiming(plain_picture(), side_px + more))
        assert header is not None
        assert (header.objection(SIZE_BYTES) == "") is is_taken


@pytest.mark.parametrize("kind", ["BMP", "GIF", "TIFF", "PPM"])
def test_other_formats_are_none(kind: str) -> None:
    """Formats without a limit are not tried."""
    assert picture_header(plain_picture(kind)) is None


@pytest.mark.parametrize("scans", [30, 1000])
def test_picture_in_many_scans_is_refused(scans: int) -> None:
    """Each scan goes over all pixels again, and takes a few bytes."""
    jpeg = plain_picture(progressive=True)
    last = jpeg[jpeg.rindex(bytes((0xFF, SOS))) : -2]
    plain, bomb = picture_header(jpeg), picture_header(jpeg[:-2] + last * scans + jpeg[-2:])

    assert plain is not None
    assert bomb is not None
    assert plain.scans < MAX_SCANS
    assert f"in {plain.scans + scans} scans" in bomb.objection(SIZE_BYTES)


def test_png_of_many_bytes_a_pixel_is_refused() -> None:
    """Sixteen bits for each of four colours take as long as eight times as many pixels of one."""
    large = 8000
    png = claiming(plain_picture("PNG"), large)
    plain, deep = picture_header(png), picture_header(png[:24] + bytes((16, 6)) + png[26:])

    assert plain is not None
    assert deep is not None
    assert plain.objection(SIZE_BYTES) == ""
    assert "save it with 8 bits for each colour" in deep.objection(SIZE_BYTES)
