"""Settling: a guess of one frame's alignment brought to sub-pixel, on those features that match.

Where fewer features match than the panel has, their own pixels may still tell more of the motion than their places do:
an anchor that is seen obliquely is squeezed. A motion that they tell beyond doubt is believed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from decoder.agreement import fitted
from decoder.alignment import Alignment, Matrix, Point, is_rigid
from decoder.anchors import AnchorHit
from decoder.errors import AlignmentLost
from decoder.features import Feature
from decoder.motion import Model
from decoder.pictures import GreyPicture
from decoder.plane_fit import carried as all_carried
from decoder.registration import Registered
from decoder.seen_panel import SeenPanel

# Published work and the thesis agree on 0.8 for "found"; the same holds for the features of the panel.
MIN_FEATURE_SCORE = 0.8
# Before the last pixel is settled a good feature may match much worse.
MIN_GUESS_SCORE = 0.3
# If those pull each other away: one that is covered rarely matches this well, one half outside hardly ever.
CLEARER_SCORES = (0.6, 0.85)
# What matches may change with where it is settled.
MATCHING_PASSES = 3
# What a larger model moves at a gauge, beside how uncertain it is there: less than this it may owe to noise.
BELIEVED_SIGMAS = 3.0
# Of many anchors two alone hold a panel only where it usually is: elsewhere they may be two others that look alike.
FEW_ANCHORS = 4
MAX_FEW_SHIFT_PX = 40.0
Scores = Mapping[str, float]
"""How well features match, by their names."""


@dataclass(frozen=True, slots=True)
class Settled:
    """Where some features match best, how well all of them match there, and which it rests on."""

    alignment: Alignment
    scores: Scores
    features: Sequence[Feature]

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the features that do not match."""
        return failing(self.scores)


class Settling:
    """Of guesses of one frame's alignment; motions are relative to where the panel usually is."""

    def __init__(self, seen: SeenPanel, frame: GreyPicture) -> None:
        self._seen = seen
        self._frame = frame

    def scores(self, alignment: Alignment) -> dict[str, float]:
        """How well each feature matches."""
        return {feature.name: feature.score(self._frame, alignment) for feature in self._seen.features}

    def on_matching(self, guess: Alignment) -> Settled:
        """On just those features that match there: a hand or a glare may cover the others.

        Raises
        ------
        AlignmentLost
            As `on`.
        """
        there = self.on_any(guess)
        for _ in range(MATCHING_PASSES):
            matching = [feature for feature in self._seen.features if feature.name not in there.failed]
            if _names(matching) == _names(there.features):
                break
            there = self.on(there.alignment, matching)
        return there

    def on_any(self, guess: Alignment) -> Settled:
        """On all that may match; if something among it pulls the others away, on what matches already.

        Raises
        ------
        AlignmentLost
            As `on`.
        """
        features, first = self._seen.features, self.scores(guess)
        likely = [feature for feature in features if first[feature.name] >= MIN_GUESS_SCORE] or features
        lost: AlignmentLost | None = None
        for least in (MIN_GUESS_SCORE, *CLEARER_SCORES):
            clearer = [feature for feature in likely if first[feature.name] >= least] or likely
            if lost is not None and len(clearer) == len(likely):
                continue
            likely = clearer
            try:
                return self.on(guess, likely)
            except AlignmentLost as error:
                lost = lost or error
        raise lost or AlignmentLost("the panel's features do not settle on one place")

    def on(self, guess: Alignment, features: Sequence[Feature]) -> Settled:
        """The motion on some features, and the scores of all.

        Raises
        ------
        AlignmentLost
            If they do not settle on one place.
        """
        if not features:
            return Settled(guess, self.scores(guess), features)  # the scores will tell what is missing
        model = self._seen.model(features)
        settled = self._seen.registration(features).refine(self._frame, self._simplified(guess, features, model))
        if settled is None and model > Model.SIMILARITY:
            model = Model.SIMILARITY
            simple = self._simplified(guess, features, model)
            settled = self._seen.registration(features, model).refine(self._frame, simple)
        if settled is None:
            scores = self.scores(guess)
            self.check(guess, scores)  # says what is missing, if that is why
            raise AlignmentLost("the panel's features do not settle on one place", failing(scores))
        anchors = sum(feature.name != "level" for feature in features)
        if anchors > 1 and model < self._seen.model(self._seen.features):
            settled = self._widened(settled, features, model)
        if len(features) < len(self._seen.features):
            return Settled(settled.alignment, self.scores(settled.alignment), features)
        return Settled(settled.alignment, settled.scores, features)

    def check(self, moved: Alignment, scores: Mapping[str, float]) -> None:
        """Whether what matches is enough to hold the panel.

        Raises
        ------
        AlignmentLost
            If not; it names what was not found, and its score.
        """
        anchors = {name: score for name, score in scores.items() if name != "level"}
        good = sum(score >= MIN_FEATURE_SCORE for score in anchors.values())
        name, best = max(anchors.items(), key=lambda item: item[1])
        failed = failing(scores)
        if best < MIN_FEATURE_SCORE:
            raise AlignmentLost(f"anchor {name} not found (score {best:.2f})", failed)
        if good == 1 and self._seen.level and scores["level"] < MIN_FEATURE_SCORE:
            raise AlignmentLost(f"level edge not found (score {scores['level']:.2f})", failed)
        if good == 1 and not self._seen.level and len(anchors) > 1:
            raise AlignmentLost(f"only anchor {name} found, and the roll is unknown without another", failed)
        few = good <= 2 < FEW_ANCHORS < len(anchors)  # noqa: PLR2004
        if few and np.hypot(*moved.motion_at(self._seen.finders[0].centre_px).shift_px) > MAX_FEW_SHIFT_PX:
            raise AlignmentLost(f"only {good} of {len(anchors)} anchors found, far from where they usually are", failed)

    def _widened(self, settled: Registered, features: Sequence[Feature], model: Model) -> Registered:
        """The same by larger models, as far as the features' pixels tell them from the smaller one."""
        start = settled
        for larger in (one for one in (Model.AFFINE, Model.PERSPECTIVE) if one > model):
            wider = self._seen.wider(features, larger).refine(self._frame, start.alignment, is_far=True)
            if wider is None:
                continue
            start = wider
            if self._is_believed(wider, settled):
                settled = wider
        return settled

    def _is_believed(self, wider: Registered, settled: Registered) -> bool:
        covariance = wider.alignment.covariance
        if covariance is None or sum(wider.scores.values()) <= sum(settled.scores.values()):
            return False
        points = self._seen.gauges.astype(np.float64)
        there = [all_carried(one.alignment.matrix, points) for one in (settled, wider)]
        moved_px = np.hypot(*(there[1] - there[0]))
        return bool((moved_px > BELIEVED_SIGMAS * covariance.sigma_px(points)).any())

    def _simplified(self, guess: Alignment, features: Sequence[Feature], model: Model) -> Alignment:
        """A guess without what the model would leave as it is: shear and perspective that nothing vouches for."""
        if model is Model.PERSPECTIVE or is_rigid(guess.matrix):
            return guess
        names = {feature.name for feature in features}
        hits = {
            index: AnchorHit(carried(guess.matrix, finder.centre_px), 1.0)
            for index, finder in enumerate(self._seen.finders)
            if finder.name in names
        }
        if len(hits) > 1:
            return self.moved(fitted([finder.centre_px for finder in self._seen.finders], hits, model))
        if not hits:
            return guess
        ((index, hit),) = hits.items()
        place = self._seen.finders[index].centre_px
        return self.moved(Alignment.pinned(place, hit.centre_px, guess.motion_at(place).roll_deg, 1.0).matrix)

    def moved(self, motion: Matrix) -> Alignment:
        """Where the panel lies after a (3, 3) motion."""
        return replace(self._seen.start, elements=tuple((motion / motion[2, 2]).ravel().tolist()))


def carried(matrix: Matrix, point_px: Point) -> Point:
    """Where a (3, 3) motion carries a point."""
    x, y, depth = matrix @ (*point_px, 1.0)
    return float(x / depth), float(y / depth)


def failing(scores: Scores) -> tuple[str, ...]:
    """Names of the features that do not match."""
    return tuple(name for name, score in scores.items() if score < MIN_FEATURE_SCORE)


def _names(features: Sequence[Feature]) -> list[str]:
    return [feature.name for feature in features]
