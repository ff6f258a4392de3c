"""`decode calibrate focal`: pixels per radian over focal length, from photographs of a ruler."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import IO

import click
import numpy as np

from decoder.calibration.camera_file import known_camera, merged, write_camera
from decoder.calibration.focal_fit import FocalFit, fit_focal
from decoder.calibration.focal_plot import focal_svg
from decoder.calibration.measurements import Measured, measure_alike, measure_listed, read_measurements
from decoder.calibration.photographs import same_size
from decoder.calibration.profile import Line
from decoder.commands.calibrate_options import camera_output, line_option
from decoder.outputs import as_text, write_all
from decoder.text_table import text_table

TAPE_INCHES = 0.0625
HEADER = [
    "photograph",
    "mm",
    "ticks",
    "found",
    "px/rad",
    "sigma",
    "fit-",
    "small angle",
    "arctangent",
    "tilt",
    "rms px",
]
EPILOG = """\b
px/rad is in the centre of the field, with the ruler's tilt taken out; fit- is what the quadratic misses it by. The
small-angle form is the thesis's, the arctangent form the mean over the ruler.

\b
Examples:
  decode calibrate focal zoom_*.jpg --line 520,606,1096,606 --inches 6 --distance-inches 36
  decode calibrate focal ruler.yaml -o camera.yaml --plot focal.svg
"""


@click.command("focal", epilog=EPILOG)
@click.argument("photographs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="PHOTOGRAPH...")
@click.option(
    "--line", callback=line_option, metavar="X0,Y0,X1,Y1", help="Along the ticks, in the first photograph's pixels."
)
@click.option("--inches", type=click.FloatRange(min=0, min_open=True), help="How long the line is on the ruler.")
@click.option("--distance-inches", type=click.FloatRange(min=0, min_open=True), help="From the lens to the ruler.")
@click.option(
    "--distance-sigma-inches", type=click.FloatRange(min=0), default=TAPE_INCHES, show_default=True,
    help="How uncertain that distance is.",
)  # fmt: skip
@camera_output
@click.option("--plot", type=click.Path(path_type=Path, dir_okay=False), metavar="SVG", help="Draw figure 3.3 here.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON for a script to read.")
def command(  # noqa: PLR0917 - click gives them by name
    photographs: tuple[Path, ...],
    line: Line | None,
    inches: float | None,
    distance_inches: float | None,
    distance_sigma_inches: float,
    camera_file: Path,
    plot: Path | None,
    *,
    as_json: bool,
) -> None:
    """Photographs of a ruler at several zooms give the camera's pixels per radian.

    PHOTOGRAPH... are the photographs of a ruler that stayed in its place while the camera zoomed; --line says where on
    the first one the ruler's ticks are. Or one YAML file lists photographs with a line or points for each
    (docs/calibration.md).
    """
    known = known_camera(camera_file)
    measured, distance = _measure(photographs, line, inches, distance_inches)
    size = same_size({one.name: one.size_px for one in measured})
    lengths = np.array([one.focal_length_mm for one in measured])
    values = np.array([one.fit.pixels_per_radian for one in measured])
    sigmas = np.array([one.fit.sigma for one in measured])
    fit = fit_focal(lengths, values, sigmas, scale_sigma=distance_sigma_inches / distance)
    focal = {
        "pixels_per_radian": fit.coefficients.tolist(),
        "covariance": fit.covariance.tolist(),
        "range_mm": [float(lengths.min()), float(lengths.max())],
    }
    model = next((one.model for one in measured if one.model), known.model if known else "")
    write_camera(camera_file, merged(known, model=model, picture_size=size, focal=focal))
    if plot is not None:
        drawing = focal_svg(lengths, values, fit)

        def write(stream: IO[str]) -> None:
            stream.write(drawing)

        write_all(plot.parent, {plot.name: as_text(write)})
    click.echo(_json(measured, fit, focal) if as_json else _text(measured, fit, camera_file))


def _measure(
    photographs: tuple[Path, ...], line: Line | None, inches: float | None, distance_inches: float | None
) -> tuple[list[Measured], float]:
    if photographs[0].suffix in (".yaml", ".yml"):
        if len(photographs) > 1 or line or inches or distance_inches:
            raise click.UsageError("a YAML file says it all: give it alone")
        listed = read_measurements(photographs[0])
        return measure_listed(listed, photographs[0].parent), listed.distance_inches
    if line is None or inches is None or distance_inches is None:
        raise click.UsageError("photographs need --line, --inches and --distance-inches, or a YAML file instead")
    return measure_alike(photographs, line, inches, distance_inches), distance_inches


def _text(measured: list[Measured], fit: FocalFit, camera_file: Path) -> str:
    rows = [
        [
            one.name,
            f"{one.focal_length_mm:.2f}",
            one.graduation,
            str(one.fit.marks),
            f"{one.fit.pixels_per_radian:.2f}",
            f"{one.fit.sigma:.2f}",
            f"{residual:+.2f}",
            f"{one.fit.small_angle:.2f}",
            f"{one.fit.arctangent:.2f}",
            f"{one.fit.tilt_deg:+.1f}",
            f"{one.fit.rms_px:.3f}",
        ]
        for one, residual in zip(measured, fit.residuals, strict=True)
    ]
    c0, c1, c2 = fit.coefficients
    spreads = np.sqrt(np.diag(fit.covariance))
    equation = f"pixels per radian = {c0:.6g} {c1:+.6g} f {c2:+.4g} f^2   (f in mm)"
    return (
        f"{text_table(HEADER, rows)}\n\n{equation}\n"
        f"standard uncertainties, the distance's among them: {spreads[0]:.3g}, {spreads[1]:.3g}, {spreads[2]:.3g}\n"
        f"\n{camera_file}"
    )


def _json(measured: list[Measured], fit: FocalFit, focal: dict[str, list[float]]) -> str:
    photographs = [
        asdict(one) | {"residual": residual} for one, residual in zip(measured, fit.residuals.tolist(), strict=True)
    ]
    return json.dumps({"focal": focal, "photographs": photographs}, indent=2)
