"""What strangers' files say: names that stay in their folder, lines that do nothing, cells that compute nothing."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from flight_file.thresholds import MAX_NAME_BYTES
from flight_file.untrusted import (
    encodable,
    file_name,
    file_names,
    from_cell,
    name_key,
    printable,
    read_beside,
    read_named_in,
    shown,
    to_cell,
)

any_text = st.text(st.characters(exclude_categories=()))  # surrogates too
DEVICES = re.compile(r"(?i)(con|prn|aux|nul|com\d|lpt\d)(\..*)?")

PLAIN = ["flight", "thesis_a1", "20180504T120000Z-2", "Flug von Zürich (2)", "飛行", "a.b", "_x", "console", "=1+1"]
HOSTILE = [
    "../victim", "/etc/passwd", "..", ".", "", "-rf", ".hidden", "a/b", "a\\b", "a\0b", "a\nb", "\x1b[2Jx", "\u202egpj",
    "CON", "con.txt", "LPT1 .x", "nul", "name.", "name ", " name", "a:b", "what?", "\udcff", "x" * 5000, "é" * 5000,
    "/-rf", "/.x", "C:\\x", "~/\x7f",
]  # fmt: skip


@given(text=any_text)
@example(text="CON")
def test_name_stays_in_its_folder(text: str) -> None:
    """Any text becomes one name that every file system takes, and a second time nothing changes."""
    name = file_name(text)

    assert name == os.path.basename(name)  # noqa: PTH119 - text that is no path
    assert name.isprintable()
    assert not set(name) & set('/\\:*?"<>|')
    assert name[0] not in " .-"
    assert name[-1] not in " ."
    assert not DEVICES.fullmatch(name)
    assert 0 < len(name.encode()) <= MAX_NAME_BYTES
    assert file_name(name) == name


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_name_is_changed_and_marked(text: str, tmp_path: Path) -> None:
    """What had to be changed can be told apart by eight digits, and can be created; a plain name stays as it is."""
    assert list(map(file_name, PLAIN)) == PLAIN
    name = file_name(text)
    (tmp_path / name).touch()

    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert not text or re.search(r"-[0-9a-f]{8}$", name)
    assert len({file_name(each) for each in [*PLAIN, *HOSTILE]}) == len([*PLAIN, *HOSTILE]) - 1  # "" is a flight, too


@given(texts=st.lists(any_text | st.sampled_from(["N1", "n1", "a/b", "a:b", "a_b"]), unique=True, max_size=8))
def test_names_given_together_are_distinct(texts: list[str]) -> None:
    """No two texts share a name, not even on a disk that does not tell capitals."""
    names = file_names(texts)

    assert list(names) == texts
    assert len({name_key(name) for name in names.values()}) == len(texts)


@given(text=any_text)
def test_printed_text_moves_nothing(text: str) -> None:
    """What is printed has no control character, no line break and no half of a surrogate; plain text is kept."""
    shown = printable(text)

    assert shown.isprintable()
    assert printable(shown.encode().decode()) == shown
    assert printable("\x1b[31mred\n\u202e\udcff\U000e0001") == "\\x1b[31mred\\x0a\\u202e\\udcff\\U000e0001"


@given(text=any_text, repeated=st.sampled_from((1, 1, 100)))
def test_shown_text_is_one_short_line(text: str, repeated: int) -> None:
    """A stranger's text within a sentence is printable and short; a short plain one stays as it is."""
    said = shown(text * repeated, most=20)

    assert said.isprintable()
    assert len(said) <= 20 + len("...")
    assert said == text or text * repeated != text or not text.isprintable() or len(text) > 20
    assert shown("two\nlines") == "two\\x0alines"
    assert shown("a" * 500_000) == "a" * 120 + "..."


@given(text=any_text)
def test_encodable_text_has_bytes(text: str) -> None:
    """Only what UTF-8 cannot encode is escaped."""
    assert encodable(text).encode().decode() == encodable(encodable(text))
    assert encodable("line\n\udcff ü") == "line\n\\udcff ü"


@given(text=st.text() | st.sampled_from(["=cmd()", "'=x", "''-1", "-3", "@a", "+1", "\tx", "'"]))
def test_cell_is_no_formula_and_comes_back(text: str) -> None:
    """No cell begins as a formula does; read again it is the text that it was."""
    assert to_cell(text)[:1] not in {*"=+-@\t\r"} - {""}
    assert from_cell(to_cell(text)) == text


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A panel's folder, with a picture in it and a secret beside it."""
    made = tmp_path / "panel"
    (made / "below").mkdir(parents=True)
    (made / "panel.jpg").write_bytes(b"picture")
    (made / "below" / "fr.png").write_bytes(b"needle")
    (made / "own.jpg").symlink_to("panel.jpg")
    (tmp_path / "secret").write_bytes(b"secret")
    (made / "out.jpg").symlink_to(tmp_path / "secret")
    (made / "zero").symlink_to("/dev/zero")
    (made / "loop").symlink_to("loop")
    os.mkfifo(made / "fifo")
    with (made / "large").open("wb") as stream:
        stream.truncate(1 << 30)
    return made


@pytest.mark.parametrize(
    ("name", "content"), [("panel.jpg", b"picture"), ("./panel.jpg", b"picture"), ("below/fr.png", b"needle"),
                          ("own.jpg", b"picture")]
)  # fmt: skip
def test_file_in_the_folder_is_read(folder: Path, name: str, content: bytes) -> None:
    """Files in the folder or below are read, through links that stay in it too."""
    assert read_beside(folder, name) == content


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("../secret", "same folder"), ("/dev/zero", "same folder"), ("below/../../secret", "same folder"),
        ("..", "same folder"), (".", "same folder"), ("", "same folder"), ("a\0b", "same folder"),
        ("a\nb", "same folder"), ("\udcff", "same folder"), ("..\\secret", "same folder"),
        ("out.jpg", "link out"), ("zero", "link out"), ("fifo", "regular file"), ("below", "directory"),
        ("large", "60 MiB"), ("loop", "symbolic links"), ("none.jpg", "No such file"), ("x" * 5000, "too long"),
    ],
)  # fmt: skip
def test_anything_else_is_refused_without_waiting(folder: Path, name: str, words: str) -> None:
    """Links and paths out of the folder, pipes, devices, folders and huge files are not opened, or not read."""
    with pytest.raises(OSError, match=words) as refused:
        read_beside(folder, name)

    assert refused.value.strerror


@pytest.mark.parametrize("links", [("panel.yaml",), ("panel.yaml", "panel.jpg")])
def test_file_beside_what_a_link_leads_to_is_read(folder: Path, tmp_path: Path, links: tuple[str, ...]) -> None:
    """A panel that is linked into a flight's folder brings its pictures along, linked there too or not."""
    (folder / "panel.yaml").write_bytes(b"panel")
    (tmp_path / "flight").mkdir()
    for name in links:
        (tmp_path / "flight" / name).symlink_to(folder / name)

    assert read_named_in(tmp_path / "flight" / "panel.yaml", "panel.jpg") == b"picture"
    assert read_named_in(tmp_path / "flight" / "panel.yaml", "below/fr.png") == b"needle"


def test_picture_beside_a_link_comes_first_and_may_not_lead_elsewhere(folder: Path, tmp_path: Path) -> None:
    """What lies beside the link is what is meant; a link out of both folders is refused, not passed over."""
    (folder / "panel.yaml").write_bytes(b"panel")
    flight = tmp_path / "flight"
    flight.mkdir()
    (flight / "panel.yaml").symlink_to(folder / "panel.yaml")
    (flight / "panel.jpg").write_bytes(b"nearer")
    assert read_named_in(flight / "panel.yaml", "panel.jpg") == b"nearer"
    (flight / "panel.jpg").unlink()
    (flight / "panel.jpg").symlink_to(tmp_path / "secret")

    for name in ("panel.jpg", "out.jpg", "../secret"):
        with pytest.raises(PermissionError):
            read_named_in(flight / "panel.yaml", name)
