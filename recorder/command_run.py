"""`recorder run`."""

from __future__ import annotations

import signal
from pathlib import Path

import click

from recorder.config import load_config
from recorder.failures import failures_as_sentences
from recorder.host import this_host
from recorder.run import record
from recorder.stop import Stop


@click.command(
    epilog="""\b
Examples:
  recorder run --config /etc/recorder/recorder.yaml
  recorder run --config replay.yaml && decode flights/*.mcap

\b
A minimal replay.yaml:
  camera: {driver: replay, path: pictures/, rate_hz: 4, pace: fastest}
  storage: {directory: flights/}""",
)
@click.option(
    "--config",
    "config_path",
    type=click.Path(path_type=Path),
    required=True,
    help="The recorder.yaml to follow; paths in it are relative to it.",
)
def run(config_path: Path) -> None:
    """Record in the foreground, until SIGTERM or Ctrl-C, or until a replay has no more pictures.

    The finished segments are listed on stdout; the log goes to stderr as JSON lines.
    """
    with failures_as_sentences():
        config, configuration = load_config(config_path)
        stop = Stop()
        _stop_on_signals(stop)
        outcome = record(config, host=this_host(), stop=stop, configuration=configuration)
    for path in outcome.paths:
        click.echo(path)


def _stop_on_signals(stop: Stop) -> None:
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda number, _frame: stop.request(f"stopped by {signal.Signals(number).name}"))
    # A terminal that goes away must not end a recording.
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
