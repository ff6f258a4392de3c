"""What a worker does: one flight, from its files in some store to its results in another, in one process."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from socket import gethostname

from threadpoolctl import threadpool_limits

from decoder.commands.decoding import decoded_flight
from decoder.errors import DecoderError, OutputError
from decoder.fleet.addresses import join, parent
from decoder.fleet.finished import Finished, from_marker, to_marker
from decoder.fleet.flights import FleetFlight
from decoder.fleet.order import Order
from decoder.fleet.outcome import JOINED, Outcome, State, decoded_outcome, failed
from decoder.fleet.staging import working_folder
from decoder.fleet.store import MARKER
from decoder.fleet.stores import store_of
from decoder.fleet.versions import installed, refuse_mismatch
from decoder.formats import Decoded, planned_files
from decoder.output_names import output_name
from decoder.outputs import write_all
from flight_file.errors import FlightFileError
from flight_file.reader import Flight, open_flight


def decode_one(flight: FleetFlight, order: Order) -> Outcome:
    """Decodes a flight, unless its results are there already; what can be expected to fail is told in the outcome.

    Raises
    ------
    VersionMismatch
        If this process would not decode as the one that asks.
    """
    refuse_mismatch(order.versions, installed(order.formats), f"the worker on {gethostname()}")
    threadpool_limits(1)  # for good: two flights in threads of one process would set each other's limit back
    begun = time.monotonic()
    try:
        return _ensured(flight, order, begun)
    except (DecoderError, FlightFileError) as error:
        return replace(failed(flight, str(error)), seconds=_since(begun))
    except OSError as error:
        return replace(failed(flight, f"{type(error).__name__}: {error}"), seconds=_since(begun))


def _ensured(flight: FleetFlight, order: Order, begun: float) -> Outcome:
    folder = join(order.output, flight.name)
    output, source = store_of(folder), store_of(flight.addresses[0])
    stamps = tuple(map(source.stamp, flight.addresses))
    earlier = from_marker(output.read(join(folder, MARKER)))
    if earlier is not None and earlier.still_holds(order.key, stamps):
        return replace(earlier.outcome, status=State.KEPT)
    known = [] if earlier is None else earlier.files
    _refuse_strangers(folder, output.strangers(folder, known), flight)
    with _staging(flight) as staged:
        opened = open_flight(source.fetch(flight.addresses, staged))
        if earlier is not None and earlier.may_hold(order.key, stamps) and _digests(opened) == earlier.outcome.sha256:
            _mark_again(replace(earlier, stamps=stamps), folder)
            return replace(earlier.outcome, status=State.KEPT)
        decoded = _decoded(opened, order, staged)
        with output.results(folder, known) as working:
            outputs = _write(decoded, order.formats, working)
            outcome = replace(
                decoded_outcome(flight, decoded, outputs),
                size_bytes=sum(stamp.size_bytes for stamp in stamps),
                seconds=_since(begun),
            )
            _mark(Finished(order.key, stamps, outcome), working)
    return outcome


def _decoded(opened: Flight, order: Order, staged: Path) -> Decoded:
    panel, camera = (
        None if given is None else given.fetched(staged / kind)
        for given, kind in ((order.panel, "panel"), (order.camera, "camera"))
    )
    decoded = decoded_flight(opened, panel, order.method, camera, shown=iter)
    return replace(decoded, with_images=order.with_images)


def _write(decoded: Decoded, formats: Sequence[str], working: Path) -> list[str]:
    files = planned_files(output_name(decoded.flight), formats)
    write_all(working, {name: writer(decoded) for name, writer in files.items()})
    return sorted(files)


@contextmanager
def _staging(flight: FleetFlight) -> Iterator[Path]:
    """A temporary folder; what fails in it is told by the flight's address."""
    with working_folder() as folder:
        try:
            yield folder
        except (DecoderError, FlightFileError) as error:
            told = str(error).replace(str(folder), parent(flight.addresses[0]))
            raise DecoderError(told) from error


def _refuse_strangers(folder: str, strangers: list[str], flight: FleetFlight) -> None:
    if strangers:
        raise OutputError(
            f"{folder}: holds {strangers[0]}, which is no result of {flight.name}; "
            "move it away or choose another folder with -o"
        )


def _digests(opened: Flight) -> str:
    return JOINED.join(opened.sha256_of_files().values())


def _mark(finished: Finished, folder: Path) -> Path:
    marker = folder / MARKER
    marker.write_text(to_marker(finished), encoding="utf-8")
    return marker


def _mark_again(finished: Finished, folder: str) -> None:
    with working_folder() as working:
        store_of(folder).put(_mark(finished, working), join(folder, MARKER))


def _since(begun: float) -> float:
    return round(time.monotonic() - begun, 3)
