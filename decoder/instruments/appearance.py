"""What instruments look like, and instruments as their kinds see them: as drawn in a panel, or with a learned look.

At first a needle's template is cut from the panel picture, or given as a cropped unwrapped picture (thesis 3.2.1). The
face of a dial is the panel picture without its needles; what they hide is filled in with the median of the dial at that
radius.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Protocol

import cv2
import numpy as np

from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.planes import Squeeze
from decoder.imaging.sorting import median_of
from decoder.imaging.unwrapping import (
    Grid,
    PolarGrid,
    UnwrappedGauge,
    Unwrapper,
    WindowGrid,
    needle_places,
    polar,
    row_of_angle,
    rows_in_sweep,
    turn_rows,
    windowed,
)
from decoder.instruments.found import Needle
from decoder.instruments.sampling import ALL, Part, SeenGauge
from decoder.matching.correlation import normxcorr
from decoder.matching.faces import bare_face, face_behind
from decoder.matching.needle_layer import cut_over, first_layer, without_others
from decoder.matching.needle_template import NeedleTemplate, odd_rows
from decoder.panel.arrays import Floats
from decoder.panel.errors import PanelError
from decoder.panel.gauge import Gauge
from decoder.panel.kinds.needles import Needle as DescribedNeedle
from decoder.panel.scale import FULL_CIRCLE_DEG, shortest
from decoder.registration.pivot import UNKNOWN, Pivot
from decoder.registration.thresholds import NOISE_LEVELS, SCORE_THRESHOLD


@dataclass(frozen=True, slots=True)
class CardPicture:
    """A card that turns, as it lies in the panel picture; both (P, C) float32, one turn of rows from the sweep's start.

    Attributes
    ----------
    card
        Its grey levels.
    weights
        In [0, 1]: how well each place of the dial, which stands still, shows the card.
    """

    card: UnwrappedGauge
    weights: UnwrappedGauge

    @property
    def is_learned(self) -> bool:
        """Whether a flight separated the card from what stands still over it."""
        return bool((self.weights < 1.0).any())


LearnedPicture = Any
"""What a kind learns of a quantity beside a dial's face and templates; only that kind understands it."""


@dataclass(frozen=True, slots=True)
class Look:
    """What one instrument looks like: the part of `Appearance` for its own quantities."""

    face: UnwrappedGauge
    templates: Mapping[str, NeedleTemplate] = field(default_factory=dict)
    pictures: Mapping[str, LearnedPicture] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Appearance:
    """What a panel's instruments look like: from the panel picture alone at first, then from the flight's frames.

    The other half of what is learned from a flight is where things are: `decoder.registration.placement.Placement`.

    Attributes
    ----------
    templates
        By needle.
    faces
        For each gauge in the panel's order, the unwrapped dial without needles, (rows, columns) float32.
    evenly_lit_score
        The lowest score of needles in even light. One that matches less well may be in light that varies across the
        dial, which shifts its reading.
    pictures
        By quantity, for the kinds that learn more than needles do.
    doubted
        Needles that were found in only a few of the sampled frames. What matched there may be what lay behind them in
        the panel picture.
    least_at_home
        For each needle that seemed to stand still, the lowest score to be trusted exactly where it was cut. Print
        behind it, with the needle elsewhere, may match there too, but less well.
    likely_print
        Needles that stood still while something else moved on their dials, or were learned from something else: never
        read.
    taught
        Indices in the panel of the instruments without needles that need not be learned again, since the flight would
        teach the same as long as they stay where they are. Windows always stay, wherever pivots are.
    """

    templates: Mapping[str, NeedleTemplate]
    faces: tuple[UnwrappedGauge, ...]
    evenly_lit_score: float
    pictures: Mapping[str, LearnedPicture] = field(default_factory=dict)
    doubted: frozenset[str] = frozenset()
    least_at_home: Mapping[str, float] = field(default_factory=dict)
    likely_print: frozenset[str] = frozenset()
    taught: frozenset[int] = frozenset()

    def look_of(self, index: int, gauge: Gauge) -> Look:
        """Return what is known of one gauge that has no needles."""
        names = [quantity.name for quantity in gauge.quantities if quantity.name in self.pictures]
        return Look(self.faces[index], pictures={name: self.pictures[name] for name in names})

    @classmethod
    def of(cls, looks: Sequence[Look], evenly_lit_score: float) -> Appearance:
        """Collect the looks of a panel's instruments, in the panel's order."""
        templates = {name: template for look in looks for name, template in look.templates.items()}
        pictures = {name: picture for look in looks for name, picture in look.pictures.items()}
        return cls(templates, tuple(look.face for look in looks), evenly_lit_score, pictures)


@dataclass(frozen=True, slots=True)
class Placed:
    """One gauge of a panel; `index` is its place there."""

    index: int
    gauge: Gauge
    sampled: Grid

    @property
    def grid(self) -> PolarGrid:
        """The grid of a dial."""
        return polar(self.sampled)

    @property
    def window(self) -> WindowGrid:
        """The grid of a window."""
        return windowed(self.sampled)


@dataclass(frozen=True, slots=True)
class DrawnInstrument(Placed):
    """A gauge and how the panel picture shows it: `strip`, as it is sampled.

    `known` are the pictures that were learned before a flight moved it from where it was drawn; None if it is there.
    """

    source: PanelPictures
    strip: UnwrappedGauge
    known: Mapping[str, LearnedPicture] | None

    @property
    def is_moved(self) -> bool:
        """Whether a flight has moved it: then it is no error in the panel if no needle shows."""
        return self.known is not None


@dataclass(frozen=True, slots=True)
class Instrument(Placed):
    """A gauge as its kind sees it; `face` is the dial without needles."""

    face: UnwrappedGauge

    def needles(self, appearance: Appearance) -> list[Needle]:
        """Return its needles with what is needed to search for them."""
        return [
            Needle(
                needle.name,
                self.index,
                self.gauge,
                self.grid,
                self.face,
                appearance.templates[needle.name],
                is_doubted=needle.name in appearance.doubted,
            )
            for needle in self.gauge.needles
        ]


class Grower(Protocol):
    """Learns more and more of a look, of which any one frame shows only a part."""

    @property
    def pictures(self) -> Mapping[str, LearnedPicture]:
        """What is known by now, by quantity."""
        ...

    def add(self, strips: Sequence[UnwrappedGauge]) -> Sequence[bool]:
        """Learn from further frames; return for all that were added so far whether their part is known."""
        ...


class Still:
    """Defaults for kinds in which nothing turns around a drawn pivot."""

    def sampled_part(self, _grid: Grid) -> Part:
        """Return all rows and columns."""
        return ALL

    def settled_pictures(
        self, _instrument: Instrument, _strips: Sequence[UnwrappedGauge], _known: Mapping[str, LearnedPicture]
    ) -> Mapping[str, LearnedPicture]:
        """Return none."""
        return {}

    def unexplained(
        self,
        _placed: Placed,
        _drawn: UnwrappedGauge,
        _strips: Sequence[UnwrappedGauge],
    ) -> float | None:
        """Return None."""
        return None

    def grower(self, _instrument: Instrument, _appearance: Appearance) -> Grower | None:
        """Return None."""
        return None

    def hidden_look(
        self,
        _instrument: Instrument,
        _appearance: Appearance,
        _strips: Sequence[UnwrappedGauge],
    ) -> Look | None:
        """Return None."""
        return None

    def pivot(self, _instrument: Instrument, _appearance: Appearance, _frames: Sequence[SeenGauge]) -> Pivot:
        """Return the unknown pivot."""
        return UNKNOWN

    def far_pivot(self, _instrument: Instrument, _strips: Sequence[UnwrappedGauge]) -> tuple[float, float] | None:
        """Return None."""
        return None

    def squeeze(self, _instrument: Instrument, _strips: Sequence[UnwrappedGauge], *, is_lost: bool) -> Squeeze | None:
        """Return None."""
        del is_lost
        return None

    def seen_deg(
        self, _instrument: Instrument, _own: UnwrappedGauge, _strips: Sequence[UnwrappedGauge]
    ) -> Sequence[tuple[float, float]]:
        """Return an empty list."""
        return []

    def findings(self, _gauge: Gauge, _appearance: Appearance) -> Sequence[str]:
        """Return nothing."""
        return ()


def needles_in_picture(drawn: DrawnInstrument) -> Look:
    """Cut an instrument's needles, if it has any, and reconstruct the dial below them.

    Raises
    ------
    PanelError
        If a template does not fit its picture.
    """
    gauge, grid, strip = drawn.gauge, drawn.grid, drawn.strip
    plain = median_of(strip)
    layers = {}
    for place, needle in enumerate(gauge.needles):
        path = f"gauges[{drawn.index}].needles[{place}].template"
        if not drawn.is_moved:
            _check_shown(drawn.source, gauge, needle, grid, path)
        cut = _template_picture(drawn.source, gauge, needle, grid, path)
        if float(cut.std()) < NOISE_LEVELS and not drawn.is_moved:
            raise PanelError(
                path,
                "shows no needle there: the picture is flat; check `at`, and the gauge's centre and radius",
            )
        layer = first_layer(cut, plain, grid.step_deg)
        layers[needle.name] = without_others(layer, rows_to_others(gauge, needle, grid), plain)
    covered = np.zeros(strip.shape, bool)
    for needle in gauge.needles:
        layer = layers[needle.name]
        row = _row_in_panel_picture(gauge, needle, grid, strip, layer.pixels)
        if row is not None:
            covered |= needle_places(grid, layer.touched, row, turn_rows(gauge, grid))
    face = bare_face(strip, covered)
    templates = {
        needle.name: cut_over(layer, face_behind(face, grid, needle.template.at, layer.rows))
        for needle, layer in zip(gauge.needles, layers.values(), strict=True)
    }
    return Look(face, templates)


def rows_to_others(gauge: Gauge, needle: DescribedNeedle, grid: PolarGrid) -> list[float]:
    """List how many rows after this needle the others lie, in the picture from which it was cut."""
    own, turn_deg = needle.template, FULL_CIRCLE_DEG if gauge.is_round else None
    if own.at is None:
        return []
    others = (other.template for other in gauge.needles if other is not needle)
    angles_deg = [each.at - own.at for each in others if each.at is not None and each.picture == own.picture]
    rows: list[float] = (shortest(np.array(angles_deg), turn_deg) / grid.step_deg).tolist()
    return rows


def _row_in_panel_picture(
    gauge: Gauge, needle: DescribedNeedle, grid: PolarGrid, strip: Floats, pixels: Floats
) -> float | None:
    """Return where a needle lies in the panel picture, as described or by searching; None if that fails."""
    if needle.template.at is not None and needle.template.picture is None:
        return row_of_angle(grid, needle.template.at)
    axis = (len(pixels) - 1) // 2
    scores = np.zeros(len(strip), np.float32)
    inner = normxcorr(strip, pixels, np.ones_like(pixels))
    scores[axis : axis + len(inner)] = inner
    scores[~rows_in_sweep(gauge, grid)] = 0.0
    return float(scores.argmax()) if scores.max() >= SCORE_THRESHOLD else None


def _check_shown(source: PanelPictures, gauge: Gauge, needle: DescribedNeedle, grid: PolarGrid, path: str) -> None:
    """Raise PanelError unless a needle that is cut where it stands is drawn in its sweep and in the picture."""
    at_deg = needle.template.at
    if at_deg is None:
        return
    start_deg, end_deg = gauge.sweep
    beside_deg = math.remainder(at_deg - (start_deg + end_deg) / 2, 360.0)
    if abs(beside_deg) > (end_deg - start_deg) / 2 + 45.0:
        raise PanelError(f"{path}.at", f"{at_deg:g} degrees lies outside the gauge's sweep")
    source.check_shows(grid.at(at_deg, odd_rows(needle.template.span_deg, grid.step_deg)).rim(), path)


def _template_picture(
    source: PanelPictures, gauge: Gauge, needle: DescribedNeedle, grid: PolarGrid, path: str
) -> Floats:
    """Cut out the needle's picture, (H, C) float32, H odd, with its axis in the middle row.

    A needle that vanishes when the panel picture is blurred to match the frames is cut from the unblurred picture.
    """
    template = needle.template
    rows = odd_rows(template.span_deg, grid.step_deg)
    name = template.picture or source.panel.picture
    is_panels = name == source.panel.picture
    picture = source.dials if is_panels else source.pictures[name]
    if template.at is None:
        pixels = cv2.resize(picture, (grid.columns, rows), interpolation=cv2.INTER_AREA).astype(np.float32)
    else:
        if picture.shape != source.picture.shape:
            raise PanelError(f"{path}.picture", "is not of the panel picture's size, so `at` has no meaning in it")
        window = grid.at(template.at, rows)
        in_colour = source.dials_in_colour if is_panels else partial(source.in_colour, name)
        pixels = Unwrapper([window]).unwrap(picture, source.optics.own, in_colour)[0]
    if float(pixels.std()) < NOISE_LEVELS and is_panels and source.blurred is not None:
        return _template_picture(replace(source, blurred=None), gauge, needle, grid, path)
    return pixels
