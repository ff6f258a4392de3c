"""Gauge places: a dial is found by its own marks, wherever its needle is; one that is not there is not found."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from decoder.imaging.alignment import IDENTITY
from decoder.imaging.pictures import GreyPicture
from decoder.panel.gauge import Gauge
from decoder.registration.dial_places import GaugePlace, GaugePlacer, at_consensus, place_all, shrink_to_consensus

SIDE_PX = 240
CENTRE = (120.0, 118.0)
FINE = 4
GAUGE = Gauge.model_validate(
    {
        "name": "dial",
        "centre": CENTRE,
        "radius": [14, 66],
        "sweep": [120, 420],
        "scale": [[120, 0], [420, 10]],
        "needles": [{"name": "value", "template": {"at": 250.0, "span": 20}}],
    }
)


def drawn(angle_deg: float, motion: NDArray[np.float64], *, noise: float = 2.0, seed: int = 1) -> GreyPicture:
    """A dial with ticks, numerals and a needle, carried by a (3, 3) motion."""
    side = SIDE_PX * FINE
    fine = np.full((side, side), 45, np.uint8)
    middle = np.array(CENTRE) * FINE + (FINE - 1) / 2
    for tick in range(120, 421, 20):
        direction = np.array([math.cos(math.radians(tick)), math.sin(math.radians(tick))])
        start, end = middle + direction * 54 * FINE, middle + direction * 66 * FINE
        cv2.line(fine, _point(start), _point(end), 210, 2 * FINE, cv2.LINE_AA)
        text = middle + direction * 42 * FINE
        cv2.putText(
            fine, str((tick - 120) // 20), _point(text - 20), cv2.FONT_HERSHEY_SIMPLEX, 1.4, 190, 5, cv2.LINE_AA
        )
    direction = np.array([math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))])
    cv2.line(fine, _point(middle), _point(middle + direction * 60 * FINE), 235, 4 * FINE, cv2.LINE_AA)
    picture = cv2.resize(fine, (SIDE_PX, SIDE_PX), interpolation=cv2.INTER_AREA)
    moved = cv2.warpPerspective(picture, motion, (SIDE_PX, SIDE_PX), flags=cv2.INTER_CUBIC, borderValue=45).astype(
        float
    )
    moved += np.random.default_rng(seed).normal(0, noise, moved.shape)
    return np.clip(moved, 0, 255).astype(np.uint8)


def faint(picture: GreyPicture) -> GreyPicture:
    """The same with faint marks compared to the needle."""
    levels = np.interp(np.arange(256), [0, 45, 212, 225, 255], [0, 45, 80, 235, 255])
    return levels[picture].astype(np.uint8)


def _point(place: NDArray[np.float64]) -> tuple[int, int]:
    return int(np.rint(place[0])), int(np.rint(place[1]))


def shifted(x_px: float, y_px: float, bend: float = 0.0) -> NDArray[np.float64]:
    """A shift, and a little perspective, about the dial's centre."""
    x, y = CENTRE
    there = np.array([[1, 0, x + x_px], [0, 1, y + y_px], [0, 0, 1.0]])
    back = np.array([[1, 0, -x], [0, 1, -y], [0, 0, 1.0]])
    return there @ np.array([[1 + bend, bend / 2, 0], [0, 1 - bend, 0], [0, 0, 1.0]]) @ back


@pytest.fixture(scope="module")
def placer() -> GaugePlacer:
    """Of the dial in its panel picture."""
    return GaugePlacer(GAUGE, None, drawn(250.0, np.eye(3), noise=1.0), IDENTITY)


@pytest.mark.parametrize("angle_deg", [130.0, 250.0, 405.0])
@pytest.mark.parametrize(("x_px", "y_px"), [(0.0, 0.0), (-14.6, 11.2)])
def test_dial_is_found_wherever_its_needle_is(placer: GaugePlacer, angle_deg: float, x_px: float, y_px: float) -> None:
    """To a tenth of a pixel, under noise, with the needle anywhere."""
    place = placer.place(drawn(angle_deg, shifted(x_px, y_px)), IDENTITY)

    assert place is not None
    assert place.shift_px == pytest.approx((x_px, y_px), abs=0.12)


@pytest.mark.parametrize("angle_deg", [244.0, 261.0])
@pytest.mark.parametrize("x_px", [-9.3, 8.6])
def test_needle_near_where_the_panel_picture_has_it_does_not_pull_the_dial(angle_deg: float, x_px: float) -> None:
    """With faint marks it has the strongest contrast, but says nothing about the dial's place."""
    placer = GaugePlacer(GAUGE, None, faint(drawn(250.0, np.eye(3), noise=1.0)), IDENTITY)
    place = placer.place(faint(drawn(angle_deg, shifted(x_px, 1.2))), IDENTITY)

    assert place is not None
    assert place.shift_px == pytest.approx((x_px, 1.2), abs=0.3)


@pytest.mark.parametrize(("x_px", "y_px"), [(2.4, -1.7)])
def test_short_scale_lies_where_the_other_dials_do(placer: GaugePlacer, x_px: float, y_px: float) -> None:
    """Its own marks hardly determine its pivot, far from them; the other dials do if all move alike."""
    short = GAUGE.model_copy(update={"sweep": (262.0, 318.0), "name": "short", "radius": (40.0, 66.0)})
    window = GaugePlacer(short, None, drawn(250.0, np.eye(3), noise=1.0), IDENTITY)
    frames = [drawn(130.0, shifted(x_px, y_px), noise=9.0, seed=seed) for seed in range(40, 52)]
    alone = [window.place(frame, IDENTITY) for frame in frames]
    held = [place_all([placer, placer, placer, window], frame, IDENTITY)[3] for frame in frames]

    def off_px(places: list[GaugePlace | None]) -> float:
        return float(np.mean([math.dist(place.shift_px, (x_px, y_px)) for place in places if place is not None]))

    assert sum(place is not None for place in held) >= 10
    assert off_px(held) < 0.5 * off_px(alone)


def test_dial_that_moves_by_itself_is_where_its_own_marks_are(placer: GaugePlacer) -> None:
    """If dials move by different pixels, the others say nothing about one."""
    places = place_all([placer] * 4, drawn(300.0, shifted(5.0, 2.0)), IDENTITY)
    shifts_px = [(4.0, -3.0), (-6.0, 1.0), (1.0, 7.0)]
    known = [replace(place, shift_px=shift) for place, shift in zip(places, shifts_px, strict=False) if place]
    own = places[3]
    assert own is not None
    held = shrink_to_consensus([placer] * 4, [*known, own])[3]

    assert held is not None
    assert held.shift_px == pytest.approx((5.0, 2.0), abs=0.12)
    assert held.alignment.to_frame(CENTRE) == pytest.approx((CENTRE[0] + 5.0, CENTRE[1] + 2.0), abs=0.12)


def test_dial_whose_marks_are_not_found_lies_where_the_others_do(placer: GaugePlacer) -> None:
    """Its sigma is that of one more of them, two thirds of which lie within it; with one other, what is usual."""
    draws = np.random.default_rng(5).normal((3.0, -2.0), 1.5, (4000, 6, 2))

    def told(others: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        off, sigma_px = [], []
        for shifts in draws:
            known = [GaugePlace(IDENTITY, np.eye(3), tuple(shift), 0.1) for shift in shifts[1 : others + 1]]
            place = at_consensus([placer] * (others + 1), [None, *known], IDENTITY)[0]
            assert place is not None
            assert place.alignment.to_frame(CENTRE) == pytest.approx(np.add(CENTRE, place.shift_px))
            off.append(np.subtract(place.shift_px, shifts[0]))
            sigma_px.append(place.sigma_px)
        return np.array(off), np.array(sigma_px)[:, None]

    for others in (2, 5):
        off, sigma_px = told(others)
        assert np.mean(np.abs(off) <= 1.96 * sigma_px) >= 0.93
        assert np.mean(np.abs(off) <= sigma_px) >= 0.68
    alone = GaugePlace(IDENTITY, np.eye(3), (3.0, -2.0), 0.1)
    assert at_consensus([placer] * 2, [None, alone], IDENTITY) == [None, alone]
    anchored, same = at_consensus([placer] * 2, [None, alone], IDENTITY, apart_px=(1.5, 0.7))
    assert same is alone
    assert anchored is not None
    assert (anchored.shift_px, anchored.sigma_px, anchored.alignment) == ((0.0, 0.0), 1.5, IDENTITY)


def test_another_perspective_is_taken_along(placer: GaugePlacer) -> None:
    """What stretches the dial also stretches the window searched."""
    motion = shifted(4.0, 5.0, bend=0.02)
    place = placer.place(drawn(300.0, motion), IDENTITY)

    assert place is not None
    corner = motion @ (170.0, 80.0, 1.0)
    assert place.alignment.to_frame((170.0, 80.0)) == pytest.approx((corner[0], corner[1]), abs=0.25)


@pytest.mark.parametrize("kind", ["plain", "noise", "covered"])
def test_dial_that_is_not_there_is_not_found(placer: GaugePlacer, kind: str) -> None:
    """Nothing, noise, or a hand over most of it."""
    rng = np.random.default_rng(2)
    covered = drawn(300.0, np.eye(3))
    covered[:, :150] = 140
    frame = {
        "plain": np.full((SIDE_PX, SIDE_PX), 45, np.uint8),
        "noise": rng.integers(0, 255, (SIDE_PX, SIDE_PX)).astype(np.uint8),
        "covered": covered,
    }[kind]

    assert placer.place(frame, IDENTITY) is None
