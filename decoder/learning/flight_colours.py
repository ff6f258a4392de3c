"""In which grey each gauge of a panel is read, as a few frames of a flight tell it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from decoder.imaging.unwrapping import Unwrapper
from decoder.instruments.colours import best_mixture, needle_rows
from decoder.instruments.panel_reader import PanelReader, appearance_from_panel, taken
from decoder.learning.flight_sample import Sample
from decoder.learning.thresholds import LOOKED_AT
from decoder.panel.arrays import Floats
from decoder.panel.errors import PictureError
from decoder.registration.frame_placer import UnwrappedPanel


def in_best_colours(reader: PanelReader, sample: Sample) -> PanelReader:
    """Let each gauge be read in the grey that tells its needles best; the same reader where that is as it was."""
    source = reader.source
    rows = {
        index: its
        for index, (gauge, grid) in enumerate(zip(source.panel.gauges, reader.grids, strict=True))
        if (its := needle_rows(gauge, grid))
    }
    if not rows or not source.encoded:
        return reader
    unwrapper = Unwrapper([reader.grids[index] for index in rows])
    drawn = unwrapper.colours(source.in_colour(source.panel.picture), source.optics.own)
    seen = _seen(reader, unwrapper, list(rows), sample)
    before = source.mixtures or (None,) * len(reader.grids)
    mixtures = list(before)
    for place, (index, its) in enumerate(rows.items()):
        best = best_mixture(drawn[place], [gauges[place] for gauges in seen], its)
        mixtures[index] = best if seen else before[index]
    if tuple(mixtures) == before:
        return reader
    coloured = UnwrappedPanel(replace(source, mixtures=tuple(mixtures)))
    look = appearance_from_panel(coloured, reader.appearance)
    return PanelReader.of(coloured.source, reader.method, look, reader.placement, coloured)


def _seen(reader: PanelReader, unwrapper: Unwrapper, indices: Sequence[int], sample: Sample) -> list[list[Floats]]:
    """By frame of a few in which the panel is found, some of its gauges in colour."""
    seen = []
    for placed in reader.placer.placed(taken(sample(LOOKED_AT))):
        if isinstance(placed, PictureError):
            continue
        picture, frame = placed
        colour = picture.in_colour()
        if not frame.dial_shifts_px:
            seen.append(unwrapper.colours(colour, frame.alignment))
            continue
        own = []
        for grid, index in zip(unwrapper.grids, indices, strict=True):
            x, y = frame.dial_shifts_px[index]
            there = frame.alignment.after(np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]]))
            own += Unwrapper([grid]).colours(colour, there)
        seen.append(own)
    return seen
