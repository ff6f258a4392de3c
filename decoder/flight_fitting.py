"""Fitting a reader to a flight: needles and dials as its own frames show them, and pivots where its needles turn.

Also what is left of both: what readings are uncertain by beyond what their own frames tell.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from decoder.alignment import Alignment, Matrix
from decoder.arrays import Floats
from decoder.dial_plane import DialPlane
from decoder.errors import PictureError
from decoder.first_sight import FirstSight
from decoder.flight_tuning import MIN_CUTS, SAMPLE_FRAMES, lit_views, tune_on, unwrapped
from decoder.frame_placer import UnwrappedFrame
from decoder.gauge import Gauge
from decoder.panel_needles import drawn_gauges
from decoder.panel_reader import PanelReader
from decoder.panel_tuning import tuning_from_panel
from decoder.pictures import FramePicture, GreyPicture
from decoder.pivots import Pivot, pivot_of
from decoder.reading import Reading, Status
from decoder.seen_faces import with_seen_faces
from decoder.tuning import Tuning
from decoder.uncertainty import DRAWN_PX, QuantityUncertainty, quantity_uncertainties

ROUNDS = 6
# With so many of the sampled frames found there is no need to look for the camera elsewhere.
MIN_FOUND = 8
SIGHTS = 3
# Where anchors and dials move against each other, needles tell less of their pivots.
MORE_FRAMES = 3 * SAMPLE_FRAMES
SETTLED_LIFT = 0.01
# A camera that moves by less than this at the panel picture's corners shows no depth.
STILL_PX = 6.0
LOOKED_AT = 6
# Dials that lie this near to where the anchors have them are where they should be.
IN_PLACE_PX = 0.05
# A pivot that had to be moved is moved again until it is right to this: the first step falls a little short.
SETTLED_PX = 0.03

# A needle that is missing in more of the sampled frames than this is not known as it is.
MISSING_PART = 0.5

Sample = Callable[[int], Iterable[GreyPicture | FramePicture]]
"""Gives so many frames, spread over the flight; the same ones each time."""


@dataclass(frozen=True, slots=True)
class FittedReader:
    """A reader fitted to a flight.

    Attributes
    ----------
    uncertainties
        By quantity: what its readings are uncertain by beyond what their frames tell.
    moved_px
        By gauge, for those whose needles turn elsewhere than the panel says: (x, y).
    """

    reader: PanelReader
    uncertainties: Mapping[str, QuantityUncertainty]
    moved_px: Mapping[str, tuple[float, float]]

    def sigma_deg(self, name: str, angles_deg: Floats) -> Floats:
        """(N,): what readings of a quantity at these angles are uncertain by beyond what their frames tell."""
        return self.uncertainties[name].sigma_deg(angles_deg)


def fit_to_flight(reader: PanelReader, sample: Sample) -> FittedReader:
    """The reader fitted to the flight of which `sample` gives some frames."""
    source = reader.source
    drawn = source.panel.gauges
    samples = unwrapped(reader, sample(SAMPLE_FRAMES))
    usual = None if len(samples) >= MIN_FOUND else _first_sight(reader, sample, len(samples))
    if usual is not None:
        reader = reader.tuned(replace(reader.tuning, usual=usual))
        samples = unwrapped(reader, sample(SAMPLE_FRAMES))
    if _camera_moves(reader, samples):
        agree = _anchors_agree(reader, samples)
        one_by_one = reader.tuned(replace(reader.tuning, dials_move=True, anchors_agree=agree))
        if _dials_move(one_by_one, sample):
            reader = one_by_one
            samples = unwrapped(reader, sample(_frames_wanted(reader.tuning)))
    for _ in range(ROUNDS):
        views = lit_views(reader, samples)
        found = reader.found_in(samples)
        seen = with_seen_faces(reader, views, found)
        if seen is not reader:
            reader, found = seen, seen.found_in(samples)
        tuned = tune_on(reader, samples, views, found)
        if tuned.tuning.dials_move or _any_missing(found):  # then each tilt counts; else its fit needs no better guess
            found = tuned.found_in(samples)
        pivots = _pivots(tuned, samples, found)
        gauges = _moved(tuned, drawn, pivots)
        lifts = _lifts(reader.tuning, pivots)
        if gauges == reader.source.panel.gauges and lifts == reader.tuning.lifts:
            break
        planes = tuple(
            plane if plane is None or gauge == before else plane.around(pivot.offset_px)
            for gauge, before, plane, pivot in zip(
                gauges, tuned.source.panel.gauges, _planes(tuned), pivots, strict=True
            )
        )
        panel = reader.source.panel.model_copy(update={"gauges": gauges})
        moved_source = replace(reader.source, panel=panel, planes=planes)
        reader = PanelReader(
            moved_source,
            reader.method,
            replace(
                tuning_from_panel(moved_source),
                usual=tuned.tuning.usual,
                dials_move=reader.tuning.dials_move,
                anchors_agree=reader.tuning.anchors_agree,
                lifts=lifts,
            ),
        )
        samples = unwrapped(reader, sample(_frames_wanted(reader.tuning)))
    now = tuned.source.panel.gauges
    moved = {
        gauge.name: (gauge.centre[0] - before.centre[0], gauge.centre[1] - before.centre[1])
        for gauge, before in zip(now, drawn, strict=True)
        if gauge.centre != before.centre
    }
    zeros = [gauge.readings for gauge in drawn_gauges(tuned)]
    uncertainties = quantity_uncertainties(source, pivots, zeros, dials_move=tuned.tuning.dials_move)
    learned = replace(tuned.tuning, doubted=_doubted(found))
    if tuned.tuning.dials_move:
        tuned = tuned.tuned(replace(learned, pivots=pivots))
    else:
        noise = tuned.aligner.noise_beside_claim(_pictures(sample(LOOKED_AT)))
        tuned = tuned.tuned(replace(learned, alignment_noise=noise))
    return FittedReader(tuned, uncertainties, moved)


def _doubted(found: Sequence[Mapping[str, Reading]]) -> frozenset[str]:
    """The needles that are missing in most of the sampled frames, of enough of them to tell."""
    if len(found) < MIN_CUTS:
        return frozenset()
    return frozenset(
        name
        for name in found[0]
        if sum(readings[name].status is Status.MISSING for readings in found) > MISSING_PART * len(found)
    )


def _pictures(frames: Iterable[GreyPicture | FramePicture]) -> Iterator[FramePicture]:
    for frame in frames:
        yield frame if isinstance(frame, FramePicture) else FramePicture(frame)


def _frames_wanted(tuning: Tuning) -> int:
    return MORE_FRAMES if tuning.dials_move and not tuning.anchors_agree else SAMPLE_FRAMES


def _any_missing(found: Sequence[Mapping[str, Reading]]) -> bool:
    return any(reading.status is Status.MISSING for readings in found for reading in readings.values())


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
    for taken in _pictures(sample(SAMPLE_FRAMES)):
        try:
            shifts = reader.placer.dial_shifts_px(taken.pixels, taken.focal_length_mm)
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
    for taken in _pictures(sample(SAMPLE_FRAMES)):
        height, width = taken.pixels.shape
        try:
            zoom = optics.zoom(taken.focal_length_mm, (width, height))
        except PictureError:
            continue  # of another shape, or a zoom that is not calibrated: reported when the flight is read
        motion = sight.find(taken.pixels)
        if motion is not None:
            at_panels_zoom = np.linalg.inv(zoom) @ motion
            seen.append(at_panels_zoom / at_panels_zoom[2, 2])
        if len(seen) == SIGHTS:
            break
    if not seen:
        return None
    apart = [sum(float(np.abs(one - other)[:2, 2].sum()) for other in seen) for one in seen]
    return Alignment.of(seen[int(np.argmin(apart))], 1.0)


def _pivots(
    reader: PanelReader, samples: Sequence[UnwrappedFrame], found: Sequence[Mapping[str, Reading]]
) -> tuple[Pivot, ...]:
    """By the tuned needles, near where they were found, and where the panel picture has them."""
    drawn = [] if reader.tuning.dials_move else drawn_gauges(reader)  # at other depths it is another view of the dial
    return tuple(
        pivot_of(
            gauge,
            grid,
            face,
            reader.tuning.templates,
            [
                (sample.gauges[index], readings, sample.dial_shifts_px[index] if sample.dial_shifts_px else (0.0, 0.0))
                for sample, readings in zip(samples, found, strict=True)
            ]
            + [(gauge.strip, gauge.readings, (0.0, 0.0)) for gauge in drawn[index : index + 1]],
        )
        for index, (gauge, grid, face) in enumerate(
            zip(reader.source.panel.gauges, reader.grids, reader.tuning.faces, strict=True)
        )
    )


def _planes(reader: PanelReader) -> Sequence[DialPlane | None]:
    return reader.source.planes or (None,) * len(reader.grids)


def _lifts(tuning: Tuning, pivots: Sequence[Pivot]) -> tuple[float, ...]:
    """How far needles go beyond their dials, with what was found to be missing; none where dials do not move."""
    if not tuning.dials_move:
        return ()
    so_far = tuning.lifts or (0.0,) * len(pivots)
    missing = [pivot.lift if abs(pivot.lift) > SETTLED_LIFT else 0.0 for pivot in pivots]
    return tuple(lift + more for lift, more in zip(so_far, missing, strict=True))


def _moved(reader: PanelReader, drawn: Sequence[Gauge], pivots: Sequence[Pivot]) -> tuple[Gauge, ...]:
    """The gauges with their pivots where needles turn; one that is right to what can be drawn stays as it is drawn."""
    own = reader.source.optics.own
    return tuple(
        _around(gauge, plane, own, pivot) if _is_off(pivot, was_moved=gauge != before) else gauge
        for gauge, before, plane, pivot in zip(reader.source.panel.gauges, drawn, _planes(reader), pivots, strict=True)
    )


def _is_off(pivot: Pivot, *, was_moved: bool) -> bool:
    distance_px = math.hypot(*pivot.offset_px)
    return distance_px > SETTLED_PX if was_moved else distance_px > DRAWN_PX and pivot.is_certain


def _around(gauge: Gauge, plane: DialPlane | None, own: Alignment, pivot: Pivot) -> Gauge:
    """The gauge around its true pivot, which is told in the dial's own plane."""
    if plane is None:
        (x, y), (right, down) = gauge.centre, pivot.offset_px
        return gauge.model_copy(update={"centre": (x + right, y + down)})
    there = plane.to_panel(np.array(pivot.offset_px)[:, None])[:, 0]
    return gauge.model_copy(update={"centre": own.to_frame((float(there[0]), float(there[1])))})
