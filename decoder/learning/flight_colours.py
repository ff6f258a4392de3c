"""The grey in which each gauge of a panel is read, chosen from a few frames of a flight.

A flight that is all read in luma never decodes its colours, so they cost nothing there.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from operator import itemgetter

import numpy as np

from decoder.imaging.picture_block import TopOfFrame
from decoder.imaging.pictures import Extreme, FramePicture, GreyPicture, Mixed
from decoder.imaging.unwrapping import Unwrapper, WindowGrid
from decoder.instruments.appearance import Placed
from decoder.instruments.colours import (
    best_mixture,
    changes_in_luma,
    luma_of,
    mixtures_for,
    needle_rows,
    rows_shown,
    shows_colour,
)
from decoder.instruments.kind_table import kind_of
from decoder.instruments.panel_reader import PanelReader, appearance_from_panel, taken
from decoder.instruments.thresholds import CLEARLY_WORSE
from decoder.learning.thresholds import LOOKED_AT, SAMPLE_FRAMES
from decoder.panel.arrays import Floats
from decoder.panel.errors import PictureError
from decoder.registration.frame_placer import UnwrappedPanel

Frame = GreyPicture | FramePicture | TopOfFrame


def in_best_colours(
    reader: PanelReader, lost: Sequence[int], missed: Collection[int], sample: Callable[[int], Iterable[Frame]]
) -> PanelReader:
    """Read gauges in the mixture of colours that best shows what moves; return the same reader if nothing changes.

    Parameters
    ----------
    lost
        The gauges that may not be visible as they are read now. The others keep their mixture, except windows in which
        luma shows no change at all, and lamps: sun on one that turns from green to red is a change, but one that is as
        bright in either would be read confidently, as never lit.
    missed
        Those of them that are read in too few frames: any colour that is clearer than luma is tried.
    sample
        Returns frames of the flight. A few show what turns; windows need more, as a lamp is lit in some frames only.
    """
    source = reader.source
    gauges, grids = source.panel.gauges, reader.grids
    windows = [index for index, grid in enumerate(grids) if isinstance(grid, WindowGrid)]
    rows = {index: rows_shown(gauges[index], grids[index]) for index in sorted({*lost, *windows})}
    if not rows or not source.encoded:
        return reader
    drawn = dict(zip(rows, _panels_colours(reader, list(rows)), strict=True))
    # A lamp may be grey where the panel picture shows it, and as bright in colour once it is lit.
    coloured = [
        index for index in rows if shows_colour(drawn[index], rows[index]) or gauges[index].kind.brightens is not None
    ]
    count = LOOKED_AT if set(coloured).isdisjoint(windows) else SAMPLE_FRAMES
    seen = _seen(reader, coloured, sample(count)) if coloured else []
    before = source.mixtures or (None,) * len(grids)
    mixtures = list(before)
    for place, index in enumerate(coloured):
        gauge, grid, frames = gauges[index], grids[index], [own[place] for own in seen]
        times = 1.0 if index in missed else CLEARLY_WORSE
        best = _best_mixture(Placed(index, gauge, grid), drawn[index], frames, is_lost=index in lost, times=times)
        mixtures[index] = best or before[index]
    if tuple(mixtures) == before:
        return reader
    panel = UnwrappedPanel(replace(source, mixtures=tuple(mixtures)), reader.drawn.aligner)
    changed = {index for index, own in enumerate(mixtures) if own != before[index]}
    look = appearance_from_panel(panel, reader.appearance, otherwise=changed)
    return PanelReader.of(panel.source, reader.method, look, reader.placement, panel)


def _best_mixture(
    placed: Placed, drawn: Floats, frames: Sequence[Floats], *, is_lost: bool, times: float
) -> Mixed | None:
    """Choose the grey in which a gauge is read best, given as for `mixtures_for`; None if that is luma.

    A mixture has to be so many `times` as clear as luma.

    A kind that tells how much a grey leaves unexplained is read in an extreme of all colours, unless luma explains
    clearly more. Luma, or one colour, might hide a part of a bar that has another colour, such as its red, and shows in
    frames that are not among these.
    """
    gauge, grid = placed.gauge, placed.sampled
    is_lost = is_lost or gauge.kind.brightens is not None or not changes_in_luma(grid, drawn, frames)

    def left_in(levels: Callable[[Floats], Floats]) -> float | None:
        return kind_of(gauge).unexplained(placed, levels(drawn), [levels(each) for each in frames])

    in_luma = left_in(luma_of) if frames else None
    if in_luma is not None or (frames and is_lost):
        left = [(part, each) for each in Extreme if (part := left_in(each.levels)) is not None]
        better = [each for each in left if in_luma is None or each[0] < CLEARLY_WORSE * in_luma]
        if left:
            return min(better, key=itemgetter(0), default=(0.0, None))[1]
    if not is_lost:
        return None
    choice = mixtures_for(gauge, grid, drawn, frames)
    return best_mixture(grid, drawn, frames, needle_rows(gauge, grid), choice, times=times)


def _panels_colours(reader: PanelReader, indices: Sequence[int]) -> list[Floats]:
    """Sample some gauges in colour, as the panel picture shows them."""
    source = reader.source
    unwrapper = Unwrapper([reader.grids[index] for index in indices])
    return unwrapper.colours(source.dials_in_colour(), source.optics.own)


def _seen(reader: PanelReader, indices: Sequence[int], frames: Iterable[Frame]) -> list[list[Floats]]:
    """Sample some of the gauges in colour, in each frame in which the panel is found."""
    unwrapper = Unwrapper([reader.grids[index] for index in indices])
    seen = []
    for placed in reader.placer.placed(taken(frames)):
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
