"""The panel reader: one frame in, the readings of all needles out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from decoder.alignment import Alignment, Matrix, Point
from decoder.arrays import Floats
from decoder.card_reader import CardReader
from decoder.errors import AlignmentLost, PictureError
from decoder.gauge_places import GaugePlacer, place_all
from decoder.gauge_reader import GaugeReader
from decoder.many_frames import GaugesOfFrame, ManyFrames, PlacedFrame, UnwrappedGauges
from decoder.method import Method
from decoder.panel_pictures import PanelPictures
from decoder.panel_tuning import tuning_from_panel
from decoder.picture_block import ROWS_OF_BLOCKS, PictureBlock, TopOfFrame
from decoder.pictures import FramePicture, GreyPicture
from decoder.pivots import with_lines_checked
from decoder.place_uncertainty import PlaceUncertainty
from decoder.reading import Reading
from decoder.resampling import inside
from decoder.tuning import Tuning
from decoder.unwrapping import UnwrappedGauge, Unwrapper

# Rims are looked at in some points only; between these they bulge by less.
RIM_MARGIN_PX = 8
# How far a camera may shake without the panel's lower end leaving the rows that are decompressed.
TOP_MARGIN_PX = 24


@dataclass(frozen=True, slots=True)
class UnwrappedFrame:
    """One frame's alignment, and its unwrapped gauges in the panel's order.

    `whole` tells for each gauge whether all of it lies in the frame; `focal_length_mm` and `size_px` are the frame's.
    `dial_shifts_px` are how far dials that were found by themselves lie from where the anchors have them, and
    `dial_sigmas_px` how uncertain that is.
    """

    alignment: Alignment
    gauges: Sequence[UnwrappedGauge]
    whole: Sequence[bool]
    focal_length_mm: float | None = None
    size_px: tuple[int, int] | None = None
    dial_shifts_px: Sequence[Point] = ()
    dial_sigmas_px: Sequence[float] = ()


@dataclass(frozen=True, slots=True)
class FrameReadings:
    """One frame's alignment, and its readings by needle.

    `alignment_sigma_px` is how uncertain the place of each gauge is, in the panel's order. `dial_shifts_px` are how far
    the needles of dials that were found by themselves lie from where the alignment has them, (x, y) in the panel
    picture's pixels; empty where all lie where it says.
    """

    alignment: Alignment
    readings: Mapping[str, Reading]
    alignment_sigma_px: Sequence[float] = ()
    dial_shifts_px: Sequence[Point] = ()


class PanelReader:
    """Reads frames with one panel, one tuning and one method; keeps nothing from frame to frame."""

    def __init__(self, source: PanelPictures, method: Method, tuning: Tuning) -> None:
        source = source.with_planes()
        optics = source.optics
        self.source = source
        self.method = method
        self.tuning = tuning
        self.grids = [source.grid(index) for index in range(len(source.panel.gauges))]
        self.block = PictureBlock()
        self.aligner = source.aligner(tuning.usual)
        self._places = PlaceUncertainty(source, tuning)
        self._placers = [
            None if gauge.card is not None else GaugePlacer(gauge, grid.plane, source.picture, optics.own)
            for gauge, grid in zip(source.panel.gauges if tuning.dials_move else (), self.grids, strict=False)
        ]
        self._radii_px = np.array([sum(gauge.radius) / 2 for gauge in source.panel.gauges])
        self._unwrappers = [Unwrapper([grid]) for grid in self.grids if tuning.dials_move]
        self._rims = [grid.rim() for grid in self.grids]
        self._all_rims = np.concatenate(self._rims, axis=1)
        self._gauges = [
            CardReader(gauge, gauge.card, grid, tuning.cards[gauge.card.name])
            if gauge.card is not None
            else GaugeReader(
                gauge,
                grid,
                {needle.name: tuning.templates[needle.name] for needle in gauge.needles},
                face,
                method,
                evenly_lit_score=tuning.evenly_lit_score,
            )
            for gauge, grid, face in zip(source.panel.gauges, self.grids, tuning.faces, strict=True)
        ]

    @classmethod
    def from_panel(cls, source: PanelPictures, method: Method) -> Self:
        """A reader with the templates as the panel gives them.

        Raises
        ------
        PanelError
            If a template, an anchor or the level edge does not fit the panel picture.
        """
        return cls(source, method, tuning_from_panel(source))

    def tuned(self, tuning: Tuning) -> PanelReader:
        """The same reader with another tuning."""
        return PanelReader(self.source, self.method, tuning)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the panel leaves wanting, a sentence each."""
        return tuple(filter(None, [self.aligner.shortcoming, self.source.optics.shortcoming]))

    def unwrap(self, frame: GreyPicture, focal_length_mm: float | None = None) -> UnwrappedFrame:
        """A frame aligned and unwrapped; `focal_length_mm` is its own, if it tells.

        Raises
        ------
        PictureError
            If the frame is of another shape than the panel picture, or the panel is not found in it.
        """
        (unwrapped,) = self.unwrap_many([FramePicture(frame, focal_length_mm)])
        if isinstance(unwrapped, PictureError):
            raise unwrapped
        return unwrapped

    def unwrap_many(self, frames: Sequence[FramePicture]) -> list[UnwrappedFrame | PictureError]:
        """Each frame aligned and unwrapped, or why it is not."""
        placed = [
            self._placed(frame) if there is None else (frame.pixels, there)
            for frame, there in zip(frames, self._at_first_look(frames), strict=True)
        ]
        return [one if isinstance(one, PictureError) else self._with_gauges(*one) for one in placed]

    def _with_gauges(self, picture: GreyPicture, frame: UnwrappedFrame) -> UnwrappedFrame:
        if frame.gauges:
            return frame
        return replace(frame, gauges=self.unwrapper.unwrap(picture, frame.alignment))

    def dial_shifts_px(self, frame: GreyPicture, focal_length_mm: float | None = None) -> list[Point | None]:
        """How far each gauge's own marks lie from where the anchors have it; None where they are not found.

        Raises
        ------
        PictureError
            As `unwrap`.
        """
        alignment = self._near(frame, focal_length_mm)
        places = place_all(self._placers, frame, alignment)
        return [None if place is None else place.shift_px for place in places]

    def _near(self, frame: GreyPicture, focal_length_mm: float | None) -> Alignment:
        """Where dials are looked for one by one: where all anchors have them, or else most of them roughly."""
        if self.tuning.anchors_agree:
            try:
                alignment = self.aligner.align(frame, focal_length_mm)
            except AlignmentLost:
                return self.aligner.align_roughly(frame, focal_length_mm)
            if self.aligner.agrees(alignment):
                return alignment
        return self.aligner.align_roughly(frame, focal_length_mm)

    def _unwrap_one_by_one(self, frame: GreyPicture, focal_length_mm: float | None) -> UnwrappedFrame:
        """Each gauge where its own marks are; one whose marks are not found is not read."""
        alignment = self._near(frame, focal_length_mm)
        height, width = frame.shape
        lifts = self.tuning.lifts or (0.0,) * len(self.grids)
        gauges, whole, shifts, sigmas = [], [], [], []
        places = place_all(self._placers, frame, alignment)
        for place, unwrapper, rim, lift in zip(places, self._unwrappers, self._rims, lifts, strict=True):
            there = alignment if place is None else place.alignment.after(_shift(place.shift_px, lift))
            gauges += unwrapper.unwrap(frame, there)
            whole.append(place is not None and inside(rim, there, width, height))
            shifts.append((0.0, 0.0) if place is None else place.shift_px)
            sigmas.append(0.0 if place is None else place.sigma_px)
        return UnwrappedFrame(alignment, gauges, whole, focal_length_mm, (width, height), shifts, sigmas)

    def read(self, frame: GreyPicture, focal_length_mm: float | None = None) -> FrameReadings:
        """The readings of one frame.

        Raises
        ------
        PictureError
            As `unwrap`.
        """
        (read,) = self.read_many([FramePicture(frame, focal_length_mm)])
        if isinstance(read, PictureError):
            raise read
        return read

    def read_many(
        self, frames: Iterable[FramePicture | TopOfFrame | PictureError]
    ) -> list[FrameReadings | PictureError]:
        """The readings of each frame, or why there are none; to the bit the same whatever the frames beside it."""
        taken = list(frames)
        placed = [
            (frame.pixels, there) if there is not None and not isinstance(frame, PictureError) else self._placed(frame)
            for frame, there in zip(taken, self._at_first_look(taken), strict=True)
        ]
        gauges = [self._gauges_of(*one) for one in placed if not isinstance(one, PictureError)]
        own = iter(self._many_frames.read(gauges))
        return [one if isinstance(one, PictureError) else self._composed(one[1], next(own)) for one in placed]

    def _at_first_look(self, frames: Sequence[FramePicture | TopOfFrame | PictureError]) -> list[UnwrappedFrame | None]:
        """Where the panel lies in those frames in which it lies where it usually does, gauges and all."""
        found: list[UnwrappedFrame | None] = [None] * len(frames)
        if self.tuning.dials_move:
            return found
        alike: dict[tuple[object, ...], list[int]] = {}
        for index, frame in enumerate(frames):
            if not isinstance(frame, PictureError):
                key = (*frame.pixels.shape, frame.height_px, frame.focal_length_mm)
                alike.setdefault(key, []).append(index)
        for own in alike.values():
            pictures = [frame for frame in (frames[index] for index in own) if not isinstance(frame, PictureError)]
            for index, there in zip(own, self._all_where_usual(pictures), strict=True):
                found[index] = there
        return found

    def _all_where_usual(self, frames: Sequence[FramePicture | TopOfFrame]) -> list[UnwrappedFrame | None]:
        """The same for frames of one size and zoom."""
        (height, width), height_px = frames[0].pixels.shape, frames[0].height_px
        focal_length_mm = frames[0].focal_length_mm
        try:
            alignments = self.aligner.align_usual([frame.pixels for frame in frames], height_px, focal_length_mm)
        except PictureError:
            return [None] * len(frames)  # each frame says so itself
        last_px = height - (RIM_MARGIN_PX if height < height_px else 0)
        return [
            UnwrappedFrame(there, (), [True] * len(self._rims), focal_length_mm, (width, height_px))
            if there is not None and inside(self._all_rims, there, width, last_px)
            else None
            for there in alignments
        ]

    def _placed(
        self, frame: FramePicture | TopOfFrame | PictureError
    ) -> tuple[GreyPicture, UnwrappedFrame] | PictureError:
        """A frame, and where the panel lies in it; unwrapped where each dial is to be found by itself."""
        try:
            if isinstance(frame, PictureError):
                return frame
            whole = frame.whole() if isinstance(frame, TopOfFrame) else frame
            place = self._unwrap_one_by_one if self.tuning.dials_move else self._aligned
            return whole.pixels, place(whole.pixels, whole.focal_length_mm)
        except PictureError as error:
            return error

    def rows_wanted(self, samples: Sequence[UnwrappedFrame]) -> int | None:
        """How many rows from the top show all that is read of the panel in frames like these; None for all of them."""
        if self.tuning.dials_move or any(grid.raised is not None for grid in self.grids) or not samples:
            return None
        points = np.ascontiguousarray(np.concatenate([self._all_rims, self.aligner.outline()], axis=1).T[None])
        lowest_px = max(float(sample.alignment.places(points)[..., 1].max()) for sample in samples)
        blocks = math.ceil((lowest_px + TOP_MARGIN_PX) / ROWS_OF_BLOCKS)
        return max(blocks, 1) * ROWS_OF_BLOCKS

    @staticmethod
    def _gauges_of(picture: GreyPicture, frame: UnwrappedFrame) -> GaugesOfFrame:
        if frame.gauges:
            return UnwrappedGauges(frame.gauges, frame.whole)
        return PlacedFrame(picture, frame.alignment, frame.whole)

    @cached_property
    def unwrapper(self) -> Unwrapper:
        """Of all gauges."""
        return Unwrapper(self.grids)

    @cached_property
    def _many_frames(self) -> ManyFrames:
        is_quick = self.method is Method.NORMXCORR
        return ManyFrames(self.source.panel.gauges, self.grids, self.tuning, self._gauges, is_quick=is_quick)

    def _aligned(self, frame: GreyPicture, focal_length_mm: float | None) -> UnwrappedFrame:
        """A frame with its alignment, not unwrapped."""
        alignment = self.aligner.align(frame, focal_length_mm)
        height, width = frame.shape
        whole = [True] * len(self._rims)
        if not inside(self._all_rims, alignment, width, height):
            whole = [inside(rim, alignment, width, height) for rim in self._rims]
        return UnwrappedFrame(alignment, (), whole, focal_length_mm, (width, height))

    def read_unwrapped(self, unwrapped: UnwrappedFrame) -> FrameReadings:
        """The readings of a frame that is unwrapped already."""
        (read,) = self.read_all_unwrapped([unwrapped])
        return read

    def read_all_unwrapped(self, frames: Sequence[UnwrappedFrame]) -> list[FrameReadings]:
        """The readings of frames that are unwrapped already."""
        own = self._many_frames.read(UnwrappedGauges(frame.gauges, frame.whole) for frame in frames)
        return [self._composed(frame, readings) for frame, readings in zip(frames, own, strict=True)]

    def found_in(self, frames: Sequence[UnwrappedFrame]) -> list[Mapping[str, Reading]]:
        """By frame what its gauges' readers find by needle; what dials' places add to it is left out."""
        own = self._many_frames.read(UnwrappedGauges(frame.gauges, frame.whole) for frame in frames)
        return [{name: reading for gauge in gauges for name, reading in gauge.items()} for gauges in own]

    def _composed(self, unwrapped: UnwrappedFrame, own_readings: Sequence[Mapping[str, Reading]]) -> FrameReadings:
        """Readings by gauge, with what the places of their dials add to their uncertainty."""
        readings: dict[str, Reading] = {}
        sigma_px = self._dial_sigmas_px(unwrapped)
        sigmas_deg = np.degrees(sigma_px / self._radii_px).tolist()
        for own, sigma_deg in zip(self._lines_checked(unwrapped, own_readings), sigmas_deg, strict=True):
            for name, reading in own.items():
                total_deg = math.hypot(reading.sigma_deg, sigma_deg)
                readings[name] = Reading(reading.status, reading.angle_deg, total_deg, reading.score)
        shifts_px = self._needle_shifts_px(unwrapped)
        return FrameReadings(unwrapped.alignment, readings, tuple(sigma_px.tolist()), shifts_px)

    def _lines_checked(
        self, unwrapped: UnwrappedFrame, own_readings: Sequence[Mapping[str, Reading]]
    ) -> Sequence[Mapping[str, Reading]]:
        """Where dials are found by themselves, each needle's line held against its pivot."""
        tuning, gauges = self.tuning, self.source.panel.gauges
        if not tuning.pivots:
            return own_readings
        return [
            with_lines_checked(strip, readings, gauge, grid, face=face, templates=tuning.templates, pivot=pivot)
            for gauge, grid, face, pivot, strip, readings in zip(
                gauges, self.grids, tuning.faces, tuning.pivots, unwrapped.gauges, own_readings, strict=True
            )
        ]

    def _needle_shifts_px(self, unwrapped: UnwrappedFrame) -> tuple[Point, ...]:
        """How far the needles of each gauge lie from where the alignment has them: their dial's shift, and the lift."""
        shifts_px = unwrapped.dial_shifts_px
        lifts = self.tuning.lifts or (0.0,) * len(self.grids)
        return tuple((x * (1.0 + lift), y * (1.0 + lift)) for (x, y), lift in zip(shifts_px, lifts, strict=False))

    def _dial_sigmas_px(self, unwrapped: UnwrappedFrame) -> Floats:
        """(gauges,): how uncertain the place of each dial is, in the panel picture's pixels."""
        if unwrapped.dial_sigmas_px:
            return np.array(unwrapped.dial_sigmas_px)
        return self._places.sigma_px(unwrapped.alignment)


def _shift(shift_px: Point, part: float) -> Matrix:
    return np.array([[1.0, 0.0, part * shift_px[0]], [0.0, 1.0, part * shift_px[1]], [0.0, 0.0, 1.0]])
