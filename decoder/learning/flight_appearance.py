"""What needles and dials look like, learned from a sample of a flight's own frames.

A template cut from one picture carries that picture's noise, and whatever lies behind the needle there, into every
reading. Many frames separate needle and dial: the dial's face is what each pixel shows when no needle is there, and
the needle is what it adds to the faces it passes over. A reading then compares the gauge with the needle drawn over
the face behind it, so marks and numerals no longer pull at it.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace

from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import PolarGrid, turn_rows
from decoder.instruments.appearance import Instrument, LearnedPicture
from decoder.instruments.kind_table import kind_of
from decoder.instruments.missing import is_lost
from decoder.instruments.needle_learner import NeedleLearner, Readings
from decoder.instruments.needle_lines import places_of
from decoder.instruments.panel_reader import PanelReader
from decoder.instruments.reading import Reading, Status
from decoder.instruments.thresholds import APART_DEG, FRAMES_TO_LEARN, MIN_PLACES
from decoder.matching.faces import LitViews, in_light_of
from decoder.panel.gauge import Gauge
from decoder.panel.scale import FULL_CIRCLE_DEG
from decoder.registration.frame_placer import UnwrappedFrame
from decoder.registration.thresholds import LIKELY_SCORE, SCORE_THRESHOLD

# Learned needles over learned faces usually score 0.99.
EVENLY_LIT_SCORE = 0.97


def lit_views(reader: PanelReader, samples: Sequence[UnwrappedFrame]) -> LitViews:
    """Bring all dials of the samples into the panel picture's light; windows, which may shine, are left as they are."""
    dials = [isinstance(grid, PolarGrid) for grid in reader.grids]
    return [
        in_light_of(picture, (sample.gauges[index] for sample in samples))
        if is_dial
        else [sample.gauges[index] for sample in samples]
        for index, (picture, is_dial) in enumerate(zip(reader.own_gauges, dials, strict=True))
    ]


def learn_appearance(
    reader: PanelReader, views: LitViews, found: Sequence[Readings], of: Collection[int] | None = None
) -> PanelReader:
    """Learn what instruments look like; with too few frames the reader is returned unchanged.

    Parameters
    ----------
    views
        By gauge and frame, from `lit_views`.
    found
        For each frame, the readings in it.
    of
        Indexes of the gauges to learn; the others stay as known. None for all.
    """
    if len(found) < FRAMES_TO_LEARN:
        return reader
    gauges, before = reader.source.panel.gauges, reader.appearance
    learners = {
        index: NeedleLearner(gauge.over_face, grid, turn_rows(gauge, grid), seen, first, before.templates)
        for index, (gauge, grid, seen, first) in enumerate(zip(gauges, reader.grids, views, before.faces, strict=True))
        if isinstance(grid, PolarGrid)
    }
    learned = set(range(len(gauges)) if of is None else of) - before.taught
    pictures: dict[str, LearnedPicture] = {}
    for index, (gauge, grid, face, seen) in enumerate(zip(gauges, reader.grids, before.faces, views, strict=True)):
        if index not in learned:
            pictures |= before.look_of(index, gauge).pictures
            continue
        strips = [like for like in seen if like is not None]
        pictures |= kind_of(gauge).learned_pictures(Instrument(index, gauge, grid, face), strips, before.pictures)
    templates = dict(before.templates)
    faces = list(before.faces)
    for index in sorted(learners.keys() & learned):
        learner = learners[index]
        faces[index] = learner.face(found, before.templates)
        templates |= learner.templates(found, templates, faces[index])
    return reader.with_appearance(
        replace(
            before,
            templates=templates,
            faces=tuple(faces),
            evenly_lit_score=EVENLY_LIT_SCORE,
            pictures=pictures,
            taught=before.taught | {index for index in learned if index not in learners or not gauges[index].turning},
        )
    )


def kept_where_better(
    reader: PanelReader,
    learned: PanelReader,
    samples: Sequence[UnwrappedFrame],
    views: LitViews,
    found: Sequence[Readings],
) -> tuple[PanelReader, Sequence[Readings]]:
    """Keep what was `learned` of each gauge unless it loses most of what was `found`; return the readings too.

    A thin needle that hardly differs from its dial may be learned as noise.
    """
    gauges, again = reader.source.panel.gauges, read_sample(learned, samples)
    worse = set()
    for index, gauge in enumerate(gauges):
        before, after = (len(found) * len(gauge.over_face) - _missing(gauge, own) for own in (found, again))
        if after < HALF * before:
            worse.add(index)
    if not worse:
        return learned, again
    learned = learn_appearance(reader, views, found, set(range(len(gauges))) - worse)
    return learned, read_sample(learned, samples)


def learn_likely_needles(
    reader: PanelReader, samples: Sequence[UnwrappedFrame], views: LitViews, found: Sequence[Readings]
) -> tuple[PanelReader, Sequence[Readings]]:
    """Learn gauges again from needles' likely matches, as long as that finds more needles; return the readings too.

    A frame with one missing needle teaches nothing about the dial below the others, and a needle that is over print in
    only a few frames is missing until the dial there is known. Needles that were found before must be found in the same
    place. A needle that is missing in most frames is itself learned from its likely matches: it has no better ones.
    """
    gauges = reader.source.panel.gauges
    of = {index for index, gauge in enumerate(gauges) if isinstance(reader.grids[index], PolarGrid)}
    while True:
        likely = as_likely(gauges, found)
        of = {index for index in of if _missing(gauges[index], found) > _missing(gauges[index], likely)}
        if not of:
            return reader, found
        again = learn_appearance(reader, views, likely, of)
        read = read_sample(again, samples)
        better = {index for index in of if _lost(gauges[index], found, read) < _missing(gauges[index], found)}
        if better and better != of:
            again = learn_appearance(reader, views, likely, better)
            read = read_sample(again, samples)
        if better:
            reader, found = again, read
        of = better


def learn_hidden_looks(
    reader: PanelReader, samples: Sequence[UnwrappedFrame], views: LitViews, found: Sequence[Readings]
) -> tuple[PanelReader, Sequence[Readings]]:
    """Learn parts that the panel picture hides, if their kind can locate them; return the reader with its readings."""
    before = reader.appearance
    faces, templates = list(before.faces), dict(before.templates)
    for index, (gauge, grid, seen) in enumerate(zip(reader.source.panel.gauges, reader.grids, views, strict=True)):
        strips = [strip for strip in seen if strip is not None]
        if len(strips) < FRAMES_TO_LEARN or not is_lost(gauge, found):
            continue
        look = kind_of(gauge).hidden_look(Instrument(index, gauge, grid, before.faces[index]), before, strips)
        if look is not None:
            faces[index], templates = look.face, {**templates, **look.templates}
    if templates == before.templates:
        return reader, found
    reader = reader.with_appearance(replace(before, templates=templates, faces=tuple(faces)))
    return reader, read_sample(reader, samples)


def as_likely(gauges: Sequence[Gauge], found: Sequence[Readings]) -> list[Readings]:
    """Treat missing needles with likely matches as EDGE or, on a lost gauge, as READ to teach.

    What matches less well there teaches only if it is found at several places: at few, it may be print.
    """
    lost = {each.name for gauge in gauges if is_lost(gauge, found) for each in gauge.quantities}
    moving = {
        name
        for name in lost
        if places_of(readings[name].angle_deg for readings in found if _is_likely(readings[name])) > MIN_PLACES
    }

    def likely(name: str, reading: Reading) -> Reading:
        if reading.status is not Status.MISSING or not _is_likely(reading):
            return reading
        teaches = name in moving or (name in lost and reading.score >= SCORE_THRESHOLD)
        return replace(reading, status=Status.READ if teaches else Status.EDGE)

    return [{name: likely(name, reading) for name, reading in readings.items()} for readings in found]


def _is_likely(reading: Reading) -> bool:
    return reading.score >= LIKELY_SCORE and math.isfinite(reading.angle_deg)


def _missing(gauge: Gauge, found: Sequence[Readings]) -> int:
    """Count the readings of a gauge's needles that are missing."""
    return sum(readings[needle.name].status is Status.MISSING for readings in found for needle in gauge.over_face)


def _lost(gauge: Gauge, before: Sequence[Readings], after: Sequence[Readings]) -> int:
    """Count the readings of a gauge's needles that are missing `after`, or elsewhere than `before`."""
    pairs = [
        (old[needle.name], new[needle.name])
        for old, new in zip(before, after, strict=True)
        for needle in gauge.over_face
    ]
    moved = (
        old.is_seen and new.is_seen and abs(math.remainder(new.angle_deg - old.angle_deg, FULL_CIRCLE_DEG)) > APART_DEG
        for old, new in pairs
    )
    return _missing(gauge, after) + sum(moved)


def read_sample(reader: PanelReader, samples: Sequence[UnwrappedFrame]) -> Sequence[Readings]:
    """Read a sample, by frame."""
    return [frame.readings for frame in reader.read_unwrapped(samples)]
