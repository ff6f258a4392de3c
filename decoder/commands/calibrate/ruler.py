"""`decode calibrate focal` and `distortion`: pixels per radian, and whether the lens bends a ruler."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import IO, Any

import click
import numpy as np

from decoder.calibration.camera_file import known_camera, merged, write_camera
from decoder.calibration.focal_fit import FocalFit, fit_focal
from decoder.calibration.focal_plot import focal_svg
from decoder.calibration.march import March, march
from decoder.calibration.measurements import Measured, measure_alike, measure_listed, read_measurements
from decoder.calibration.photographs import Photograph, read_photograph, same_size
from decoder.calibration.profile import Line
from decoder.commands.calibrate.pose import picture_file
from decoder.commands.options import camera_output
from decoder.outputs.csv_output import text_table
from decoder.outputs.outputs import as_text, refuse_overwriting, write_all
from decoder.panel.errors import CalibrationError
from flight_file.untrusted import say, say_json

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
FOCAL_EPILOG = """\b
px/rad is in the centre of the field, with the ruler's tilt taken out; fit- is what the quadratic misses it by. The
small-angle form is the thesis's, the arctangent form the mean over the ruler.

\b
Examples:
  decode calibrate focal zoom_*.jpg --line 520,606,1096,606 --inches 6 --distance-inches 36
  decode calibrate focal ruler.yaml -o camera.yaml --plot focal.svg
"""

LINE_WANTED = "give both ends as x0,y0,x1,y1 in pixels"
THRESHOLD_PX = 0.5
DISTORTION_EPILOG = """\b
drift: how far a tick is from the middle of its block; bend: what of that the lens does, outwards positive.

\b
Examples:
  decode calibrate distortion wide.jpg --line 10,601,1605,611 --inches 16.5
  decode calibrate distortion wide.jpg --line 10,601,1605,611 --inches 16.5 --stacked stacked.png -o camera.yaml
"""


def line_option(_context: click.Context, _option: click.Parameter, value: str | None) -> Line | None:
    """`x0,y0,x1,y1` as a line."""
    if value is None:
        return None
    try:
        x0, y0, x1, y1 = map(float, value.split(","))
    except ValueError as error:
        raise click.BadParameter(LINE_WANTED) from error
    if (x0, y0) == (x1, y1):
        raise click.BadParameter(LINE_WANTED)
    return Line((x0, y0), (x1, y1))


@click.command("focal", epilog=FOCAL_EPILOG)
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
def focal(  # noqa: PLR0917 - click gives them by name
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
    if plot is not None:
        refuse_overwriting([*photographs, camera_file], [plot])
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
    if as_json:
        say_json(_focal_document(measured, fit, focal))
    else:
        say(*_focal_text(measured, fit, camera_file).split("\n"))


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


def _focal_text(measured: list[Measured], fit: FocalFit, camera_file: Path) -> str:
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


def _focal_document(measured: list[Measured], fit: FocalFit, focal: dict[str, list[float]]) -> dict[str, Any]:
    photographs = [
        asdict(one) | {"residual": residual} for one, residual in zip(measured, fit.residuals.tolist(), strict=True)
    ]
    return {"focal": focal, "photographs": photographs}


@click.command("distortion", epilog=DISTORTION_EPILOG)
@click.argument("photograph_file", type=click.Path(path_type=Path), metavar="PHOTOGRAPH")
@click.option("--line", callback=line_option, required=True, metavar="X0,Y0,X1,Y1",
              help="Along the ruler's ticks, from one edge of the picture to the other.")  # fmt: skip
@click.option("--inches", type=click.FloatRange(min=0, min_open=True), required=True,
              help="How long the line is on the ruler.")  # fmt: skip
@click.option("--threshold-px", type=click.FloatRange(min=0, min_open=True), default=THRESHOLD_PX, show_default=True,
              help="Below it, at the outermost tick, distortion is negligible.")  # fmt: skip
@click.option("--stacked", type=click.Path(path_type=Path, dir_okay=False), metavar="PICTURE",
              help="Write the stacked blocks, figure 3.2, here (.png or .jpg).")  # fmt: skip
@camera_output
@click.option("--json", "as_json", is_flag=True, help="Print JSON for a script to read.")
def distortion(  # noqa: PLR0917 - click gives them by name
    photograph_file: Path,
    line: Line,
    inches: float,
    threshold_px: float,
    stacked: Path | None,
    camera_file: Path,
    *,
    as_json: bool,
) -> None:
    """Whether the lens bends a ruler that runs through the middle of PHOTOGRAPH from edge to edge.

    Distortion that is not negligible goes into camera.yaml as k1 for the photograph's focal length, if
    `decode calibrate focal` has put the focal length there before.
    """
    if stacked is not None:
        refuse_overwriting([photograph_file, camera_file], [stacked])
    photograph = read_photograph(photograph_file)
    try:
        result = march(photograph.grey, line, inches)
    except CalibrationError as error:
        raise CalibrationError(f"{photograph.name}: {error}") from error
    bends = abs(result.edge_px) >= threshold_px
    entry = _entry(photograph, result, camera_file) if camera_file.exists() else None
    if stacked is not None:
        write_all(stacked.parent, {stacked.name: picture_file(stacked, result.stacked)})
    if bends and entry is not None:
        write_camera(camera_file, merged(known_camera(camera_file), distortion=[entry]))
    if as_json:
        say_json(_march_document(result, entry, bends=bends))
    else:
        say(*_march_text(result, entry, threshold_px, bends=bends).split("\n"))
    if bends and entry is None:
        say(f"{camera_file} is not there yet: run `decode calibrate focal` first, then this again", err=True)
    elif bends:
        say(f"k1 at {photograph.focal_length_mm:g} mm is in {camera_file}", err=True)


def _entry(photograph: Photograph, result: March, camera_file: Path) -> dict[str, float] | None:
    """k1 in normalised coordinates, by the focal length that camera.yaml knows."""
    known = known_camera(camera_file)
    if known is None:
        return None
    lens = known.model_copy(update={"distortion": ()}).lens(photograph.focal_length_mm, photograph.size_px)
    unit = lens.pixels_per_radian**2
    return {
        "focal_length_mm": photograph.focal_length_mm,
        "k1": result.per_px2 * unit,
        "k1_sigma": math.hypot(
            result.per_px2_sigma * unit,
            2 * result.per_px2 * lens.pixels_per_radian * lens.pixels_per_radian_sigma,
        ),
    }


def _march_text(result: March, entry: dict[str, float] | None, threshold_px: float, *, bends: bool) -> str:
    columns = zip(result.number, result.place_px, result.drift_px, result.bend_px, strict=True)
    rows = [[f"{n:+.0f}", f"{place:+.1f}", f"{drift:+.2f}", f"{bend:+.2f}"] for n, place, drift, bend in columns]
    kind = "pincushion" if result.edge_px > 0 else "barrel"
    found = (
        f"{result.edge_px:+.2f} +- {result.edge_sigma_px:.2f} px at the outermost tick, threshold {threshold_px:g} px"
    )
    verdict = f"{kind} distortion: {found}" if bends else f"distortion is negligible: {found}"
    parts = [text_table([result.block, "px from the axis", "drift px", "bend px"], rows), verdict]
    if bends and entry is not None:
        parts.append(f"k1 = {entry['k1']:.4g} +- {entry['k1_sigma']:.2g}")
    return "\n\n".join(parts)


def _march_document(result: March, entry: dict[str, float] | None, *, bends: bool) -> dict[str, Any]:
    return {
        "negligible": not bends,
        "edge_px": result.edge_px,
        "edge_sigma_px": result.edge_sigma_px,
        "k1": None if entry is None else entry["k1"],
        "k1_sigma": None if entry is None else entry["k1_sigma"],
        "block": result.block,
        "ticks": [
            {"number": number, "place_px": place, "drift_px": drift, "bend_px": bend}
            for number, place, drift, bend in zip(
                result.number.tolist(), result.place_px.tolist(), result.drift_px.tolist(), result.bend_px.tolist(),
                strict=True,
            )
        ],
    }  # fmt: skip
