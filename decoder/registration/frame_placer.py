"""The frame placer: locates the panel in frames, and with it each gauge, or each gauge by itself."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from typing import NamedTuple

import numpy as np

from decoder.imaging.alignment import Alignment, Matrix, Point
from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.picture_block import ROWS_OF_BLOCKS, TopOfFrame
from decoder.imaging.pictures import FramePicture, GreyPicture
from decoder.imaging.resampling import as_places, each_inside, inside
from decoder.imaging.unwrapping import UnwrappedGauge, Unwrapper, WindowGrid
from decoder.panel.arrays import Floats
from decoder.panel.errors import AlignmentLost, PanelError, PictureError
from decoder.registration.aligner import Aligner
from decoder.registration.dial_places import GaugePlacer, at_consensus, place_all
from decoder.registration.placement import Placement
from decoder.registration.registration import Look
from decoder.registration.seen_panel import SeenPanel
from decoder.registration.thresholds import MOST_SAMPLES

# Rims are tested at a few points only; between these they bulge by less than this.
RIM_MARGIN_PX = 8
# The panel's lower end must stay within the rows that are decompressed even if a camera shakes more than in the sample.
# The margin is at least this many pixels plus this many times the shake in the sample, and at most one row of blocks.
LEAST_SHAKE_PX, SHAKES = 2, 2


Taken = FramePicture | TopOfFrame | PictureError
"""A frame as it was taken from the flight, or why there is none."""


class UnwrappedPanel:
    """The grids of a panel's gauges, and the panel picture on them, by gauge.

    `aligner` is by the same anchors, if there is one already.

    Raises
    ------
    PanelError
        If reference points or a rim determine no plane, or a needle's height is unusable; or if gauges have too many
        pixels, together or a single window.
    """

    def __init__(self, source: PanelPictures, aligner: Aligner | None = None) -> None:
        self.source = source.with_planes()
        self._aligner = aligner
        self.grids = [self.source.grid(index) for index in range(len(self.source.panel.gauges))]
        samples = sum(grid.rows * grid.columns for grid in self.grids)
        # Whole windows are sampled, in all frames of a sample at once, so one may take only a part of all samples.
        for index, grid in enumerate(self.grids):
            if isinstance(grid, WindowGrid) and grid.rows * grid.columns > MOST_SAMPLES // 8:
                million = grid.rows * grid.columns / 1e6
                problem = f"covers {million:.1f} million pixels with what is around it, more than a window may"
                raise PanelError(f"gauges[{index}].window", f"{problem}; draw it close around what is read")
        if samples > MOST_SAMPLES:
            problem = (
                f"cover {samples / 1e6:.0f} million pixels unwrapped, more than {MOST_SAMPLES // 10**6} million;"
                " make the panel picture smaller"
            )
            raise PanelError("gauges", problem)
        self.unwrapper = Unwrapper(self.grids)

    @cached_property
    def aligner(self) -> Aligner:
        """Finds the panel in frames, whose camera may be anywhere.

        Raises
        ------
        PanelError
            If an anchor or the level edge does not fit the panel picture.
        """
        if self._aligner is not None:
            return self._aligner.around(self.source.panel.gauges)
        return Aligner(self.source.panel, self.source.picture, optics=self.source.optics)

    @cached_property
    def rims(self) -> list[Floats]:
        """By gauge, as `PolarGrid.rim`."""
        return [grid.rim() for grid in self.grids]

    @cached_property
    def gauges(self) -> list[UnwrappedGauge]:
        """As the panel picture shows them; dials as sharp as frames show them, if that is known."""
        source, own = self.source, self.source.optics.own
        shown = self.unwrapper.unwrap(source.picture, own, partial(source.in_colour, source.panel.picture))
        if source.blurred is None:
            return shown
        dials = self.unwrapper.unwrap(source.dials, own, source.dials_in_colour)
        parts = zip(self.grids, dials, shown, strict=True)
        return [window if isinstance(grid, WindowGrid) else dial for grid, dial, window in parts]


@dataclass(frozen=True, slots=True)
class UnwrappedFrame:
    """One frame's alignment, and its unwrapped gauges in the panel's order.

    `whole` says for each gauge whether all of it lies in the frame; `focal_length_mm` and `size_px` are the frame's.
    For dials that are located by themselves, `dial_shifts_px` are how far they lie from where the anchors put them,
    `dial_sigmas_px` the uncertainty of that, and `dial_alignments` where they lie; None for one that was not found.
    """

    alignment: Alignment
    gauges: Sequence[UnwrappedGauge]
    whole: Sequence[bool]
    focal_length_mm: float | None = None
    size_px: tuple[int, int] | None = None
    dial_shifts_px: Sequence[Point] = ()
    dial_sigmas_px: Sequence[float] = ()
    dial_alignments: Sequence[Alignment | None] = ()

    def alignment_of(self, gauge_index: int) -> Alignment | None:
        """Return where a gauge lies; None if it is located by itself and was not found."""
        return self.dial_alignments[gauge_index] if self.dial_alignments else self.alignment


Placed = tuple[FramePicture | TopOfFrame, UnwrappedFrame]
"""A frame, and where the panel lies in it."""


class _Kind(NamedTuple):
    """What frames that are first looked at together have in common; `rows` is how many of them are decompressed."""

    size_px: tuple[int, int]
    rows: int
    focal_length_mm: float | None

    @classmethod
    def of(cls, frame: FramePicture | TopOfFrame) -> _Kind:
        rows, width = frame.pixels.shape
        return cls((width, frame.height_px), rows, frame.focal_length_mm)

    @property
    def is_whole(self) -> bool:
        """Whether all rows are decompressed."""
        return self.rows == self.size_px[1]


class FramePlacer:
    """Locates the panel in frames, with the parts of a `Placement` that `Placement.searches_as` compares."""

    def __init__(self, drawn: UnwrappedPanel, placement: Placement) -> None:
        source, grids = drawn.source, drawn.grids
        self.unwrapper = drawn.unwrapper
        self.aligner = drawn.aligner.at(placement.usual, is_upright=placement.is_upright)
        self._placement, self._grids, self._own = placement, grids, source.optics.own
        self._placers = [
            GaugePlacer(gauge, grid.plane, source.picture, source.optics.own) if gauge.kind.has_still_face else None
            for gauge, grid in zip(source.panel.gauges if placement.dials_move else (), grids, strict=False)
        ]
        self._unwrappers = [Unwrapper([grid]) for grid in grids if placement.dials_move]
        self._rims = drawn.rims
        self._all_rims = as_places(np.concatenate(self._rims, axis=1))

    def unwrap_many(self, frames: Iterable[Taken]) -> list[UnwrappedFrame | PictureError]:
        """Align and unwrap each frame, or say why not."""
        return [one if isinstance(one, PictureError) else self._with_gauges(*one) for one in self.placed(frames)]

    def _with_gauges(self, picture: FramePicture | TopOfFrame, frame: UnwrappedFrame) -> UnwrappedFrame:
        if frame.gauges:
            return frame
        return replace(frame, gauges=self.unwrapper.unwrap(picture.pixels, frame.alignment, picture.in_colour))

    def placed(self, frames: Iterable[Taken]) -> list[Placed | PictureError]:
        """Align each frame, and unwrap it if dials are located by themselves; or say why not."""
        taken: list[Taken] = []
        alike: dict[_Kind, tuple[SeenPanel | None, dict[int, Look]]] = {}
        for number, frame in enumerate(frames):  # looked at as they arrive, while they are in the processor's cache
            taken.append(frame)
            if not isinstance(frame, PictureError):
                kind = _Kind.of(frame)
                if kind not in alike:
                    alike[kind] = self._seen(kind), {}
                seen, looks = alike[kind]
                look = None if seen is None else seen.look_at(frame.pixels, is_whole=kind.is_whole)
                if look is not None and (kind.is_whole or None not in look.patches):
                    looks[number] = look
        alignments: dict[int, Alignment | None] = {}
        inside_all: dict[int, UnwrappedFrame] = {}
        for kind, (seen, looks) in alike.items():
            if seen is not None and looks:
                found = dict(zip(looks, seen.as_usual(list(looks.values())), strict=True))
                alignments |= found
                known = {number: there for number, there in found.items() if there is not None}
                inside_all |= self._all_inside(kind, known)
        return [
            (frame, inside_all[number])
            if not isinstance(frame, PictureError) and number in inside_all
            else self._placed(frame, [alignments[number]] if number in alignments else [])
            for number, frame in enumerate(taken)
        ]

    def _seen(self, kind: _Kind) -> SeenPanel | None:
        """Return the panel as such frames usually show it; None if each frame has to be searched by itself."""
        if self._placement.dials_move:
            return None
        try:
            return self.aligner.seen_at(kind.focal_length_mm, kind.size_px)
        except PictureError:
            return None  # each frame says so itself

    def _all_inside(self, kind: _Kind, alignments: Mapping[int, Alignment]) -> dict[int, UnwrappedFrame]:
        """Return, by number, those of the frames that contain the panel with all its gauges."""
        width, height_px = kind.size_px
        last_px = kind.rows - (RIM_MARGIN_PX if kind.rows < height_px else 0)
        are_inside = each_inside(self._all_rims, list(alignments.values()), width, last_px)
        return {
            number: UnwrappedFrame(there, (), [True] * len(self._rims), kind.focal_length_mm, kind.size_px)
            for (number, there), is_inside in zip(alignments.items(), are_inside, strict=True)
            if is_inside
        }

    def _placed(self, frame: Taken, looked: Sequence[Alignment | None]) -> Placed | PictureError:
        """Return a frame and where the panel lies in it; unwrapped if dials are located by themselves.

        `looked` is the result of looking at the panel's usual place, if that was done; it is not repeated.
        """
        try:
            if isinstance(frame, PictureError):
                return frame
            whole = frame.whole() if isinstance(frame, TopOfFrame) else frame
            if self._placement.dials_move:
                return whole, self._unwrap_one_by_one(whole)
            align = self.aligner.search if looked else self.aligner.align
            alignment = next(filter(None, looked), None) or align(whole.pixels, whole.focal_length_mm)
        except PictureError as error:
            return error
        height, width = whole.pixels.shape
        are_inside = [inside(rim, alignment, width, height) for rim in self._rims]
        return whole, UnwrappedFrame(alignment, (), are_inside, whole.focal_length_mm, (width, height))

    def dial_shifts_px(self, frame: GreyPicture, focal_length_mm: float | None = None) -> list[Point | None]:
        """Return how far each gauge's own marks lie from where the anchors put it; None where they are not found.

        Raises
        ------
        PictureError
            As `unwrap`.
        """
        alignment, _ = self._near(frame, focal_length_mm)
        places = place_all(self._placers, frame, alignment)
        return [None if place is None else place.shift_px for place in places]

    def _near(self, frame: GreyPicture, focal_length_mm: float | None) -> tuple[Alignment, bool]:
        """Return where to search for dials one by one, and whether all anchors put them there, not a few roughly."""
        if self._placement.anchors_agree:
            with suppress(AlignmentLost):
                alignment = self.aligner.align(frame, focal_length_mm)
                if self.aligner.agrees(alignment):
                    return alignment, True
        return self.aligner.align_roughly(frame, focal_length_mm), False

    def _unwrap_one_by_one(self, picture: FramePicture) -> UnwrappedFrame:
        """Unwrap each gauge where its own marks are or, if they are not found, where most others are."""
        frame, focal_length_mm = picture.pixels, picture.focal_length_mm
        alignment, is_by_all = self._near(frame, focal_length_mm)
        height, width = frame.shape
        in_colour = cache(picture.in_colour)
        lifts = self._placement.lifts or (0.0,) * len(self._grids)
        gauges, whole, shifts, sigmas, alignments = [], [], [], [], []
        found, apart_px = place_all(self._placers, frame, alignment), self._placement.apart_px if is_by_all else ()
        places = at_consensus(self._placers, found, alignment, apart_px)
        for place, unwrapper, rim, lift in zip(places, self._unwrappers, self._rims, lifts, strict=True):
            there = alignment if place is None else place.alignment.after(_shift(place.shift_px, lift))
            gauges += unwrapper.unwrap(frame, there, in_colour)
            whole.append(place is not None and inside(rim, there, width, height))
            shifts.append((0.0, 0.0) if place is None else place.shift_px)
            sigmas.append(0.0 if place is None else place.sigma_px)
            alignments.append(None if place is None else there)
        return UnwrappedFrame(alignment, gauges, whole, focal_length_mm, (width, height), shifts, sigmas, alignments)

    def rows_at_first(self) -> int | None:
        """Do as `rows_wanted` before any frame was seen, as if the camera stood where the panel picture was taken."""
        return self._rows([self._own], ROWS_OF_BLOCKS)

    def rows_wanted(self, alignments: Sequence[Alignment]) -> int | None:
        """Return how many rows from the top show all that is read in frames like these; None for all of them."""
        return self._rows(alignments, LEAST_SHAKE_PX)

    def _rows(self, alignments: Sequence[Alignment], least_shake_px: int) -> int | None:
        if self._placement.dials_move or any(grid.raised is not None for grid in self._grids) or not alignments:
            return None
        points = np.concatenate([self._all_rims, as_places(self.aligner.outline())], axis=1)
        lowest_px = [float(alignment.places(points)[..., 1].max()) for alignment in alignments]
        shake_px = least_shake_px + SHAKES * (max(lowest_px) - min(lowest_px))
        margin_px = RIM_MARGIN_PX + min(shake_px, ROWS_OF_BLOCKS)
        blocks = math.ceil((max(lowest_px) + margin_px) / ROWS_OF_BLOCKS)
        return max(blocks, 1) * ROWS_OF_BLOCKS


def _shift(shift_px: Point, part: float) -> Matrix:
    return np.array([[1.0, 0.0, part * shift_px[0]], [0.0, 1.0, part * shift_px[1]], [0.0, 0.0, 1.0]])
