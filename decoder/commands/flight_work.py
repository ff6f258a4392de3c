"""The work of `decode FLIGHT` on an open flight: decode, write, and report."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from decoder.instruments.frame_batch import read_here
from decoder.outputs.csv_output import summary_table
from decoder.outputs.json_output import Provenance
from decoder.outputs.outputs import JOURNAL_SUFFIX, Decoded, Write, output_name, write_all
from decoder.outputs.report_truth import truth_section
from decoder.outputs.thresholds import MOST_LISTED
from decoder.panel.errors import DecoderError, FlightUnreadable
from decoder.panel.vocabulary import TruthRequest
from decoder.parallel.decode_journal import DecodeJournal, identity_of
from decoder.parallel.decoding import decoded_flight
from decoder.parallel.worker_pool import Death, WorkerPool
from decoder.timeseries.cross_checks import cross_checks
from decoder.timeseries.flight_data import FlightData
from decoder.timeseries.flight_part import FlightPart
from decoder.timeseries.health import health_line
from decoder.timeseries.outliers import find_outliers
from decoder.timeseries.truth_comparison import read_truth
from flight_file.errors import FlightFileError
from flight_file.reader import Flight
from flight_file.untrusted import say


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
    columns: Mapping[str, Mapping[str, Any]],
) -> bool:
    """Decode a flight, write its files and report; return whether anything was lost.

    An unreadable truth is reported before decoding.
    """
    known = None if truth is None else read_truth(truth)
    pool = WorkerPool(jobs) if jobs > 1 else None
    journal = DecodeJournal(
        directory / f"{output_name(flight)}{JOURNAL_SUFFIX}",
        partial(identity_of, flight, part),
        resume=resume,
        tell=_tell,
    )
    with _kept(journal):
        with pool or nullcontext():
            read = journal.around(read_here if pool is None else pool.read)
            decoded = decoded_flight(flight, panel_file, method, camera_file, read=read, part=part, columns=columns)
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
    """If decoding is interrupted, say what is kept."""
    try:
        yield
    except FlightUnreadable:
        journal.remove()
        raise
    except (KeyboardInterrupt, DecoderError, FlightFileError):
        if journal.frames:
            _tell(f"{journal.path} keeps {journal.frames} frames; --resume continues from there")
        raise


def _tell(sentence: str) -> None:
    say(f"decode: {sentence}", err=True)


def _report(data: FlightData, provenance: Provenance, deaths: Sequence[Death], written: list[Path]) -> None:
    say(f"{len(data.frame)} frames, {data.time_s[-1] - data.time_s[0]:.2f} s", "")
    say(*summary_table(data).split("\n"))
    say("", *(f"{gauge}: {health_line(findings)}" for gauge, findings in data.health.items()))
    for check in cross_checks(data):
        say(f"cross-check: {check.words}")
    if data.gps is not None:
        located = f"{int(data.gps.located.sum())} of {len(data.frame)} frames have a position"
        say(f"GPS: {located}; the receiver had no fix in {data.gps.without_fix} of {data.gps.samples} samples")
    for missing in data.missing_frames[:MOST_LISTED]:
        say(f"frame {missing.frame} missing: {missing.reason}", err=True)
    if len(data.missing_frames) > MOST_LISTED:
        say(f"... and {len(data.missing_frames) - MOST_LISTED} more; all are in the JSON file", err=True)
    for outlier in find_outliers(data)[:MOST_LISTED]:
        say(f"{outlier.needle} at frame {data.frame[outlier.first]}: {outlier.reason}", err=True)
    for warning in data.warnings:
        say(f"warning: {warning}", err=True)
    for death in deaths[:MOST_LISTED]:
        say(f"warning: {death}; its frames were read again", err=True)
    if len(deaths) > MOST_LISTED:
        say(f"... and {len(deaths) - MOST_LISTED} more processes", err=True)
    for loss in provenance.losses:
        say(f"lost: {loss}", err=True)
    say("", *map(str, written))
