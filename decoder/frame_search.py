"""The search of one frame: from first guesses to the alignment that all matching features settle on.

Where all features match well at once around the flight's usual place, that is it. Otherwise the frame is searched:
anchors by NCC near their usual places, then everywhere, then everywhere and turned. What most of them agree on is the
first guess; where only one was found, the level edge tells the roll. Then all features that match settle it to
sub-pixel, and anchors that were missed are looked for again where these have them. An alignment whose features do not
match is refused: a frame that cannot be aligned is missing, never read somewhere else.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from decoder.agreement import NEAR_PART, NEAR_PX, agreements, consistent, fitted
from decoder.alignment import Alignment, Matrix
from decoder.anchors import SEARCH_MARGIN_PX, AnchorHit
from decoder.errors import AlignmentLost
from decoder.motion import Model
from decoder.pictures import GreyPicture
from decoder.seen_panel import SeenPanel
from decoder.settling import FEW_ANCHORS, MIN_FEATURE_SCORE, Settled, Settling, carried

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


class FrameSearch:
    """One frame's alignment; motions are relative to where the panel usually is."""

    def __init__(self, seen: SeenPanel, frame: GreyPicture) -> None:
        self._seen = seen
        self._frame = frame
        self._settling = Settling(seen, frame)

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
            self._settling.check(self._seen.start, self._settling.scores(self._seen.start))
            raise AlignmentLost("the panel's features do not settle on one place")
        raise min(losses, key=lambda loss: len(loss.failed))  # the first of those that came nearest

    def _as_usual(self) -> Alignment | None:
        """Where the panel usually lies, if all its features match there well; also with some of them half outside."""
        usual_place = self._seen.usual_place(UNMISTAKABLE_SCORE)
        looks = usual_place.look_at(self._frame)
        (at_once,) = usual_place.find([looks]) if looks else [None]
        if at_once is not None:
            return at_once
        found = self._seen.registration(self._seen.features).refine(self._frame, self._seen.start)
        if found is None or min(found.scores.values()) < UNMISTAKABLE_SCORE:
            return None
        return self._checked(Settled(found.alignment, found.scores, self._seen.features))

    def rough_alignment(self) -> Alignment | None:
        """What most anchors agree on, each found by itself; None if fewer than two are found well."""
        finders = self._seen.finders
        hits = [[hit for hit in finder.anywhere(self._frame) if hit.score >= MIN_HIT_SCORE] for finder in finders]
        for agreement in agreements([finder.centre_px for finder in finders], hits):
            failed = tuple(
                anchor.name for index, anchor in enumerate(self._seen.anchors) if index not in agreement.hits
            )
            score = min(hit.score for hit in agreement.hits.values())
            return replace(self._settling.moved(agreement.motion).after(self._seen.usual), score=score, failed=failed)
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
            yield self._settling.moved(self._refined(agreement.motion))
        if not agreed and any(hits):
            best = max((index for index, own in enumerate(hits) if own), key=lambda index: hits[index][0].score)
            for hit in hits[best]:
                yield self._pinned(best, hit)

    def _pinned(self, index: int, hit: AnchorHit) -> Alignment:
        """A guess from one anchor, and from the level edge if there is one."""
        roll_deg = self._seen.levels[index].find(self._frame, hit.centre_px, 0.0) if self._seen.levels else 0.0
        pinned = Alignment.pinned(self._seen.finders[index].centre_px, hit.centre_px, roll_deg, hit.score)
        return self._settling.moved(pinned.matrix)

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
        there = self._settling.on_matching(guess)
        for _ in self._seen.finders:  # each time one more, at least
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

    def _with_missed(self, there: Settled) -> Alignment | None:
        """The motion of the anchors that match and those that are found again where these have them; None if none."""
        finders = self._seen.finders
        places = [finder.centre_px for finder in finders]
        span_px = max(math.dist(one, other) for one in places for other in places)
        margin_px = round(NEAR_PX + NEAR_PART * span_px)
        hits, again = {}, {}
        for index, finder in enumerate(finders):
            if finder.name in there.failed:
                hit = finder.seen_through(self._frame, there.alignment, margin_px)
                if hit.score >= MIN_HIT_SCORE:
                    again[index] = hit
            else:
                centre_px = carried(there.alignment.matrix, finder.centre_px)
                hits[index] = AnchorHit(centre_px, there.scores[finder.name])
        if not again or not hits:
            return None
        hits = consistent(places, hits | again)
        model = self._seen.model([self._seen.anchors[index] for index in hits])
        return self._settling.moved(fitted(places, hits, model))

    def _checked(self, there: Settled) -> Alignment:
        """The alignment of the panel picture, if its features match well enough."""
        self._settling.check(there.alignment, there.scores)
        score = min(score for score in there.scores.values() if score >= MIN_FEATURE_SCORE)
        return replace(there.alignment.after(self._seen.usual), score=score, failed=there.failed)
