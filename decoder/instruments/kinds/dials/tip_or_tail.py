"""Tip or tail: which way a needle over a card points, if an oblique view makes it turn about another point.

A needle stands above its card, so a camera that looks from the side sees it turn about another point than the card.
Around the card's pivot it then appears bent: its tip lies to one side of the line through the centre, its tail to the
other, both the further the nearer they are to the centre. Half a turn on, the sides are swapped. Compared as one
picture, a needle may therefore resemble its reverse more than itself. So it is drawn in both directions, bent by
various amounts, and the best drawings of each direction are compared where they differ. Elsewhere both fit equally well
or badly, which says nothing about the direction.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import PolarGrid, UnwrappedGauge
from decoder.matching.correlation import partial_normxcorr
from decoder.matching.needle_search import COARSE_STEP
from decoder.matching.needle_template import NeedleTemplate
from decoder.panel.arrays import Floats, Indices
from decoder.panel.scale import FULL_CIRCLE_DEG
from decoder.registration.thresholds import CERTAIN_SIGMAS

# How far aside a needle may pass, in radii: twice its own height seen from 45 degrees, as the template is bent too.
ASIDE = np.linspace(-0.08, 0.08, 17)
# How far its angle may be off: where it is found, and where its reverse, which is bent the other way, is found.
FOUND_DEG, BENT_DEG = 1.0, 6.0


@dataclass(frozen=True, slots=True)
class Facing:
    """Which way a needle points, given the line along which it was found.

    Attributes
    ----------
    ahead
        From -1, if the dial looks exactly as if the needle pointed the other way, to 1.
    sigma
        The standard deviation of that.
    beside_rows
        How far beside that line the needle lies once it is drawn with its apparent bend.
    """

    ahead: float
    sigma: float
    beside_rows: int

    @property
    def is_clear(self) -> bool:
        """Whether one direction fits certainly, and more than three times, better than the other."""
        return abs(self.ahead) > max(HALF, CERTAIN_SIGMAS * self.sigma)


@dataclass(frozen=True, slots=True)
class View:
    """A dial of more than one turn and across the centre, (R, C) each.

    Attributes
    ----------
    seen, face
        As it is, and what lies behind its needles.
    shown
        1 where nothing lies over both, else 0.
    """

    seen: UnwrappedGauge
    face: UnwrappedGauge
    shown: Floats


def facing(view: View, template: NeedleTemplate, grid: PolarGrid, row: int, beside_deg: float = FOUND_DEG) -> Facing:
    """Compare a needle along a row, or up to so many degrees beside it, with its reverse."""
    bent_rows, beside = _bent_rows(grid), round(beside_deg / grid.step_deg)
    reach = int(np.abs(bent_rows).max()) + beside
    turn = round(FULL_CIRCLE_DEG / grid.step_deg)
    around = row - (template.rows - 1) // 2 - reach + np.arange(template.rows + 2 * reach)
    here, shown = view.seen[around % turn], view.shown[around % turn]
    own, reverse = (
        _Bent.best(view.seen[lines % turn], view.face[lines % turn], template, bent_rows + reach, beside)
        for lines in (around, around + turn // 2)
    )
    # A line through the centre, seen from its other end, has its columns reversed.
    drawn, weights = reverse.drawn[:, ::-1], shown * np.maximum(own.trust, reverse.trust[:, ::-1])
    middle, apart = (own.drawn + drawn) / 2, own.drawn - drawn
    energy = float((weights * np.square(apart)).sum())
    if energy == 0.0:
        return Facing(0.0, 1.0, own.beside_rows)
    lit = _in_light_of_best(here, (own.drawn, drawn), weights)
    ahead = 2.0 * float((weights * apart * (lit - middle)).sum()) / energy
    near = own if ahead > 0.0 else reverse
    left = weights * apart * (lit - (own.drawn if ahead > 0.0 else drawn))
    return Facing(ahead, 2.0 * float(np.sqrt(np.square(left).sum())) / energy, near.beside_rows)


def _in_light_of_best(seen: Floats, drawings: Sequence[Floats], weights: Floats) -> Floats:
    """Bring a picture into the light of that drawing which explains most of it, as the weighted pixels show it.

    In the light of what two drawings share, a needle would seem the fainter the more they differ: one with a bright tip
    and a dark tail would point nowhere.
    """
    total, least = float(weights.sum()), float(np.finfo(np.float32).eps)
    about = seen - float((weights * seen).sum()) / total
    power = max(float((weights * about * about).sum()), least)

    def shared(drawn: Floats) -> float:
        return float((weights * about * drawn).sum())

    def alike(drawn: Floats) -> float:
        mean = float((weights * drawn).sum()) / total
        return shared(drawn) / math.sqrt(max(float((weights * np.square(drawn - mean)).sum()), least))

    best = max(drawings, key=alike)
    lit: Floats = shared(best) / power * about + float((weights * best).sum()) / total
    return lit


def _bent_rows(grid: PolarGrid) -> Indices:
    """Return by how many rows each way to bend a needle moves its columns, (A, C)."""
    radii_px = grid.radii_px  # negative across the centre, where the needle is bent the other way
    away_px = np.where(np.abs(radii_px) > 1.0, radii_px, np.inf)
    bent_deg = np.degrees(np.multiply.outer(ASIDE * radii_px[-1], 1.0 / away_px))
    rows: Indices = np.rint(bent_deg / grid.step_deg).astype(np.intp)
    return rows


@dataclass(frozen=True, slots=True)
class _Bent:
    """A needle over a face, bent and turned so that it matches best what is seen: `drawn` and `trust` (K, C)."""

    drawn: Floats
    trust: Floats
    beside_rows: int

    @classmethod
    def best(cls, seen: Floats, face: Floats, template: NeedleTemplate, rows: Indices, beside: int) -> Self:
        """Draw it; `rows` (A, C) are those of its first pixels for each way to bend it, within `beside` rows."""
        thin = np.arange(0, seen.shape[1], COARSE_STEP)
        windows = rows[:, None, thin] - beside + np.arange(template.rows + 2 * beside)[:, None]
        scores, _ = partial_normxcorr(seen[windows, thin], face[windows, thin], _thinned(template))
        bent, turned = np.unravel_index(int(scores.argmax()), scores.shape)
        at = rows[bent] + turned - beside + np.arange(template.rows)[:, None], np.arange(seen.shape[1])
        drawn, trust = face.copy(), np.zeros_like(face)
        drawn[at] = template.light + template.transparency * face[at]
        trust[at] = template.trust
        return cls(drawn, trust, int(turned) - beside)


def _thinned(template: NeedleTemplate) -> NeedleTemplate:
    """Return every third column of a template."""
    pixels, light, transparency, trust = (
        np.ascontiguousarray(each[:, ::COARSE_STEP])
        for each in (template.pixels, template.light, template.transparency, template.trust)
    )
    return NeedleTemplate(pixels, light, transparency, trust, template.step_deg)
