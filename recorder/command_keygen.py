"""`recorder keygen`."""

from __future__ import annotations

from pathlib import Path

import click

from recorder.failures import failures_as_sentences


@click.command(
    epilog="""\b
Examples:
  recorder keygen /etc/recorder/recorder.key

\b
Then, in recorder.yaml:
  evidence: {key: recorder.key}""",
)
@click.argument("file", type=click.Path(path_type=Path))
def keygen(file: Path) -> None:
    """Make an Ed25519 key to sign recordings with: the private key in FILE, the public one in FILE.pub.

    Only its owner may read FILE. Take FILE.pub off the box at once, by a way that you trust: `recorder verify` is given
    it. An existing key is never replaced.
    """
    from flight_file.keys import make_key_files  # noqa: PLC0415 - the other commands do not pay for it

    with failures_as_sentences():
        public = make_key_files(file)
    click.echo(f"private key: {file}")
    click.echo(f"public key:  {public}")
