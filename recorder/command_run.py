"""`recorder run`."""

from __future__ import annotations

import faulthandler
import os
from pathlib import Path

import click

from recorder.config import load_config
from recorder.failures import failures_as_sentences
from recorder.host import this_host
from recorder.run import record
from recorder.service_manager import ServiceManager
from recorder.signals import stop_on_signals
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
        stop_on_signals(stop)
        faulthandler.enable()  # the watchdog's SIGABRT then leaves in the log where each thread hung
        outcome = record(
            config,
            host=this_host(),
            stop=stop,
            configuration=configuration,
            service=ServiceManager.from_environment(os.environ),
        )
    for path in outcome.paths:
        click.echo(path)
