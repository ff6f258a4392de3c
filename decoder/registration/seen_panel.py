"""The panel as a camera usually sees it at one zoom: features and anchors where they usually lie in such frames.

A frame then differs from it by a small motion only, wherever the camera usually is.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import cv2
import numpy as np

from decoder.imaging.alignment import Alignment, Matrix, Point
from decoder.imaging.motion import Model
from decoder.imaging.optics import Optics
from decoder.imaging.pictures import GreyPicture
from decoder.imaging.planes import MIN_PAIRS
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.panel.lens import Lens
from decoder.panel.panel import Anchor, Panel
from decoder.registration.anchors import AnchorFinder, middle_of, whole_box
from decoder.registration.features import Feature, LevelFinder, anchor_feature, level_feature, sample, seen_through
from decoder.registration.registration import Look, Registration
from decoder.registration.thresholds import CLEAR_SCORE, KEPT, MAX_SIGMA_PX, NOISE_LEVELS


class SeenPanel:
    """Features, anchors and level edge of a panel in frames of one zoom and size.

    Parameters
    ----------
    usual
        (3, 3): from the panel picture to such frames, both without distortion.
    lens
        Of such frames, if known.
    is_upright
        Whether their camera does not roll, so that a lone anchor is not used to estimate the roll.
    """

    def __init__(
        self,
        panel: Panel,
        picture: GreyPicture,
        usual: Matrix,
        optics: Optics,
        lens: Lens | None,
        *,
        is_upright: bool = True,
    ) -> None:
        self.usual = usual
        self.start = Alignment.of(np.eye(3), 1.0, lens=lens)
        self._panel, self._taken = panel, picture
        self._optics = optics
        self._lens = lens
        self._is_upright = is_upright
        self._picture = _as_sharp_as_frames(picture, self._scale(picture))
        anchors = [anchor_feature(anchor.name, self._picture, anchor.box) for anchor in panel.anchors]
        level = [] if panel.level is None else [level_feature(self._picture, panel.level)]
        self.anchors = [self._seen(feature) for feature in anchors]
        self.level = self._seen(level[0]) if level else None
        self.features = [*self.anchors, *([self.level] if self.level else [])]
        self.finders = [self._finder(anchor) for anchor in panel.anchors]
        self.levels = [LevelFinder(self.level, finder.centre_px, lens) for finder in self.finders] if self.level else []
        self.gauges = self.carry(np.concatenate([_cross(gauge) for gauge in panel.gauges], axis=1))
        self._registrations: OrderedDict[tuple[object, ...], tuple[Registration, Model, float]] = OrderedDict()

    def at(self, usual: Matrix) -> SeenPanel:
        """Return the same panel for frames in which it lies elsewhere."""
        return SeenPanel(self._panel, self._taken, usual, self._optics, self._lens, is_upright=self._is_upright)

    def carry(self, points: Floats) -> Floats:
        """Carry (2, N) points of the panel picture, as taken, to their usual places in such frames, undistorted."""
        return _projected(self._optics.straight(points), self.usual)

    def look_at(self, frame: GreyPicture, *, is_whole: bool = True) -> Look:
        """Look at a frame where all features usually lie."""
        return self.registration(self.features).look_at(frame, self.start, is_whole=is_whole)

    def as_usual(self, looks: Sequence[Look]) -> list[Alignment | None]:
        """Locate the panel picture in frames; None where some feature does not match well near its usual place."""
        found = self.registration(self.features).refine(looks)
        lowest = [0.0 if one is None else min(one.scores.values()) for one in found]
        return [
            None if one is None or score < CLEAR_SCORE else replace(one.doubted.after(self.usual), score=score)
            for one, score in zip(found, lowest, strict=True)
        ]

    def registration(self, features: Sequence[Feature], largest: Model = Model.PERSPECTIVE) -> Registration:
        """Register on some of the features, with the largest model up to `largest` that they can carry."""
        return self._kept(features, largest)[0]

    def wider(self, features: Sequence[Feature], model: Model) -> Registration:
        """Register on some of the features with a model of any size, however uncertain."""
        key = (model, "any", *(feature.name for feature in features))
        if key not in self._registrations:
            self._keep(key, (Registration(features, model), model, math.inf))
        return self._registrations[key][0]

    def model(self, features: Sequence[Feature]) -> Model:
        """Return the largest model that some of the features can carry."""
        return self._kept(features)[1]

    @property
    def shortcoming(self) -> str | None:
        """What all features together lack, as a sentence; None if nothing."""
        wanted = self._wanted(self.features)
        _, model, sigma_px = self._kept(self.features)
        if model is wanted:
            return None
        return (
            f"the anchors stand so far to one side that {wanted.words} would be uncertain by {sigma_px:.1f} pixels at"
            f" a gauge: frames are aligned by {model.words}; add anchors on the other sides of the gauges"
        )

    def _kept(
        self, features: Sequence[Feature], largest: Model = Model.PERSPECTIVE
    ) -> tuple[Registration, Model, float]:
        key = (largest, *(feature.name for feature in features))
        if key not in self._registrations:
            self._keep(key, self._fitting(features, largest))
        return self._registrations[key]

    def _keep(self, key: tuple[object, ...], fitting: tuple[Registration, Model, float]) -> None:
        self._registrations[key] = fitting
        if len(self._registrations) > KEPT:
            self._registrations.popitem(last=False)

    def _fitting(self, features: Sequence[Feature], largest: Model) -> tuple[Registration, Model, float]:
        """Choose the registration and its model, and estimate the wanted model's uncertainty at the worst gauge."""
        wanted = min(self._wanted(features), largest)
        registration = Registration(features, wanted)
        wanted_sigma_px = sigma_px = self._worst_sigma_px(registration)
        model = wanted
        while sigma_px > MAX_SIGMA_PX and model > Model.RIGID:
            model = max(smaller for smaller in Model if smaller < model)
            registration = Registration(features, model)
            sigma_px = self._worst_sigma_px(registration)
        return registration, model, wanted_sigma_px

    def _wanted(self, features: Sequence[Feature]) -> Model:
        """Return the model that some features would carry if they were well placed."""
        anchors = sum(feature.name != "level" for feature in features)
        if anchors >= MIN_PAIRS:
            return Model.PERSPECTIVE
        if anchors == MIN_PAIRS - 1 and len(self.anchors) > anchors:
            return Model.AFFINE  # one is covered; the others determine most of a perspective
        if anchors > 1:
            return Model.SIMILARITY
        return Model.SHIFT if self._is_upright and len(features) == 1 else Model.RIGID

    def _worst_sigma_px(self, registration: Registration) -> float:
        return float(registration.predicted(NOISE_LEVELS).sigma_px(self.gauges).max())

    def _seen(self, feature: Feature) -> Feature:
        if self._is_as_drawn:
            return feature
        return seen_through(feature, self.carry)

    @property
    def _is_as_drawn(self) -> bool:
        return not (self.start.lens is not None and self.start.lens.distorts) and bool((self.usual == np.eye(3)).all())

    def _scale(self, picture: GreyPicture) -> float:
        height, width = picture.shape
        middle = ((width - 1) / 2, (height - 1) / 2)
        return Alignment.of(self.usual, 1.0).motion_at(middle).scale

    def _finder(self, anchor: Anchor) -> AnchorFinder:
        x, y = self.carry(middle_of(anchor))[:, 0]
        centre = (float(x), float(y))
        return AnchorFinder(anchor.name, centre, partial(self._rendered, anchor, centre), self._lens)

    def _rendered(self, anchor: Anchor, centre: Point) -> GreyPicture:
        """Draw the anchor as such frames show it."""
        left, top, width, height = whole_box(anchor)
        if self._is_as_drawn:
            return np.ascontiguousarray(self._picture[top : top + height, left : left + width])
        scale = Alignment.of(self.usual, 1.0).motion_at((left + width / 2, top + height / 2)).scale
        width, height = max(round(width * scale), 4), max(round(height * scale), 4)
        x, y = np.meshgrid(np.arange(width) - (width - 1) / 2, np.arange(height) - (height - 1) / 2)
        there = np.stack([centre[0] + x, centre[1] + y]).reshape(2, -1)
        own = _projected(there, np.linalg.inv(self.usual)).astype(np.float64)
        lens = self._optics.lens
        if lens is not None and lens.distorts:
            own = lens.distorted(own)
        pixels = sample(self._picture, *own.astype(np.float32).reshape(2, height, width))
        return np.clip(np.rint(pixels), 0, 255).astype(np.uint8)


def _cross(gauge: Gauge) -> Floats:
    """(2, 5): a gauge's centre and four points of its perimeter."""
    x, y = gauge.centre
    radius = gauge.radius[1]
    return np.array([[x, x - radius, x + radius, x, x], [y, y, y, y - radius, y + radius]])


def _projected(points: Floats, matrix: Floats) -> Floats:
    if (matrix == np.eye(3)).all():
        return points
    carried = matrix @ np.vstack([points, np.ones(points.shape[1])])
    projected: Floats = carried[:2] / carried[2]
    return projected


def _as_sharp_as_frames(picture: GreyPicture, scale: float) -> GreyPicture:
    """Blur away detail of the panel picture that frames at a smaller scale cannot have."""
    if scale >= 1.0:
        return picture
    spread_px = 0.5 * math.sqrt(1.0 / scale**2 - 1.0)
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), spread_px), np.uint8)
