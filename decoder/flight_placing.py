"""Placing a flight: where its camera stands, and whether its dials move against the anchors, as a sample shows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from decoder.alignment import Alignment, Matrix
from decoder.errors import PictureError
from decoder.first_sight import FirstSight
from decoder.flight_tuning import SAMPLE_FRAMES, taken, unwrapped
from decoder.frame_placer import UnwrappedFrame
from decoder.panel_reader import PanelReader
from decoder.picture_block import TopOfFrame
from decoder.pictures import FramePicture, GreyPicture
from decoder.tuning import Tuning

# With so many of the sampled frames found there is no need to look for the camera elsewhere.
MIN_FOUND = 8
SIGHTS = 3
# Where anchors and dials move against each other, needles tell less of their pivots.
MORE_FRAMES = 3 * SAMPLE_FRAMES
# A camera that moves by less than this at the panel picture's corners shows no depth.
STILL_PX = 6.0
LOOKED_AT = 6
# Dials that lie this near to where the anchors have them are where they should be.
IN_PLACE_PX = 0.05

Sample = Callable[[int], Iterable[GreyPicture | FramePicture | TopOfFrame]]
"""Gives so many frames, spread over the flight; the same ones each time. Of each the first rows may be all there is."""


def placed_for(reader: PanelReader, sample: Sample) -> tuple[PanelReader, list[UnwrappedFrame]]:
    """The reader, told where the camera stands and whether dials move, and the sample as it unwraps it."""
    samples = unwrapped(reader, sample(SAMPLE_FRAMES))
    usual = None if len(samples) >= MIN_FOUND else _first_sight(reader, sample, len(samples))
    if usual is not None:
        reader = reader.tuned(replace(reader.tuning, usual=usual))
        samples = unwrapped(reader, sample(SAMPLE_FRAMES))
    if _camera_moves(reader, samples):
        agree = _anchors_agree(reader, samples)
        one_by_one = reader.tuned(replace(reader.tuning, dials_move=True, anchors_agree=agree))
        if _dials_move(one_by_one, sample):
            return one_by_one, unwrapped(one_by_one, sample(frames_wanted(one_by_one.tuning)))
    return reader, samples


def frames_wanted(tuning: Tuning) -> int:
    """How many frames a sample is to have."""
    return MORE_FRAMES if tuning.dials_move and not tuning.anchors_agree else SAMPLE_FRAMES


def _pictures(frames: Iterable[GreyPicture | FramePicture | TopOfFrame]) -> Iterator[FramePicture]:
    """The frames of a sample, whole."""
    for frame in taken(frames):
        try:
            yield frame.whole() if isinstance(frame, TopOfFrame) else frame
        except PictureError:
            continue  # damaged below its first rows: reported when the flight is read


def _camera_moves(reader: PanelReader, samples: Sequence[UnwrappedFrame]) -> bool:
    """Whether the camera stands so far from where the panel picture was taken that depth may show."""
    height, width = reader.source.picture.shape
    corners = [(x, y) for x in (0.0, float(width)) for y in (0.0, float(height))]
    shifts_px = [math.dist(corner, sample.alignment.to_frame(corner)) for sample in samples for corner in corners]
    return max(shifts_px, default=0.0) > STILL_PX


def _anchors_agree(reader: PanelReader, samples: Sequence[UnwrappedFrame]) -> bool:
    """Whether all anchors tell the same, in most frames."""
    return 2 * sum(reader.aligner.agrees(sample.alignment) for sample in samples) > len(samples)


def _dials_move(reader: PanelReader, sample: Sample) -> bool:
    """Whether dials lie elsewhere than the anchors have them, in some of the sampled frames."""
    shifts_px: list[float] = []
    frames = 0
    for frame in _pictures(sample(SAMPLE_FRAMES)):
        try:
            shifts = reader.placer.dial_shifts_px(frame.pixels, frame.focal_length_mm)
        except PictureError:
            continue
        shifts_px += [math.hypot(*shift) for shift in shifts if shift is not None]
        frames += 1
        if frames == LOOKED_AT:
            break
    return bool(shifts_px) and float(np.sqrt(np.mean(np.square(shifts_px)))) > IN_PLACE_PX


def _first_sight(reader: PanelReader, sample: Sample, found: int) -> Alignment | None:
    """Where the camera stands, by the first frames that first sight makes out; None where it makes out too few."""
    if 2 * found >= sum(1 for _ in sample(SAMPLE_FRAMES)):
        return None
    optics, sight = reader.aligner.optics, FirstSight(reader.source.picture)
    seen: list[Matrix] = []
    for frame in _pictures(sample(SAMPLE_FRAMES)):
        height, width = frame.pixels.shape
        try:
            zoom = optics.zoom(frame.focal_length_mm, (width, height))
        except PictureError:
            continue  # of another shape, or a zoom that is not calibrated: reported when the flight is read
        motion = sight.find(frame.pixels)
        if motion is not None:
            at_panels_zoom = np.linalg.inv(zoom) @ motion
            seen.append(at_panels_zoom / at_panels_zoom[2, 2])
        if len(seen) == SIGHTS:
            break
    if not seen:
        return None
    apart = [sum(float(np.abs(one - other)[:2, 2].sum()) for other in seen) for one in seen]
    return Alignment.of(seen[int(np.argmin(apart))], 1.0)
