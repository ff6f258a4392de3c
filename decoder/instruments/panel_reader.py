"""The panel reader: one frame in, the readings of all needles out."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from typing import Self

import numpy as np

from decoder.imaging.alignment import Point
from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.picture_block import PictureBlock, TopOfFrame, batch_frames
from decoder.imaging.pictures import FramePicture, GreyPicture
from decoder.imaging.resampling import inside, part_inside
from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import Grid, PolarGrid, UnwrappedGauge, Unwrapper
from decoder.instruments.appearance import Appearance, DrawnInstrument, Instrument
from decoder.instruments.kind_table import KINDS, kind_of
from decoder.instruments.kinds.dials.geared import told_together
from decoder.instruments.kinds.dials.needle_dials import NeedleKind
from decoder.instruments.reading import ANYWHERE, FrameReadings, Reading, Readings, Status
from decoder.instruments.sampling import GaugeSampler, Reader, Samples
from decoder.instruments.thresholds import SURE_SCORE
from decoder.panel.arrays import Floats
from decoder.panel.errors import PictureError
from decoder.panel.gauge import Gauge
from decoder.panel.vocabulary import Method
from decoder.registration.aligner import Aligner
from decoder.registration.frame_placer import FramePlacer, Taken, UnwrappedFrame, UnwrappedPanel
from decoder.registration.placement import Placement, PlaceUncertainty
from decoder.registration.thresholds import SCORE_THRESHOLD


class InstrumentReaders:
    """Reads all instruments of one panel.

    Parameters
    ----------
    gauges
        From the panel.
    unwrapper
        Of their grids, in the same order.
    """

    def __init__(self, gauges: Sequence[Gauge], unwrapper: Unwrapper, appearance: Appearance, method: Method) -> None:
        self._gauges, self._unwrapper = gauges, unwrapper
        self.appearance, self.method = appearance, method
        plain = method is Method.XCORR  # then every needle is searched for by itself
        kinds = [kind_of(gauge) for gauge in gauges]
        self._kinds = [KINDS[0] if plain and isinstance(kind, NeedleKind) else kind for kind in kinds]

    @cached_property
    def sampler(self) -> GaugeSampler:
        """Samples the panel's gauges."""
        searched = [index for index, kind in enumerate(self._kinds) if kind.is_searched]
        parts = [kind.sampled_part(grid) for kind, grid in zip(self._kinds, self._unwrapper.grids, strict=True)]
        return GaugeSampler(self._unwrapper, searched, dict(enumerate(parts)))

    @cached_property
    def _readers(self) -> list[Reader]:
        parts = zip(self._gauges, self._unwrapper.grids, self.appearance.faces, strict=True)
        instruments = [Instrument(index, *own) for index, own in enumerate(parts)]
        of_kinds = [
            (kind, [own for own, its in zip(instruments, self._kinds, strict=True) if its is kind]) for kind in KINDS
        ]
        return [kind.reader(own, self.appearance, self.sampler, self.method) for kind, own in of_kinds if own]

    @cached_property
    def _columns(self) -> list[_Columns]:
        return [_Columns.of(gauge) for gauge in self._gauges]

    def with_appearance(self, appearance: Appearance) -> InstrumentReaders:
        """Return readers of the same panel with another appearance."""
        readers = InstrumentReaders(self._gauges, self._unwrapper, appearance, self.method)
        readers.sampler = self.sampler
        return readers

    def read(self, frames: Sequence[Samples], whole: Sequence[Sequence[bool]], place_sigmas_deg: Floats) -> Readings:
        """Read F frames, each independently of the others.

        Parameters
        ----------
        frames
            As `sampler` takes them.
        whole
            For each frame and gauge, whether all of it lies in the frame; if not, it is missing.
        place_sigmas_deg
            (F, gauges): the uncertainty of angles due to the positions of their dials.
        """
        if not frames:
            return []
        parts = [reader.read(frames, place_sigmas_deg) for reader in self._readers]
        found = [
            {name: reading for part in parts for name, reading in part[number].items()} for number in range(len(frames))
        ]
        return [
            {
                name: reading
                for columns, is_whole in zip(self._columns, there, strict=True)
                for name, reading in columns.told(own, is_whole=is_whole).items()
            }
            for own, there in zip(found, whole, strict=True)
        ]


@dataclass(frozen=True, slots=True)
class _Columns:
    """What is read of one gauge: the names of its quantities, and of what several of them show together."""

    gauge: Gauge
    names: tuple[str, ...]
    together: str | None

    @classmethod
    def of(cls, gauge: Gauge) -> Self:
        """Collect the names once, as frames are many."""
        together = None if gauge.combination is None else gauge.combination.quantity.name
        return cls(gauge, tuple(quantity.name for quantity in gauge.quantities), together)

    def told(self, found: Mapping[str, Reading], *, is_whole: bool) -> dict[str, Reading]:
        """Return the gauge's readings in one frame by name, with the common value of several hands."""
        if not is_whole:
            unread = Reading(Status.MISSING, np.nan, np.inf, 0.0)
            return dict.fromkeys([*self.names, *([] if self.together is None else [self.together])], unread)
        own = {name: found[name] for name in self.names}
        if self.together is None:
            return own
        value = found[self.together] if self.together in found else told_together(self.gauge, own)
        return own | {self.together: value}


@dataclass(frozen=True)
class PanelReader:
    """Reads frames with one panel; keeps nothing from frame to frame.

    Attributes
    ----------
    drawn
        The panel, its grids, and the panel picture on them.
    placement
        Where the panel and its dials are, as far as the flight has taught.
    placer
        Locates the panel in frames.
    instruments
        Read what it shows, with the looks that the flight has taught.
    block
        Memory for frames.
    """

    drawn: UnwrappedPanel
    placement: Placement
    placer: FramePlacer
    instruments: InstrumentReaders
    block: PictureBlock = field(default_factory=PictureBlock)

    @classmethod
    def of(
        cls,
        source: PanelPictures,
        method: Method,
        appearance: Appearance,
        placement: Placement,
        drawn: UnwrappedPanel | None = None,
    ) -> PanelReader:
        """Return a reader of a panel; `drawn` is the panel with its grids, if already made.

        Raises
        ------
        PanelError
            If an anchor or the level edge does not fit the panel picture.
        """
        drawn = drawn or UnwrappedPanel(source)
        instruments = InstrumentReaders(drawn.source.panel.gauges, drawn.unwrapper, appearance, method)
        return cls(drawn, placement, FramePlacer(drawn, placement), instruments)

    def with_appearance(self, appearance: Appearance) -> PanelReader:
        """Return the same reader with another appearance."""
        return replace(self, instruments=self.instruments.with_appearance(appearance), block=PictureBlock())

    def with_placement(self, placement: Placement) -> PanelReader:
        """Return the same reader with another placement."""
        is_same = placement.searches_as(self.placement)
        placer = self.placer if is_same else FramePlacer(self.drawn, placement)
        return replace(self, placement=placement, placer=placer, block=PictureBlock())

    @property
    def source(self) -> PanelPictures:
        """The panel and its pictures."""
        return self.drawn.source

    @property
    def appearance(self) -> Appearance:
        """What its instruments look like."""
        return self.instruments.appearance

    @property
    def method(self) -> Method:
        """How needles are found."""
        return self.instruments.method

    @property
    def grids(self) -> list[Grid]:
        """By gauge."""
        return self.drawn.grids

    @property
    def own_gauges(self) -> list[UnwrappedGauge]:
        """The gauges of the panel picture, unwrapped."""
        return self.drawn.gauges

    @property
    def aligner(self) -> Aligner:
        """Locates the panel as a whole in frames."""
        return self.placer.aligner

    @cached_property
    def _places(self) -> PlaceUncertainty:
        return PlaceUncertainty(self.source, self.placement)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The shortcomings of the panel, a sentence each."""
        of_pictures = filter(None, [self.source.optics.shortcoming, self.source.shortcoming])
        return (*self.aligner.shortcomings, *of_pictures, *_assumed_windows(self.source))

    def unwrap(self, frame: GreyPicture, focal_length_mm: float | None = None) -> UnwrappedFrame:
        """Align and unwrap a frame; `focal_length_mm` is its own, if known.

        Raises
        ------
        PictureError
            If the frame differs in shape from the panel picture, or the panel is not found in it.
        """
        (unwrapped,) = self.placer.unwrap_many([FramePicture(frame, focal_length_mm)])
        if isinstance(unwrapped, PictureError):
            raise unwrapped
        return unwrapped

    def read(self, frames: Iterable[Taken]) -> list[FrameReadings | PictureError]:
        """Read each frame, or say why not; bit for bit independently of the other frames."""
        placed = self.placer.placed(frames)
        there = [one for one in placed if not isinstance(one, PictureError)]
        sampler = self.instruments.sampler
        samples = [
            sampler.of_unwrapped(frame.gauges)
            if frame.gauges
            else sampler.of_frame(picture.pixels, frame.alignment, picture.in_colour)
            for picture, frame in there
        ]
        read = iter(self._readings([frame for _, frame in there], samples))
        return [one if isinstance(one, PictureError) else next(read) for one in placed]

    def read_unwrapped(self, frames: Sequence[UnwrappedFrame]) -> list[FrameReadings]:
        """Read frames that are already unwrapped."""
        return self._readings(frames, [self.instruments.sampler.of_unwrapped(frame.gauges) for frame in frames])

    def _readings(self, frames: Sequence[UnwrappedFrame], samples: Sequence[Samples]) -> list[FrameReadings]:
        """Read each frame, with the uncertainty of its dials' positions."""
        sigmas_px = self._places.sigmas_px([frame.alignment for frame in frames])
        for sigma_px, frame in zip(sigmas_px, frames, strict=True):
            if frame.dial_sigmas_px:  # of a window, which stays where the anchors put it, only theirs is known
                own_px = np.array(frame.dial_sigmas_px)
                sigma_px[:] = np.where(own_px > 0.0, own_px, sigma_px)
        radii_px = np.array([gauge.arc_px for gauge in self.source.panel.gauges])
        shown = [self._shown(frame) for frame in frames]
        readings = self.instruments.read(samples, shown, np.degrees(sigmas_px / radii_px))
        return [
            FrameReadings(frame.alignment, self._checked(frame, own), self._needle_shifts_px(frame))
            for frame, own in zip(frames, readings, strict=True)
        ]

    def _shown(self, frame: UnwrappedFrame) -> list[bool]:
        """Decide for each gauge whether to read it: if all of it is in the frame, or half of a dial with one needle."""
        if all(frame.whole) or frame.size_px is None:
            return list(frame.whole)
        return [is_whole or self._is_half_in_sight(frame, index) for index, is_whole in enumerate(frame.whole)]

    def _is_half_in_sight(self, frame: UnwrappedFrame, gauge_index: int) -> bool:
        """Whether the frame shows half of a dial with one needle."""
        alignment = frame.alignment_of(gauge_index)
        if frame.size_px is None or alignment is None or not _may_be_cut(self.source.panel.gauges[gauge_index]):
            return False
        return part_inside(self.drawn.rims[gauge_index], alignment, *frame.size_px) >= HALF

    def _needle_in_sight(self, frame: UnwrappedFrame, gauge_index: int, reading: Reading) -> bool:
        """Whether the whole of a needle that was read lies in the frame, and certainly is the needle."""
        alignment, grid = frame.alignment_of(gauge_index), self.grids[gauge_index]
        if reading.score < SURE_SCORE or frame.size_px is None or alignment is None or not isinstance(grid, PolarGrid):
            return False
        return inside(grid.at(reading.angle_deg, 1).rim(), alignment, *frame.size_px)

    def _checked(self, frame: UnwrappedFrame, readings: Mapping[str, Reading]) -> dict[str, Reading]:
        """Return the readings with those marked missing that are likely print, or doubted and do not match well.

        A doubted value of several hands is missing if one of them is: its score is that of the hands that show, but
        hidden ones may count its turns.
        """
        checked = dict(readings)
        for index, (gauge, is_whole) in enumerate(zip(self.source.panel.gauges, frame.whole, strict=True)):
            if not is_whole and _may_be_cut(gauge):
                (needle,) = gauge.turning
                if not self._needle_in_sight(frame, index, checked[needle.name]):
                    checked[needle.name] = replace(checked[needle.name], status=Status.MISSING)
        doubtful = {name for name in self.appearance.doubted if checked[name].score < SURE_SCORE}
        doubtful |= self.appearance.likely_print
        together = {each.quantity.name for each in self.source.panel.combinations if doubtful.intersection(each.parts)}
        for name in doubtful | (together & self.appearance.doubted):
            checked[name] = replace(checked[name], status=Status.MISSING)
        return checked | dict(self._printed(checked))

    def _printed(self, readings: Mapping[str, Reading]) -> Iterator[tuple[str, Reading]]:
        """Yield needles that match exactly where they were cut, but worse than usual there.

        The match may be print that was behind the needle, and the needle may be anywhere.
        """
        for gauge in self.source.panel.gauges if self.appearance.least_at_home else ():
            first_deg, last_deg = gauge.sweep
            for needle in gauge.over_face:
                reading, least = readings[needle.name], self.appearance.least_at_home.get(needle.name, -1.0)
                if reading.status is not Status.MISSING and reading.score < least and reading.is_at(needle.at_deg):
                    sigma_deg = math.hypot(reading.sigma_deg, ANYWHERE * (last_deg - first_deg))
                    yield needle.name, replace(reading, status=Status.EDGE, sigma_deg=sigma_deg)

    def _needle_shifts_px(self, unwrapped: UnwrappedFrame) -> tuple[Point, ...]:
        """Return how far each gauge's needles are from where the alignment puts them: the dial's shift, with lift."""
        shifts_px = unwrapped.dial_shifts_px
        if not shifts_px:
            return ()
        lifts = self.placement.lifts or (0.0,) * len(self.grids)
        return tuple((x * (1.0 + lift), y * (1.0 + lift)) for (x, y), lift in zip(shifts_px, lifts, strict=False))


def read_picture(reader: PanelReader, picture: GreyPicture, focal_length_mm: float | None = None) -> FrameReadings:
    """Read one frame of which only the grey levels are known, as `read_frame`.

    Raises
    ------
    PictureError
        As `PanelReader.unwrap`.
    """
    return read_frame(reader, FramePicture(picture, focal_length_mm))


def read_frame(reader: PanelReader, frame: FramePicture) -> FrameReadings:
    """Read one frame: a batch of one.

    Raises
    ------
    PictureError
        As `PanelReader.unwrap`.
    """
    (read,) = reader.read([frame])
    if isinstance(read, PictureError):
        raise read
    return read


def taken(frames: Iterable[GreyPicture | FramePicture | TopOfFrame]) -> Iterator[FramePicture | TopOfFrame]:
    """Yield the frames of a sample, wrapping those without a focal length."""
    return (FramePicture(frame) if isinstance(frame, np.ndarray) else frame for frame in frames)


def unwrapped(reader: PanelReader, frames: Iterable[GreyPicture | FramePicture | TopOfFrame]) -> list[UnwrappedFrame]:
    """Return those of the frames that can be aligned, unwrapped."""
    sampled = taken(frames)
    height, width = reader.source.picture.shape
    samples: list[UnwrappedFrame] = []
    while batch := tuple(islice(sampled, batch_frames((width, height)))):
        # what is not found is reported when the flight is read
        samples += [one for one in reader.placer.unwrap_many(batch) if not isinstance(one, PictureError)]
    return samples


def _may_be_cut(gauge: Gauge) -> bool:
    """Whether a gauge partly outside a picture can be read where its needle shows."""
    return len(gauge.turning) == len(gauge.pointers) == 1


def appearance_from_panel(
    drawn: UnwrappedPanel,
    known: Appearance | None = None,
    *,
    stay: Collection[int] = (),
    otherwise: Collection[int] = (),
) -> Appearance:
    """Let each instrument's kind take its look from the panel's own pictures.

    Windows keep the look that is `known`, except those (by index) that are sampled `otherwise` than before. Dials take
    a new look, except those without needles (by index) that `stay`.

    Raises
    ------
    PanelError
        If a gauge or a template does not fit its picture.
    """
    looks, kept = [], set[int]()
    parts = zip(drawn.source.panel.gauges, drawn.grids, drawn.rims, drawn.gauges, strict=True)
    for index, (gauge, grid, rim, strip) in enumerate(parts):
        # Where a flight has moved a dial at the picture's border, part of it lies outside.
        is_cut = _may_be_cut(gauge) or known is not None
        check = drawn.source.check_shows_half if is_cut else drawn.source.check_shows
        check(rim, f"gauges[{index}]")
        is_known = not isinstance(grid, PolarGrid) and index not in otherwise
        if known is not None and (index in stay or is_known):
            looks.append(known.look_of(index, gauge))
            kept.add(index)
        else:
            pictures = None if known is None else known.pictures
            looks.append(kind_of(gauge).first_look(DrawnInstrument(index, gauge, grid, drawn.source, strip, pictures)))
    # a needle cut from a single picture may match no better than the threshold even in even light
    seen = Appearance.of(looks, evenly_lit_score=SCORE_THRESHOLD)
    return seen if known is None else replace(seen, taught=known.taught & kept)


def _assumed_windows(source: PanelPictures) -> Iterator[str]:
    """Name the windows of other pictures that are neither drawn nor found by the anchors, a sentence each."""
    for index, gauge in enumerate(source.panel.gauges):
        for place, taught in enumerate(() if gauge.printed is None else gauge.printed.also):
            if taught.window is None and taught.picture not in source.places:
                yield (
                    f"gauges[{index}].printed.also[{place}]: no anchors are found in {taught.picture}, so its digits"
                    " are taken from where they stand in the panel picture; give its `window`"
                )
