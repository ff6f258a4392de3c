"""`decode calibrate distortion`: the block-march test on a photograph of a ruler."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import click

from decoder.calibration.camera_file import known_camera, merged, write_camera
from decoder.calibration.march import March, march
from decoder.calibration.photographs import Photograph, read_photograph
from decoder.calibration.profile import Line
from decoder.commands.calibrate_options import camera_output, line_option, picture_file
from decoder.errors import CalibrationError
from decoder.outputs import write_all
from decoder.text_table import text_table

THRESHOLD_PX = 0.5
EPILOG = """\b
drift: how far a tick is from the middle of its block; bend: what of that the lens does, outwards positive.

\b
Examples:
  decode calibrate distortion wide.jpg --line 10,601,1605,611 --inches 16.5
  decode calibrate distortion wide.jpg --line 10,601,1605,611 --inches 16.5 --stacked stacked.png -o camera.yaml
"""


@click.command("distortion", epilog=EPILOG)
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
def command(  # noqa: PLR0917 - click gives them by name
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
    click.echo(_json(result, entry, bends=bends) if as_json else _text(result, entry, threshold_px, bends=bends))
    if bends and entry is None:
        click.echo(f"{camera_file} is not there yet: run `decode calibrate focal` first, then this again", err=True)
    elif bends:
        click.echo(f"k1 at {photograph.focal_length_mm:g} mm is in {camera_file}", err=True)


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


def _text(result: March, entry: dict[str, float] | None, threshold_px: float, *, bends: bool) -> str:
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


def _json(result: March, entry: dict[str, float] | None, *, bends: bool) -> str:
    described: dict[str, Any] = {
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
    return json.dumps(described, indent=2)
