"""The search of one frame: from first guesses to the alignment that all matching features settle on.

Where all features match well at once around the flight's usual place, that is it. Otherwise the frame is searched:
anchors by NCC near their usual places, then everywhere, then everywhere and turned. What most of them agree on is the
first guess; where only one was found, the level edge tells the roll. Then all features that match settle it to
sub-pixel. An alignment whose features do not match is refused: a frame that cannot be aligned is missing, never read
somewhere else.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from decoder.agreement import agreements, consistent, fitted
from decoder.alignment import Alignment, Matrix, Point, is_rigid
from decoder.anchors import SEARCH_MARGIN_PX, AnchorHit
from decoder.errors import AlignmentLost
from decoder.features import Feature
from decoder.motion import Model
from decoder.pictures import GreyPicture
from decoder.seen_panel import SeenPanel

# Published work and the thesis agree on 0.8 for "found"; the same holds for the features of the panel.
MIN_FEATURE_SCORE = 0.8
# Before the last pixel is settled a good feature may match much worse.
MIN_GUESS_SCORE = 0.3
# If those pull each other away: one that is covered rarely matches this well, one half outside hardly ever.
CLEARER_SCORES = (0.6, 0.85)
# Features that all match this well in the usual place need not be searched for.
UNMISTAKABLE_SCORE = 0.9
# A rolled or slightly blurred anchor still scores this much before the roll is known; what the alignment rests on in
# the end is held to the same 0.8 as the needles.
MIN_FIRST_SCORE = 0.5
# Nor does one that is not held in place by others, but counts only with them.
MIN_HIT_SCORE = 0.6
# In the whole frame anchors are looked for upright, then turned: at four degrees off one still matches.
TURNS_DEG = (-5.0, 5.0)
# Where a common shift, roll and scale leave an anchor in another perspective.
REFINE_MARGINS_PX = (24, 6)
# Of many anchors two alone hold a panel only where it usually is: elsewhere they may be two others that look alike.
FEW_ANCHORS = 4
MAX_FEW_SHIFT_PX = 40.0


class FrameSearch:
    """One frame's alignment; motions are relative to where the panel usually is."""

    def __init__(self, seen: SeenPanel, frame: GreyPicture) -> None:
        self._seen = seen
        self._frame = frame

    def alignment(self) -> Alignment:
        """Of the panel picture with the frame."""
        as_usual = self._as_usual()
        if as_usual is not None:
            return as_usual
        losses = []
        for guess in self._guesses():
            try:
                return self._from_guess(guess)
            except AlignmentLost as error:
                losses.append(error)
        if not losses:
            self._check(self._seen.start, self._scores(self._seen.start))
            raise AlignmentLost("the panel's features do not settle on one place")
        raise min(losses, key=lambda loss: len(loss.failed))  # the first of those that came nearest

    def _as_usual(self) -> Alignment | None:
        """Where the panel usually lies, if all its features match there well; also with some of them half outside."""
        (at_once,) = self._seen.usual_place(UNMISTAKABLE_SCORE).find([self._frame])
        if at_once is not None:
            return at_once
        found = self._seen.registration(self._seen.features).refine(self._frame, self._seen.start)
        if found is None or min(found.scores.values()) < UNMISTAKABLE_SCORE:
            return None
        return self._checked(found.alignment, found.scores, self._seen.features)

    def rough_alignment(self) -> Alignment | None:
        """What most anchors agree on, each found by itself; None if fewer than two are found well."""
        finders = self._seen.finders
        hits = [[hit for hit in finder.anywhere(self._frame) if hit.score >= MIN_HIT_SCORE] for finder in finders]
        for agreement in agreements([finder.centre_px for finder in finders], hits):
            failed = tuple(
                anchor.name for index, anchor in enumerate(self._seen.anchors) if index not in agreement.hits
            )
            score = min(hit.score for hit in agreement.hits.values())
            return replace(self._moved(agreement.motion).after(self._seen.usual), score=score, failed=failed)
        return None

    def _guesses(self) -> Iterator[Alignment]:
        """First guesses, from the likeliest to the most laborious; not more than a few."""
        finders = self._seen.finders
        near = [[finder.near(self._frame, finder.centre_px, SEARCH_MARGIN_PX)] for finder in finders]
        near = [[hit for hit in hits if hit.score >= MIN_FIRST_SCORE] for hits in near]
        yield from self._guesses_from(near)
        found = [list(finder.anywhere(self._frame)) for finder in finders]
        yield from self._guesses_from(found)
        if len(finders) > 1:
            for hits, finder in zip(found, finders, strict=True):
                hits += [hit for turned_deg in TURNS_DEG for hit in finder.anywhere(self._frame, turned_deg)]
            yield from self._guesses_from(found)

    def _guesses_from(self, hits: Sequence[Sequence[AnchorHit]]) -> Iterator[Alignment]:
        agreed = agreements([finder.centre_px for finder in self._seen.finders], hits)
        for agreement in agreed:
            yield self._moved(self._refined(agreement.motion))
        if not agreed and any(hits):
            best = max((index for index, own in enumerate(hits) if own), key=lambda index: hits[index][0].score)
            for hit in hits[best]:
                yield self._pinned(best, hit)

    def _pinned(self, index: int, hit: AnchorHit) -> Alignment:
        """A guess from one anchor, and from the level edge if there is one."""
        roll_deg = self._seen.levels[index].find(self._frame, hit.centre_px, 0.0) if self._seen.levels else 0.0
        pinned = Alignment.pinned(self._seen.finders[index].centre_px, hit.centre_px, roll_deg, hit.score)
        return self._moved(pinned.matrix)

    def _moved(self, motion: Matrix) -> Alignment:
        return replace(self._seen.start, elements=tuple((motion / motion[2, 2]).ravel().tolist()))

    def _refined(self, motion: Matrix) -> Matrix:
        """A guess from a few anchors, with all anchors that are found where it expects them."""
        if self._seen.model(self._seen.features) is not Model.PERSPECTIVE:
            return motion
        places = [finder.centre_px for finder in self._seen.finders]
        for margin_px in REFINE_MARGINS_PX:
            guess = Alignment.of(motion, 1.0)
            roll_deg = guess.motion_at(places[0]).roll_deg
            turned_deg = min((0.0, *TURNS_DEG), key=lambda turn: abs(turn - roll_deg))
            hits = {
                index: finder.near(self._frame, guess.to_frame(finder.centre_px), margin_px, turned_deg)
                for index, finder in enumerate(self._seen.finders)
            }
            found = {index: hit for index, hit in hits.items() if hit.score >= MIN_FIRST_SCORE}
            if len(found) < FEW_ANCHORS - 1:
                return motion
            found = consistent(places, found)
            motion = fitted(places, found, self._seen.model([self._seen.anchors[index] for index in found]))
        return motion

    def _from_guess(self, guess: Alignment) -> Alignment:
        features = self._seen.features
        settled, scores = self._settled_on_any(guess)
        used: Sequence[Feature] = features
        if min(scores.values()) < MIN_FEATURE_SCORE:  # a hand or a glare covers some of them: do without
            used = [feature for feature in features if scores[feature.name] >= MIN_FEATURE_SCORE]
            settled, scores = self._settled(settled, used)
        return self._checked(settled, scores, used)

    def _settled_on_any(self, guess: Alignment) -> tuple[Alignment, Mapping[str, float]]:
        """On all that may match; if something among it pulls the others away, on what matches already."""
        features, first = self._seen.features, self._scores(guess)
        likely = [feature for feature in features if first[feature.name] >= MIN_GUESS_SCORE] or features
        lost: AlignmentLost | None = None
        for least in (MIN_GUESS_SCORE, *CLEARER_SCORES):
            clearer = [feature for feature in likely if first[feature.name] >= least] or likely
            if lost is not None and len(clearer) == len(likely):
                continue
            likely = clearer
            try:
                return self._settled(guess, likely)
            except AlignmentLost as error:
                lost = lost or error
        raise lost or AlignmentLost("the panel's features do not settle on one place")

    def _scores(self, alignment: Alignment) -> dict[str, float]:
        return {feature.name: feature.score(self._frame, alignment) for feature in self._seen.features}

    def _settled(self, guess: Alignment, features: Sequence[Feature]) -> tuple[Alignment, Mapping[str, float]]:
        """The motion on some features, and the scores of all."""
        if not features:
            return guess, self._scores(guess)  # the scores will tell what is missing
        model = self._seen.model(features)
        settled = self._seen.registration(features).refine(self._frame, self._simplified(guess, features, model))
        if settled is None and model > Model.SIMILARITY:
            simple = self._simplified(guess, features, Model.SIMILARITY)
            settled = self._seen.registration(features, Model.SIMILARITY).refine(self._frame, simple)
        if settled is None:
            scores = self._scores(guess)
            self._check(guess, scores)  # says what is missing, if that is why
            raise AlignmentLost("the panel's features do not settle on one place", _failing(scores))
        if len(features) < len(self._seen.features):
            return settled.alignment, self._scores(settled.alignment)
        return settled.alignment, settled.scores

    def _simplified(self, guess: Alignment, features: Sequence[Feature], model: Model) -> Alignment:
        """A guess without what the model would leave as it is: shear and perspective that nothing vouches for."""
        if model is Model.PERSPECTIVE or is_rigid(guess.matrix):
            return guess
        names = {feature.name for feature in features}
        hits = {
            index: AnchorHit(_carried(guess.matrix, finder.centre_px), 1.0)
            for index, finder in enumerate(self._seen.finders)
            if finder.name in names
        }
        if len(hits) > 1:
            return self._moved(fitted([finder.centre_px for finder in self._seen.finders], hits, model))
        if not hits:
            return guess
        ((index, hit),) = hits.items()
        place = self._seen.finders[index].centre_px
        return self._moved(Alignment.pinned(place, hit.centre_px, guess.motion_at(place).roll_deg, 1.0).matrix)

    def _checked(self, moved: Alignment, scores: Mapping[str, float], used: Sequence[Feature]) -> Alignment:
        """The alignment of the panel picture, if its features match well enough."""
        self._check(moved, scores)
        resting = [scores[feature.name] for feature in used if scores[feature.name] >= MIN_FEATURE_SCORE]
        return replace(moved.after(self._seen.usual), score=min(resting), failed=_failing(scores))

    def _check(self, moved: Alignment, scores: Mapping[str, float]) -> None:
        anchors = {name: score for name, score in scores.items() if name != "level"}
        good = sum(score >= MIN_FEATURE_SCORE for score in anchors.values())
        name, best = max(anchors.items(), key=lambda item: item[1])
        failed = _failing(scores)
        if best < MIN_FEATURE_SCORE:
            raise AlignmentLost(f"anchor {name} not found (score {best:.2f})", failed)
        if good == 1 and self._seen.level and scores["level"] < MIN_FEATURE_SCORE:
            raise AlignmentLost(f"level edge not found (score {scores['level']:.2f})", failed)
        if good == 1 and not self._seen.level and len(anchors) > 1:
            raise AlignmentLost(f"only anchor {name} found, and the roll is unknown without another", failed)
        few = good <= 2 < FEW_ANCHORS < len(anchors)  # noqa: PLR2004
        if few and np.hypot(*moved.motion_at(self._seen.finders[0].centre_px).shift_px) > MAX_FEW_SHIFT_PX:
            raise AlignmentLost(f"only {good} of {len(anchors)} anchors found, far from where they usually are", failed)


def _carried(matrix: Matrix, point_px: Point) -> Point:
    x, y, depth = matrix @ (*point_px, 1.0)
    return float(x / depth), float(y / depth)


def _failing(scores: Mapping[str, float]) -> tuple[str, ...]:
    return tuple(name for name, score in scores.items() if score < MIN_FEATURE_SCORE)
