"""`decode calibrate board`: focal length and distortion from photographs of a chessboard or ChArUco board."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import numpy as np

from decoder.calibration.board import BoardFit, charuco, chessboard, fit_boards
from decoder.calibration.camera_file import known_camera, merged, write_camera
from decoder.calibration.focal_fit import fit_focal
from decoder.calibration.photographs import Photograph, read_photographs
from decoder.calibration.thresholds import MIN_PHOTOGRAPHS
from decoder.commands.options import camera_output
from decoder.outputs.csv_output import text_table
from decoder.panel.camera import COEFFICIENTS
from decoder.panel.lens import DistortionModel
from flight_file.untrusted import say, say_json

HEADER = ["mm", "photographs", "px/rad", "sigma", "k1", "sigma", "k2", "rms px"]
EPILOG = """\b
Six photographs or more for each zoom, the board tilted to different sides and brought into the corners.

\b
Examples:
  decode calibrate board board_*.jpg --squares 9x6
  decode calibrate board board_*.jpg --squares 9x7 --dictionary DICT_5X5_100 --marker-part 0.75
  decode calibrate board board.mcap --squares 9x7 --model fisheye --focal-length-mm 3
"""


def _squares(_context: click.Context, _option: click.Parameter, value: str) -> tuple[int, int]:
    match = re.fullmatch(r"0*([4-9]|[1-9]\d+)x0*([4-9]|[1-9]\d+)", value)
    if match is None:
        raise click.BadParameter("count the squares across and down, such as 9x6, four or more each way")
    return int(match[1]), int(match[2])


@click.command("board", epilog=EPILOG)
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="PHOTOGRAPH|FLIGHT...")
@click.option("--squares", callback=_squares, required=True, metavar="NxM", help="Squares across and down.")
@click.option("--dictionary", metavar="DICT", help="For a ChArUco board: its markers, such as DICT_5X5_100.")
@click.option("--marker-part", type=click.FloatRange(0.2, 0.95), default=0.75, show_default=True,
              help="For a ChArUco board: a marker's width, as a fraction of a square's.")  # fmt: skip
@click.option("--model", type=click.Choice([str(model) for model in DistortionModel]), default="brown_conrady",
              show_default=True, help="rational for a wide lens, fisheye for an action camera's.")  # fmt: skip
@click.option("--focal-length-mm", "otherwise_mm", type=click.FloatRange(min=0.1, max=1e4), metavar="MM",
              help="For pictures that do not state it, such as a film's.")  # fmt: skip
@click.option("--replace-focal", is_flag=True, help="Put the focal length into CAMERA even if it has one.")
@camera_output
@click.option("--json", "as_json", is_flag=True, help="Print JSON for a script to read.")
def command(
    files: tuple[Path, ...],
    squares: tuple[int, int],
    dictionary: str | None,
    marker_part: float,
    *,
    model: str,
    otherwise_mm: float | None,
    camera_file: Path,
    replace_focal: bool,
    as_json: bool,
) -> None:
    """Photographs or a film of a board, at one zoom or several, give the lens's distortion and focal length.

    The distortion takes its place in camera.yaml beside what is there; the focal length does so if there is none yet.
    Three zooms or more give the quadratic, fewer the straight line of a pinhole.
    """
    known = known_camera(camera_file)
    find = chessboard(squares) if dictionary is None else charuco(squares, marker_part, dictionary)
    cameras: list[str] = []
    fits = fit_boards(_noting(read_photographs(files, otherwise_mm, _tell), cameras), find, DistortionModel(model))
    new: dict[str, Any] = {
        "picture_size": fits[0].size_px,
        "distortion": [
            {"focal_length_mm": fit.focal_length_mm, **_model(fit), **_coefficients(fit), "k1_sigma": fit.k1_sigma}
            for fit in fits
        ],
    }
    if known is None or replace_focal:
        new["focal"] = _focal(fits)
    if known is None and any(cameras):
        new["model"] = cameras[0]
    write_camera(camera_file, merged(known, **new))
    if as_json:
        say_json([_json(fit) for fit in fits])
    else:
        say(*_text(fits, camera_file).split("\n"))


def _tell(sentence: str) -> None:
    say(sentence, err=True)


def _noting(photographs: Iterator[Photograph], cameras: list[str]) -> Iterator[Photograph]:
    """Pass photographs on, and note which camera took each."""
    for photograph in photographs:
        cameras.append(photograph.model)
        yield photograph


def _model(fit: BoardFit) -> dict[str, str]:
    model = fit.distortion.model
    return {} if model is DistortionModel.BROWN_CONRADY else {"model": str(model)}


def _coefficients(fit: BoardFit) -> dict[str, float]:
    return dict(zip(COEFFICIENTS[fit.distortion.model], fit.distortion.coefficients, strict=True))


def _json(fit: BoardFit) -> dict[str, Any]:
    return {
        "focal_length_mm": fit.focal_length_mm, "pixels_per_radian": fit.pixels_per_radian, "sigma": fit.sigma,
        "model": str(fit.distortion.model), **_coefficients(fit), "k1_sigma": fit.k1_sigma, "rms_px": fit.rms_px,
        "photographs": fit.photographs,
    }  # fmt: skip


def _focal(fits: tuple[BoardFit, ...]) -> dict[str, Any]:
    lengths = np.array([fit.focal_length_mm for fit in fits])
    values = np.array([fit.pixels_per_radian for fit in fits])
    sigmas = np.array([fit.sigma for fit in fits])
    span = [float(lengths.min()), float(lengths.max())]
    if len(fits) >= MIN_PHOTOGRAPHS:
        found = fit_focal(lengths, values, sigmas, scale_sigma=0.0)
        return {
            "pixels_per_radian": found.coefficients.tolist(),
            "covariance": found.covariance.tolist(),
            "range_mm": span,
        }
    slope = float(np.average(values / lengths, weights=(lengths / sigmas) ** 2))
    spread = max(float(np.max(sigmas / lengths)), float(np.ptp(values / lengths)))
    return {
        "pixels_per_radian": [0.0, slope, 0.0],
        "covariance": [[0.0, 0.0, 0.0], [0.0, spread**2, 0.0], [0.0, 0.0, 0.0]],
        "range_mm": span,
    }


def _text(fits: tuple[BoardFit, ...], camera_file: Path) -> str:
    rows = [
        [
            f"{fit.focal_length_mm:.2f}", str(fit.photographs), f"{fit.pixels_per_radian:.2f}", f"{fit.sigma:.2f}",
            f"{fit.distortion.radial[0]:+.5f}", f"{fit.k1_sigma:.5f}", f"{fit.distortion.radial[1]:+.5f}",
            f"{fit.rms_px:.3f}",
        ]
        for fit in fits
    ]  # fmt: skip
    return f"{text_table(HEADER, rows)}\n\n{camera_file}"
