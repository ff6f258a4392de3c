"""The frame placer: where the panel lies in frames, and with it each gauge, or each gauge by itself."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from decoder.aligner import AlignedFrame
from decoder.alignment import Alignment, Matrix, Point
from decoder.dials_together import place_all
from decoder.errors import AlignmentLost, PictureError
from decoder.gauge_places import GaugePlacer
from decoder.picture_block import ROWS_OF_BLOCKS, TopOfFrame
from decoder.pictures import FramePicture, GreyPicture
from decoder.resampling import all_inside, as_places, each_inside, inside
from decoder.tuning import Tuning
from decoder.unwrapped_panel import UnwrappedPanel
from decoder.unwrapping import UnwrappedGauge, Unwrapper
from decoder.usual_place import Look, UsualPlace

# Rims are looked at in some points only; between these they bulge by less.
RIM_MARGIN_PX = 8
# The panel's lower end must not leave the rows that are decompressed where a camera shakes more than in the sample: so
# many pixels are allowed for that at least, so many times what it shakes there, and no more than so many.
LEAST_SHAKE_PX, SHAKES, MOST_SHAKE_PX = 2, 2, 16


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


Taken = FramePicture | TopOfFrame | PictureError
"""A frame as it was taken from the flight, or why there is none."""
Placed = tuple[GreyPicture, UnwrappedFrame]
"""A frame's grey levels, and where the panel lies in them."""


class _Kind(NamedTuple):
    """What frames have in common that are first looked at together; `rows` are those that are there."""

    size_px: tuple[int, int]
    rows: int
    focal_length_mm: float | None

    @classmethod
    def of(cls, frame: FramePicture | TopOfFrame) -> _Kind:
        rows, width = frame.pixels.shape
        return cls((width, frame.height_px), rows, frame.focal_length_mm)


class _FirstLook:
    """The first look at frames of a kind; without a place where they all take more than that."""

    def __init__(self, place: UsualPlace | None) -> None:
        self._place = place
        self._looks: dict[int, Sequence[Look]] = {}

    def take(self, number: int, frame: GreyPicture) -> None:
        looks = None if self._place is None else self._place.look_at(frame)
        if looks is not None:
            self._looks[number] = looks

    def alignments(self) -> dict[int, Alignment]:
        """By the number of the frame, of those where one was found."""
        if self._place is None or not self._looks:
            return {}
        found = zip(self._looks, self._place.find(list(self._looks.values())), strict=True)
        return {number: there for number, there in found if there is not None}


class FramePlacer:
    """Places frames of one panel with one tuning, of which it asks what `Tuning.places_as` compares."""

    def __init__(self, drawn: UnwrappedPanel, tuning: Tuning) -> None:
        source, grids = drawn.source, drawn.grids
        self.unwrapper = drawn.unwrapper
        self.aligner = drawn.aligner.at(tuning.usual)
        self._tuning, self._grids, self._own = tuning, grids, source.optics.own
        self._placers = [
            None if gauge.card is not None else GaugePlacer(gauge, grid.plane, source.picture, source.optics.own)
            for gauge, grid in zip(source.panel.gauges if tuning.dials_move else (), grids, strict=False)
        ]
        self._unwrappers = [Unwrapper([grid]) for grid in grids if tuning.dials_move]
        self._rims = drawn.rims
        self._all_rims = as_places(np.concatenate(self._rims, axis=1))

    def unwrap_many(self, frames: Iterable[Taken]) -> list[UnwrappedFrame | PictureError]:
        """Each frame aligned and unwrapped, or why it is not."""
        return [one if isinstance(one, PictureError) else self._with_gauges(*one) for one in self.placed(frames)]

    def _with_gauges(self, picture: GreyPicture, frame: UnwrappedFrame) -> UnwrappedFrame:
        if frame.gauges:
            return frame
        return replace(frame, gauges=self.unwrapper.unwrap(picture, frame.alignment))

    def placed(self, frames: Iterable[Taken]) -> list[Placed | PictureError]:
        """Each frame aligned, and unwrapped where each dial is found by itself; or why it is not."""
        taken: list[Taken] = []
        alike: dict[_Kind, _FirstLook] = {}
        for number, frame in enumerate(frames):  # looked at as they come, while they are in the processor's cache
            taken.append(frame)
            if not isinstance(frame, PictureError):
                kind = _Kind.of(frame)
                if kind not in alike:
                    alike[kind] = _FirstLook(self._usual_place(kind))
                alike[kind].take(number, frame.pixels)
        found: dict[int, UnwrappedFrame] = {}
        for kind, look in alike.items():
            found |= self._all_inside(kind, look.alignments())
        return [
            self._placed(frame)
            if isinstance(frame, PictureError) or number not in found
            else (frame.pixels, found[number])
            for number, frame in enumerate(taken)
        ]

    def alignment_noise(self, frames: Iterable[Taken]) -> float:
        """How many times as uncertain as they claim alignments of frames are, by those in which all matches."""
        found = [one for one in self.placed(frames) if not isinstance(one, PictureError)]
        own_px = self.aligner.optics.size_px
        return self.aligner.noise_beside_claim(
            AlignedFrame(pixels, there.size_px or own_px, there.focal_length_mm, there.alignment)
            for pixels, there in found
        )

    def _usual_place(self, kind: _Kind) -> UsualPlace | None:
        if self._tuning.dials_move:
            return None
        try:
            return self.aligner.usual_place(kind.size_px, kind.focal_length_mm)
        except PictureError:
            return None  # each frame says so itself

    def _all_inside(self, kind: _Kind, alignments: Mapping[int, Alignment]) -> dict[int, UnwrappedFrame]:
        """By number those of the frames in which the panel lies with all its gauges."""
        width, height_px = kind.size_px
        last_px = kind.rows - (RIM_MARGIN_PX if kind.rows < height_px else 0)
        are_inside = each_inside(self._all_rims, list(alignments.values()), width, last_px)
        return {
            number: UnwrappedFrame(there, (), [True] * len(self._rims), kind.focal_length_mm, kind.size_px)
            for (number, there), is_inside in zip(alignments.items(), are_inside, strict=True)
            if is_inside
        }

    def _placed(self, frame: Taken) -> Placed | PictureError:
        """A frame, and where the panel lies in it; unwrapped where each dial is to be found by itself."""
        try:
            if isinstance(frame, PictureError):
                return frame
            whole = frame.whole() if isinstance(frame, TopOfFrame) else frame
            place = self._unwrap_one_by_one if self._tuning.dials_move else self._aligned
            return whole.pixels, place(whole.pixels, whole.focal_length_mm)
        except PictureError as error:
            return error

    def _aligned(self, frame: GreyPicture, focal_length_mm: float | None) -> UnwrappedFrame:
        """A frame with its alignment, not unwrapped."""
        alignment = self.aligner.align(frame, focal_length_mm)
        height, width = frame.shape
        whole = [True] * len(self._rims)
        if not all_inside(self._all_rims, alignment, width, height):
            whole = [inside(rim, alignment, width, height) for rim in self._rims]
        return UnwrappedFrame(alignment, (), whole, focal_length_mm, (width, height))

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
        if self._tuning.anchors_agree:
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
        lifts = self._tuning.lifts or (0.0,) * len(self._grids)
        gauges, whole, shifts, sigmas = [], [], [], []
        places = place_all(self._placers, frame, alignment)
        for place, unwrapper, rim, lift in zip(places, self._unwrappers, self._rims, lifts, strict=True):
            there = alignment if place is None else place.alignment.after(_shift(place.shift_px, lift))
            gauges += unwrapper.unwrap(frame, there)
            whole.append(place is not None and inside(rim, there, width, height))
            shifts.append((0.0, 0.0) if place is None else place.shift_px)
            sigmas.append(0.0 if place is None else place.sigma_px)
        return UnwrappedFrame(alignment, gauges, whole, focal_length_mm, (width, height), shifts, sigmas)

    def rows_at_first(self) -> int | None:
        """As `rows_wanted` before any frame was seen: as if the camera stood where the panel picture was taken."""
        return self._rows([self._own], MOST_SHAKE_PX)

    def rows_wanted(self, alignments: Sequence[Alignment]) -> int | None:
        """How many rows from the top show all that is read of the panel in frames like these; None for all of them."""
        return self._rows(alignments, LEAST_SHAKE_PX)

    def _rows(self, alignments: Sequence[Alignment], least_shake_px: int) -> int | None:
        if self._tuning.dials_move or any(grid.raised is not None for grid in self._grids) or not alignments:
            return None
        points = np.concatenate([self._all_rims, as_places(self.aligner.outline())], axis=1)
        lowest_px = [float(alignment.places(points)[..., 1].max()) for alignment in alignments]
        shake_px = least_shake_px + SHAKES * (max(lowest_px) - min(lowest_px))
        margin_px = RIM_MARGIN_PX + min(shake_px, MOST_SHAKE_PX)
        blocks = math.ceil((max(lowest_px) + margin_px) / ROWS_OF_BLOCKS)
        return max(blocks, 1) * ROWS_OF_BLOCKS


def _shift(shift_px: Point, part: float) -> Matrix:
    return np.array([[1.0, 0.0, part * shift_px[0]], [0.0, 1.0, part * shift_px[1]], [0.0, 0.0, 1.0]])
