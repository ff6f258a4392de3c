"""A gauge in other light is brought into the light of the panel picture, wherever its card and needles have turned."""

from __future__ import annotations

import numpy as np
import pytest

from decoder.matching.faces import in_light_of
from decoder.panel.arrays import Floats

WIDTH, TOLERANCE, HALF_INK = 24, 0.06, 0.5


def dial(turn: int = 0, *, needle: int = 40) -> Floats:
    """(360, 24): a dark face with bright numerals unlike each other, turned by so many rows, below a bright needle."""
    rng = np.random.default_rng(0)
    face = np.full((360, WIDTH), 30.0, np.float32)
    for first in range(0, 360, 30):
        face[first : first + 14, 12:] += 150.0 * (rng.random((14, WIDTH - 12)) > HALF_INK)
    face = np.roll(face, turn, axis=0)
    face[needle : needle + 8] = 220.0
    return face


def gain_of(seen: Floats, lit: Floats | None) -> float:
    """By how much the contrast was raised."""
    assert lit is not None
    return float(np.polyfit(seen.ravel(), lit.ravel(), 1)[0])


def noisy(strip: Floats, gain: float, offset: float) -> Floats:
    """A dial in other light, from a camera with noise."""
    noise = np.random.default_rng(1).normal(0.0, 1.0, strip.shape)
    return (gain * strip + offset + noise).astype(np.float32)


@pytest.mark.parametrize("gain", [0.3, 0.5, 0.8, 1.2])
@pytest.mark.parametrize("turn", [0, 47, 133, 301])
def test_a_card_that_turned_in_other_light_gets_the_contrast_of_the_panel_picture(gain: float, turn: int) -> None:
    """Its pixels are elsewhere, so comparing them one by one tells nothing."""
    seen = noisy(dial(turn, needle=200), gain, 5.0)
    (lit,) = in_light_of(dial(), [seen])
    assert gain_of(seen, lit) * gain == pytest.approx(1.0, abs=TOLERANCE)


@pytest.mark.parametrize("glare", [150.0, 250.0])
@pytest.mark.parametrize("gain", [0.3, 0.5, 0.8])
def test_a_reflection_does_not_change_the_light(gain: float, glare: float) -> None:
    """It covers a seventh of the dial and has more contrast than all the rest of it."""
    seen = noisy(dial(), gain, 5.0)
    seen[250:300] = glare
    (lit,) = in_light_of(dial(), [seen])
    assert gain_of(seen[:250], None if lit is None else lit[:250]) * gain == pytest.approx(1.0, abs=TOLERANCE)


def test_black_frames_teach_nothing() -> None:
    """Noise is not raised to the contrast of a dial."""
    black = np.random.default_rng(2).normal(2.0, 1.0, dial().shape).astype(np.float32)
    seen = [noisy(dial(), 0.6, 0.0), black, black, black]
    assert [lit is None for lit in in_light_of(dial(), seen)] == [False, True, True, True]


def test_frames_in_dim_light_are_used_where_they_are_the_brighter_half_only() -> None:
    """A flight in the dusk is learned from what it has; one by day, from its better frames."""
    dim = noisy(dial(), 0.15, 0.0)
    assert in_light_of(dial(), [dim])[0] is not None
    assert in_light_of(dial(), [noisy(dial(), 0.7, 0.0)] * 3 + [dim])[-1] is None


def test_no_frames_give_none() -> None:
    """Nothing seen is no error."""
    assert in_light_of(dial(), []) == []
