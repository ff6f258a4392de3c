"""The command `recorder`, and the one place where expected failures become one sentence and an exit code.

Each subcommand is loaded when it is asked for, so that `recorder --help` is quick on a small board. Any other exception
is a bug and keeps its traceback.
"""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import IO, cast

import click

from camera_drivers.errors import CameraError
from flight_file.errors import FlightFileError
from flight_file.untrusted import printable
from recorder.errors import MAY_PASS, ConfigurationError, RecorderError

FAILED = 1
DONE_WITH_LOSS = 3
WRONG_CONFIGURATION = 78  # EX_CONFIG of sysexits.h; systemd is told not to start again after it
_EXIT_CODES: tuple[tuple[type[Exception], int], ...] = (
    (ConfigurationError, WRONG_CONFIGURATION),
    (RecorderError, FAILED),
    (CameraError, FAILED),
    (FlightFileError, FAILED),
)
# Of reading a file: its disk failed or is not mounted yet, or something was used up; the next start may find it.
_MAY_PASS = MAY_PASS | {errno.ENOENT}
# Name: module that has the click command under the same name, and the line for `recorder --help`.
COMMANDS = {
    "run": ("recorder.run", "Record until stopped, or until a replay ends."),
    "replay": ("recorder.command_replay", "Make one flight file from a folder of photographs."),
    "simulate": ("recorder.command_simulate", "Simulate a camera on this machine, for trying things without one."),
    "info": ("recorder.command_info", "Show what a flight holds, and whether anything is missing."),
    "extract": ("recorder.command_recover", "Extract the pictures from a flight, byte for byte."),
    "recover": ("recorder.command_recover", "Repair what a power cut left behind."),
    "verify": ("recorder.evidence", "Check CRCs, digests, chain and signatures; name the first fault."),
    "mark": ("recorder.marks", "Keep the newest segment, and the one before, whatever the disk has room for."),
    "keygen": ("recorder.evidence", "Make a key to sign recordings with."),
}


class _Failure(click.ClickException):
    """A failure whose exit code counts even where its sentence cannot be written."""

    def show(self, file: IO[str] | None = None) -> None:
        """Print the sentence on stderr."""
        with suppress(OSError):
            super().show(file)


@contextmanager
def failures_as_sentences() -> Iterator[None]:
    """Turn our own errors into click's, with their exit codes."""
    try:
        yield
    except tuple(kind for kind, _ in _EXIT_CODES) as error:
        failure = _Failure(printable(str(error)))
        failure.exit_code = _exit_code(error)  # type: ignore[misc]  # click reads it from the instance
        raise failure from error


def _exit_code(error: Exception) -> int:
    code = next(code for kind, code in _EXIT_CODES if isinstance(error, kind))
    cause: BaseException | None = error
    while code == WRONG_CONFIGURATION and cause is not None:
        if isinstance(cause, OSError) and cause.errno in _MAY_PASS:
            return FAILED
        cause = cause.__cause__
    return code


class _LazyGroup(click.Group):
    """A group that imports a subcommand only to run it or to show its own help."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - click's signature
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002 - click's signature
        if cmd_name not in COMMANDS:
            return None
        module, _ = COMMANDS[cmd_name]
        return cast("click.Command", getattr(import_module(module), cmd_name))

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002 - click's
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in COMMANDS.items()])


@click.group(
    cls=_LazyGroup,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="""\b
Examples:
  recorder run --config recorder.yaml
  recorder replay photographs -o flight.mcap
  recorder info flights/20180504T120000Z_*.mcap

\b
Exit codes: 0 done, 1 failed, 2 wrong usage, 3 done with loss, 78 wrong configuration.""",
)
@click.version_option(package_name="image-flight-recorder", prog_name="recorder")
def main() -> None:
    """Record flights: pictures of an instrument panel, with honest times, in files that survive a power cut."""
