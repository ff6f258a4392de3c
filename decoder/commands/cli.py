"""The `decode` command line: its commands, and how expected failures end.

`decode FLIGHT` is `decode flight FLIGHT`: decoding is the program's purpose, so it needs no verb. The help of commands
is in a table, and a command's module is imported when it is run: `decode --help` imports none of them, and is quick.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping
from typing import Any

import click

from decoder.panel.errors import DecoderError
from decoder.parallel.processes import EXIT_FAILED, INTERRUPTED, ends_at_once
from flight_file.errors import FlightFileError
from flight_file.untrusted import printable, say

CommandTable = Mapping[str, tuple[str, str]]
"""Name: the module that has the click command, as `command` or as what a colon names, and the line for `--help`."""

COMMANDS = {
    "flight": ("decoder.commands.flight", "Decode a flight file into flight data (what `decode FLIGHT` does)."),
    "calibrate": ("decoder.commands.cli:calibrate", "Make camera.yaml from photographs; find where a camera was."),
    "fleet": ("decoder.commands.fleet", "Decode many flights, on this machine or on a cluster, with one index."),
    "frames": ("decoder.commands.frames", "Write a flight's pictures with the readings drawn in."),
    "video": ("decoder.commands.video", "Write a flight as a film with the readings drawn in."),
    "rpm": ("decoder.commands.rpm", "Measure engine speed from its sound, and compare it with the tachometer."),
    "export": ("decoder.commands.export", "Write flight data as Parquet or as a Garmin G1000 log."),
    "setup": ("decoder.commands.setup", "Draw or edit a panel in the browser."),
    "explain": ("decoder.commands.explain", "Say how sure one value is, and why."),
    "accuracy": ("decoder.commands.accuracy", "Compare flight data with the truth."),
}
CALIBRATIONS = {
    "focal": ("decoder.commands.calibrate.ruler:focal", "Pixels per radian over focal length, from a ruler."),
    "distortion": ("decoder.commands.calibrate.ruler:distortion", "Whether the lens bends a ruler, and by how much."),
    "board": ("decoder.commands.calibrate.board", "Focal length and distortion from a chessboard or ChArUco board."),
    "pose": ("decoder.commands.calibrate.pose", "Where the camera was, from reference points; squares a picture up."),
}
DEFAULT_COMMAND = "flight"

EPILOG = """\b
Examples:
  decode flight.mcap
  decode flight_0000.mcap flight_0001.mcap -o results --panel panel.yaml
  decode fleet 'archive/*/*.mcap' -o results
  decode frames flight.mcap -o pictures --flagged
  decode video flight.mcap -o overlay.mp4 --data results
  decode rpm flight.mcap -o results/rpm.csv --cylinders 4 --blades 2
  decode export results/flight.csv -o flight.parquet
  decode setup flight.mcap --panel panel.yaml
  decode explain results/flight.csv oil_press_psi --frame 57
  decode accuracy results/flight.csv truth.csv
"""


CALIBRATIONS_EPILOG = """\b
Examples:
  decode calibrate focal zoom_*.jpg --line 520,606,1096,606 --inches 6 --distance-inches 36
  decode calibrate distortion wide.jpg --line 10,601,1605,611 --inches 16.5
  decode calibrate board board_*.jpg --squares 9x6
  decode calibrate pose panel.yaml --camera camera.yaml --squared squared.png
"""


class CommandGroup(click.Group):
    """The commands of a table, imported late."""

    def __init__(self, *, table: CommandTable, **options: Any) -> None:  # noqa: ANN401 - click's own, passed through
        super().__init__(**options)
        self.table = table

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - click's signature
        """List the names in the table."""
        return list(self.table)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002 - click's signature
        """Import the command of that name."""
        if cmd_name not in self.table:
            return None
        with ends_at_once():
            module, _, name = self.table[cmd_name][0].partition(":")
            command: click.Command = getattr(importlib.import_module(module), name or "command")
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """Take the help of every command from the table, so that `--help` imports none of them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in self.table.items()])


class DecodeGroup(CommandGroup):
    """A table of commands; an argument that is not one of them is a flight to decode."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put the default command before arguments that do not start with a command."""
        if args and args[0] not in self.table and args[0] not in ("--help", "--version"):
            args = [DEFAULT_COMMAND, *args]
        return super().parse_args(ctx, args)


@click.group(cls=DecodeGroup, table=COMMANDS, epilog=EPILOG, no_args_is_help=True)
@click.version_option(package_name="image-flight-recorder")
def cli() -> None:
    """Turn the pictures of a flight file into flight data."""


@click.group("calibrate", cls=CommandGroup, table=CALIBRATIONS, epilog=CALIBRATIONS_EPILOG)
def calibrate() -> None:
    """Make camera.yaml from photographs of things whose size is known, and find where a camera was."""


def main() -> None:
    """Run `decode`; expected failures are one sentence on stderr and exit code 1."""
    try:
        cli(prog_name="decode", standalone_mode=False)
    except click.exceptions.Exit as done:
        sys.exit(done.exit_code)
    except click.exceptions.NoArgsIsHelpError as asked:
        asked.show()
        sys.exit(asked.exit_code)
    except click.UsageError as error:
        click.UsageError(printable(error.format_message()), error.ctx).show()
        sys.exit(error.exit_code)
    except (KeyboardInterrupt, click.Abort):
        say(INTERRUPTED, err=True)
        sys.exit(EXIT_FAILED)
    except (DecoderError, FlightFileError) as error:
        say(f"decode: {error}", err=True)
        sys.exit(EXIT_FAILED)
