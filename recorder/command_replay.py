"""`recorder replay`."""

from __future__ import annotations

from pathlib import Path

import click

from recorder.failures import DONE_WITH_LOSS, failures_as_sentences
from recorder.host import this_host
from recorder.replaying import replay_into
from recorder.settings import AttachSettings
from recorder.signals import stop_on_signals
from recorder.stop import Stop


@click.command(
    epilog="""\b
Examples:
  recorder replay photographs -o flight.mcap
  recorder replay photographs -o flight.mcap --rate 0.5 --panel panel.yaml
  recorder replay flights/20180504T120000Z_*.mcap -o flight.mcap --panel panel.yaml

\b
Exit codes: 0 done, 1 failed, 2 wrong usage, 3 something is lost of the flights that were replayed.""",
)
@click.argument("sources", metavar="SOURCE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "-o", "--output", "target", type=click.Path(path_type=Path), required=True, metavar="FLIGHT",
    help="The flight file to make; what is there already is never replaced.",
)  # fmt: skip
@click.option(
    "--rate", "rate_hz", type=click.FloatRange(0, 1000, min_open=True), metavar="HZ",
    help="Pictures a second, for photographs whose EXIF times are missing or too coarse.",
)  # fmt: skip
@click.option("--panel", type=click.Path(path_type=Path), help="A panel.yaml to put in, with the pictures it names.")
@click.option("--camera", type=click.Path(path_type=Path), help="A camera.yaml to put in.")
@click.pass_context
def replay(
    context: click.Context,
    *,
    sources: tuple[Path, ...],
    target: Path,
    rate_hz: float | None,
    panel: Path | None,
    camera: Path | None,
) -> None:
    """Make one flight file of a folder of photographs, or of earlier flight files.

    SOURCE is a folder whose JPEGs are taken in the order of their names, each at its EXIF time, or the segments of a
    recording. The pictures go in byte for byte.
    """
    with failures_as_sentences():
        attach = AttachSettings(panel=panel, camera=camera)
        stop = Stop()
        stop_on_signals(stop)
        replayed = replay_into(target, sources, rate_hz=rate_hz, attach=attach, host=this_host(), stop=stop)
    click.echo(f"{target}: {replayed.stored} pictures")
    for loss in replayed.losses:
        click.echo(f"  lost: {loss.reason}", err=True)
    context.exit(DONE_WITH_LOSS if replayed.losses else 0)
