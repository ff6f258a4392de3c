"""The report's flags and evidence: the spans to look at first, and crops of the pictures that show them.

First come the frames of every flag, then the extremes and the steps of each needle, then an even sample. Each group is
ordered so that any prefix of it is spread over the flight; so whatever there is room for is an unbiased selection.

Crops are cut where the frame's alignment puts each gauge. Needles are not drawn into the pixels: the page draws them
over the crop, so that they can be hidden. A frame without alignment is shown whole.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import cv2
import numpy as np
from PIL import Image

from decoder.imaging.pictures import ColourPicture
from decoder.instruments.reading import Status
from decoder.outputs.drawn_readings import DrawnGauge, Point
from decoder.panel.scale import shortest
from decoder.registration.thresholds import SCORE_THRESHOLD
from decoder.timeseries.cross_checks import CrossCheck, Disagreement, cross_checks
from decoder.timeseries.events import What, find_events
from decoder.timeseries.flight_data import FlightData, NeedleSeries, lost_runs
from decoder.timeseries.outliers import find_outliers

STEPS = 3
SAMPLE = 240

REACH = 1.22
"""How much of a gauge's surroundings is seen, in its radii."""
GAUGE_PX = 160
WHOLE_PX = 560
ENLARGED_PX = 1024
FRAME_SHAPE = 3 / 4  # the usual height over width of cameras
JPEG_QUALITY = 80
BYTES_OF_PIXEL = 0.25  # roughly what such a crop takes as JPEG
RIM_STEP = 3

Evidence = dict[str, Any]


class Kind(StrEnum):
    """What a flag says, the most serious first."""

    EXCEEDED = What.EXCEEDED.value
    """Values beyond a limit that somebody gave."""
    DISAGREEMENT = "disagreement"
    """Instruments that show the same and differ by more than can be explained."""
    OUTLIER = "outlier"
    """Values that the frames around them make hard to believe."""
    LOST = "panel not found"
    """Frames that could not be read at all."""
    MISSING = "missing"
    INTERPOLATED = "interpolated"
    HIDDEN = "hidden"
    EDGE = "edge"
    STEP = What.STEP.value
    """Changes within a frame that stay."""
    PHASE = What.PHASE.value


KINDS = tuple(Kind)
_NEEDLE_KINDS = {
    Status.MISSING: Kind.MISSING,
    Status.INTERPOLATED: Kind.INTERPOLATED,
    Status.HIDDEN: Kind.HIDDEN,
    Status.EDGE: Kind.EDGE,
}


@dataclass(frozen=True, slots=True)
class Flag:
    """A run of frames; `first` and `last` are rows of the flight data, both included.

    Attributes
    ----------
    needle
        Empty if it is about the whole panel.
    reason
        As far as the flight data show it.
    """

    kind: Kind
    needle: str
    first: int
    last: int
    reason: str

    @property
    def frames(self) -> int:
        """How many frames it covers."""
        return self.last - self.first + 1


def find_flags(data: FlightData) -> list[Flag]:
    """Find all flags, by time; those of one time in the order of `Kind`."""
    flags = [
        Flag(Kind.OUTLIER, outlier.needle, outlier.first, outlier.last, outlier.reason.value)
        for outlier in find_outliers(data)
    ]
    flags += [
        Flag(Kind(event.what.value), event.needle, event.first, event.last, event.words) for event in find_events(data)
    ]
    for check in cross_checks(data):
        flags += [
            Flag(Kind.DISAGREEMENT, check.columns[0], each.first, each.last, _disagreement(check, each))
            for each in check.disagreements
        ]
    flags += [Flag(Kind.LOST, "", first, last, reason) for first, last, reason in lost_runs(data)]
    for series in data.series:
        flags += _of_needle(series, is_combined=series.quantity.name in data.combined)
    return sorted(flags, key=lambda flag: (flag.first, KINDS.index(flag.kind)))


def _disagreement(check: CrossCheck, each: Disagreement) -> str:
    but = f" ({check.but})" if check.but else ""
    apart, allowed = (f"{size:.4g} {check.apart_unit}" for size in (each.apart, each.allowed))
    return f"{check.what} differ by {apart}; {allowed} can be explained{but}"


def _of_needle(series: NeedleSeries, *, is_combined: bool) -> Iterator[Flag]:
    for status, kind in _NEEDLE_KINDS.items():
        for first, last in series.runs(status):
            score = float(np.min(series.score[first : last + 1]))
            yield Flag(kind, series.quantity.name, first, last, _reason(series, kind, score, is_combined=is_combined))


def _reason(series: NeedleSeries, kind: Kind, score: float, *, is_combined: bool) -> str:
    cover = series.quantity.covered_by
    if kind is Kind.HIDDEN:
        return f"under {cover}; it is given that needle's value" if cover else "under another needle"
    if kind is Kind.EDGE:
        what = f"{cover}, glare or a bug" if cover else "another needle, glare or a bug"
        return f"{what} covers a part and the rest matched, or its drawing leaves it unsure (lowest score {score:.2f})"
    end = "the value is on the line between its neighbours" if kind is Kind.INTERPOLATED else "there is no value"
    if is_combined:
        return f"a pointer was not seen, or they contradict each other; {end}"
    if score == 0.0:
        return f"the gauge was not found, or not whole in the frame; {end}"
    if score < SCORE_THRESHOLD:
        return f"nothing matched well enough (lowest score {score:.2f}); {end}"
    return f"the match was rejected: it may be another needle, or lies where the needle cannot be; {end}"


def planned(data: FlightData, flags: Sequence[Flag]) -> list[int]:
    """Return the rows of the flight data whose pictures are wanted, most wanted first."""
    last = len(data.frame) - 1
    wanted: dict[int, None] = {}

    def want(rows: Iterable[int]) -> None:
        wanted.update(dict.fromkeys(row for row in rows if 0 <= row <= last))

    for kind in KINDS:
        own = [flag for flag in flags if flag.kind is kind]
        scattered = [own[index] for index in scattered_order(len(own))]
        want((flag.first + flag.last) // 2 for flag in scattered)
    for kind in KINDS:
        own = [flag for flag in flags if flag.kind is kind]
        want(row for index in scattered_order(len(own)) for row in (own[index].first, own[index].last))
    want([0, last])
    for series in data.series:
        want(_extremes(series))
        want(_steps(series))
    for kind in (Kind.OUTLIER, Kind.LOST):
        want(row for flag in flags if flag.kind is kind for row in (flag.first - 1, flag.last + 1))
    even = np.unique(np.linspace(0, max(last, 0), SAMPLE).round().astype(int)).tolist()
    want(even[index] for index in scattered_order(len(even)))
    return list(wanted)


def scattered_order(count: int) -> list[int]:
    """Order the numbers below `count` so that any prefix is spread evenly (van der Corput's sequence)."""
    bits = max(count - 1, 0).bit_length()
    reversed_bits = (int(f"{number:0{bits}b}"[::-1], 2) if bits else 0 for number in range(1 << bits))
    return [number for number in reversed_bits if number < count]


def _extremes(series: NeedleSeries) -> list[int]:
    """Find the rows of the lowest and highest value, and of the lowest score of any value."""
    valued = np.flatnonzero(np.isfinite(series.value))
    if not valued.size:
        return []
    value, score = series.value[valued], series.score[valued]
    return [int(valued[place]) for place in (value.argmin(), value.argmax(), score.argmin())]


def _steps(series: NeedleSeries) -> list[int]:
    """Find the rows before and after the largest steps between neighbouring values."""
    valued = np.flatnonzero(np.isfinite(series.value))
    sizes = np.abs(shortest(np.diff(series.value[valued]), series.quantity.wraps))
    largest = np.argsort(-sizes, kind="stable")[:STEPS]
    return [int(row) for place in largest if sizes[place] > 0 for row in (valued[place], valued[place + 1])]


@dataclass(frozen=True, slots=True)
class Plan:
    """Which pictures go into a report.

    Attributes
    ----------
    rows
        Those with pictures.
    wholes
        Those with the whole frame, large.
    has_crops
        Whether each gauge is cut out by itself; not if the whole frame takes no more room.
    has_coarse
        Whether the others have the whole frame, small.
    """

    rows: frozenset[int]
    wholes: frozenset[int]
    has_crops: bool = True
    has_coarse: bool = False

    def frame_px(self, row: int) -> int:
        """Return the size of the whole frame of a row, 0 for none."""
        return ENLARGED_PX if row in self.wholes else WHOLE_PX if self.has_coarse else 0


def picture_plan(data: FlightData, flags: Sequence[Flag], gauges: int, room_bytes: int) -> Plan:
    """Choose the pictures for about this much room, most wanted first: every flag's before any is large."""
    wanted = planned(data, flags)
    whole_bytes, coarse_bytes = (size_px**2 * FRAME_SHAPE * BYTES_OF_PIXEL for size_px in (ENLARGED_PX, WHOLE_PX))
    crops_bytes = max(gauges, 1) * GAUGE_PX**2 * BYTES_OF_PIXEL * 4 / 3
    if crops_bytes >= whole_bytes / 2:
        rows = frozenset(wanted[: max(0, int(room_bytes / whole_bytes))])
        return Plan(rows, rows, has_crops=False)
    has_coarse = len(flags) * (crops_bytes + coarse_bytes) <= room_bytes
    each_bytes = crops_bytes + (coarse_bytes if has_coarse else 0)
    wholes = wanted[: max(0, int((room_bytes - len(flags) * each_bytes) / 2 / whole_bytes))]
    rows = frozenset(wanted[: max(0, int((room_bytes - len(wholes) * whole_bytes) / each_bytes))])
    return Plan(rows, frozenset(wholes), has_coarse=has_coarse)


def evidence(
    picture: ColourPicture,
    gauges: Sequence[DrawnGauge],
    places: dict[str, int],
    *,
    frame_px: int = 0,
    has_crops: bool = True,
) -> Evidence:
    """Cut the pictures of one frame.

    Parameters
    ----------
    picture : (H, W, 3) uint8
    gauges : as they lie in it; none where the panel was not found
    places : the index of each needle among the page's needles, by name
    frame_px : the size of the whole frame to include, 0 for none
    has_crops : whether each gauge is cut out by itself
    """
    height, width = picture.shape[:2]
    box = (0, 0, width, height)
    if not gauges:
        return {"size": [width, height], "whole": _crop(picture, box, frame_px or WHOLE_PX)}
    found = [_gauge(picture, gauge, places, has_crop=has_crops) for gauge in gauges]
    return {
        "size": [width, height],
        "gauges": [gauge for gauge in found if gauge is not None],
        **({"frame": _crop(picture, box, frame_px)} if frame_px else {}),
    }


def _gauge(picture: ColourPicture, gauge: DrawnGauge, places: dict[str, int], *, has_crop: bool) -> Evidence | None:
    height, width = picture.shape[:2]
    left, top, right, bottom = gauge.part_px(REACH, (width, height))
    if right - left < 2 or bottom - top < 2:  # noqa: PLR2004 - it lies outside the frame
        return None
    return {
        "name": gauge.name,
        **(
            _crop(picture, (left, top, right, bottom), GAUGE_PX)
            if has_crop
            else {"box": [left, top, right - left, bottom - top]}
        ),
        "pivot": _rounded([gauge.pivot_px]),
        "rim": _rounded(gauge.rim_px[::RIM_STEP]),
        "needles": [
            {"at": places[reading.name], "line": None if reading.line_px is None else _rounded(reading.line_px)}
            for reading in gauge.readings
        ],
    }


def _crop(picture: ColourPicture, box: tuple[int, int, int, int], size_px: int) -> Evidence:
    """Cut a part out of a picture, at most `size_px` wide or high; `box` is left, top, right, bottom."""
    left, top, right, bottom = box
    part = picture[top:bottom, left:right]
    smaller = min(1.0, size_px / max(right - left, bottom - top))
    if smaller < 1.0:
        size = (max(1, round((right - left) * smaller)), max(1, round((bottom - top) * smaller)))
        part = np.asarray(cv2.resize(part, size, interpolation=cv2.INTER_AREA), np.uint8)
    return {"box": [left, top, right - left, bottom - top], "px": max(part.shape[:2]), "jpeg": jpeg_text(part)}


def jpeg_text(pixels: ColourPicture, quality: int = JPEG_QUALITY) -> str:
    """Encode a picture, (H, W) or (H, W, 3) uint8, as JPEG in base64."""
    stream = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(stream, "JPEG", quality=quality, optimize=True)
    return base64.b64encode(stream.getvalue()).decode()


def _rounded(points: Sequence[Point]) -> list[float]:
    """Return x and y alternating, with the origin at the pixel's corner as in a drawing."""
    return [round(coordinate + 0.5, 2) for point in points for coordinate in point]
