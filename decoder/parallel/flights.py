"""Flights that people name, by path, pattern, URL or list; the segments of one recording belong together."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from decoder.panel.errors import FleetError
from decoder.parallel.store import fixed_part, is_pattern, is_url, join, leaf, normal, parent
from decoder.parallel.stores import store_of
from flight_file.session import parse_segment_name
from flight_file.untrusted import file_name, name_key

RESERVED = ("index.csv", "index.parquet", ".inputs")

LIST = "@"
COMMENT = "#"
SUFFIXES = (".mcap", ".mcap.part")


@dataclass(frozen=True, slots=True)
class Found:
    """A flight file, and the folder that flights' names are relative to."""

    address: str
    root: str


@dataclass(frozen=True, slots=True)
class FleetFlight:
    """One flight of a fleet.

    Attributes
    ----------
    name
        Where its results go below the output: its folder below the root, and its recording, each a `file_name`.
    addresses
        Of its files, sorted.
    """

    name: str
    addresses: tuple[str, ...]


def grouped(files: Iterable[Found]) -> list[FleetFlight]:
    """Group files into flights, sorted by name; a file that is named twice counts once.

    Raises
    ------
    FleetError
        If two flights would have one name, or the results of one would lie within another's.
    """
    flights: dict[tuple[str, str], list[str]] = {}
    roots: dict[str, str] = {}
    for file in files:
        if file.address not in roots:
            roots[file.address] = file.root
            flights.setdefault((parent(file.address), _recording(leaf(file.address))), []).append(file.address)
    named: dict[str, FleetFlight] = {}
    for (folder, recording), addresses in flights.items():
        flight = FleetFlight(_name(folder, roots[addresses[0]], recording), tuple(sorted(addresses)))
        _refuse_twice(flight, named)
        named[name_key(flight.name)] = flight
    _refuse_nested(named)
    return sorted(named.values(), key=lambda flight: flight.name)


def _recording(name: str) -> str:
    segment = parse_segment_name(Path(name))
    return segment[0] if segment is not None else name.removesuffix(".part").removesuffix(".mcap") or name


def _name(folder: str, root: str, recording: str) -> str:
    root = root.rstrip("/")
    if folder != root and not folder.startswith(root + "/"):
        raise FleetError(f"{join(folder, recording)}: is not below --root {root}; leave out one of them")
    parts = [*folder[len(root) + 1 :].split("/"), recording]
    name = "/".join(file_name(part) for part in parts if part)
    if name_key(name) in RESERVED:
        raise FleetError(f"{join(folder, recording)}: its results would be called {name}, which is taken; rename it")
    return name


def _refuse_twice(flight: FleetFlight, named: dict[str, FleetFlight]) -> None:
    other = named.get(name_key(flight.name))
    if other is not None:
        raise FleetError(
            f"{other.addresses[0]} and {flight.addresses[0]} would both be called {flight.name}; "
            "name the folder above both with --root"
        )


def _refuse_nested(named: dict[str, FleetFlight]) -> None:
    for key, flight in named.items():
        above = parent(key)
        while above:
            if above in named:
                raise FleetError(
                    f"the results of {flight.name} would lie within those of {named[above].name}; "
                    "decode them into two folders (-o)"
                )
            above = parent(above)


def flight_files(words: Sequence[str], root: str | None = None) -> Iterator[Found]:
    """Yield every flight file that is meant; a file named explicitly may turn out missing when it is decoded.

    Parameters
    ----------
    words
        Addresses, patterns, and `@LIST` for a file with one of either on each line; `#` begins a comment. A relative
        path in a list is relative to the list's folder.
    root
        The folder that flights' names are relative to; by default the fixed part of a pattern, or a file's folder.

    Raises
    ------
    FleetError
        If a list cannot be read, a pattern matches nothing, or a folder is named.
    """
    fixed = None if root is None else normal(root)
    for word in words:
        if not word.startswith(LIST):
            yield from _meant(word, normal(word), fixed)
            continue
        address = normal(word.removeprefix(LIST))
        for number, line in _lines(address):
            if line.startswith(LIST):
                raise FleetError(f"{address}: line {number}: a list cannot name another one")
            yield from _meant(f"{address}: line {number}: {line}", normal(line, parent(address)), fixed)


def _meant(words: str, address: str, root: str | None) -> Iterator[Found]:
    if is_url(address):
        store_of(address)  # so that an unknown kind is refused before anything is decoded
        plain = not is_pattern(address)
    elif Path(address).is_dir():
        raise FleetError(f"{words}: is a folder; name the flights in it: '{words}/*.mcap'")
    else:
        plain = not is_pattern(address) or Path(address).exists()
    if plain:
        yield Found(address, root or parent(address))
        return
    found = [each for each in store_of(address).found(address) if each.endswith(SUFFIXES)]
    if not found:
        raise FleetError(f"{words}: no flight file (.mcap) fits it; check the pattern")
    for each in found:
        yield Found(each, root or fixed_part(address))


def _lines(address: str) -> Iterator[tuple[int, str]]:
    content = store_of(address).read(address)
    if content is None:
        raise FleetError(f"{address}: there is no such list; check the name")
    try:
        lines = content.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise FleetError(f"{address}: is no list of flights: not UTF-8 text; write one address on each line") from error
    named = [(number, line.strip()) for number, line in enumerate(lines, 1)]
    named = [(number, line) for number, line in named if line and not line.startswith(COMMENT)]
    if not named:
        raise FleetError(f"{address}: names no flight; write one address on each line")
    yield from named
