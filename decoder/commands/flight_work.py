"""What `decode FLIGHT` does once the flight is open: decode, write, and report."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path

import click

from decoder.commands.decoding import decoded_flight
from decoder.decode_identity import identity_of
from decoder.decode_journal import SUFFIX, DecodeJournal
from decoder.errors import DecoderError, FlightUnreadable
from decoder.flight_data import FlightData
from decoder.flight_part import FlightPart
from decoder.formats import Decoded
from decoder.frame_batch import read_here
from decoder.json_output import Provenance
from decoder.outliers import find_outliers
from decoder.output_names import output_name
from decoder.outputs import Write, write_all
from decoder.report.truth_section import truth_section
from decoder.summary import summary_table
from decoder.truth_comparison import read_truth
from decoder.truth_request import TruthRequest
from decoder.worker_pool import Death, WorkerPool
from flight_file.errors import FlightFileError
from flight_file.reader import Flight

MAX_LISTED = 10


def decode_and_write(
    flight: Flight,
    directory: Path,
    files: Mapping[str, Callable[[Decoded], Write]],
    *,
    panel_file: Path | None,
    camera_file: Path | None,
    method: str,
    with_images: bool,
    jobs: int,
    part: FlightPart | None,
    truth: TruthRequest | None,
    resume: bool,
) -> bool:
    """Decodes a flight, writes its files and says what came out; whether anything was lost on the way.

    A truth that cannot be read is told of before anything is decoded.
    """
    known = None if truth is None else read_truth(truth)
    pool = WorkerPool(jobs) if jobs > 1 else None
    journal = DecodeJournal(
        directory / f"{output_name(flight)}{SUFFIX}", partial(identity_of, flight, part), resume=resume, tell=_tell
    )
    with _kept(journal):
        with pool or nullcontext():
            read = journal.around(read_here if pool is None else pool.read)
            decoded = decoded_flight(flight, panel_file, method, camera_file, read=read, part=part)
        decoded = replace(decoded, with_images=with_images)
        if known is not None:
            section = truth_section(decoded.data, decoded.provenance, known)
            decoded = replace(decoded, truth=section, command=f"{decoded.command} {shlex.join(known.request.words)}")
        written = write_all(directory, {file: writer(decoded) for file, writer in files.items()})
    journal.remove()
    _report(decoded.data, decoded.provenance, pool.deaths if pool is not None else [], written)
    return bool(decoded.provenance.losses or (pool is not None and pool.left_out))


@contextmanager
def _kept(journal: DecodeJournal) -> Iterator[None]:
    """Says, where a decode is broken off, what is kept of it."""
    try:
        yield
    except FlightUnreadable:
        journal.remove()
        raise
    except (KeyboardInterrupt, DecoderError, FlightFileError):
        if journal.frames:
            _tell(f"{journal.path} keeps {journal.frames} frames; --resume goes on from there")
        raise


def _tell(sentence: str) -> None:
    click.echo(f"decode: {sentence}", err=True)


def _report(data: FlightData, provenance: Provenance, deaths: Sequence[Death], written: list[Path]) -> None:
    click.echo(f"{len(data.frame)} frames, {data.time_s[-1] - data.time_s[0]:.2f} s\n")
    click.echo(summary_table(data))
    for missing in data.missing_frames[:MAX_LISTED]:
        click.echo(f"frame {missing.frame} missing: {missing.reason}", err=True)
    if len(data.missing_frames) > MAX_LISTED:
        click.echo(f"... and {len(data.missing_frames) - MAX_LISTED} more; all are in the JSON file", err=True)
    for outlier in find_outliers(data)[:MAX_LISTED]:
        click.echo(f"{outlier.needle} at frame {data.frame[outlier.first]}: {outlier.reason}", err=True)
    for warning in data.warnings:
        click.echo(f"warning: {warning}", err=True)
    for death in deaths[:MAX_LISTED]:
        click.echo(f"warning: {death}; its frames were read again", err=True)
    if len(deaths) > MAX_LISTED:
        click.echo(f"... and {len(deaths) - MAX_LISTED} more processes", err=True)
    for loss in provenance.losses:
        click.echo(f"lost: {loss}", err=True)
    click.echo("\n" + "\n".join(str(path) for path in written))
