"""The search of one frame: from first guesses to an alignment that fits all matching features.

A frame is searched if some feature does not match at its usual place in the flight: anchors are searched for by NCC
near their usual places, then everywhere. The first guess is what most of them agree on;
where only one was found, the level edge gives the roll. All features that match then refine it to sub-pixel, and missed
anchors are searched for again where these put them. An alignment whose features do not match is refused: a frame that
cannot be aligned is missing, never read somewhere else.

If some features do not match, the pixels of the others may still determine more of the motion than their positions
do: an anchor seen obliquely is squeezed. A motion with more parameters is accepted if it is significant.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from decoder.imaging.alignment import Alignment, Matrix, Point, is_rigid
from decoder.imaging.motion import Model
from decoder.imaging.motion import carried as all_carried
from decoder.imaging.pictures import GreyPicture
from decoder.imaging.planes import MIN_PAIRS
from decoder.panel.errors import AlignmentLost
from decoder.registration.agreement import NEAR_PART, NEAR_PX, agreements, consistent, fitted
from decoder.registration.anchors import SEARCH_MARGIN_PX, AnchorHit, reduced
from decoder.registration.features import Feature
from decoder.registration.registration import Registered, Registration
from decoder.registration.seen_panel import SeenPanel
from decoder.registration.thresholds import (
    LIKELY_SCORE,
    MAX_FEW_SHIFT_PX,
    MIN_FIRST_SCORE,
    MIN_GUESS_SCORE,
    SCORE_THRESHOLD,
    SIGNIFICANT_SIGMAS,
)

# Thresholds to try if features disagree: a covered one rarely reaches the first, one half outside hardly the second.
CLEARER_SCORES = (0.6, 0.85)
# Which features match may change with the alignment, so they are determined repeatedly.
MATCHING_PASSES = 3
Scores = Mapping[str, float]
"""How well features match, by their names."""

# A common shift, roll and scale leave anchors in another perspective this far off.
REFINE_MARGINS_PX = (24, 6)


@dataclass(frozen=True, slots=True)
class RefinedAlignment:
    """The alignment at which some features match best, how well all of them match there, and which it rests on."""

    alignment: Alignment
    scores: Scores
    features: Sequence[Feature]

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the features that do not match."""
        return failing(self.scores)


class AlignmentRefiner:
    """Refines guesses of one frame's alignment; motions are relative to the panel's usual place."""

    def __init__(self, seen: SeenPanel, frame: GreyPicture) -> None:
        self._seen = seen
        self._frame = frame

    def scores(self, alignment: Alignment) -> dict[str, float]:
        """Return how well each feature matches."""
        return {feature.name: feature.score(self._frame, alignment) for feature in self._seen.features}

    def on_matching(self, guess: Alignment) -> RefinedAlignment:
        """Refine on just those features that match there, as a hand or glare may cover the others.

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

    def on_any(self, guess: Alignment) -> RefinedAlignment:
        """Refine on all features that may match, or if one of them pulls the others off, on those that match better.

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

    def on(self, guess: Alignment, features: Sequence[Feature]) -> RefinedAlignment:
        """Refine on some features, and score all.

        Raises
        ------
        AlignmentLost
            If it does not converge.
        """
        if not features:
            return RefinedAlignment(guess, self.scores(guess), features)  # the scores show what is missing
        model = self._seen.model(features)
        settled = self._refined(self._seen.registration(features), self._simplified(guess, features, model))
        if settled is None and model > Model.SIMILARITY:
            model = Model.SIMILARITY
            simple = self._simplified(guess, features, model)
            settled = self._refined(self._seen.registration(features, model), simple)
        if settled is None:
            scores = self.scores(guess)
            self.check(guess, scores)  # names what is missing, if that is why
            raise AlignmentLost("the panel's features do not settle on one place", failing(scores))
        anchors = sum(feature.name != "level" for feature in features)
        if anchors > 1 and model < self._seen.model(self._seen.features):
            settled = self._widened(settled, features, model)
        if len(features) < len(self._seen.features):
            return RefinedAlignment(settled.doubted, self.scores(settled.alignment), features)
        return RefinedAlignment(settled.doubted, settled.scores, features)

    def _refined(self, registration: Registration, guess: Alignment, *, is_far: bool = False) -> Registered | None:
        (found,) = registration.refine([registration.look_at(self._frame, guess)], is_far=is_far)
        return found

    def check(self, moved: Alignment, scores: Mapping[str, float]) -> None:
        """Check that what matches is enough to hold the panel.

        Raises
        ------
        AlignmentLost
            If not; it names what was not found, and its score.
        """
        anchors = {name: score for name, score in scores.items() if name != "level"}
        good = sum(score >= SCORE_THRESHOLD for score in anchors.values())
        name, best = max(anchors.items(), key=lambda item: item[1])
        failed = failing(scores)
        if best < SCORE_THRESHOLD:
            raise AlignmentLost(f"anchor {name} not found (score {best:.2f})", failed)
        if good == 1 and self._seen.level and scores["level"] < SCORE_THRESHOLD:
            raise AlignmentLost(f"level edge not found (score {scores['level']:.2f})", failed)
        if good == 1 and not self._seen.level and len(anchors) > 1:
            raise AlignmentLost(f"only anchor {name} found, and the roll is unknown without another", failed)
        few = good <= 2 < MIN_PAIRS < len(anchors)  # noqa: PLR2004
        if few and np.hypot(*moved.motion_at(self._seen.finders[0].centre_px).shift_px) > MAX_FEW_SHIFT_PX:
            raise AlignmentLost(f"only {good} of {len(anchors)} anchors found, far from where they usually are", failed)

    def _widened(self, settled: Registered, features: Sequence[Feature], model: Model) -> Registered:
        """Register with larger models, as far as they differ significantly from the smaller one."""
        start = settled
        for larger in (one for one in (Model.AFFINE, Model.PERSPECTIVE) if one > model):
            wider = self._refined(self._seen.wider(features, larger), start.alignment, is_far=True)
            if wider is None:
                continue
            start = wider
            if self._is_believed(wider, settled):
                settled = wider
        return settled

    def leans(self, settled: Alignment) -> bool:
        """Whether the features' own pixels show a significant shear that their alignment leaves out."""
        there = settled.after(np.linalg.inv(self._seen.usual))
        wider = self._refined(self._seen.wider(self._seen.features, Model.AFFINE), there, is_far=True)
        return wider is not None and self._is_believed(wider, Registered(there, self.scores(there)))

    def _is_believed(self, wider: Registered, settled: Registered) -> bool:
        covariance = wider.alignment.covariance
        if covariance is None or sum(wider.scores.values()) <= sum(settled.scores.values()):
            return False
        points = self._seen.gauges.astype(np.float64)
        there = [all_carried(one.alignment.matrix, points) for one in (settled, wider)]
        moved_px = np.hypot(*(there[1] - there[0]))
        return bool((moved_px > SIGNIFICANT_SIGMAS * covariance.sigma_px(points)).any())

    def _simplified(self, guess: Alignment, features: Sequence[Feature], model: Model) -> Alignment:
        """Return a guess without the shear and perspective that the model cannot fit and nothing supports."""
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
        """Return where the panel lies after a (3, 3) motion."""
        return replace(self._seen.start, elements=tuple((motion / motion[2, 2]).ravel().tolist()))


def carried(matrix: Matrix, point_px: Point) -> Point:
    """Apply a (3, 3) motion to a point."""
    x, y, depth = matrix @ (*point_px, 1.0)
    return float(x / depth), float(y / depth)


def failing(scores: Scores) -> tuple[str, ...]:
    """Return the names of the features that do not match."""
    return tuple(name for name, score in scores.items() if score < SCORE_THRESHOLD)


def _names(features: Sequence[Feature]) -> list[str]:
    return [feature.name for feature in features]


class FrameSearch:
    """Finds one frame's alignment; motions are relative to the panel's usual place."""

    def __init__(self, seen: SeenPanel, frame: GreyPicture) -> None:
        self._seen = seen
        self._frame = frame
        self._shrunk = cache(partial(reduced, frame))
        self._settling = AlignmentRefiner(seen, frame)

    def alignment(self) -> Alignment:
        """Find the panel picture in a frame in which it is not at its usual place.

        Raises
        ------
        AlignmentLost
            Naming what was not found and its score.
        """
        losses = []
        for guess in self._guesses():
            try:
                return self._from_guess(guess)
            except AlignmentLost as error:
                losses.append(error)
        if not losses:
            self._settling.check(self._seen.start, self._settling.scores(self._seen.start))
            raise AlignmentLost("the panel's features do not settle on one place")
        raise min(losses, key=lambda loss: len(loss.failed))  # the first of those that came closest

    def rough_alignment(self) -> Alignment | None:
        """Return what most anchors agree on, each found by itself; None if fewer than two are found well."""
        finders = self._seen.finders
        hits = [
            [hit for hit in finder.anywhere(self._frame, self._shrunk) if hit.score >= LIKELY_SCORE]
            for finder in finders
        ]
        for agreement in agreements([finder.centre_px for finder in finders], hits):
            failed = tuple(
                anchor.name for index, anchor in enumerate(self._seen.anchors) if index not in agreement.hits
            )
            score = min(hit.score for hit in agreement.hits.values())
            return replace(self._settling.moved(agreement.motion).after(self._seen.usual), score=score, failed=failed)
        return None

    def _guesses(self) -> Iterator[Alignment]:
        """Yield a few first guesses, from the likeliest to the most laborious."""
        finders = self._seen.finders
        near = [[finder.near(self._frame, finder.centre_px, SEARCH_MARGIN_PX)] for finder in finders]
        near = [[hit for hit in hits if hit.score >= MIN_FIRST_SCORE] for hits in near]
        yield from self._guesses_from(near)
        found = [list(finder.anywhere(self._frame, self._shrunk)) for finder in finders]
        yield from self._guesses_from(found)

    def _guesses_from(self, hits: Sequence[Sequence[AnchorHit]]) -> Iterator[Alignment]:
        agreed = agreements([finder.centre_px for finder in self._seen.finders], hits)
        for agreement in agreed:
            yield self._settling.moved(self._refined(agreement.motion))
        if not agreed and any(hits):
            best = max((index for index, own in enumerate(hits) if own), key=lambda index: hits[index][0].score)
            for hit in hits[best]:
                yield self._pinned(best, hit)

    def _pinned(self, index: int, hit: AnchorHit) -> Alignment:
        """Return a guess from one anchor, and from the level edge if there is one."""
        roll_deg = self._seen.levels[index].find(self._frame, hit.centre_px, 0.0) if self._seen.levels else 0.0
        pinned = Alignment.pinned(self._seen.finders[index].centre_px, hit.centre_px, roll_deg, hit.score)
        return self._settling.moved(pinned.matrix)

    def _refined(self, motion: Matrix) -> Matrix:
        """Refine a guess from a few anchors with all anchors that are found where it expects them."""
        if self._seen.model(self._seen.features) is not Model.PERSPECTIVE:
            return motion
        places = [finder.centre_px for finder in self._seen.finders]
        for margin_px in REFINE_MARGINS_PX:
            guess = Alignment.of(motion, 1.0)
            hits = {
                index: finder.near(self._frame, guess.to_frame(finder.centre_px), margin_px)
                for index, finder in enumerate(self._seen.finders)
            }
            found = {index: hit for index, hit in hits.items() if hit.score >= MIN_FIRST_SCORE}
            if len(found) < MIN_PAIRS - 1:
                return motion
            found = consistent(places, found)
            motion = fitted(places, found, self._seen.model([self._seen.anchors[index] for index in found]))
        return motion

    def _from_guess(self, guess: Alignment) -> Alignment:
        there = self._settling.on_matching(guess)
        for _ in self._seen.finders:  # each pass adds at least one
            motion = self._with_missed(there) if there.failed else None
            if motion is None:
                break
            try:
                again = self._settling.on_matching(motion)
            except AlignmentLost:
                break
            if len(again.failed) >= len(there.failed):
                break
            there = again
        return self._checked(there)

    def _with_missed(self, there: RefinedAlignment) -> Alignment | None:
        """Fit the motion of the anchors that match and the missed ones found again from it; None if none was found."""
        finders = self._seen.finders
        places = [finder.centre_px for finder in finders]
        span_px = max(math.dist(one, other) for one in places for other in places)
        margin_px = round(NEAR_PX + NEAR_PART * span_px)
        hits, again = {}, {}
        for index, finder in enumerate(finders):
            if finder.name in there.failed:
                hit = finder.seen_through(self._frame, there.alignment, margin_px)
                if hit.score >= LIKELY_SCORE:
                    again[index] = hit
            else:
                centre_px = carried(there.alignment.matrix, finder.centre_px)
                hits[index] = AnchorHit(centre_px, there.scores[finder.name])
        if not again or not hits:
            return None
        hits = consistent(places, hits | again)
        model = self._seen.model([self._seen.anchors[index] for index in hits])
        return self._settling.moved(fitted(places, hits, model))

    def _checked(self, there: RefinedAlignment) -> Alignment:
        """Accept the alignment of the panel picture if its features match well enough."""
        self._settling.check(there.alignment, there.scores)
        score = min(score for score in there.scores.values() if score >= SCORE_THRESHOLD)
        return replace(there.alignment.after(self._seen.usual), score=score, failed=there.failed)
