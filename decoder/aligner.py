"""The aligner: from a frame to its alignment with the panel picture, or the reason why there is none.

Where all features match well at once around the flight's usual place, that is it. Otherwise the frame is searched.
First guess: the best anchor by NCC, then the roll by the level edge (or by the direction from one anchor to another).
Then all features that are visible settle it to sub-pixel. An alignment whose features do not match is refused: a
frame that cannot be aligned is missing, never read somewhere else.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from decoder.alignment import IDENTITY, Alignment
from decoder.anchors import AnchorFinder, AnchorHit
from decoder.errors import PanelError, PictureError
from decoder.features import Feature, anchor_feature, level_feature
from decoder.level import LevelFinder
from decoder.panel import Panel
from decoder.pictures import GreyPicture
from decoder.registration import Registration

# Published work and the thesis agree on 0.8 for "found"; the same holds for the features of the panel.
MIN_FEATURE_SCORE = 0.8
# Before the last pixel is settled a good feature may match much worse.
MIN_GUESS_SCORE = 0.3
# Features that all match this well in the usual place need not be searched for.
UNMISTAKABLE_SCORE = 0.9


class AlignmentLost(PictureError):
    """The panel was not found in a frame."""


class Aligner:
    """Aligns frames with one panel picture.

    `usual` is where the camera mostly was during the flight (`IDENTITY` if nothing is known): searches start there.
    """

    def __init__(self, panel: Panel, picture: GreyPicture, usual: Alignment = IDENTITY) -> None:
        self._finders = [
            AnchorFinder(anchor, picture, path=f"anchors[{index}]") for index, anchor in enumerate(panel.anchors)
        ]
        self._anchors = [anchor_feature(anchor.name, picture, anchor.box) for anchor in panel.anchors]
        self._level = self._level_of(panel, picture)
        self._features = [*self._anchors, *([self._level] if self._level else [])]
        self._levels = [LevelFinder(self._level, finder.centre_px) for finder in self._finders] if self._level else []
        self._registrations: dict[tuple[str, ...], Registration] = {}
        self.usual = usual

    @staticmethod
    def _level_of(panel: Panel, picture: GreyPicture) -> Feature | None:
        if panel.level is None:
            return None
        height, width = picture.shape
        if not all(0 <= x < width and 0 <= y < height for x, y in panel.level):
            raise PanelError("level", f"lies outside the {width} x {height} panel picture")
        feature = level_feature(picture, panel.level)
        if float(feature.pixels.std()) < MIN_FEATURE_SCORE:
            raise PanelError("level", "lies on no visible edge of the panel picture")
        return feature

    def align(self, frame: GreyPicture) -> Alignment:
        """Where the panel picture's points lie in the frame.

        Raises
        ------
        AlignmentLost
            Naming what was not found and its score.
        """
        as_usual = self._registration(self._features).refine(frame, self.usual)
        if as_usual is not None and min(as_usual.scores.values()) >= UNMISTAKABLE_SCORE:
            return self._checked(as_usual.alignment, as_usual.scores)
        try:
            return self._aligned(frame, [finder.find(frame, self._usual_offset_px(finder)) for finder in self._finders])
        except AlignmentLost:
            return self._aligned(frame, [finder.find_anywhere(frame) for finder in self._finders])

    def _aligned(self, frame: GreyPicture, hits: list[AnchorHit]) -> Alignment:
        guess = self._first_guess(frame, hits)
        settled, scores = self._settled(frame, guess, self._features)
        if min(scores.values()) < MIN_FEATURE_SCORE:  # a hand or a glare covers some of them: do without
            first = self._scores(frame, guess)
            settled, scores = self._settled(
                frame, guess, [f for f in self._features if first[f.name] >= MIN_GUESS_SCORE]
            )
            good = [feature for feature in self._features if scores[feature.name] >= MIN_FEATURE_SCORE]
            settled, scores = self._settled(frame, settled, good)
        return self._checked(settled, scores)

    def _scores(self, frame: GreyPicture, alignment: Alignment) -> dict[str, float]:
        return {feature.name: feature.score(frame, alignment) for feature in self._features}

    def _settled(
        self, frame: GreyPicture, guess: Alignment, features: list[Feature]
    ) -> tuple[Alignment, Mapping[str, float]]:
        """The alignment on some features, and the scores of all."""
        if not features:
            return guess, self._scores(frame, guess)  # the scores will tell what is missing
        settled = self._registration(features).refine(frame, guess)
        if settled is None:
            self._checked(guess, self._scores(frame, guess))  # says what is missing, if that is why
            raise AlignmentLost("the panel's features do not settle on one place")
        if len(features) < len(self._features):
            return settled.alignment, self._scores(frame, settled.alignment)
        return settled.alignment, settled.scores

    def _first_guess(self, frame: GreyPicture, hits: list[AnchorHit]) -> Alignment:
        best = max(range(len(hits)), key=lambda index: hits[index].score)
        hit, finder = hits[best], self._finders[best]
        if self._levels:
            roll_deg = self._levels[best].find(frame, hit.centre_px, self.usual.roll_deg)
        else:
            roll_deg = self._roll_between_anchors(hits)
        return Alignment.pinned(finder.centre_px, hit.centre_px, roll_deg, hit.score)

    def _usual_offset_px(self, finder: AnchorFinder) -> tuple[float, float]:
        x, y = self.usual.to_frame(finder.centre_px)
        return x - finder.centre_px[0], y - finder.centre_px[1]

    def _roll_between_anchors(self, hits: list[AnchorHit]) -> float:
        found = [index for index, hit in enumerate(hits) if hit.score >= MIN_FEATURE_SCORE]
        pairs = [(one, other) for one in found for other in found if one < other]
        if not pairs:
            return 0.0
        one, other = max(pairs, key=lambda pair: math.dist(*(self._finders[index].centre_px for index in pair)))
        there = _direction_deg(hits[one].centre_px, hits[other].centre_px)
        here = _direction_deg(self._finders[one].centre_px, self._finders[other].centre_px)
        return (there - here + 180.0) % 360.0 - 180.0

    def _registration(self, features: list[Feature]) -> Registration:
        names = tuple(feature.name for feature in features)
        if names not in self._registrations:
            self._registrations[names] = Registration(features, rolls=len(features) > 1)
        return self._registrations[names]

    def _checked(self, alignment: Alignment, scores: Mapping[str, float]) -> Alignment:
        anchors = {name: score for name, score in scores.items() if name != "level"}
        name, best = max(anchors.items(), key=lambda item: item[1])
        if best < MIN_FEATURE_SCORE:
            raise AlignmentLost(f"anchor {name} not found (score {best:.2f})")
        if not self._level and len(anchors) > 1 and sorted(anchors.values())[-2] < MIN_FEATURE_SCORE:
            raise AlignmentLost(f"only anchor {name} found, and the roll is unknown without another")
        if self._level and scores["level"] < MIN_FEATURE_SCORE:
            raise AlignmentLost(f"level edge not found (score {scores['level']:.2f})")
        return replace(alignment, score=min(best, scores.get("level", 1.0)))


def _direction_deg(start: tuple[float, float], end: tuple[float, float]) -> float:
    return math.degrees(math.atan2(end[1] - start[1], end[0] - start[0]))
