"""Under shadows with hard edges, a panel is where it was found to within the uncertainty that is claimed."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest

from decoder.imaging.motion import carried
from decoder.imaging.pictures import GreyPicture
from decoder.panel.panel import parse_panel
from decoder.registration.aligner import Aligner
from decoder.registration.sift_localizer import SiftLocalizer
from tests.decoder.registration.plane import SIZE_PX, Field, boxes, turn

WIDTH_PX, HEIGHT_PX = SIZE_PX
X_PX, Y_PX = np.meshgrid(np.arange(WIDTH_PX, dtype=np.float64), np.arange(HEIGHT_PX, dtype=np.float64))
PLACES = ((60, 60), (560, 60), (60, 400), (560, 400), (220, 140), (400, 310), (400, 150), (230, 300))
TILTS = (0.0, 0.1)
SEEDS = 12


def leaves(seed: int) -> Field:
    """The light under leaves, half of it in their shadows."""
    shape = HEIGHT_PX // 45, WIDTH_PX // 45
    thick = cv2.resize(np.random.default_rng(seed).normal(0.0, 1.0, shape), SIZE_PX, interpolation=cv2.INTER_CUBIC)
    light: Field = 0.28 + 0.36 * (1.0 + np.tanh(4.5 * thick))
    return light


def struts(seed: int) -> Field:
    """The light beside two struts, whose shadows have straight edges."""
    rng, light = np.random.default_rng(seed), np.ones((HEIGHT_PX, WIDTH_PX))
    for _ in range(2):
        turned, x, y = rng.uniform(0.0, np.pi), rng.uniform(0.2, 0.8) * WIDTH_PX, rng.uniform(0.2, 0.8) * HEIGHT_PX
        across = np.abs((X_PX - x) * np.cos(turned) + (Y_PX - y) * np.sin(turned))
        light *= 1.0 - 0.35 * (1.0 - np.tanh((across - rng.uniform(15.0, 60.0)) / rng.uniform(1.0, 4.0)))
    return light


def window(seed: int) -> Field:
    """The patch of light that a window lets in."""
    rng, turned = np.random.default_rng(seed), 0.3
    x, y = X_PX - rng.uniform(0.2, 0.8) * WIDTH_PX, Y_PX - rng.uniform(0.2, 0.8) * HEIGHT_PX
    along, across = x * np.cos(turned) + y * np.sin(turned), y * np.cos(turned) - x * np.sin(turned)
    within = [
        1.0 - np.tanh((np.abs(one) - rng.uniform(*sizes)) / 1.5)
        for one, sizes in ((along, (80.0, 220.0)), (across, (60.0, 150.0)))
    ]
    light: Field = 0.3 + 0.175 * within[0] * within[1]
    return light


def slope(seed: int) -> Field:
    """Light that falls off to one side, which any anchor's own light follows."""
    right, down = np.random.default_rng(seed).uniform(-0.4, 0.4, 2)
    light: Field = 1.0 + right * (X_PX / WIDTH_PX - 0.5) + down * (Y_PX / HEIGHT_PX - 0.5)
    return light


def measured(
    light: Callable[[int], Field], anchors: int, document: dict[str, Any]
) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """How far gauges are from where the panel is found in such light, and the uncertainty that is claimed, both px."""
    panel, offs_px, sigmas_px = boxes(), [], []
    boxed = [{"name": f"{x} {y}", "box": [x, y, 40, 40]} for x, y in PLACES[:anchors]]
    aligner = Aligner(parse_panel(json.dumps({**document, "anchors": boxed, "level": None})), panel)
    centres = np.array([gauge["centre"] for gauge in document["gauges"]], np.float64).T
    for seed in range(SEEDS):
        for tilt in TILTS:
            motion = turn(roll_deg=1.0, tilt=(tilt, 0.0), shift_px=(9.0, -14.0))
            found = aligner.align(lit(panel, motion, light(seed), seed))
            assert found.covariance is not None
            offs_px.append(np.hypot(*(carried(found.matrix, centres) - carried(motion, centres))))
            sigmas_px.append(found.covariance.sigma_px(centres))
    return np.concatenate(offs_px), np.concatenate(sigmas_px)


def lit(panel: GreyPicture, motion: np.ndarray[Any, Any], light: Field, seed: int) -> GreyPicture:
    """A frame with a sensor's noise."""
    shown = cv2.warpPerspective(panel, motion, SIZE_PX, flags=cv2.INTER_AREA) * light
    shown += np.random.default_rng(seed).normal(0.0, 3.0, shown.shape)
    return np.clip(np.rint(shown), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(("light", "anchors"), [(leaves, 8), (struts, 8), (struts, 4), (window, 8)])
def test_anchors_that_shadows_move_are_as_uncertain_as_they_contradict_each_other(
    light: Callable[[int], Field], anchors: int, document: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Places that are up to three pixels off do not claim a tenth of one: most are within the 95 % that they claim."""
    monkeypatch.setattr(SiftLocalizer, "alignment", lambda *_: None)
    off_px, sigma_px = measured(light, anchors, document)

    assert off_px.max() > 0.2
    assert (off_px < 2.45 * sigma_px).mean() > 0.8
    assert (off_px < 4.0 * sigma_px).all()


@pytest.mark.parametrize("anchors", [8, 4])
def test_light_that_anchors_follow_leaves_them_as_certain_as_they_are(
    anchors: int, document: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A slope of light or a perspective that the motion has is no contradiction, and costs no other search."""
    monkeypatch.setattr(SiftLocalizer, "alignment", lambda *_: pytest.fail("asked without need"))
    off_px, sigma_px = measured(slope, anchors, document)

    assert off_px.max() < 0.07
    assert np.median(sigma_px) < 0.05
    assert sigma_px.max() < 0.1


@pytest.mark.parametrize("light", [leaves, struts])
def test_a_panel_whose_anchors_shadows_hide_is_where_all_that_it_shows_puts_it(
    light: Callable[[int], Field], document: dict[str, Any]
) -> None:
    """Most of the places are right to a third of a pixel, and those that are thirty pixels off say so."""
    off_px, sigma_px = measured(light, 6, document)

    assert np.median(off_px) < 0.35
    assert (off_px < np.maximum(5.0 * sigma_px, 0.1)).all()
