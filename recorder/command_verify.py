"""`recorder verify`."""

from __future__ import annotations

import json
from pathlib import Path

import click

from flight_file.verification import Verdict
from flight_file.verification import verify as verify_files
from recorder.failures import DONE_WITH_LOSS, FAILED, failures_as_sentences
from recorder.verify_text import as_json, as_lines

_EXIT_CODES = {Verdict.FITS: 0, Verdict.LOSS: DONE_WITH_LOSS, Verdict.FAULT: FAILED}
_WORST_FIRST = (Verdict.FAULT, Verdict.LOSS, Verdict.FITS)


@click.command(
    epilog="""\b
Examples:
  recorder verify flights/*.mcap
  recorder verify --public-key recorder.key.pub flights/20180504T120000Z_*.mcap
  recorder verify --json flight.mcap | jq .[0].first_fault

\b
Exit codes: 0 all fits, 1 something does not fit, 2 wrong usage, 3 it fits as far as it goes: something is missing.""",
)
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--public-key", type=click.Path(path_type=Path), help="Every segment must be signed with this key.")
@click.option("--json", "as_document", is_flag=True, help="Print a JSON document instead of lines.")
@click.pass_context
def verify(context: click.Context, files: tuple[Path, ...], public_key: Path | None, *, as_document: bool) -> None:
    """Check that flights are as they were recorded, and name the first frame that does not fit.

    CRCs and digests show damage, the chain shows what was changed, removed, added or reordered, a signature shows who
    recorded it. Without --public-key a signature proves only that somebody signed.
    """
    with failures_as_sentences():
        checks = verify_files(files, public_key=_key(public_key))
    if as_document:
        click.echo(json.dumps([as_json(check) for check in checks], indent=2))
    else:
        click.echo("\n".join(line for check in checks for line in as_lines(check)))
    verdicts = {check.verdict for check in checks}
    context.exit(_EXIT_CODES[next(verdict for verdict in _WORST_FIRST if verdict in verdicts)])


def _key(path: Path | None) -> bytes | None:
    if path is None:
        return None
    from flight_file.keys import load_public_key  # noqa: PLC0415 - without a key nobody pays for it

    return load_public_key(path)
