"""`decode calibrate`: the commands that make camera.yaml, and the one that finds a camera's place."""

from __future__ import annotations

import click

from decoder.commands.cli import CommandGroup

COMMANDS = {
    "focal": ("decoder.commands.calibrate_ruler:focal", "Pixels per radian over focal length, from a ruler."),
    "distortion": ("decoder.commands.calibrate_ruler:distortion", "Whether the lens bends a ruler, and by how much."),
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


@click.group("calibrate", cls=CommandGroup, table=COMMANDS, epilog=EPILOG)
def command() -> None:
    """Make camera.yaml from photographs of things whose size is known, and find where a camera was."""
