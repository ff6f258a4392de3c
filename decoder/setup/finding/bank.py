"""Bank scales: the marks of an attitude indicator, which have no numerals, and are the same on all of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from decoder.panel.arrays import Floats
from decoder.panel.scale import FULL_CIRCLE_DEG, shortest
from decoder.setup.dial_edges import oblique_rim
from decoder.setup.drawn_plane import XY, DrawnPlane
from decoder.setup.finding.dials import APART_PX, FoundDial, Page, likely_px
from decoder.setup.finding.strokes import aimed_at, peaks
from decoder.setup.finding.thresholds import CLEAR_DIRECTIONS, LEAST_RUN, OFF_DEG
from decoder.setup.finding.ticks import Comb, Tick, comb_around, shaped

# Degrees of bank that have a mark on every scale, and those that may have one.
MARKS_DEG = (-60.0, -30.0, -20.0, -10.0, 0.0, 10.0, 20.0, 30.0, 60.0)
BESIDES_DEG = (-90.0, -45.0, 45.0, 90.0)
PLACES = 100
# Seen from beside its pivot, its marks appear this much wider apart.
WIDE = (1.0, 0.94, 1.06, 0.88, 1.12)
PASSES = 6


def banks_on(page: Page, found: Sequence[FoundDial], shape: Floats | None) -> Iterator[tuple[FoundDial, float]]:
    """Find bank scales where no dial was found, and the angle of each one's 0.

    Parameters
    ----------
    shape : (2, 2), how the panel's dials are seen
    """
    taken: list[tuple[XY, float]] = [(each.centre, each.comb.rim.radius_px) for each in found]
    for place, directions in peaks(aimed_at(page.strokes, page.picture.shape), PLACES, APART_PX):
        if directions < CLEAR_DIRECTIONS - LEAST_RUN or any(
            math.dist(place, centre) < radius_px for centre, radius_px in taken
        ):
            continue
        for radius_px in likely_px(page.strokes, place):
            comb = comb_around(page.picture, page.planes, page.strokes, place, radius_px)
            if comb is None or len(comb.ticks) < len(MARKS_DEG) - 1:
                continue
            told = bank_of(comb, np.eye(2) if shape is None else shape)
            if told is not None:
                drawn, zero_deg = told
                ticks = [_seen_from(tick, comb, drawn) for tick in comb.ticks]
                own = [tick for tick in ticks if _beside_deg(np.array([tick.angle_deg - zero_deg]))[0] <= 2 * OFF_DEG]
                laid = replace(comb, ticks=tuple(sorted(own, key=lambda tick: tick.angle_deg)))
                rim = oblique_rim(page.planes, drawn, laid.ring_px[1])
                taken.append((rim.centre, rim.radius_px))
                yield FoundDial(replace(laid, rim=rim), (), (), 0.0), zero_deg
                break


def bank_of(comb: Comb, shape: Floats) -> tuple[DrawnPlane, float] | None:
    """Fit a bank scale to a comb: the plane around its pivot and the angle of its 0 there; None if it is not one.

    Its marks are on one side only, and their angles determine the pivot.
    """
    flat = shaped(comb.rim.centre, shape)
    middle_px = sum(comb.ring_px) / 2
    places = np.array([comb.rim.drawn.place(tick.angle_deg, middle_px) for tick in comb.ticks]).T
    points = np.asarray(flat.to_dial(places), np.float64)
    told = [
        fitted
        for first_deg in _turn_deg(points)
        for wide in WIDE
        if (fitted := _fitted(points, float(first_deg), wide)) is not None
    ]
    if not told:
        return None
    _, _, zero_deg, pivot = max(told, key=lambda each: each[:2])
    return flat.moved(*pivot), zero_deg % FULL_CIRCLE_DEG


def _fitted(points: Floats, zero_deg: float, wide: float) -> tuple[int, float, float, XY] | None:
    """Fit a bank scale to ticks (2, N) from a guess; return matched marks minus their error, its 0, and its pivot."""
    pivot, marks = np.zeros(2), np.array(MARKS_DEG) * wide
    for _ in range(PASSES):
        angles = _turn_deg(points - pivot[:, None])
        off = shortest(angles[None, :] - zero_deg - marks[:, None], FULL_CIRCLE_DEG)
        own = np.abs(off).argmin(axis=1)
        hit = np.abs(off[np.arange(len(own)), own]) <= 2 * OFF_DEG
        if hit.sum() < len(MARKS_DEG) - 1:
            return None
        marks = np.array(MARKS_DEG)
        left = shortest(angles[own[hit]] - zero_deg - marks[hit], FULL_CIRCLE_DEG)
        x, y = (points - pivot[:, None])[:, own[hit]]
        far = np.hypot(x, y) ** 2
        design = np.stack([-y / far, x / far, np.full(len(x), 1.0)], axis=1)
        right, down, turn = np.linalg.lstsq(design, np.radians(left), rcond=None)[0]
        pivot, zero_deg = pivot + np.array([right, down]), zero_deg + math.degrees(turn)
    away = shortest(angles - zero_deg, FULL_CIRCLE_DEG)
    beside = _beside_deg(away) > 2 * OFF_DEG
    count = int(hit.sum()) - int((beside & (np.abs(away) < MARKS_DEG[-1])).sum())
    miss_deg = float(np.abs(left).mean())
    return (
        None
        if count < len(MARKS_DEG) - 1 or miss_deg > OFF_DEG / 2
        else (count, -miss_deg, zero_deg, (float(pivot[0]), float(pivot[1])))
    )


def _seen_from(tick: Tick, comb: Comb, drawn: DrawnPlane) -> Tick:
    """Measure a tick of a comb again, as seen from another pivot."""
    inner, outer = (drawn.polar(comb.rim.drawn.place(tick.angle_deg, px)) for px in (tick.inner_px, tick.outer_px))
    return replace(tick, angle_deg=inner[0] % FULL_CIRCLE_DEG, inner_px=inner[1], outer_px=max(outer[1], inner[1]))


def _beside_deg(away_deg: Floats) -> Floats:
    """(N,): how far angles from a scale's 0 are from its marks."""
    known = np.array((*MARKS_DEG, *BESIDES_DEG))
    beside: Floats = np.abs(shortest(away_deg[:, None] - known, FULL_CIRCLE_DEG)).min(axis=1)
    return beside


def _turn_deg(points: Floats) -> Floats:
    turns: Floats = np.degrees(np.arctan2(points[1], points[0]))
    return turns
