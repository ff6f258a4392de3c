"""`decode calibrate pose`: where the camera was, from the panel's reference points, and the picture squared up."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import click
import cv2
import numpy as np

from decoder.calibration.squaring import off_axes_deg, square_of, squared_up
from decoder.commands.thresholds import WORST_PX
from decoder.imaging.camera_pose import PARAMETERS, Matrix, Pose, PoseSolution
from decoder.imaging.panel_pictures import panel_from_file
from decoder.imaging.pictures import GreyPicture
from decoder.imaging.pose import SIGMA_PX, pose_from_points
from decoder.outputs.csv_output import text_table
from decoder.outputs.outputs import Write, refuse_overwriting, write_all
from decoder.panel.camera import camera_from_file
from decoder.panel.errors import PanelError
from decoder.panel.lens import Lens
from decoder.panel.panel import Panel
from decoder.registration.thresholds import MAX_ROLL_DEG
from flight_file.untrusted import say, say_json

EPILOG = """\b
Roll is clockwise as seen from behind the camera, pitch upwards, yaw to the right. The panel's y may be counted up or
down: the picture shows which.

\b
Examples:
  decode calibrate pose panel.yaml --camera camera.yaml
  decode calibrate pose panel.yaml --camera camera.yaml --squared squared.png
  decode calibrate pose panel.yaml --camera camera.yaml --json
"""

PICTURES = (".png", ".jpg")


@click.command("pose", epilog=EPILOG)
@click.argument("panel_file", type=click.Path(path_type=Path), metavar="PANEL")
@click.option("--camera", "camera_file", type=click.Path(path_type=Path), required=True, metavar="CAMERA",
              help="The camera.yaml of the camera that took the panel picture.")  # fmt: skip
@click.option("--sigma-px", type=click.FloatRange(min=0, min_open=True), default=SIGMA_PX, show_default=True,
              help="How uncertain a reference point's place in the picture is.")  # fmt: skip
@click.option("--squared", type=click.Path(path_type=Path, dir_okay=False), metavar="PICTURE",
              help="Write the panel picture squared up here (.png or .jpg).")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print JSON for a script to read.")
def command(panel_file: Path, camera_file: Path, sigma_px: float, squared: Path | None, *, as_json: bool) -> None:
    """Where the camera was when it took the panel picture of PANEL, from its `reference_points`.

    Three points give all positions that fit exactly, more the best one by least squares.
    """
    source = panel_from_file(panel_file)
    if squared is not None:
        beside = [panel_file.parent / name for name in source.panel.pictures]
        refuse_overwriting([panel_file, camera_file, *beside], [squared])
    panel = source.panel
    lens = replace(source, camera=camera_from_file(camera_file)).optics.lens
    if lens is None:
        raise PanelError("focal_length_mm", "is missing; the lens depends on it", source=str(panel_file))
    inches = np.array([point.inches for point in panel.reference_points], np.float64).reshape(-1, 2)
    pixels = np.array([point.at for point in panel.reference_points], np.float64).reshape(-1, 2)
    plumb = None if panel.level is None else np.array(panel.level, np.float64)
    solutions = pose_from_points(inches, pixels, lens, sigma_px=sigma_px, plumb_px=plumb)
    best = solutions[0].pose
    if squared is not None:
        straight = squared_up(source.picture, best, lens, square_of(best, lens, inches))
        write_all(squared.parent, {squared.name: picture_file(squared, straight)})
    lines = _straight_lines(panel, best, lens, inches, pixels)
    if as_json:
        say_json(_document(solutions, lines))
    else:
        say(*_text(solutions, lines, len(inches)).split("\n"))
    for warning in _warnings(solutions, panel, best, lens):
        say(warning, err=True)


def _straight_lines(panel: Panel, pose: Pose, lens: Lens, inches: Matrix, pixels: Matrix) -> list[dict[str, Any]]:
    """Measure how far lines that should be level or plumb are off, in the picture and squared up, degrees."""
    flip = np.array([1.0, -1.0 if pose.y_up else 1.0])
    back = np.linalg.inv(pose.homography(lens))

    def on_panel(points: Matrix) -> Matrix:
        seen = back @ np.vstack([lens.undistorted(points.T), np.ones(len(points))])
        return np.asarray((seen[:2] / seen[2]).T * flip)

    lines = []
    for first in range(len(inches)):
        for second in range(first + 1, len(inches)):
            meant = off_axes_deg(inches * flip, first, second)
            if abs(meant) < MAX_ROLL_DEG:
                after = off_axes_deg(on_panel(pixels), first, second)
                name = f"reference points {first} and {second}"
                before = off_axes_deg(pixels, first, second) - meant
                lines.append({"line": name, "before_deg": before, "after_deg": after - meant})
    if panel.level is not None:
        ends = np.array(panel.level, np.float64)
        lines.append(
            {"line": "level", "before_deg": off_axes_deg(ends, 0, 1), "after_deg": off_axes_deg(on_panel(ends), 0, 1)}
        )
    return lines


def _warnings(solutions: tuple[PoseSolution, ...], panel: Panel, pose: Pose, lens: Lens) -> list[str]:
    said = []
    if len(solutions) > 1:
        by = "the edge `level`" if panel.level else "being nearest to square on"
        said.append(
            f"{len(solutions)} camera positions fit; the first was chosen by {by}. A further reference point decides."
        )
    if not solutions[0].trusted:
        said.append(
            "this position falls together with another one within the points' uncertainty; add a reference point."
        )
    if solutions[0].rms_px > WORST_PX:
        points = np.array([point.inches for point in panel.reference_points])
        missed = np.linalg.norm(pose.pixels(points, lens) - [point.at for point in panel.reference_points], axis=1)
        said.append(
            f"the reference points miss by {solutions[0].rms_px:.1f} pixels, most of all reference_points"
            f"[{int(np.argmax(missed))}]; check their places."
        )
    return said


def _text(solutions: tuple[PoseSolution, ...], lines: list[dict[str, Any]], points: int) -> str:
    header = ["solution", "x in", "y in", "distance in", "roll", "pitch", "yaw", "tilt"]
    rows = []
    for number, solution in enumerate(solutions, start=1):
        rows.append([str(number), *(f"{v:.3f}" for v in solution.values), f"{solution.pose.tilt_deg:.2f}"])
        rows.append(["  +-", *(f"{v:.3f}" for v in solution.sigmas), ""])
    best = solutions[0]
    how = (
        f"{points} reference points, y counted {'up' if best.pose.y_up else 'down'}; {best.iterations} iterations,"
        f" residual {best.residual_inches:.1e} inch ({best.rms_px:.2f} px), condition {best.condition:.0f}"
    )
    parts = [text_table(header, rows), how]
    if lines:
        table = [[line["line"], f"{line['before_deg']:+.2f}", f"{line['after_deg']:+.2f}"] for line in lines]
        parts.append(text_table(["degrees off level or plumb", "in the picture", "squared up"], table))
    return "\n\n".join(parts)


def _document(solutions: tuple[PoseSolution, ...], lines: list[dict[str, Any]]) -> dict[str, Any]:
    described = [
        {
            **dict(zip(PARAMETERS, solution.values.tolist(), strict=True)),
            **{f"{name}_sigma": sigma for name, sigma in zip(PARAMETERS, solution.sigmas.tolist(), strict=True)},
            "tilt_deg": solution.pose.tilt_deg,
            "y": "up" if solution.pose.y_up else "down",
            "iterations": solution.iterations,
            "residual_inches": solution.residual_inches,
            "rms_px": solution.rms_px,
            "condition": solution.condition,
            "trusted": solution.trusted,
            "covariance": solution.covariance.tolist(),
        }
        for solution in solutions
    ]
    return {"solutions": described, "lines": lines}


def picture_file(path: Path, picture: GreyPicture) -> Write:
    """Make a writer of a picture, in the format that the file's ending names.

    Raises
    ------
    click.BadParameter
        If it names none.
    """
    if path.suffix.lower() not in PICTURES:
        raise click.BadParameter(f"{path}: give the picture a name that ends in {' or '.join(PICTURES)}")
    encoded = cv2.imencode(path.suffix.lower(), picture)[1].tobytes()

    def write(stream: IO[bytes]) -> None:
        stream.write(encoded)

    return write
