"""`decode calibrate`: the commands that make camera.yaml, and the one that finds a camera's place."""

from __future__ import annotations

import importlib

import click

COMMANDS = {
    "focal": ("decoder.commands.calibrate_focal", "Pixels per radian over focal length, from a ruler."),
    "distortion": ("decoder.commands.calibrate_distortion", "Whether the lens bends a ruler, and by how much."),
    "board": ("decoder.commands.calibrate_board", "Focal length and distortion from a chessboard or ChArUco board."),
    "pose": ("decoder.commands.calibrate_pose", "Where the camera was, from reference points; squares a picture up."),
}
EPILOG = """\b
Examples:
  decode calibrate focal zoom_*.jpg --line 520,606,1096,606 --inches 6 --distance-inches 36
  decode calibrate distortion wide.jpg --line 10,601,1605,611 --inches 16.5
  decode calibrate board board_*.jpg --squares 9x6
  decode calibrate pose panel.yaml --camera camera.yaml --squared squared.png
"""


class CalibrateGroup(click.Group):
    """Commands from the table above, imported late."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - click's signature
        """The names in the table."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002 - click's signature
        """The command of that name, its module imported now."""
        if cmd_name not in COMMANDS:
            return None
        found: click.Command = importlib.import_module(COMMANDS[cmd_name][0]).command
        return found

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """The help of every command from the table, so that `--help` imports none of them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in COMMANDS.items()])


@click.group("calibrate", cls=CalibrateGroup, epilog=EPILOG)
def command() -> None:
    """Make camera.yaml from photographs of things whose size is known, and find where a camera was."""
