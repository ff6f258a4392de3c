"""The grey in which a gauge is read: luma, or a mixture of colours that separates what moves on it from the rest.

A red needle on a teal dial, or a horizon's blue above its brown, may be as bright as its surroundings. Luma, the only
component that is normally decoded, then does not show it, but red alone does. A frame's pixels around the gauge are
mixed before they are resampled, so all code that learns and reads gets one grey picture in either case.

JPEG and video have one colour sample for each two by two pixels. A mixture must separate what moves twice as clearly as
luma to be better wherever it is read; where luma reads nothing, a little more clearly is enough. A window is read in
one colour alone, to which anything that shines adds light; a bar in the brightest or darkest of all colours, since it
may have several.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import combinations, product

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.pictures import Mixture
from decoder.imaging.sorting import MAD_TO_SIGMA, median_of
from decoder.imaging.unwrapping import Grid, PolarGrid, Unwrapper, WindowGrid, row_of_angle
from decoder.instruments.thresholds import CLEARLY_WORSE
from decoder.matching.faces import in_light_of
from decoder.matching.thresholds import MIN_VIEWS
from decoder.panel.arrays import Floats, Mask
from decoder.panel.gauge import Gauge
from decoder.registration.thresholds import NOISE_LEVELS

LUMA = np.array([0.299, 0.587, 0.114])  # the weights of a JPEG's luma. Source: JFIF
# The share of a dial's pixels that is taken to stand still, whatever moves on it: what they show in frames is noise.
STILL_PART = 0.25


@cache
def mixtures() -> tuple[Mixture, ...]:
    """List all mixtures, without those of opposite sign, and without the sum of all three, which is luma again."""
    counts = [each for each in product((1, 0, -1), repeat=3) if next(filter(None, each), 0) == 1]
    return tuple(Mixture(*each) for each in counts if min(each) < 1)


def luma_of(colours: Floats) -> Floats:
    """(...): the luma of colours (..., 3)."""
    luma: Floats = colours @ LUMA.astype(np.float32)
    return luma


def needle_rows(gauge: Gauge, grid: Grid) -> list[Mask]:
    """(R,) for each needle that the panel picture shows: the rows of its dial that it covers; none for a window.

    A needle drawn beside its dial's sweep covers none, and is left out.
    """
    if not isinstance(grid, PolarGrid):
        return []
    covered = [
        np.abs(np.arange(grid.rows) - row_of_angle(grid, needle.at_deg)) * grid.step_deg <= needle.hides_deg / 2
        for needle in gauge.over_face
        if needle.at_deg is not None and needle.hides_deg is not None
    ]
    return [rows for rows in covered if rows.any()]


def rows_shown(gauge: Gauge, grid: Grid) -> list[Mask]:
    """(R,) each: the rows that have to show something: `needle_rows`, or if there are none, all rows."""
    return needle_rows(gauge, grid) or [np.ones(grid.rows, bool)]


def in_panels_colours(source: PanelPictures) -> PanelPictures:
    """Choose a mixture for gauges whose needles the panel picture shows in colour only.

    Raises
    ------
    PanelError
        As `PanelPictures.grid`.
    """
    source = source.with_planes()
    if source.mixtures or not source.encoded:
        return source
    mixtures = tuple(_seen_in(source, gauge, index) for index, gauge in enumerate(source.panel.gauges))
    return replace(source, mixtures=mixtures) if any(mixtures) else source


def _seen_in(source: PanelPictures, gauge: Gauge, index: int) -> Mixture | None:
    """Return a mixture that shows the needles, if luma does not; None if luma does, or if no mixture does."""
    grid = source.grid(index)
    rows = needle_rows(gauge, grid)
    if not rows:
        return None
    (grey,) = Unwrapper([grid]).unwrap(source.picture, source.optics.own)
    if all(grey[its].std() >= NOISE_LEVELS for its in rows):
        return None
    (colours,) = Unwrapper([grid]).colours(source.in_colour(source.panel.picture), source.optics.own)
    best = max(mixtures(), key=lambda mixture: _least_spread(colours @ mixture.parts, rows))
    return best if _least_spread(colours @ best.parts, rows) >= CLEARLY_WORSE * NOISE_LEVELS else None


def _least_spread(drawn: Floats, rows: Sequence[Mask]) -> float:
    return min(float(drawn[its].std()) for its in rows)


def shows_colour(drawn: Floats, rows: Sequence[Mask]) -> bool:
    """Whether the panel picture (R, C, 3) has more colour in some rows of a gauge than noise explains."""
    beside = drawn - (drawn @ LUMA.astype(np.float32))[..., None]
    return any(float(beside[its].std(axis=(0, 1)).max()) > NOISE_LEVELS for its in rows)


def changes_in_luma(grid: Grid, drawn: Floats, seen: Sequence[Floats]) -> bool:
    """Whether luma shows more change of a gauge than noise explains, given as for `mixtures_for`."""
    luma = _clearness(grid, drawn, seen, (), LUMA)
    return max(luma) > CLEARLY_WORSE


def mixtures_for(gauge: Gauge, grid: Grid, drawn: Floats, seen: Sequence[Floats]) -> list[Mixture]:
    """List the mixtures for a gauge: all for a dial; for a window single colours, to which what shines adds light.

    `drawn` (R, C, 3) is the gauge in the panel picture, and `seen` the same in some frames.
    """
    if isinstance(grid, PolarGrid):
        return list(mixtures())
    alone = Mixture(1, 0, 0), Mixture(0, 1, 0), Mixture(0, 0, 1)
    brightens = gauge.kind.brightens
    if brightens is None:
        return list(alone)
    return [each for each in alone if _brightens(grid, drawn, seen, each.parts) == brightens]


def _brightens(grid: WindowGrid, drawn: Floats, seen: Sequence[Floats], parts: NDArray[np.float64]) -> bool:
    """Whether a window that differs most from the panel picture's in the same light is brighter."""
    own = drawn @ parts
    apart = [float((view - own)[grid.within].mean()) for view in _in_light(grid, own, [each @ parts for each in seen])]
    return max(apart, key=abs, default=0.0) > 0.0


def _in_light(grid: Grid, own: Floats, seen: Sequence[Floats]) -> list[Floats]:
    """(R, C) for each frame that is lit well enough: the gauge, brought into the panel picture's light.

    The light on a window is measured around it, since a lamp may fill most of the window.
    """
    if isinstance(grid, WindowGrid) and grid.margin:
        around = np.ones(own.shape, bool)
        around[grid.within] = False
        return [each * float(own[around].mean() / max(each[around].mean(), 1.0)) for each in seen]
    return [view for view in in_light_of(own, seen) if view is not None]


def best_mixture(
    grid: Grid,
    drawn: Floats,
    seen: Sequence[Floats],
    needles: Sequence[Mask],
    choice: Sequence[Mixture],
    *,
    times: float = CLEARLY_WORSE,
) -> Mixture | None:
    """Choose the mixture that separates what moves so many times as clearly as luma; None if there is none.

    Parameters
    ----------
    drawn
        (R, C, 3): the unwrapped gauge in the panel picture, in colour.
    seen
        The same in some frames.
    needles
        As `needle_rows`. The mixture must show the needle that is least clear in luma better, and no other may become
        less clear than that one was; if no mixture does, the same test is applied to the two needles that luma
        distinguishes least. Without needles, everything that changes between frames is compared. Of mixtures that are
        about as clear, the one in which the panel picture's needles are found again best is chosen.
    choice
        As `mixtures_for`.
    """
    luma = _clearness(grid, drawn, seen, needles, LUMA)
    told = {mixture: _clearness(grid, drawn, seen, needles, mixture.parts) for mixture in choice}
    count = len(needles) or 1
    for part in (slice(0, count), slice(count, len(luma))):
        dimmest = part.start + int(np.argmin(luma[part])) if luma[part] else 0
        least = luma[dimmest]
        better = [
            each
            for each, clear in told.items()
            if clear[dimmest] > max(times * least, CLEARLY_WORSE) and min(clear[:count] + clear[part]) > least
        ]
        if better:
            least_clear = {each: min(told[each][:count] + told[each][part]) for each in better}
            clear = [each for each in better if CLEARLY_WORSE * least_clear[each] >= max(least_clear.values())]
            return min(clear, key=lambda each: (_not_found_again(drawn, seen, needles, each.parts), -least_clear[each]))
    return _found_again(drawn, seen, needles, [each for each in choice if min(told[each]) > CLEARLY_WORSE])


def _found_again(
    drawn: Floats, seen: Sequence[Floats], needles: Sequence[Mask], choice: Sequence[Mixture]
) -> Mixture | None:
    """Choose the mixture in which needles are found again clearly better than in luma; None if there is none.

    Digits or anything else that changes behind a needle may show more clearly in luma than the needle does in any
    mixture, and hide it there.
    """
    if not needles:
        return None
    told = {each: _not_found_again(drawn, seen, needles, each.parts) for each in choice}
    best = min(told, key=lambda each: told[each], default=None)
    in_luma = _not_found_again(drawn, seen, needles, LUMA)
    return best if best is not None and CLEARLY_WORSE * told[best] < in_luma else None


def _not_found_again(
    drawn: Floats, seen: Sequence[Floats], needles: Sequence[Mask], parts: NDArray[np.float64]
) -> float:
    """Return the part of needles, as the panel picture shows them, that frames leave unexplained on average.

    What a reflection or another light adds may be strong in one colour, and hardly show in another that is as clear.
    The usual dial is left out: print next to a needle is found again in all frames.
    """
    weights = parts.astype(np.float32)
    own = drawn @ weights
    views = [view for view in in_light_of(own, [each @ weights for each in seen]) if view is not None]
    if not views:
        return 1.0
    usual = median_of(np.stack(views))
    cuts = [(own - usual)[its] for its in needles]
    found = [cv2.matchTemplate(view - usual, cut, cv2.TM_CCOEFF_NORMED).max() for cut in cuts for view in views]
    return float(np.mean(1.0 - np.square(np.maximum(found, 0.0)))) if found else 0.0


def _clearness(
    grid: Grid, drawn: Floats, seen: Sequence[Floats], needles: Sequence[Mask], parts: NDArray[np.float64]
) -> list[float]:
    """Return the contrast of each needle against the usual dial, and of each two needles; or of all that moves.

    Contrasts are in sigmas of noise. The noise of each colour is at least that of sensors and JPEGs, and more if the
    stillest part of the dial differs by more. Without needles, all pixels count although few of them move, so the
    contrast is scaled: noise alone just reaches the limit for a clear contrast. What changes around a window, such as
    the lamp beside it, is not its own.
    """
    weights = parts.astype(np.float32)
    own = drawn @ weights
    views = _in_light(grid, own, [each @ weights for each in seen])
    if len(views) < MIN_VIEWS:
        return [0.0] * (math.comb(len(needles) + 1, 2) or 1)
    usual = median_of(np.stack(views))
    left = np.stack(views) - usual
    spread = MAD_TO_SIGMA * float(np.quantile(np.median(np.abs(left), axis=0), STILL_PART))
    noise = float(np.hypot(spread, NOISE_LEVELS * np.linalg.norm(parts)))
    shown = [(own - usual)[its] for its in needles]
    inside = left[:, *grid.within] if isinstance(grid, WindowGrid) else left
    moves = [*shown, *(_difference(*both) for both in combinations(shown, 2))] or [CLEARLY_WORSE * inside]
    return [math.sqrt(float(np.mean(each**2))) / noise for each in moves]


def _difference(one: Floats, other: Floats) -> Floats:
    """(C,): subtract the clearest pixels of two needles (R, C), at each distance from the centre.

    Only rows close to their drawn axes count: another needle may be in those around.
    """
    first, second = (_clearest(each[len(each) // 4 : len(each) - len(each) // 4]) for each in (one, other))
    difference: Floats = first - second
    return difference


def _clearest(shown: Floats) -> Floats:
    """(C,): the value farthest from zero in each column (R, C)."""
    clearest: Floats = np.take_along_axis(shown, np.abs(shown).argmax(axis=0)[None], axis=0)[0]
    return clearest
