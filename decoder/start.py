"""Where `decode` starts: ready for Ctrl-C before anything that takes time is imported."""

from __future__ import annotations

import os

from decoder.parallel.processes import ONE_EACH, ends_at_once


def main() -> None:
    """Run `decode`; expected failures are one sentence on stderr and exit code 1."""
    os.environ.update(ONE_EACH)
    with ends_at_once():
        from decoder.commands.cli import main as run  # noqa: PLC0415 - click alone takes longer than a finger
    run()
