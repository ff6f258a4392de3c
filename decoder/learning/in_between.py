"""Looking at frames between those of a sample, for instruments of which any one frame shows only a part.

A tape moves on between two frames of a sample by more than its window shows. Halving the time between a frame whose
part is known and one whose part is not, again and again, leads to frames that overlap what is known.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

from decoder.imaging.unwrapping import UnwrappedGauge
from decoder.instruments.appearance import Grower, Instrument
from decoder.instruments.kind_table import kind_of
from decoder.instruments.panel_reader import PanelReader, unwrapped
from decoder.learning.flight_sample import FlightSample, Tell, nobody
from decoder.learning.thresholds import SAMPLE_FRAMES

# The most frames that are looked at, the sample's among them.
MOST_FRAMES = 8 * SAMPLE_FRAMES


def learn_in_between(reader: PanelReader, sample: FlightSample, *, tell: Tell = nobody) -> PanelReader:
    """Let instruments that need more than a sample learn from frames in between."""
    growers = dict(_growers(reader))
    if not growers:
        return reader
    tell("looking at frames in between for what a sample shows too little of")
    looked = _Looked(reader, sample, growers)
    wanted: Sequence[int] = sample.ranks
    while wanted:
        looked.at(wanted)
        wanted = looked.between()
    before = reader.appearance
    pictures = {name: own for grower in growers.values() for name, own in grower.pictures.items()}
    return reader.with_appearance(replace(before, pictures={**before.pictures, **pictures}))


def _growers(reader: PanelReader) -> Iterator[tuple[int, Grower]]:
    """Yield what learns more, by the gauge's index in the panel."""
    appearance = reader.appearance
    for index, gauge in enumerate(reader.source.panel.gauges):
        instrument = Instrument(index, gauge, reader.grids[index], appearance.faces[index])
        grower = kind_of(gauge).grower(instrument, appearance)
        if grower is not None:
            yield index, grower


class _Looked:
    """What growers know of the frames that were looked at, by rank."""

    def __init__(self, reader: PanelReader, sample: FlightSample, growers: Mapping[int, Grower]) -> None:
        self._reader, self._sample, self._growers = reader, sample, growers
        self._tried: set[int] = set()
        self._ranks: list[int] = []
        self._is_known: dict[int, Sequence[bool]] = {}

    def at(self, ranks: Sequence[int]) -> None:
        """Look at more frames; those in which the panel is not found are left out."""
        strips: dict[int, list[UnwrappedGauge]] = {index: [] for index in self._growers}
        for rank in ranks:
            self._tried.add(rank)
            taken = self._sample.at(rank)
            for frame in unwrapped(self._reader, [] if taken is None else [taken]):
                self._ranks.append(rank)
                for index, own in strips.items():
                    own.append(frame.gauges[index])
        for index, own in strips.items():
            if own:
                self._is_known[index] = self._growers[index].add(own)

    def between(self) -> list[int]:
        """Return ranks half way between frames of which a grower knows one; at first between all, if it knows none."""
        wanted = set[int]()
        for is_known in self._is_known.values():
            known = sorted(zip(self._ranks, is_known, strict=True))
            wanted |= {
                (first + last) // 2
                for (first, one), (last, other) in pairwise(known)
                if one != other or (len(self._tried) <= SAMPLE_FRAMES and not any(is_known))
            }
        return sorted(wanted - self._tried)[: MOST_FRAMES - len(self._tried)]
