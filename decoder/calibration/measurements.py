"""How rulers are measured in photographs: a line to find ticks on, or marks set by hand.

Either a YAML file lists them, or one line serves all photographs of a ruler that did not move while the camera zoomed:
a point of the picture then moves straight away from the middle as the focal length grows.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from decoder.calibration.photographs import Photograph, read_photograph, same_size
from decoder.calibration.profile import Line
from decoder.calibration.ruler_fit import Marks, RulerFit, fit_ruler, refuse_off_centre
from decoder.calibration.thresholds import MIN_PERIOD_PX, MIN_TICKS
from decoder.calibration.ticks import find_ticks
from decoder.panel.arrays import Number
from decoder.panel.description import Point, Positive, Strict, parse_description
from decoder.panel.errors import CalibrationError, MeasurementsError
from flight_file.untrusted import read_yaml_file

EDGE_PX = 2.0  # the distance to keep between a line and the picture's edge


class RulerPhotograph(Strict):
    """One photograph of the ruler: `line` to find its ticks on, or `points` set by hand.

    `inches` is the length of the line or between two points; for more points, the place of each on the ruler. Points
    need no picture if `focal_length_mm` and `picture_size` are given.
    """

    picture: str | None = None
    focal_length_mm: Positive | None = None
    picture_size: tuple[int, int] | None = None
    line: tuple[Number, Number, Number, Number] | None = None
    points: Annotated[tuple[Point, ...], Field(min_length=2)] | None = None
    inches: Positive | tuple[Number, ...]

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        if (self.line is None) == (self.points is None):
            raise ValueError("give either `line` (x0, y0, x1, y1) or `points`")
        if self.picture is None and (self.line is not None or None in (self.focal_length_mm, self.picture_size)):
            raise ValueError("name the `picture`, or give points with `focal_length_mm` and `picture_size`")
        places = self.inches if isinstance(self.inches, tuple) else (0.0, self.inches)
        if self.points is not None and (len(places) != len(self.points) or len(set(places)) != len(places)):
            raise ValueError("inches needs one place on the ruler for each point, all different")
        if self.line is not None and isinstance(self.inches, tuple):
            raise ValueError("inches is the length of the line, one number")
        return self


class RulerPhotographs(Strict):
    """All photographs of a ruler at one distance."""

    distance_inches: Positive
    photographs: Annotated[tuple[RulerPhotograph, ...], Field(min_length=1)]


@dataclass(frozen=True, slots=True)
class Measured:
    """One photograph's measurement."""

    name: str
    focal_length_mm: float
    size_px: tuple[int, int]
    model: str
    graduation: str
    fit: RulerFit


def read_measurements(path: Path) -> RulerPhotographs:
    """Read the list in a YAML file.

    Raises
    ------
    MeasurementsError
        If it cannot be read or is wrong.
    """
    try:
        text = read_yaml_file(path)
    except OSError as error:
        raise MeasurementsError("", f"cannot be read: {error.strerror}", source=str(path)) from error
    return parse_description(
        RulerPhotographs, text, error=MeasurementsError, thing="measurements", page="docs/calibration.md",
        source=str(path),
    )  # fmt: skip


def measure_listed(listed: RulerPhotographs, folder: Path) -> list[Measured]:
    """Measure every photograph of a list, with its pictures in a folder.

    Raises
    ------
    CalibrationError
        Naming the photograph that cannot be used.
    """
    measured = []
    for number, entry in enumerate(listed.photographs):
        name = entry.picture or f"photographs[{number}]"
        with_ticks = entry.line is not None or entry.focal_length_mm is None or entry.picture_size is None
        photograph = read_photograph(folder / name) if with_ticks else None
        size = photograph.size_px if photograph else entry.picture_size
        length = entry.focal_length_mm or (photograph.focal_length_mm if photograph else None)
        if size is None or length is None:
            raise CalibrationError(f"{name}: neither the photograph nor the list says its focal length and size")
        try:
            if entry.line is not None and photograph is not None and not isinstance(entry.inches, tuple):
                line = Line(entry.line[:2], entry.line[2:])
                graduation, marks = _ticks(photograph, line, entry.inches)
            else:
                graduation, marks = "by hand", _by_hand(entry)
            fit = fit_ruler(marks, distance_inches=listed.distance_inches, size_px=size)
        except CalibrationError as error:
            raise CalibrationError(f"{name}: {error}") from error
        measured.append(Measured(name, length, size, photograph.model if photograph else "", graduation, fit))
    return measured


def measure_alike(paths: tuple[Path, ...], line: Line, inches: float, distance_inches: float) -> list[Measured]:
    """Measure photographs of a ruler that did not move; the line is in the first one's pixels.

    Raises
    ------
    CalibrationError
        Naming the photograph that cannot be used.
    """
    photographs = [read_photograph(path) for path in paths]
    same_size({photograph.name: photograph.size_px for photograph in photographs})
    measured: list[Measured] = []
    for photograph in photographs:
        zoom = photograph.focal_length_mm / photographs[0].focal_length_mm
        try:
            zoomed, part = _zoomed(line, zoom, photograph.size_px)
            graduation, marks = _ticks(photograph, zoomed, inches * part)
            fit = fit_ruler(marks, distance_inches=distance_inches, size_px=photograph.size_px)
        except CalibrationError as error:
            raise CalibrationError(f"{photograph.name}: {error}") from error
        measured.append(
            Measured(photograph.name, photograph.focal_length_mm, photograph.size_px, photograph.model, graduation, fit)
        )
    return measured


def _ticks(photograph: Photograph, line: Line, inches: float) -> tuple[str, Marks]:
    if line.length_px < MIN_TICKS * MIN_PERIOD_PX:
        raise CalibrationError(f"the line is {line.length_px:.0f} pixels long; draw it along many ticks")
    refuse_off_centre(line, photograph.size_px)
    ticks = find_ticks(photograph.grey, line, inches)
    return ticks.graduation, Marks(ticks.points_px, ticks.inches)


def _by_hand(entry: RulerPhotograph) -> Marks:
    places = entry.inches if isinstance(entry.inches, tuple) else (0.0, entry.inches)
    return Marks(np.array(entry.points, np.float64), np.array(places, np.float64))


def _zoomed(line: Line, zoom: float, size_px: tuple[int, int]) -> tuple[Line, float]:
    """Carry a line to another zoom, clipped at the picture's edge; also return what part of it is left."""
    middle = (np.array(size_px) - 1) / 2
    start, end = (middle + zoom * (np.array(point) - middle) for point in (line.start_px, line.end_px))
    low, high = EDGE_PX, np.array(size_px) - 1 - EDGE_PX
    with np.errstate(divide="ignore", invalid="ignore"):
        bounds = np.sort(np.stack([(low - start) / (end - start), (high - start) / (end - start)]), axis=0)
    first = max(0.0, float(np.nanmax(bounds[0])))
    last = min(1.0, float(np.nanmin(bounds[1])))
    if last <= first:
        raise CalibrationError("the line lies outside the picture")
    ends = start + first * (end - start), start + last * (end - start)
    return Line((float(ends[0][0]), float(ends[0][1])), (float(ends[1][0]), float(ends[1][1]))), last - first
