"""From addresses to flights: the segments of one recording belong together, and every flight has its own name."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from decoder.errors import FleetError
from decoder.fleet.addresses import join, leaf, parent
from flight_file.segments import parse_segment_name

RESERVED = ("index.csv", "index.parquet", ".inputs")


@dataclass(frozen=True, slots=True)
class Found:
    """A flight file, and the folder that names of flights are counted from."""

    address: str
    root: str


@dataclass(frozen=True, slots=True)
class FleetFlight:
    """One flight of a fleet.

    Attributes
    ----------
    name
        Where its results go below the output: its folder below the root, and its recording.
    addresses
        Of its files, sorted.
    """

    name: str
    addresses: tuple[str, ...]


def grouped(files: Iterable[Found]) -> list[FleetFlight]:
    """The flights that files belong to, sorted by name; a file that is named twice counts once.

    Raises
    ------
    FleetError
        If two flights would have one name, or the results of one lie within another's.
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
        named[flight.name] = flight
    _refuse_nested(named)
    return sorted(named.values(), key=lambda flight: flight.name)


def _recording(name: str) -> str:
    segment = parse_segment_name(Path(name))
    return segment[0] if segment is not None else name.removesuffix(".part").removesuffix(".mcap")


def _name(folder: str, root: str, recording: str) -> str:
    root = root.rstrip("/")
    if folder != root and not folder.startswith(root + "/"):
        raise FleetError(f"{join(folder, recording)}: is not below --root {root}; leave out one of them")
    name = join(folder[len(root) + 1 :], recording).lstrip("/")
    if name in RESERVED:
        raise FleetError(f"{join(folder, recording)}: its results would be called {name}, which is taken; rename it")
    return name


def _refuse_twice(flight: FleetFlight, named: dict[str, FleetFlight]) -> None:
    other = named.get(flight.name)
    if other is not None:
        raise FleetError(
            f"{other.addresses[0]} and {flight.addresses[0]} would both be called {flight.name}; "
            "name the folder above both with --root"
        )


def _refuse_nested(named: dict[str, FleetFlight]) -> None:
    for name in named:
        above = parent(name)
        while above:
            if above in named:
                raise FleetError(
                    f"the results of {name} would lie within those of {above}; decode them into two folders (-o)"
                )
            above = parent(above)
