"""The `decode` command line: which commands there are, and how expected failures end.

`decode FLIGHT` is `decode flight FLIGHT`: decoding is what the program is for, so it needs no verb.
"""

from __future__ import annotations

import sys

import click

from decoder.commands.group import CommandGroup
from decoder.errors import DecoderError
from decoder.interrupts import EXIT_FAILED, INTERRUPTED
from flight_file.errors import FlightFileError

COMMANDS = {
    "flight": ("decoder.commands.flight", "Decode a flight file into flight data (what `decode FLIGHT` does)."),
    "calibrate": ("decoder.commands.calibrate", "Make camera.yaml from photographs; find where a camera was."),
    "fleet": ("decoder.commands.fleet", "Decode many flights, on this machine or on a cluster, with one index."),
    "frames": ("decoder.commands.frames", "Write a flight's pictures with the readings drawn in."),
    "export": ("decoder.commands.export", "Write flight data as Parquet or as a Garmin G1000 log."),
    "setup": ("decoder.commands.setup", "Draw or edit a panel in the browser."),
    "accuracy": ("decoder.commands.accuracy", "Hold flight data against the truth."),
}
DEFAULT_COMMAND = "flight"

EPILOG = """\b
Examples:
  decode flight.mcap
  decode flight_0000.mcap flight_0001.mcap -o results --panel panel.yaml
  decode fleet 'archive/*/*.mcap' -o results
  decode frames flight.mcap -o pictures --flagged
  decode export results/flight.csv -o flight.parquet
  decode setup flight.mcap --panel panel.yaml
  decode accuracy results/flight.csv truth.csv
"""


class DecodeGroup(CommandGroup):
    """A table of commands; an argument that names none of them is a flight to decode."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Puts the default command before arguments that start with no command."""
        if args and args[0] not in self.table and args[0] not in ("--help", "--version"):
            args = [DEFAULT_COMMAND, *args]
        return super().parse_args(ctx, args)


@click.group(cls=DecodeGroup, table=COMMANDS, epilog=EPILOG, no_args_is_help=True)
@click.version_option(package_name="image-flight-recorder")
def cli() -> None:
    """Turn the pictures of a flight file into flight data."""


def main() -> None:
    """Runs `decode`; expected failures are one sentence on stderr and exit code 1."""
    try:
        cli(prog_name="decode", standalone_mode=False)
    except click.exceptions.Exit as done:
        sys.exit(done.exit_code)
    except click.UsageError as error:
        error.show()
        sys.exit(error.exit_code)
    except (KeyboardInterrupt, click.Abort):
        click.echo(INTERRUPTED, err=True)
        sys.exit(EXIT_FAILED)
    except (DecoderError, FlightFileError) as error:
        click.echo(f"decode: {error}", err=True)
        sys.exit(EXIT_FAILED)
