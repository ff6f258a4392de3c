"""All gauges of many frames: what is plain by the quick reader, the rest by the gauge readers one by one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Protocol

import numpy as np

from decoder.alignment import Alignment
from decoder.arrays import Floats
from decoder.gauge import Gauge
from decoder.gauge_reader import STACKED, GaugeReader
from decoder.pictures import GreyPicture
from decoder.quick_pixels import Pixels, QuickGrids
from decoder.quick_reader import Plain, QuickReader
from decoder.quick_search import QuickNeedle
from decoder.reading import Reading
from decoder.scale_marks import FULL_CIRCLE_DEG
from decoder.searching import Search, Sought
from decoder.touching_pairs import STATUSES
from decoder.tuning import Tuning
from decoder.unwrapping import PolarGrid, UnwrappedGauge, Unwrapper


class OneGaugeReader(Protocol):
    """Reads one gauge of one frame: a `GaugeReader` or a `CardReader`."""

    def read(self, unwrapped: UnwrappedGauge, scores: Mapping[str, Floats], /) -> dict[str, Reading]:
        """The readings by name."""
        ...

    def unread(self) -> dict[str, Reading]:
        """What is to be said of a gauge that does not lie in the frame."""
        ...


class GaugesOfFrame(Protocol):
    """The gauges of one frame, `whole` telling for each whether all of it lies in the frame."""

    whole: Sequence[bool]

    def quick(self, grids: QuickGrids) -> Pixels:
        """The pixels that the quick reader asks for."""
        ...

    def unwrapped(self, index: int, unwrapper: Callable[[], Unwrapper]) -> UnwrappedGauge:
        """One gauge, unwrapped."""
        ...


class PlacedFrame:
    """The gauges of a frame whose alignment is known; what the search needs is sampled at once."""

    def __init__(self, picture: GreyPicture, alignment: Alignment, whole: Sequence[bool]) -> None:
        self._picture, self._alignment, self.whole = picture, alignment, whole

    def quick(self, grids: QuickGrids) -> Pixels:
        """The pixels that the quick reader asks for."""
        return grids.of_frame(self._picture, self._alignment)

    def unwrapped(self, _: int, unwrapper: Callable[[], Unwrapper]) -> UnwrappedGauge:
        """One gauge, unwrapped."""
        (image,) = unwrapper().unwrap(self._picture, self._alignment)
        return image


class UnwrappedGauges:
    """The gauges of a frame that is unwrapped already."""

    def __init__(self, gauges: Sequence[UnwrappedGauge], whole: Sequence[bool]) -> None:
        self._gauges, self.whole = gauges, whole
        self._quick: tuple[QuickGrids, Pixels] | None = None

    def quick(self, grids: QuickGrids) -> Pixels:
        """The pixels that the quick reader asks for; kept for the next that asks on the same grids."""
        if self._quick is None or self._quick[0] is not grids:
            self._quick = grids, grids.of_unwrapped(self._gauges)
        return self._quick[1]

    def unwrapped(self, index: int, _: Callable[[], Unwrapper]) -> UnwrappedGauge:
        """One gauge, unwrapped."""
        return self._gauges[index]


class _Gauge:
    """One gauge of the panel: its grid, and the needles to be searched for if the quick reader has not done that."""

    def __init__(self, gauge: Gauge, grid: PolarGrid, face: UnwrappedGauge, tuning: Tuning) -> None:
        self.gauge, self.grid, self.face = gauge, grid, face
        self.is_searched = _is_searched(gauge)
        self.is_quick = _is_quick(gauge, grid)
        self._templates = {needle.name: tuning.templates[needle.name] for needle in gauge.needles}

    def quick_needles(self, index: int) -> list[QuickNeedle]:
        if not self.is_quick:
            return []
        return [
            QuickNeedle(name, index, self.gauge, self.grid, self.face, template)
            for name, template in self._templates.items()
        ]

    def scores(self, image: UnwrappedGauge) -> dict[str, Floats]:
        """Of the search on the whole unwrapped gauge, by needle."""
        if not self.is_searched:
            return {}
        return dict(zip(self._templates, self._search.scores([image]), strict=True))

    @cached_property
    def unwrapper(self) -> Unwrapper:
        return Unwrapper([self.grid])

    @cached_property
    def _search(self) -> Search:
        return Search([Sought(template, self.face, 0) for template in self._templates.values()])


def _is_searched(gauge: Gauge) -> bool:
    return gauge.card is None and len(gauge.needles) < STACKED


def _is_quick(gauge: Gauge, grid: PolarGrid) -> bool:
    return _is_searched(gauge) and grid.raised is None


def quick_grids_of(gauges: Sequence[Gauge], unwrapper: Unwrapper) -> QuickGrids | None:
    """The grids of those gauges that may be read in many frames at once; None if there are none."""
    parts = zip(gauges, unwrapper.grids, strict=True)
    quick = [index for index, (gauge, grid) in enumerate(parts) if _is_quick(gauge, grid)]
    return QuickGrids(quick, unwrapper) if quick else None


class ManyFrames:
    """Reads the gauges of one panel in many frames at once.

    `readers` are by the gauges' order in the panel; without `is_quick` all is left to them. `quick_grids` are as
    `quick_grids_of` makes them, if they are at hand.
    """

    def __init__(
        self,
        gauges: Sequence[Gauge],
        grids: Sequence[PolarGrid],
        tuning: Tuning,
        readers: Sequence[OneGaugeReader],
        *,
        is_quick: bool,
        quick_grids: QuickGrids | None = None,
    ) -> None:
        self._readers = readers
        self._gauges = [_Gauge(*own, tuning) for own in zip(gauges, grids, tuning.faces, strict=True)]
        needles = [
            needle for index, gauge in enumerate(self._gauges) if is_quick for needle in gauge.quick_needles(index)
        ]
        seen = quick_grids or quick_grids_of(gauges, Unwrapper(grids)) if needles else None
        known = [reader.pairs for reader in readers if isinstance(reader, GaugeReader)]
        pairs = {name: pair for own in known for name, pair in own.items()}
        self._quick = None if seen is None else QuickReader(needles, seen, tuning.evenly_lit_score, pairs)
        self._needles: list[list[tuple[int, str]]] = [
            [(number, needle.name) for number, needle in enumerate(needles) if needle.gauge_index == index]
            for index in range(len(grids))
        ]
        self._gauge_of_needle = [needle.gauge_index for needle in needles]
        self._of_needle = [self._gauges[index] for index in self._gauge_of_needle]

    def read(self, frames: Sequence[GaugesOfFrame], place_sigmas_deg: Floats) -> list[list[Mapping[str, Reading]]]:
        """By frame and gauge the readings by name, to the bit the same whatever the frames beside it.

        `place_sigmas_deg` (F, gauges) are what readings are uncertain by because their dials' places are.
        """
        if self._quick is None or not frames:
            return [
                [self._read(index, frame, None, sigma_deg) for index, sigma_deg in enumerate(own)]
                for frame, own in zip(frames, place_sigmas_deg.tolist(), strict=True)
            ]
        plain = self._quick.read([frame.quick(self._quick.grids) for frame in frames])
        of_gauges = [[needle for needle, _ in own] for own in self._needles]
        settled = np.array([plain.settled[:, own].all(axis=1) for own in of_gauges]).tolist()
        readings = self._plain_readings(plain, place_sigmas_deg)
        return [
            [
                {name: readings[number][needle] for needle, name in own}
                if own and frame.whole[index] and settled[index][number]
                else self._read(
                    index,
                    frame,
                    _spread(self._quick, plain, number, own),
                    float(place_sigmas_deg[number, index]),
                )
                for index, own in enumerate(self._needles)
            ]
            for number, frame in enumerate(frames)
        ]

    def _plain_readings(self, plain: Plain, place_sigmas_deg: Floats) -> list[list[Reading]]:
        """By frame and needle; to be believed where they are settled."""
        steps_deg = np.array([gauge.grid.step_deg for gauge in self._of_needle])
        starts_deg = np.array([gauge.grid.start_deg for gauge in self._of_needle])
        firsts_deg = np.array([gauge.gauge.sweep[0] for gauge in self._of_needle])
        is_round = np.array([gauge.gauge.is_round for gauge in self._of_needle])
        angles_deg = starts_deg + plain.row * steps_deg
        angles_deg = np.where(is_round, firsts_deg + (angles_deg - firsts_deg) % FULL_CIRCLE_DEG, angles_deg)
        sigmas_deg = np.hypot(plain.sigma_rows * steps_deg, place_sigmas_deg[:, self._gauge_of_needle])
        columns = (plain.status.tolist(), angles_deg.tolist(), sigmas_deg.tolist(), plain.score.tolist())
        return [
            [
                Reading(STATUSES[status], at_deg, sigma_deg, score)
                for status, at_deg, sigma_deg, score in zip(*own, strict=True)
            ]
            for own in zip(*columns, strict=True)
        ]

    def _read(
        self, index: int, frame: GaugesOfFrame, scores: Mapping[str, Floats] | None, place_sigma_deg: float
    ) -> Mapping[str, Reading]:
        """One gauge by its own reader."""
        if not frame.whole[index]:
            return self._readers[index].unread()
        gauge = self._gauges[index]
        image = frame.unwrapped(index, lambda: gauge.unwrapper)
        found = self._readers[index].read(image, gauge.scores(image) if scores is None else scores)
        return {name: reading.in_place_within(place_sigma_deg) for name, reading in found.items()}


def _spread(quick: QuickReader, plain: Plain, number: int, own: Sequence[tuple[int, str]]) -> dict[str, Floats] | None:
    """What the quick reader's search found on a gauge's rows; None where it did not search."""
    if not own:
        return None
    return {name: quick.search.search.spread(needle, plain.coarse[number, needle]) for needle, name in own}
