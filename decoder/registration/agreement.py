"""Agreement: which anchor hits belong to one panel, and how far off a panel may be if only few anchors were found.

Features that look alike, a hand, or glare give hits in wrong places. Every two hits of different anchors propose a
shift, roll and scale; the proposal that most other hits agree with wins (as in RANSAC, but exhaustively, since there
are few). So identical knobs are told apart by their positions.

Three anchors determine no perspective, one anchor no roll. If a hand covers the others, the frame is aligned with a
smaller model, and dials far from the remaining anchors may be pixels off. Frames that showed enough anchors give the
size of that error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decoder.imaging.alignment import Matrix, Point
from decoder.imaging.motion import Frame2D, Model
from decoder.imaging.planes import MIN_PAIRS
from decoder.panel.arrays import Floats
from decoder.registration.anchors import AnchorHit
from decoder.registration.thresholds import (
    CONSISTENT_PX,
    MAX_PROPOSALS,
    MAX_ROLL_DEG,
    MAX_SCALE_CHANGE,
    MIN_GUESS_SCORE,
)

NEAR_PX = 4.0
# What perspective may add to a common shift, roll and scale, as a part of the distance between the outermost anchors.
NEAR_PART = 0.03
MAX_ANCHORS = 16
# The uncertainty of a hit found to the pixel, and how far perspective may move a point, as a part of the lever.
HIT_SIGMA_PX = 0.5
PRIOR_PART = 0.05
FITTING_PASSES = 4


@dataclass(frozen=True, slots=True)
class Agreement:
    """A motion from the usual places, (3, 3), and the hits that agree with it by the index of their anchor."""

    motion: Matrix
    hits: dict[int, AnchorHit]


def agreements(places_px: Sequence[Point], hits: Sequence[Sequence[AnchorHit]]) -> list[Agreement]:
    """Return the motions that at least two anchors agree on, best first, at most three.

    Parameters
    ----------
    places_px : where the anchors usually lie
    hits : for each anchor, where it may have been found
    """
    usable = _best_anchors(hits)
    found = [(index, hit) for index in usable for hit in hits[index] if hit.score >= MIN_GUESS_SCORE]
    if len({index for index, _ in found}) < 2:  # noqa: PLR2004 - two to agree
        return []
    usual = np.array([complex(*place) for place in places_px])
    owner = np.array([index for index, _ in found])
    there = np.array([complex(*hit.centre_px) for _, hit in found])
    score = np.array([hit.score for _, hit in found])
    turn, shift = _proposals(usual, owner, there)
    if not turn.size:
        return []
    span_px = float(np.abs(usual[usable][:, None] - usual[usable][None, :]).max())
    off = np.abs(turn[:, None] * usual[owner] + shift[:, None] - there)
    worth = score * (1.0 - off / (NEAR_PX + NEAR_PART * span_px))
    worth = np.where(worth > 0, worth + 1.0, 0.0)  # the number of hits that agree counts more than how well they do
    of_anchor = np.stack([worth[:, owner == index].max(axis=1) for index in np.unique(owner)], axis=1)
    chosen: list[Agreement] = []
    taken: set[frozenset[int]] = set()
    for proposal in np.argsort(-of_anchor.sum(axis=1), kind="stable"):
        agreeing = {}
        for index in np.unique(owner):
            own = np.flatnonzero(owner == index)
            best = own[worth[proposal, own].argmax()]
            if worth[proposal, best] > 0:
                agreeing[int(index)] = int(best)
        if frozenset(agreeing.values()) in taken:
            continue
        taken.add(frozenset(agreeing.values()))
        members = {index: found[position][1] for index, position in agreeing.items()}
        chosen.append(Agreement(fitted(places_px, members, Model.SIMILARITY), members))
        if len(chosen) == MAX_PROPOSALS:
            break
    return chosen


def fitted(places_px: Sequence[Point], hits: dict[int, AnchorHit], model: Model) -> Matrix:
    """(3, 3): fit the motion from the anchors' usual places to where they were found.

    Where the hits do not determine it, it stays close to a plain shift, roll and scale.
    """
    usual = np.array([places_px[index] for index in hits]).T
    there = np.array([hit.centre_px for hit in hits.values()]).T
    motion: Matrix = all_fitted(usual, there[None], model)[0]
    return motion


def all_fitted(usual: Floats, there: Floats, model: Model) -> Floats:
    """(F, 3, 3): the same for usual places (2, N) that were found in F frames, (F, 2, N)."""
    axes = Frame2D.around(usual)
    prior = np.zeros(model)
    prior[Model.SIMILARITY :] = (HIT_SIGMA_PX / (PRIOR_PART * axes.lever_px)) ** 2
    rows = axes.jacobian(usual, model).reshape(-1, model)
    inverse = np.linalg.inv(rows.T @ rows + np.diag(prior + 1e-9))
    upright = np.vstack([usual, np.ones(usual.shape[1])])
    parameters = np.zeros((len(there), model))
    motions = axes.matrices(parameters, model)
    for _ in range(FITTING_PASSES - 1):
        seen = motions @ upright
        off = (there - seen[:, :2] / seen[:, 2:]).reshape(len(there), -1)
        parameters = parameters + (off @ rows - prior * parameters) @ inverse
        motions = axes.matrices(parameters, model)
    return motions


def consistent(places_px: Sequence[Point], hits: dict[int, AnchorHit]) -> dict[int, AnchorHit]:
    """Keep the hits that one perspective explains, dropping the worst one by one while five or more remain."""
    kept = dict(hits)
    while len(kept) > MIN_PAIRS:
        motion = fitted(places_px, kept, Model.PERSPECTIVE)
        off_px = {}
        for index, hit in kept.items():
            x, y, depth = motion @ (*places_px[index], 1.0)
            off_px[index] = math.dist((x / depth, y / depth), hit.centre_px)
        worst = max(off_px, key=lambda index: off_px[index])
        if off_px[worst] <= CONSISTENT_PX:
            break
        del kept[worst]
    return kept


def _best_anchors(hits: Sequence[Sequence[AnchorHit]]) -> list[int]:
    """Choose the anchors with the best hits, limited in number to bound the work."""
    order = sorted(range(len(hits)), key=lambda index: -max((hit.score for hit in hits[index]), default=0.0))
    return sorted(order[:MAX_ANCHORS])


def _proposals(usual: Floats, owner: Floats, there: Floats) -> tuple[Floats, Floats]:
    """Return turn (with scale) and shift, as complex numbers, for each plausible pair of hits of different anchors."""
    one, other = np.triu_indices(len(owner), 1)
    apart = usual[owner[other]] - usual[owner[one]]
    pair = (owner[one] != owner[other]) & (np.abs(apart) > 1.0)
    one, other, apart = one[pair], other[pair], apart[pair]
    turn = (there[other] - there[one]) / apart
    plausible = (np.abs(np.abs(turn) - 1.0) < MAX_SCALE_CHANGE) & (np.abs(np.angle(turn)) < math.radians(MAX_ROLL_DEG))
    turn, one = turn[plausible], one[plausible]
    return turn, there[one] - turn * usual[owner[one]]


def unseen_px(motions: Sequence[Matrix], features: Sequence[Point], places: Floats, model: Model) -> Floats:
    """(N,): how far places (2, N) typically lie from where the features' best motion of a model puts them.

    Parameters
    ----------
    motions
        (3, 3) each: full motions that were observed.
    features
        Where the features lie before a motion, (x, y) px.
    """
    if not motions or not features or model is Model.PERSPECTIVE:
        return np.zeros(places.shape[1])
    whole, usual = np.array(motions), np.array(features).T
    guesses = all_fitted(usual, _carried(whole, usual), model)
    off_px = _carried(whole, places) - _carried(guesses, places)
    off: Floats = np.sqrt(np.square(off_px).sum(axis=(0, 1)) / len(motions))
    return off


def _carried(motions: Floats, places: Floats) -> Floats:
    """(F, 2, N): apply motions (F, 3, 3) to places (2, N)."""
    there = motions @ np.vstack([places, np.ones(places.shape[1])])
    carried: Floats = there[:, :2] / there[:, 2:]
    return carried
