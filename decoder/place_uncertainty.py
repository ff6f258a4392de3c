"""How uncertain the place of each dial is in a frame whose alignment is known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from decoder.alignment import Alignment, Point
from decoder.anchors import middle_of
from decoder.arrays import Floats
from decoder.motion import Frame2D, Model, MotionCovariance
from decoder.panel_pictures import PanelPictures
from decoder.tuning import Tuning
from decoder.unseen_motion import unseen_px

# Levers of so many sets of features and zooms are kept.
KEPT_LEVERS = 64


class PlaceUncertainty:
    """Of all gauges of a panel: by the features that an alignment rests on, and by what these cannot tell."""

    def __init__(self, source: PanelPictures, tuning: Tuning) -> None:
        self._panel, self._optics = source.panel, source.optics
        self._usual, self._motions = tuning.usual, tuning.motions
        self._centres = self._usually_at([gauge.centre for gauge in source.panel.gauges])
        self._noise = tuning.alignment_noise
        self._scale = tuning.usual.motion_at(source.panel.gauges[0].centre).scale
        self._levers: dict[tuple[Frame2D, Model], tuple[Floats, Floats]] = {}

    def sigmas_px(self, alignments: Sequence[Alignment]) -> Floats:
        """(frames, gauges): by how much each centre may be off, in the panel picture's pixels."""
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
            variance *= self._noise**2
            sigmas[own] = np.sqrt(np.maximum(variance, 0.0) + unseen_px2)
        return sigmas

    def _levers_of(self, known: MotionCovariance, failed: Sequence[str]) -> tuple[Floats, Floats]:
        """As `_lever`, worked out once for all alignments that rest on the same."""
        key = (known.axes, known.model)  # the axes tell which features it rests on
        if key not in self._levers:  # where the camera usually stands is near enough for a doubt
            if len(self._levers) == KEPT_LEVERS:
                self._levers.clear()
            self._levers[key] = self._lever(known, failed)
        return self._levers[key]

    def _lever(self, known: MotionCovariance, failed: Sequence[str]) -> tuple[Floats, Floats]:
        """How the centres move with a motion, two rows each, and the variance of what its model leaves out."""
        levers = known.axes.jacobian(self._centres, known.model) / self._scale
        off_px = unseen_px(self._motions, self._features(failed), self._centres, known.model) / self._scale
        return levers.transpose(1, 0, 2).reshape(2 * self._centres.shape[1], -1), off_px**2 / 2

    def _features(self, failed: Sequence[str]) -> list[Point]:
        """Where what an alignment rests on usually lies: the middles of anchors, the ends of the level edge."""
        panel = self._panel
        middles = [tuple(middle_of(anchor)[:, 0]) for anchor in panel.anchors if anchor.name not in failed]
        ends = panel.level if panel.level is not None and "level" not in failed else ()
        places = [*middles, *ends]
        return [(float(x), float(y)) for x, y in self._usually_at(places).T] if places else []

    def _usually_at(self, places: Sequence[Point]) -> Floats:
        """(2, N): where points of the panel picture lie in frames as a rule."""
        straight = self._optics.straight(np.array(places, np.float64).T)
        carried = self._usual.matrix @ np.vstack([straight, np.ones(straight.shape[1])])
        usually: Floats = carried[:2] / carried[2]
        return usually
