"""Which flights are meant: paths, patterns, lists; segments together, each flight with a name of its own."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.panel.errors import FleetError
from decoder.parallel.flights import FleetFlight, Found, flight_files, grouped

Folder = Callable[..., Path]


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    """Makes empty files."""

    def make(*names: str) -> Path:
        for name in names:
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).touch()
        return tmp_path

    return make


def named(*words: object, root: Path | None = None) -> dict[str, list[str]]:
    """The names of files by the name of their flight."""
    flights = grouped(flight_files([str(word) for word in words], None if root is None else str(root)))
    return {flight.name: [address.rpartition("/")[2] for address in flight.addresses] for flight in flights}


def test_segments_of_one_recording_are_one_flight(folder: Folder) -> None:
    """They are grouped by folder and name, finished or not; other files are flights by themselves."""
    place = folder("a/rec_0000.mcap", "a/rec_0001.mcap", "a/rec_0002.mcap.part", "b/rec_0000.mcap", "b/flight.mcap")

    assert named(f"{place}/*/*.mcap*") == {
        "a/rec": ["rec_0000.mcap", "rec_0001.mcap", "rec_0002.mcap.part"],
        "b/flight": ["flight.mcap"],
        "b/rec": ["rec_0000.mcap"],
    }


def test_patterns_take_flight_files_only(folder: Folder) -> None:
    """Signatures, notes and folders are passed over; `**` goes down; a file that is there is meant as it is written."""
    place = folder("x/y/f.mcap", "x/y/f.mcap.sig", "x/notes.txt", "g.mcap", "flight[1].mcap")

    assert list(named(f"{place}/**/*")) == ["flight[1]", "g", "x/y/f"]
    assert list(named(place / "flight[1].mcap")) == ["flight[1]"]


def test_lists_name_what_is_beside_them(folder: Folder) -> None:
    """Relative lines are taken from the list's folder; blanks, remarks and a file named twice do no harm."""
    place = folder("lists/f.mcap", "lists/deep/g_0000.mcap", "h.mcap")
    text = f"# all of May\n\nf.mcap\n deep/*.mcap \n{place}/h.mcap\n./f.mcap\n"
    (place / "lists" / "may.txt").write_text(text)

    assert named(f"@{place}/lists/may.txt") == {"f": ["f.mcap"], "g": ["g_0000.mcap"], "h": ["h.mcap"]}


def test_root_names_flights_by_their_place(folder: Folder) -> None:
    """Flights of one name in two folders need a folder above both to be told apart."""
    place = folder("a/f.mcap", "b/f.mcap")
    files = [place / "a" / "f.mcap", place / "b" / "f.mcap"]

    assert list(named(*files, root=place)) == ["a/f", "b/f"]
    with pytest.raises(FleetError, match=r"a/f\.mcap and .*b/f\.mcap would both be called f; .*--root"):
        named(*files)
    with pytest.raises(FleetError, match="is not below --root"):
        named(*files, root=place / "a")


def test_results_never_lie_within_others(folder: Folder) -> None:
    """A flight beside a folder of its own name, and one called as the index, are refused."""
    place = folder("a.mcap", "a/b/c.mcap", "index.csv.mcap")

    with pytest.raises(FleetError, match="results of a/b/c would lie within those of a"):
        named(place / "a.mcap", f"{place}/**/c.mcap")
    with pytest.raises(FleetError, match=r"called index\.csv"):
        named(place / "index.csv.mcap")


NAMES = st.text("ab_0.", min_size=1, max_size=6)


@given(st.lists(st.tuples(st.sampled_from(["/r", "/r/a", "/r/b", "/r/a/c"]), NAMES), max_size=12))
def test_every_file_is_in_one_flight(files: list[tuple[str, str]]) -> None:
    """Whatever files are called: each is in exactly one flight of a name of its own, or all are refused."""
    addresses = [f"{folder}/{name}.mcap" for folder, name in files]
    try:
        flights: list[FleetFlight] = grouped(Found(address, "/r") for address in addresses)
    except FleetError:
        return
    assert sorted(address for flight in flights for address in flight.addresses) == sorted(set(addresses))
    assert len({flight.name for flight in flights}) == len(flights)


@pytest.mark.parametrize(
    ("word", "told"),
    [
        ("{}/*.bag", "*.bag: no flight file (.mcap) fits it"),
        ("{}", ": is a folder; name the flights in it: '"),
        ("@{}/none.txt", "none.txt: there is no such list"),
        ("@{}/empty.txt", "empty.txt: names no flight"),
        ("@{}/picture.txt", "picture.txt: is no list of flights"),
        ("@{}/nested.txt", "nested.txt: line 2: a list cannot name another one"),
        ("@{}/lines.txt", "lines.txt: line 1: no*.mcap: no flight file (.mcap) fits it"),
        ("pigeon://loft/f.mcap", "pigeon://loft/f.mcap: Protocol not known: pigeon"),
    ],
)
def test_what_is_not_meant_is_told(folder: Folder, word: str, told: str) -> None:
    """One sentence each, with the list's line."""
    place = folder("flight.mcap", "empty.txt")
    (place / "picture.txt").write_bytes(b"\xff\xd8\xff\xe0")
    (place / "nested.txt").write_text("flight.mcap\n@other.txt\n")
    (place / "lines.txt").write_text("no*.mcap\n")
    with pytest.raises(FleetError) as raised:
        named(word.format(place))

    assert told in str(raised.value)
    assert len(str(raised.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("module", "words", "told"),
    [
        ("fsspec", ["s3://flights/f.mcap", "-o", "out"], "s3://flights/f.mcap: needs fsspec: pip install 'image-fl"),
        ("s3fs", ["s3://flights/f.mcap", "-o", "out"], "s3://flights/f.mcap: Install s3fs"),
        ("distributed", ["f.mcap", "-o", "out", "--scheduler", "tcp://h:1"], "--scheduler needs dask.distributed: pip"),
    ],
)
def test_missing_extra_is_told(folder: Folder, module: str, words: list[str], told: str) -> None:
    """Without the extra [cluster] URLs and clusters are refused with what to install."""
    program = f"import sys; sys.modules[{module!r}] = None; from decoder.commands.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", program, "fleet", *words],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder("f.mcap"),
    )

    assert done.returncode == 1
    assert done.stderr.startswith(f"decode: {told}"), done.stderr
    assert len(done.stderr.splitlines()) == 1
