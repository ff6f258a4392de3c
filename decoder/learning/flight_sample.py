"""The sample of a flight to which its reader is fitted, and the camera's usual place according to it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from decoder.imaging.alignment import Alignment, Matrix, is_rigid
from decoder.imaging.motion import Model
from decoder.imaging.picture_block import PictureBlock, TopOfFrame, coloured_by
from decoder.imaging.pictures import FramePicture, GreyPicture, grey_picture
from decoder.imaging.sorting import median, median_of
from decoder.imaging.video import GroupDecoder, encoded_of
from decoder.instruments.panel_reader import PanelReader, taken, unwrapped
from decoder.instruments.thresholds import FRAMES_TO_LEARN
from decoder.learning.thresholds import IN_PLACE_PX, LOOKED_AT, SAMPLE_FRAMES, STILL_PX
from decoder.matching.thresholds import MIN_VIEWS
from decoder.panel.errors import PictureError
from decoder.registration.frame_placer import UnwrappedFrame
from decoder.registration.placement import Placement
from decoder.registration.thresholds import SIGNIFICANT_SIGMAS
from flight_file.frame import Frame
from flight_file.reader import Flight, spread

# Eight pictures of 18 megapixels, or all smaller ones that are needed.
KEPT_BYTES = 144 * 2**20

Taken = FramePicture | TopOfFrame

# More frames are needed to find pivots if anchors and dials shift relative to each other.
MORE_FRAMES = 3 * SAMPLE_FRAMES

Sample = Callable[[int], Iterable[GreyPicture | FramePicture | TopOfFrame]]
"""Gives so many frames, spread over the flight; the same ones each time. Of each the first rows may be all there is."""
Tell = Callable[[str], None]
"""Is told what is being done, in words for whoever waits."""


def nobody(words: str) -> None:
    """Ignore the words."""


class FlightSample:
    """Yields any number of frames, spread over the flight; pictures are kept in memory as far as there is room.

    Only the first `rows` of each frame are decompressed, until those turn out too few too often; None if their number
    is unknown. Some room is reserved for the frames that are looked at again at the end. `opened` are the frames that
    could be opened so far.
    """

    def __init__(
        self, flight: Flight, rows: int | None = None, *, kept_bytes: int = KEPT_BYTES, tell: Tell = nobody
    ) -> None:
        self.opened: set[int] = set()
        self._tell = tell
        self._flight = flight
        self._rows = rows
        self._too_few = 0
        self._looked_at: set[int] = set()
        self._kept: dict[int, Taken] = {}
        self._by_rank: dict[int, int] = {}
        self._room = kept_bytes
        self._video = GroupDecoder()

    def __call__(self, frames: int) -> Iterator[Taken]:
        """Return the same frames each time for the same number, without those that cannot be opened."""
        ranks = sorted(spread(self._flight.count(), frames))
        if all(rank in self._by_rank for rank in ranks):
            return (self._kept[self._by_rank[rank]] for rank in ranks)
        return self._read(frames, ranks)

    @property
    def ranks(self) -> list[int]:
        """Ranks of the frames that are looked at first, in order of time."""
        return sorted(spread(self._flight.count(), SAMPLE_FRAMES))

    def at(self, rank: int) -> Taken | None:
        """Return the frame of this rank; None if it cannot be opened, or was returned before."""
        frame = self._flight.sample_frame(rank)
        if frame is None or frame.sequence in self._looked_at:
            return None
        self._looked_at.add(frame.sequence)
        kept = self._kept.get(frame.sequence)
        try:
            return self._decompressed(frame) if kept is None else kept
        except PictureError:
            return None  # reported when the flight is read

    def given_up(self, frame: Frame) -> Taken | None:
        """Hand over the picture of a frame, if it was kept, and drop it."""
        self._by_rank.clear()
        return self._kept.pop(frame.sequence, None)

    def _read(self, frames: int, ranks: list[int]) -> Iterator[Taken]:
        """Read frames from the file, except for pictures that are kept."""
        given = []
        often = spread(self._flight.count(), LOOKED_AT)
        for number, (rank, frame) in enumerate(zip(ranks, self._flight.sample_frames(frames), strict=False), start=1):
            self._tell(f"aligning frame {number} of a sample of {len(ranks)}")
            taken = self._kept.get(frame.sequence)
            if taken is None:
                try:
                    taken = self._decompressed(frame)
                except PictureError:
                    continue  # reported when the flight is read
                self._keep(frame, taken, 0 if rank in often else sum(later > rank for later in often))
            given.append(frame.sequence)
            self.opened.add(frame.sequence)
            yield taken
        if len(given) == len(ranks) and all(sequence in self._kept for sequence in given):  # none was left out
            self._by_rank |= dict(zip(ranks, given, strict=True))

    def _decompressed(self, frame: Frame) -> Taken:
        encoded, focal_length_mm = encoded_of(frame), frame.exif.lens_mm
        if self._rows is None or frame.group is not None:
            return FramePicture(grey_picture(encoded, self._video), focal_length_mm, coloured_by(encoded, self._video))
        taken = PictureBlock().frame(encoded, 0, focal_length_mm, self._rows)
        coloured = coloured_by(encoded, self._video)  # does not use the block's memory
        if isinstance(taken, TopOfFrame):
            return replace(taken, whole=partial(self._whole, frame), coloured=coloured)
        return replace(taken, coloured=coloured)

    def _whole(self, frame: Frame) -> FramePicture:
        """Decompress a whole frame whose first rows were not enough; if that happens often, stop trying rows only."""
        self._too_few += 1
        if self._too_few > MIN_VIEWS:
            self._rows = None
        coloured = coloured_by(frame.encoded, self._video)
        picture = FramePicture(grey_picture(frame.encoded), frame.exif.lens_mm, coloured)
        if frame.sequence in self._kept:
            self._room += _size(frame, self._kept[frame.sequence]) - _size(frame, picture)
            self._kept[frame.sequence] = picture
        return picture

    def _keep(self, frame: Frame, taken: Taken, held_back: int) -> None:
        """Keep a picture if there is room for it and for `held_back` more."""
        size = _size(frame, taken)
        if (1 + held_back) * size <= self._room:
            self._room -= size
            self._kept[frame.sequence] = taken


def _size(frame: Frame, taken: Taken) -> int:
    """Return the bytes that a picture keeps in memory, including its JPEG, or a video decoder's data, for colours."""
    return taken.pixels.nbytes + (len(frame.encoded) if frame.group is None else 3 * taken.pixels.nbytes // 2)


def align_sample(reader: PanelReader, sample: Sample) -> tuple[PanelReader, list[UnwrappedFrame]]:
    """Align and unwrap a sample, after finding out where the camera is, and whether it rolls or dials move."""
    panel = reader.source.panel
    if len(panel.anchors) == 1 and panel.level is None:
        reader = reader.with_placement(replace(reader.placement, is_upright=False))
    samples = unwrapped(reader, sample(SAMPLE_FRAMES))
    usual = None if 2 * len(samples) >= SAMPLE_FRAMES else _first_sight(reader, sample, len(samples))
    usual = usual or (_second_sight(reader, sample) if samples else None)
    if usual is not None:
        reader = reader.with_placement(replace(reader.placement, usual=usual))
        samples = unwrapped(reader, sample(SAMPLE_FRAMES))
    if not reader.placement.is_upright and _never_rolls(reader, samples):
        reader = reader.with_placement(replace(reader.placement, is_upright=True))
        samples = unwrapped(reader, sample(SAMPLE_FRAMES))
    if _camera_moves(reader, samples):
        agree = _anchors_agree(reader, samples)
        there = with_usual_place(reader, samples)  # so that anchors seen obliquely are searched for as they appear
        one_by_one = there.with_placement(replace(there.placement, dials_move=True, anchors_agree=agree))
        apart_px = _apart_px(one_by_one, sample)
        if apart_px:
            one_by_one = one_by_one.with_placement(replace(one_by_one.placement, apart_px=apart_px))
            return one_by_one, unwrapped(one_by_one, sample(frames_wanted(one_by_one.placement)))
    return reader, samples


def with_usual_place(reader: PanelReader, samples: Sequence[UnwrappedFrame]) -> PanelReader:
    """Let searches start where the camera mostly was; with too few frames the reader is returned unchanged."""
    if len(samples) < FRAMES_TO_LEARN:
        return reader
    matrices = _at_panels_zoom(reader, samples)
    usual = _usual(samples, matrices)
    placement = replace(
        reader.placement,
        usual=usual,
        motions=_motions(samples, matrices, usual),
        rows=reader.placer.rows_wanted([sample.alignment for sample in samples]),
    )
    return reader.with_placement(placement)


def _usual(samples: Sequence[UnwrappedFrame], matrices: Sequence[Matrix]) -> Alignment:
    """Return the median alignment at the panel picture's zoom; if all are a shift and a roll, so is the median."""
    usual = median_of(np.array(matrices))
    if all(is_rigid(matrix) for matrix in matrices):
        usual[:2, :2] /= np.hypot(usual[0, 0], usual[1, 0])
    return Alignment.of(usual, float(median(np.array([sample.alignment.score for sample in samples]))))


def _motions(samples: Sequence[UnwrappedFrame], matrices: Sequence[Matrix], usual: Alignment) -> tuple[Matrix, ...]:
    """Return the motions of those samples that show most of the panel."""
    models = [0 if each.alignment.covariance is None else each.alignment.covariance.model for each in samples]
    there = np.linalg.inv(usual.matrix)
    most = max(models)
    return tuple(matrix @ there for matrix, model in zip(matrices, models, strict=True) if model == most)


def _at_panels_zoom(reader: PanelReader, samples: Sequence[UnwrappedFrame]) -> list[Matrix]:
    """(3, 3) each: frames' alignments as if they had been taken at the panel picture's zoom and size."""
    optics = reader.aligner.optics
    kinds = [(sample.focal_length_mm, sample.size_px or optics.size_px) for sample in samples]
    back = {kind: np.linalg.inv(optics.zoom(*kind)) for kind in dict.fromkeys(kinds)}
    matrices = [back[kind] @ sample.alignment.matrix for kind, sample in zip(kinds, samples, strict=True)]
    return [matrix / matrix[2, 2] for matrix in matrices]


def frames_wanted(placement: Placement) -> int:
    """Return how many frames a sample needs."""
    return MORE_FRAMES if placement.dials_move and not placement.anchors_agree else SAMPLE_FRAMES


def _pictures(frames: Iterable[GreyPicture | FramePicture | TopOfFrame]) -> Iterator[FramePicture]:
    """Decompress the frames of a sample wholly."""
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


def _never_rolls(reader: PanelReader, samples: Sequence[UnwrappedFrame]) -> bool:
    """Whether a lone anchor shows the usual roll in all frames, within its uncertainty."""
    sigmas = []
    for alignment in (sample.alignment for sample in samples):
        known = alignment.covariance
        # A round anchor shows no roll, and neither does an alignment by a shift.
        if known is not None and known.model is Model.RIGID and known.covariance[2, 2] > 0.0:
            roll_px = math.radians(alignment.roll_deg - reader.placement.usual.roll_deg) * known.axes.lever_px
            sigmas.append(roll_px / math.sqrt(known.covariance[2, 2]))
    return not sigmas or float(np.sqrt(np.mean(np.square(sigmas)))) <= SIGNIFICANT_SIGMAS


def _anchors_agree(reader: PanelReader, samples: Sequence[UnwrappedFrame]) -> bool:
    """Whether all anchors agree, in most frames."""
    return 2 * sum(reader.aligner.agrees(sample.alignment) for sample in samples) > len(samples)


def _apart_px(reader: PanelReader, sample: Sample) -> tuple[float, ...]:
    """Return how far each dial lies from where the anchors put it in some frames, or all do; empty if none moves."""
    shifts_px: list[list[float]] = [[] for _ in reader.source.panel.gauges]
    frames = 0
    for frame in _pictures(sample(SAMPLE_FRAMES)):
        try:
            shifts = reader.placer.dial_shifts_px(frame.pixels, frame.focal_length_mm)
        except PictureError:
            continue
        for own, shift in zip(shifts_px, shifts, strict=False):
            own.extend([] if shift is None else [math.hypot(*shift)])
        frames += 1
        if frames == LOOKED_AT:
            break
    if _rms([shift for own in shifts_px for shift in own]) <= IN_PLACE_PX:
        return ()
    located = [
        own for own, gauge in zip(shifts_px, reader.source.panel.gauges, strict=True) if gauge.kind.has_still_face
    ]
    usual_px = _rms([shift for own in located for shift in own])
    return tuple(max(_rms(own), usual_px) for own in shifts_px)


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values else 0.0


def _first_sight(reader: PanelReader, sample: Sample, found: int) -> Alignment | None:
    """Return where the camera is, by the first frames in which SIFT finds the panel; None if those are too few."""
    if 2 * found >= sum(1 for _ in sample(SAMPLE_FRAMES)):
        return None
    optics, sight = reader.aligner.optics, reader.aligner.localizer
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
        if len(seen) == MIN_VIEWS:
            break
    return _medoid(seen)


def _second_sight(reader: PanelReader, sample: Sample) -> Alignment | None:
    """Return where the camera is, if most frames show the panel in a perspective that its anchors cannot express."""
    aligner = reader.aligner
    seen: list[Matrix] = []
    for frame in () if aligner.tells_perspective else _pictures(sample(MIN_VIEWS)):
        height, width = frame.pixels.shape
        try:
            motion = aligner.sight(frame.pixels, frame.focal_length_mm)
            zoom = aligner.optics.zoom(frame.focal_length_mm, (width, height))
        except PictureError:
            continue
        if motion is not None:
            at_panels_zoom = np.linalg.inv(zoom) @ motion
            seen.append(at_panels_zoom / at_panels_zoom[2, 2])
    return _medoid(seen) if 2 * len(seen) > MIN_VIEWS else None


def _medoid(seen: Sequence[Matrix]) -> Alignment | None:
    """Return the motion that is closest to the others."""
    if not seen:
        return None
    apart = [sum(float(np.abs(one - other)[:2, 2].sum()) for other in seen) for one in seen]
    return Alignment.of(seen[int(np.argmin(apart))], 1.0)
