"""`recorder mark`."""

from __future__ import annotations

from pathlib import Path

import click

from recorder.clock import SystemClock
from recorder.failures import failures_as_sentences
from recorder.marks import mark as mark_newest


@click.command(
    epilog="""\b
Examples:
  recorder mark --config /etc/recorder/recorder.yaml "bird strike"
  recorder mark --directory /var/lib/recorder""",
)
@click.option("--directory", type=click.Path(path_type=Path), help="Where the recordings lie.")
@click.option(
    "--config", "config_path", type=click.Path(path_type=Path), help="The recorder.yaml that says where they lie."
)
@click.argument("note", default="")
def mark(directory: Path | None, config_path: Path | None, note: str) -> None:
    """Keep what was just recorded: the segment in work or the newest, and the one before.

    The recorder never deletes a marked segment. NOTE says why it was marked. To unmark, delete the file NAME.mcap.keep.
    """
    if (directory is None) == (config_path is None):
        raise click.UsageError("Give either --directory or --config.")
    with failures_as_sentences():
        where = directory if directory is not None else _configured(config_path)
        for path in mark_newest(where, note=note, realtime_ns=SystemClock().read().realtime_ns):
            click.echo(f"{path.name} will be kept")


def _configured(config_path: Path | None) -> Path:
    # Reading a configuration takes longer than everything else here; with --directory nobody waits for it.
    from recorder.config import load_config  # noqa: PLC0415

    if config_path is None:
        raise TypeError(config_path)
    return load_config(config_path)[0].storage.directory
