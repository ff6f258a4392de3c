"""`recorder recover`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from flight_file.errors import FlightFileError
from flight_file.salvage import Outcome, Recovery, recover_segment
from recorder.clock import SystemClock
from recorder.evidence import configured_signer
from recorder.failures import DONE_WITH_LOSS, FAILED, failures_as_sentences
from recorder.settings import EvidenceSettings

_SENTENCES = {
    Outcome.RECOVERED: "{source}: {frames} frames recovered into {path}",
    Outcome.FINISHED: "{source}: was whole, {frames} frames; it is {path} now",
    Outcome.NOTHING_TO_DO: "{source}: is whole, nothing to do",
    Outcome.IN_WORK: "{source}: is being written by a recorder, left alone",
}


@click.command(
    epilog="""\b
Examples:
  recorder recover /var/lib/recorder/*.part
  recorder recover --json damaged.mcap | jq .[0].path

\b
Exit codes: 0 done, 1 a file could not be recovered, 2 wrong usage, 3 done with loss.""",
)
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--key", type=click.Path(path_type=Path), help="Sign what is recovered with this private key.")
@click.option("--json", "as_document", is_flag=True, help="Print a JSON document instead of lines.")
@click.pass_context
def recover(context: click.Context, files: tuple[Path, ...], key: Path | None, *, as_document: bool) -> None:
    """Repair what a power cut left behind: every frame that is whole, byte for byte, in a finished flight file.

    NAME.mcap.part becomes NAME.mcap, unless a recorder is writing it at this moment. A damaged NAME.mcap is kept, and
    what is whole of it goes into NAME.recovered.mcap.
    """
    with failures_as_sentences():
        signer = configured_signer(EvidenceSettings(key=key))
    done: list[dict[str, Any]] = []
    failed = False
    for file in files:
        try:
            recovery = recover_segment(file, at=SystemClock().read(), signer=signer)
        except FlightFileError as error:
            failed = True
            click.echo(f"Error: {error}", err=True)
            continue
        done.append(_as_json(recovery))
        if not as_document:
            click.echo("\n".join(_lines(recovery)))
    if as_document:
        click.echo(json.dumps(done, indent=2))
    with_loss = any(entry["losses"] for entry in done)
    context.exit(FAILED if failed else DONE_WITH_LOSS if with_loss else 0)


def _lines(recovery: Recovery) -> list[str]:
    sentence = _SENTENCES[recovery.outcome].format(
        source=recovery.source.name, path=recovery.path.name, frames=recovery.frames
    )
    return [sentence, *(f"  lost: {loss.reason} (byte {loss.offset})" for loss in recovery.losses)]


def _as_json(recovery: Recovery) -> dict[str, Any]:
    return {
        "source": str(recovery.source),
        "path": str(recovery.path),
        "outcome": recovery.outcome.value,
        "frames": recovery.frames,
        "losses": [
            {"offset": loss.offset, "length_bytes": loss.length, "kind": loss.kind.value, "reason": loss.reason}
            for loss in recovery.losses
        ],
    }
