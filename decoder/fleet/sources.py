"""What people name as flights: paths, patterns, URLs, and lists of them in a file (`@flights.txt`)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from decoder.errors import FleetError
from decoder.fleet.addresses import fixed_part, is_pattern, is_url, normal, parent
from decoder.fleet.flights import Found
from decoder.fleet.stores import store_of

LIST = "@"
COMMENT = "#"
SUFFIXES = (".mcap", ".mcap.part")


def flight_files(words: Sequence[str], root: str | None = None) -> Iterator[Found]:
    """Every flight file that is meant; whether a file named outright is there is seen when it is decoded.

    Parameters
    ----------
    words
        Addresses, patterns, and `@LIST` for a file with one of either on each line; `#` begins a remark. A relative
        path in a list is taken from the list's folder.
    root
        The folder that flights' names are counted from; by default the fixed part of a pattern, or a file's folder.

    Raises
    ------
    FleetError
        If a list cannot be read, a pattern fits nothing, or a folder is named.
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
        store_of(address)  # a kind that nobody knows is refused before anything is decoded
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
