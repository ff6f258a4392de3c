"""Tuning: what is known of needles, dials and camera beyond the panel's description."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from decoder.alignment import Alignment, Matrix
from decoder.needle_template import NeedleTemplate
from decoder.pivots import Pivot
from decoder.unwrapping import UnwrappedGauge


@dataclass(frozen=True, slots=True)
class CardPicture:
    """A card that turns, as it lies in the panel picture; both (P, C) float32, one turn of rows from the sweep's start.

    Attributes
    ----------
    card
        Its grey levels.
    weights
        In [0, 1]: where on the dial, which stands still, the card is to be seen.
    """

    card: UnwrappedGauge
    weights: UnwrappedGauge


@dataclass(frozen=True, slots=True)
class Tuning:
    """First made from the panel picture alone (`panel_tuning`), then from the flight's own frames (`flight_tuning`).

    Attributes
    ----------
    templates
        By needle.
    faces
        For each gauge in the panel's order, the unwrapped dial without needles, (rows, columns) float32.
    usual
        Where the camera mostly was.
    motions
        (3, 3) each: how frames that showed enough of the panel moved against where the camera mostly was. A frame that
        shows less may have moved just so.
    evenly_lit_score
        What a needle in even light scores at least. One that matches less well may stand in a light that changes over
        the dial, which moves its reading.
    cards
        By name, of the gauges that have a card.
    dials_move
        Whether the camera moves so far that dials move against the anchors, and each is to be found by itself.
    anchors_agree
        Whether anchors lie in one plane, so that all of them tell where dials are to be looked for.
    lifts
        By gauge, where dials move: how far the needle goes beyond its dial for each pixel that the dial moves.
    pivots
        By gauge, where dials move: what its needles' lines are held against.
    doubted
        Needles that were found in few of the sampled frames only. What is found of them may be what lay behind them in
        the panel picture.
    alignment_noise
        How many times as uncertain as they claim alignments are.
    rows
        How many rows of a frame, from the top, show all that is looked at as a rule; None for all of them.
    """

    templates: Mapping[str, NeedleTemplate]
    faces: tuple[UnwrappedGauge, ...]
    usual: Alignment
    evenly_lit_score: float
    motions: tuple[Matrix, ...] = ()
    cards: Mapping[str, CardPicture] = field(default_factory=dict)
    dials_move: bool = False
    anchors_agree: bool = True
    lifts: tuple[float, ...] = ()
    pivots: tuple[Pivot, ...] = ()
    doubted: frozenset[str] = frozenset()
    alignment_noise: float = 1.0
    rows: int | None = None

    def places_as(self, other: Tuning) -> bool:
        """Whether the panel and its dials are looked for in frames in the same way with another tuning."""
        return self.usual is other.usual and (self.dials_move, self.anchors_agree, self.lifts) == (
            other.dials_move,
            other.anchors_agree,
            other.lifts,
        )

    def reads_as(self, other: Tuning) -> bool:
        """Whether gauges are read in the same way with another tuning: they differ in what else is known at most."""
        mine = (self.templates, self.faces, self.cards)
        return all(
            one is same for one, same in zip(mine, (other.templates, other.faces, other.cards), strict=True)
        ) and (self.evenly_lit_score == other.evenly_lit_score)
