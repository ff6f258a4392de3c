"""Registration: a known shift and roll of a smooth texture is recovered to a small part of a pixel."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from decoder.alignment import IDENTITY, Alignment
from decoder.features import Feature, anchor_feature
from decoder.motion import Model
from decoder.pictures import GreyPicture
from decoder.registration import Registration

SIZE_PX = 160
MIDDLE = (80.0, 80.0)
Texture = Callable[..., NDArray[np.float64]]


def seen(
    texture: Texture, truth: Alignment, *, gain: float = 1.0, offset: float = 0.0, noise: float = 0.0
) -> GreyPicture:
    """The texture as a camera with this alignment sees it."""
    v, u = np.mgrid[0:SIZE_PX, 0:SIZE_PX].astype(float)
    u, v = u - truth.matrix[0, 2], v - truth.matrix[1, 2]
    cos, sin = math.cos(math.radians(truth.roll_deg)), math.sin(math.radians(truth.roll_deg))
    light = gain * (120 + texture(cos * u + sin * v, cos * v - sin * u)) + offset
    light += np.random.default_rng(31).normal(0, noise, light.shape) if noise else 0.0
    return np.clip(np.rint(light), 0, 255).astype(np.uint8)


def features_of(picture: GreyPicture) -> list[Feature]:
    """Two anchors far from each other."""
    return [anchor_feature("one", picture, (20, 24, 44, 44)), anchor_feature("two", picture, (92, 96, 40, 40))]


@pytest.mark.parametrize(
    ("shift", "roll_deg"),
    [((0.0, 0.0), 0.0), ((0.37, -0.81), 0.0), ((0.0, 0.0), 0.4), ((-1.23, 0.66), -0.55), ((1.9, 1.2), 0.25)],
)
def test_known_shift_and_roll_are_recovered(texture: Texture, shift: tuple[float, float], roll_deg: float) -> None:
    """From the identity, shift comes out to 0.02 pixels and roll to 0.005 degrees."""
    truth = Alignment.pinned(MIDDLE, (MIDDLE[0] + shift[0], MIDDLE[1] + shift[1]), roll_deg, 1.0)
    registration = Registration(features_of(seen(texture, IDENTITY)), Model.RIGID)
    found = registration.refine(seen(texture, truth), IDENTITY).alignment

    assert found.roll_deg == pytest.approx(roll_deg, abs=0.005)
    assert found.to_frame(MIDDLE) == pytest.approx(truth.to_frame(MIDDLE), abs=0.02)


def test_a_start_far_off_is_followed_where_that_is_asked_for(texture: Texture) -> None:
    """A long step is otherwise a sign that there is nothing to find."""
    truth = Alignment.pinned(MIDDLE, (MIDDLE[0] + 5.5, MIDDLE[1] - 4.5), 0.0, 1.0)
    registration = Registration(features_of(seen(texture, IDENTITY)), Model.RIGID)
    frame = seen(texture, truth)
    found = registration.refine(frame, IDENTITY, is_far=True)

    assert registration.refine(frame, IDENTITY) is None
    assert found is not None
    assert found.alignment.to_frame(MIDDLE) == pytest.approx(truth.to_frame(MIDDLE), abs=0.02)


@pytest.mark.parametrize("slope", [(0.5, 0.0), (0.0, -0.8), (0.6, 0.6)])
def test_light_that_falls_off_does_not_move_the_alignment(texture: Texture, slope: tuple[float, float]) -> None:
    """A reflection that grows over the picture, by so many grey levels a pixel, pulls nothing with it."""
    registration = Registration(features_of(seen(texture, IDENTITY)), Model.RIGID)
    v, u = np.mgrid[0:SIZE_PX, 0:SIZE_PX] - SIZE_PX / 2
    lit = seen(texture, IDENTITY) + slope[0] * u + slope[1] * v
    found = registration.refine(np.clip(np.rint(lit), 0, 255).astype(np.uint8), IDENTITY).alignment

    assert found.to_frame(MIDDLE) == pytest.approx(MIDDLE, abs=0.03)
    assert found.roll_deg == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(("gain", "offset"), [(0.6, 20.0), (0.6, 90.0), (1.2, -20.0)])
def test_light_does_not_move_the_alignment(texture: Texture, gain: float, offset: float) -> None:
    """Each feature has its own gain and offset, so a darker or brighter frame lies in the same place."""
    truth = Alignment.pinned(MIDDLE, (80.42, 79.35), 0.3, 1.0)
    registration = Registration(features_of(seen(texture, IDENTITY)), Model.RIGID)
    found = registration.refine(seen(texture, truth, gain=gain, offset=offset), IDENTITY).alignment

    assert found.roll_deg == pytest.approx(0.3, abs=0.005)
    assert found.to_frame(MIDDLE) == pytest.approx((80.42, 79.35), abs=0.02)


def test_noise_averages_out(texture: Texture) -> None:
    """Four grey levels of noise leave a few hundredths of a pixel."""
    truth = Alignment.pinned(MIDDLE, (80.42, 79.35), 0.3, 1.0)
    registration = Registration(features_of(seen(texture, IDENTITY)), Model.RIGID)
    found = registration.refine(seen(texture, truth, noise=4.0), IDENTITY).alignment

    assert found.roll_deg == pytest.approx(0.3, abs=0.03)
    assert found.to_frame(MIDDLE) == pytest.approx((80.42, 79.35), abs=0.05)


def test_without_roll_the_roll_is_kept(texture: Texture) -> None:
    """One anchor alone settles the shift and leaves the roll that the level edge gave."""
    truth = Alignment.pinned(MIDDLE, (80.5, 79.5), 0.3, 1.0)
    registration = Registration(features_of(seen(texture, IDENTITY))[:1], Model.SHIFT)
    guess = Alignment.pinned(MIDDLE, MIDDLE, 0.3, 1.0)
    found = registration.refine(seen(texture, truth), guess).alignment

    assert found.roll_deg == pytest.approx(0.3, abs=1e-9)
    assert found.to_frame(MIDDLE) == pytest.approx((80.5, 79.5), abs=0.02)


def test_what_does_not_settle_is_no_alignment(texture: Texture) -> None:
    """A frame that has nothing to do with the panel gives no alignment, or one that is not far away."""
    registration = Registration(features_of(seen(texture, IDENTITY)), Model.RIGID)
    unrelated = np.random.default_rng(32).integers(0, 255, (SIZE_PX, SIZE_PX)).astype(np.uint8)
    found = registration.refine(unrelated, IDENTITY)

    assert found is None or math.dist(found.alignment.to_frame(MIDDLE), MIDDLE) < 10


def test_flat_frame_leaves_the_guess(texture: Texture) -> None:
    """A black frame gives no step, and no NaN."""
    registration = Registration(features_of(seen(texture, IDENTITY)), Model.RIGID)

    found = registration.refine(np.zeros((SIZE_PX, SIZE_PX), np.uint8), IDENTITY).alignment

    assert found.to_frame(MIDDLE) == pytest.approx(MIDDLE, abs=1e-4)
