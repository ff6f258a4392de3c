"""Selected frames of a flight, read again, with their readings drawn in for people to look at.

The needle's own pixels stay visible: the line over it is thin, and the conspicuous marks are outside the rim.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from decoder.imaging.pictures import ColourPicture
from decoder.instruments.reading import Status
from decoder.outputs.csv_output import moment_text
from decoder.outputs.drawn_readings import STATUS_COLOURS, Colour, DrawnGauge, DrawnReading, Point
from decoder.outputs.thresholds import CROP_PX, PICTURE_PX
from decoder.panel.arrays import Floats
from decoder.panel.errors import OutputError
from decoder.timeseries.flight_data import STATUSES, FlightData
from decoder.timeseries.outliers import find_outliers
from flight_file.frame import Frame

Frames = Callable[[], Iterator[Frame]]

Rows = NDArray[np.int64]
"""Rows of the flight data, rising."""

JPEG_QUALITY = 92
CROP_REACH = 1.45  # of the gauge's radius, to each side
INK, PAPER, QUIET = (240, 243, 246), (17, 21, 26), (150, 160, 170)
OPACITY = 205
KEY = "status · score · 95 % error"
CAP = (1.05, 1.22)  # from where to where the pointer's mark extends outside the rim, in radii

Box = tuple[float, float, float, float]
"""Left, top, right, bottom."""


def matched_frames(data: FlightData, frames: Frames) -> Iterator[Frame]:
    """Read the frames again, one for each row of the flight data.

    Raises
    ------
    OutputError
        If they differ from those read before.
    """
    numbers = iter(data.frame.tolist())
    for frame in frames():
        if next(numbers, None) != frame.sequence:
            raise OutputError("the flight file gave other frames than before; is the disk failing?")
        yield frame
    if next(numbers, None) is not None:
        raise OutputError("the flight file gave fewer frames than before; is the disk failing?")


def nearest(data: FlightData, at_s: Sequence[float]) -> Rows:
    """Find the frames nearest to some times since the first frame."""
    if not len(data.frame):
        return np.empty(0, np.int64)
    return np.unique([int(np.abs(data.time_s - time_s).argmin()) for time_s in at_s])


def flagged(data: FlightData) -> Rows:
    """Find the frames in which a value is interpolated, missing or implausible."""
    doubtful = np.zeros(len(data.frame), bool)
    for series in data.series:
        doubtful |= series.has(Status.INTERPOLATED, Status.MISSING)
    for outlier in find_outliers(data):
        doubtful[outlier.first : outlier.last + 1] = True
    return np.flatnonzero(doubtful)


def every(data: FlightData, step: int) -> Rows:
    """Select the first frame and every `step`-th from there."""
    return np.arange(0, len(data.frame), step)


@dataclass(frozen=True, slots=True)
class View:
    """The part of a frame that is drawn, and the size of one of its pixels in the drawing."""

    left: int
    top: int
    right: int
    bottom: int
    enlarged: float

    def place(self, point_px: Point) -> Point:
        """Carry a point of the frame into the drawing."""
        x, y = point_px
        return (x - self.left + 0.5) * self.enlarged - 0.5, (y - self.top + 0.5) * self.enlarged - 0.5


def whole_view(picture: ColourPicture) -> View:
    """Show all of a frame, enlarged by a whole number so that the drawing is finer than its pixels."""
    height, width = picture.shape[:2]
    return View(0, 0, width, height, float(max(1, min(math.ceil(PICTURE_PX / width), 4 * PICTURE_PX // height))))


def gauge_view(picture: ColourPicture, gauge: DrawnGauge) -> View:
    """Show one gauge and its surroundings, as far as they are in the frame; large enough to judge the needle by."""
    height, width = picture.shape[:2]
    left, top, right, bottom = gauge.part_px(CROP_REACH, (width, height))
    right, bottom = max(right, left + 1), max(bottom, top + 1)
    return View(left, top, right, bottom, max(1.0, CROP_PX / max(right - left, bottom - top)))


def drawn(picture: ColourPicture, view: View, gauges: Sequence[DrawnGauge], told: tuple[str, str]) -> Image.Image:
    """Draw the part of a frame that is in view with its gauges, and a caption below: what it is, and a remark."""
    pixels = seen(picture, view)
    size = (pixels.shape[1], pixels.shape[0])
    taken = [moved(gauge.box_px, view) for gauge in gauges]
    for gauge in gauges:
        draw_needles(pixels, gauge, view)
    image = Image.fromarray(pixels)
    del pixels  # avoids another copy of a large picture
    text_px = max(15, round(min(size[0] / 85, size[1] / 12)))
    for number, gauge in enumerate(gauges):
        chip = Chip(gauge.readings, text_px, [_note(reading) for reading in gauge.readings])
        box = chip.box_near(taken[number], taken[:number] + taken[number + 1 :], size)
        taken.append(box)
        chip.draw(image, box)
    return _captioned(image, told, text_px)


def seen(picture: ColourPicture, view: View) -> ColourPicture:
    """Copy the part of a frame that is in view, at the size at which it is drawn."""
    size = (round((view.right - view.left) * view.enlarged), round((view.bottom - view.top) * view.enlarged))
    part = picture[view.top : view.bottom, view.left : view.right]
    if part.shape[1::-1] == size:
        return part.copy()
    way = cv2.INTER_CUBIC if view.enlarged > 1 else cv2.INTER_AREA
    return np.asarray(cv2.resize(part, size, interpolation=way), np.uint8)


def caption(data: FlightData, row: int, recording: str) -> str:
    """Say which frame it is, and when it was taken."""
    when = moment_text(data, int(data.time_ns[row]))
    moment = f"{when[:10]} {when[11:23]} UTC" if when else "time of day unknown"
    return f"{recording} · frame {int(data.frame[row])} · {moment} · {data.time_s[row]:.3f} s"


def as_jpeg(image: Image.Image) -> bytes:
    """Encode a drawing as JPEG, colours at full resolution."""
    stream = io.BytesIO()
    image.save(stream, "JPEG", quality=JPEG_QUALITY, subsampling=0)
    return stream.getvalue()


def draw_needles(pixels: ColourPicture, gauge: DrawnGauge, view: View) -> None:
    """Draw a gauge's rim and its needles over their frame; conspicuous marks are outside the rim."""
    radius = gauge.radius_px * view.enlarged
    rim = np.array([view.place(point) for point in gauge.rim_px])
    _line(pixels, rim, INK, radius / 90, closed=True, opacity=0.35)
    pivot = np.array(view.place(gauge.pivot_px))
    for reading in gauge.readings:
        if reading.line_px is None:
            continue
        colour = STATUS_COLOURS[reading.status]
        bottom, tip = (np.array(view.place(point)) for point in reading.line_px)
        _line(pixels, np.stack([bottom, tip]), colour, radius / 60, opacity=0.8)
        cap = np.stack([pivot + (tip - pivot) * part for part in CAP])
        _line(pixels, cap, PAPER, radius / 11)
        _line(pixels, cap, colour, radius / 18)


def _line(
    pixels: ColourPicture, points: Floats, colour: Colour, width: float, *, closed: bool = False, opacity: float = 1.0
) -> None:
    """Draw a smooth line through (N, 2) points, placed to a sixteenth of a pixel."""
    reach = math.ceil(width) + 2
    left, top = np.maximum(np.floor(points.min(axis=0)) - reach, 0).astype(int)
    right, bottom = (np.ceil(points.max(axis=0)) + reach).astype(int)
    under = pixels[top : max(bottom, 0), left : max(right, 0)]
    if not under.size:
        return
    over = under.copy()
    places = np.rint((points - (left, top)) * 16).astype(np.int32)[:, None]
    cv2.polylines(over, [places], closed, colour, max(1, round(width)), cv2.LINE_AA, 4)
    under[...] = cv2.addWeighted(over, opacity, under, 1.0 - opacity, 0.0)


class Chip:
    """The text beside one gauge: for each reading its name and value, and a note below, if there are notes.

    Parameters
    ----------
    notes
        One for each reading, on how it came about; none if that is shown elsewhere.
    """

    def __init__(self, readings: Sequence[DrawnReading], text_px: int, notes: Sequence[str] = ()) -> None:
        self._large, self._small = font(round(text_px * 1.15)), font(round(text_px * 0.78))
        self._line_px, self._note_px, self._pad_px = text_px * 1.4, text_px * 1.15 * bool(notes), text_px * 0.5
        self._rows = [
            (reading, f"{reading.name}  " if reading.name else "", reading.text, note)
            for reading, note in zip(readings, notes or [""] * len(readings), strict=True)
        ]
        widths = [
            max(self._small.getlength(name) + self._large.getlength(text), self._small.getlength(note))
            for _, name, text, note in self._rows
        ]
        self._width = max(widths) + 3.2 * self._pad_px
        self._height = len(self._rows) * (self._line_px + self._note_px) + self._pad_px

    def box_near(self, gauge: Box, taken: Sequence[Box], size: tuple[int, int]) -> Box:
        """Return where it covers least of what is already there, preferably below the gauge."""
        left, top, right, bottom = gauge
        gap = (right - left) * 0.13
        middle_x, middle_y = (left + right - self._width) / 2, (top + bottom - self._height) / 2
        aside = (self._width - (right - left)) / 2
        rows = [bottom + gap, top - gap - self._height, bottom + 1.3 * gap + self._height]
        corners = [(middle_x + shift, y) for y in rows for shift in (0.0, -aside, aside)]
        corners += [(right + gap, middle_y), (left - gap - self._width, middle_y)]
        boxes = [self.box_at(corner, size) for corner in corners]
        return min(boxes, key=lambda box: sum(_overlap(box, other) for other in [*taken, gauge]))

    def box_at(self, corner: Point, size: tuple[int, int]) -> Box:
        """Return its box with the top left corner there, or as near to that as fits into the picture."""
        left = min(max(corner[0], 2.0), max(size[0] - self._width - 2.0, 0.0))
        top = min(max(corner[1], 2.0), max(size[1] - self._height - 2.0, 0.0))
        return left, top, left + self._width, top + self._height

    def draw(self, image: Image.Image, box: Box) -> None:
        """Draw it in its box, over a shade."""
        left, top = math.floor(box[0]), math.floor(box[1])
        shade = Image.new("L", (math.ceil(box[2]) - left + 1, math.ceil(box[3]) - top + 1))
        here = (box[0] - left, box[1] - top, box[2] - left, box[3] - top)
        ImageDraw.Draw(shade).rounded_rectangle(here, radius=self._pad_px, fill=OPACITY)
        image.paste(PAPER, (left, top), mask=shade)
        pencil = ImageDraw.Draw(image)
        x, y = box[0] + 2.0 * self._pad_px, box[1] + self._pad_px / 2
        for reading, name, text, note in self._rows:
            colour = STATUS_COLOURS[reading.status]
            edge, bottom = box[0] + 0.7 * self._pad_px, y + self._line_px + 0.85 * self._note_px
            bar = (edge, y + 0.2 * self._line_px, edge + 0.5 * self._pad_px, bottom)
            pencil.rounded_rectangle(bar, radius=self._pad_px / 4, fill=colour)
            baseline = y + self._line_px * 0.82
            pencil.text((x, baseline), name, font=self._small, fill=QUIET, anchor="ls")
            pencil.text((x + self._small.getlength(name), baseline), text, font=self._large, fill=colour, anchor="ls")
            pencil.text((x, baseline + self._note_px), note, font=self._small, fill=QUIET, anchor="ls")
            y += self._line_px + self._note_px


def _note(reading: DrawnReading) -> str:
    """Describe a reading in a line: status, score, and 95 % interval."""
    parts = [reading.status.value]
    if math.isfinite(reading.score):
        parts.append(f"{reading.score:.3f}")
    return " · ".join([*parts, *([reading.spread] if reading.spread else [])])


def _captioned(image: Image.Image, told: tuple[str, str], text_px: int) -> Image.Image:
    """Add a bar below a drawing: what it is on the left, the legend on the right, a remark in between."""
    letters, pad = font(text_px), text_px
    words, remark = told
    legend = (
        letters.getlength(KEY) + 1.5 * pad + sum(letters.getlength(status.value) + 2.2 * pad for status in STATUSES)
    )
    one_line = letters.getlength(words) + letters.getlength(remark) + legend + 4 * pad <= image.width
    rows = 1 if one_line else 2 + bool(remark)
    bar = round(rows * 1.6 * text_px + 0.8 * pad)
    whole = Image.new("RGB", (image.width, image.height + bar), PAPER)
    whole.paste(image, (0, 0))
    pencil = ImageDraw.Draw(whole)
    y = image.height + 0.4 * pad + 0.8 * text_px
    pencil.text((pad, y), words, font=letters, fill=INK, anchor="lm")
    colour = STATUS_COLOURS[Status.MISSING]
    if one_line:
        pencil.text((2 * pad + letters.getlength(words), y), remark, font=letters, fill=colour, anchor="lm")
        x = image.width - legend - pad / 2
    else:
        pencil.text((pad, y + 1.6 * text_px), remark, font=letters, fill=colour, anchor="lm")
        x, y = float(pad), y + (rows - 1) * 1.6 * text_px
    pencil.text((x, y), KEY, font=letters, fill=QUIET, anchor="lm")
    x += letters.getlength(KEY) + 1.5 * pad
    for status in STATUSES:
        dot = text_px * 0.3
        pencil.ellipse((x, y - dot, x + 2 * dot, y + dot), fill=STATUS_COLOURS[status])
        pencil.text((x + 3 * dot, y), status.value, font=letters, fill=QUIET, anchor="lm")
        x += letters.getlength(status.value) + 2.2 * pad
    return whole


@cache
def font(size_px: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Load the font of drawings."""
    return ImageFont.load_default(size_px)


def moved(box: Box, view: View) -> Box:
    """Carry a box of the frame into the drawing."""
    (left, top), (right, bottom) = view.place((box[0], box[1])), view.place((box[2], box[3]))
    return left, top, right, bottom


def _overlap(one: Box, other: Box) -> float:
    """Compute the area that two boxes share."""
    width = min(one[2], other[2]) - max(one[0], other[0])
    height = min(one[3], other[3]) - max(one[1], other[1])
    return max(width, 0.0) * max(height, 0.0)
