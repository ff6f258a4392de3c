"""The panel reader: one frame in, the readings of all needles out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from decoder.aligner import Aligner
from decoder.alignment import Alignment, Point
from decoder.card_reader import CardReader
from decoder.errors import PictureError
from decoder.frame_placer import FramePlacer, Taken, UnwrappedFrame
from decoder.gauge_reader import GaugeReader
from decoder.many_frames import GaugesOfFrame, ManyFrames, PlacedFrame, UnwrappedGauges, quick_grids_of
from decoder.method import Method
from decoder.panel_pictures import PanelPictures
from decoder.panel_tuning import tuning_from_panel
from decoder.picture_block import PictureBlock
from decoder.pictures import FramePicture, GreyPicture
from decoder.pivots import with_lines_checked
from decoder.place_uncertainty import PlaceUncertainty
from decoder.quick_pixels import QuickGrids
from decoder.reading import Reading, Status
from decoder.tuning import Tuning
from decoder.unwrapped_panel import UnwrappedPanel
from decoder.unwrapping import PolarGrid, UnwrappedGauge

# A needle that was found in few frames must match like one that was learned.
DOUBTED_SCORE = 0.95


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

    def __init__(
        self, source: PanelPictures, method: Method, tuning: Tuning, drawn: UnwrappedPanel | None = None
    ) -> None:
        self._drawn = drawn or UnwrappedPanel(source)
        self.source = self._drawn.source
        self.method = method
        self.tuning = tuning
        self.block = PictureBlock()

    @classmethod
    def from_panel(cls, source: PanelPictures, method: Method) -> Self:
        """A reader with the templates as the panel gives them.

        Raises
        ------
        PanelError
            If a template, an anchor or the level edge does not fit the panel picture.
        """
        drawn = UnwrappedPanel(source)
        reader = cls(source, method, tuning_from_panel(drawn), drawn)
        reader.placer  # noqa: B018 - anchors are looked at now, not when the first frame comes
        return reader

    def tuned(self, tuning: Tuning) -> PanelReader:
        """The same reader with another tuning; what was worked out and does not change with it serves again."""
        reader = PanelReader(self.source, self.method, tuning, self._drawn)
        lasting = ["_quick_grids"]
        if tuning.places_as(self.tuning):
            lasting.append("placer")
        if tuning.reads_as(self.tuning):
            lasting += ["_gauges", "_many_frames"]
        vars(reader).update({name: part for name, part in vars(self).items() if name in lasting})
        return reader

    @property
    def grids(self) -> list[PolarGrid]:
        """By gauge."""
        return self._drawn.grids

    @property
    def own_gauges(self) -> list[UnwrappedGauge]:
        """The gauges of the panel picture, unwrapped."""
        return self._drawn.gauges

    @cached_property
    def placer(self) -> FramePlacer:
        """Tells where the panel lies in frames."""
        return FramePlacer(self._drawn, self.tuning)

    @cached_property
    def _places(self) -> PlaceUncertainty:
        return PlaceUncertainty(self.source, self.tuning)

    @property
    def aligner(self) -> Aligner:
        """Tells the same of the panel as a whole."""
        return self.placer.aligner

    @cached_property
    def _gauges(self) -> list[CardReader | GaugeReader]:
        """Their readers."""
        tuning = self.tuning
        return [
            CardReader(gauge, gauge.card, grid, tuning.cards[gauge.card.name])
            if gauge.card is not None
            else GaugeReader(
                gauge,
                grid,
                {needle.name: tuning.templates[needle.name] for needle in gauge.needles},
                face,
                self.method,
                evenly_lit_score=tuning.evenly_lit_score,
            )
            for gauge, grid, face in zip(self.source.panel.gauges, self.grids, tuning.faces, strict=True)
        ]

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
        (unwrapped,) = self.placer.unwrap_many([FramePicture(frame, focal_length_mm)])
        if isinstance(unwrapped, PictureError):
            raise unwrapped
        return unwrapped

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

    def read_many(self, frames: Iterable[Taken]) -> list[FrameReadings | PictureError]:
        """The readings of each frame, or why there are none; to the bit the same whatever the frames beside it."""
        placed = self.placer.placed(frames)
        there = [one for one in placed if not isinstance(one, PictureError)]
        read = iter(self._composed([frame for _, frame in there], [self._gauges_of(*one) for one in there]))
        return [one if isinstance(one, PictureError) else next(read) for one in placed]

    @staticmethod
    def _gauges_of(picture: GreyPicture, frame: UnwrappedFrame) -> GaugesOfFrame:
        if frame.gauges:
            return UnwrappedGauges(frame.gauges, frame.whole)
        return PlacedFrame(picture, frame.alignment, frame.whole)

    @cached_property
    def _many_frames(self) -> ManyFrames:
        is_quick = self.method is Method.NORMXCORR
        return ManyFrames(
            self.source.panel.gauges,
            self.grids,
            self.tuning,
            self._gauges,
            is_quick=is_quick,
            quick_grids=self._quick_grids if is_quick else None,
        )

    @cached_property
    def _quick_grids(self) -> QuickGrids | None:
        return quick_grids_of(self.source.panel.gauges, self._drawn.unwrapper)

    def read_unwrapped(self, unwrapped: UnwrappedFrame) -> FrameReadings:
        """The readings of a frame that is unwrapped already."""
        (read,) = self.read_all_unwrapped([unwrapped])
        return read

    def read_all_unwrapped(self, frames: Sequence[UnwrappedFrame]) -> list[FrameReadings]:
        """The readings of frames that are unwrapped already."""
        return self._composed(frames, [UnwrappedGauges(frame.gauges, frame.whole) for frame in frames])

    def found_in(self, frames: Sequence[UnwrappedFrame]) -> list[Mapping[str, Reading]]:
        """By frame what its gauges' readers find by needle; what dials' places add to it is left out."""
        return self.found_on([UnwrappedGauges(frame.gauges, frame.whole) for frame in frames])

    def found_on(self, frames: Sequence[UnwrappedGauges]) -> list[Mapping[str, Reading]]:
        """The same of frames that several readers read."""
        surely = np.zeros((len(frames), len(self.grids)))
        own = self._many_frames.read(frames, surely)
        return [{name: reading for gauge in gauges for name, reading in gauge.items()} for gauges in own]

    def _composed(self, frames: Sequence[UnwrappedFrame], gauges: Sequence[GaugesOfFrame]) -> list[FrameReadings]:
        """What is read of each frame, with how uncertain the places of its dials are."""
        sigmas_px = self._places.sigmas_px([frame.alignment for frame in frames])
        for sigma_px, frame in zip(sigmas_px, frames, strict=True):
            if frame.dial_sigmas_px:
                sigma_px[:] = frame.dial_sigmas_px
        radii_px = np.array([sum(gauge.radius) / 2 for gauge in self.source.panel.gauges])
        readings = self._many_frames.read(gauges, np.degrees(sigmas_px / radii_px))
        return [
            FrameReadings(frame.alignment, self._checked(frame, own), tuple(sigma_px), self._needle_shifts_px(frame))
            for frame, own, sigma_px in zip(frames, readings, sigmas_px.tolist(), strict=True)
        ]

    def _checked(self, frame: UnwrappedFrame, readings: Sequence[Mapping[str, Reading]]) -> dict[str, Reading]:
        """By needle its reading; doubted needles that do not match well are missing."""
        checked = {name: reading for own in self._lines_checked(frame, readings) for name, reading in own.items()}
        for name in self.tuning.doubted:
            if checked[name].score < DOUBTED_SCORE:
                checked[name] = replace(checked[name], status=Status.MISSING)
        return checked

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
        if not shifts_px:
            return ()
        lifts = self.tuning.lifts or (0.0,) * len(self.grids)
        return tuple((x * (1.0 + lift), y * (1.0 + lift)) for (x, y), lift in zip(shifts_px, lifts, strict=False))
