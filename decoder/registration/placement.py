"""Learned placement: where the camera is, how it moves, where needles turn, and how precisely each dial is located."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decoder.imaging.alignment import IDENTITY, Alignment, Matrix, Point
from decoder.imaging.motion import Frame2D, Model, MotionCovariance
from decoder.imaging.panel_pictures import PanelPictures
from decoder.panel.arrays import Floats
from decoder.registration.agreement import unseen_px
from decoder.registration.anchors import findable, middle_of
from decoder.registration.thresholds import KEPT


class PlaceUncertainty:
    """The position uncertainty of a panel's gauges, from the features an alignment rests on, and from its model."""

    def __init__(self, source: PanelPictures, placement: Placement) -> None:
        self._panel, self._optics = source.panel, source.optics
        self._anchors = findable(source.panel.anchors, source.picture)
        self._usual, self._motions = placement.usual, placement.motions
        self._centres = self._usually_at([gauge.centre for gauge in source.panel.gauges])
        self._scale = placement.usual.motion_at(source.panel.gauges[0].centre).scale
        self._levers: dict[tuple[Frame2D, Model], tuple[Floats, Floats]] = {}

    def sigmas_px(self, alignments: Sequence[Alignment]) -> Floats:
        """(frames, gauges): the uncertainty of each gauge's centre, in the panel picture's pixels."""
        sigmas = np.zeros((len(alignments), self._centres.shape[1]))
        alike: dict[tuple[Frame2D, Model], list[tuple[int, MotionCovariance]]] = {}
        for index, alignment in enumerate(alignments):
            known = alignment.covariance
            if known is not None:
                alike.setdefault((known.axes, known.model), []).append((index, known))
        for together in alike.values():
            own = [index for index, _ in together]
            levers, unseen_px2 = self._levers_of(together[0][1], alignments[own[0]].failed)
            covariances = np.stack([known.covariance for _, known in together])
            variance = ((levers @ covariances) * levers).sum(axis=2).reshape(len(own), -1, 2).sum(axis=2) / 2
            sigmas[own] = np.sqrt(np.maximum(variance, 0.0) + unseen_px2)
        return sigmas

    def _levers_of(self, known: MotionCovariance, failed: Sequence[str]) -> tuple[Floats, Floats]:
        """Do `_lever` once for all alignments that rest on the same features."""
        key = (known.axes, known.model)  # the axes identify the features it rests on
        if key not in self._levers:  # the camera's usual place is near enough for an uncertainty
            if len(self._levers) == KEPT:
                self._levers.clear()
            self._levers[key] = self._lever(known, failed)
        return self._levers[key]

    def _lever(self, known: MotionCovariance, failed: Sequence[str]) -> tuple[Floats, Floats]:
        """Return how the centres move with a motion, two rows each, and the variance that its model leaves out."""
        levers = known.axes.jacobian(self._centres, known.model) / self._scale
        off_px = unseen_px(self._motions, self._features(failed), self._centres, known.model) / self._scale
        return levers.transpose(1, 0, 2).reshape(2 * self._centres.shape[1], -1), off_px**2 / 2

    def _features(self, failed: Sequence[str]) -> list[Point]:
        """Return where an alignment's features usually lie: the middles of anchors, the ends of the level edge."""
        panel = self._panel
        middles = [tuple(middle_of(anchor)[:, 0]) for anchor in self._anchors if anchor.name not in failed]
        ends = panel.level if panel.level is not None and "level" not in failed else ()
        places = [*middles, *ends]
        return [(float(x), float(y)) for x, y in self._usually_at(places).T] if places else []

    def _usually_at(self, places: Sequence[Point]) -> Floats:
        """(2, N): where points of the panel picture usually lie in frames."""
        straight = self._optics.straight(np.array(places, np.float64).T)
        carried = self._usual.matrix @ np.vstack([straight, np.ones(straight.shape[1])])
        usually: Floats = carried[:2] / carried[2]
        return usually


@dataclass(frozen=True, slots=True)
class Placement:
    """Where things are in a flight, as far as is known: the camera, how it moves, and the pivots of needles.

    Attributes
    ----------
    usual
        Where the camera mostly was.
    motions
        (3, 3) each: how frames that showed enough of the panel moved from there. A frame that shows less may have moved
        the same way.
    dials_move
        Whether the camera moves so far that dials shift relative to the anchors, and have to be located one by one.
    apart_px
        For each gauge, if dials move and that is known: how far it usually lies from where the anchors put it.
    anchors_agree
        Whether anchors lie in one plane, so that all of them tell where to search for dials.
    lifts
        For each gauge, if dials move: how far the needle moves beyond its dial for each pixel that the dial moves.
    is_upright
        Whether the camera is assumed not to roll; then a lone anchor is not used to estimate the roll.
    rows
        How many rows of a frame, from the top, usually show everything that is needed; None for all of them.
    """

    usual: Alignment = IDENTITY
    motions: tuple[Matrix, ...] = ()
    dials_move: bool = False
    apart_px: tuple[float, ...] = ()
    anchors_agree: bool = True
    lifts: tuple[float, ...] = ()
    is_upright: bool = True
    rows: int | None = None

    def searches_as(self, other: Placement) -> bool:
        """Whether the panel and its dials are searched for in the same way with another placement."""
        one, two = (
            (placement.dials_move, placement.apart_px, placement.anchors_agree, placement.lifts, placement.is_upright)
            for placement in (self, other)
        )
        return self.usual is other.usual and one == two
