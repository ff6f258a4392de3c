"""The turns of a card on which all frames agree: right whatever lies over it, or not clear."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decoder.instruments.kinds.dials.common_turns import common_turns
from decoder.panel.arrays import Floats

ROWS, COLUMNS, REACH = 360, 24, 8


def printed(seed: int, *, numerals: bool = True) -> Floats:
    """A card (P, C) with a mark every ten rows, and numerals that differ every thirty."""
    card = np.full((ROWS, COLUMNS), 35.0, np.float32)
    for mark in range(0, ROWS, 10):
        card[mark : mark + 2, 14:] = 200.0
    rng = np.random.default_rng(seed)
    for numeral in range(0, ROWS, 30):
        strokes = rng.random((10, 10)) < 0.4 if numerals else np.ones((10, 10), bool)
        card[numeral + 5 : numeral + 15, :10] += 155.0 * strokes
    return card


def frames_of(card: Floats, turns: list[int], seed: int) -> Floats:
    """(F, P, C): a card turned by rows below a lubber line and wedges that stand still, with a sensor's noise."""
    rng, shown = np.random.default_rng(seed), []
    for turn in turns:
        dial = np.roll(card, turn, axis=0)
        dial[100:106] = 235.0
        for wedge in range(0, ROWS, 45):
            dial[wedge : wedge + 3, 18:] = 220.0
        shown.append(dial + rng.normal(0.0, 2.0, dial.shape))
    return np.array(shown, np.float32)


@given(
    turns=st.lists(st.integers(0, ROWS - 1), min_size=3, max_size=6, unique=True),
    seed=st.integers(0, 1000),
)
@settings(max_examples=30)
def test_turns_of_a_card_with_numerals_are_found(turns: list[int], seed: int) -> None:
    """Wherever it stands in the frames, and whatever fixed marks are over it; none is clear and wrong."""
    found = common_turns(frames_of(printed(seed), turns, seed), REACH)

    rows = found.rows[found.clear] - np.array(turns)[found.clear]
    off = (rows - rows[:1] + ROWS // 2) % ROWS - ROWS // 2
    assert np.abs(off).max(initial=0) <= 1


def test_settings_a_few_numerals_apart_are_clear() -> None:
    """Marks coincide at all of them: what has changed between frames are the numerals alone."""
    turns = [0, 0, 60, 60, 150, 150, 240, 240]
    found = common_turns(frames_of(printed(3), turns, 5), REACH)

    assert found.clear.all()
    assert ((found.rows - found.rows[0]) % ROWS).tolist() == turns


@pytest.mark.parametrize("turns", [[0, 13, 47, 81, 200], [0, 0, 0, 0, 0]], ids=["turned", "still"])
def test_card_without_numerals_is_never_clear(turns: list[int]) -> None:
    """It looks the same a mark further on; nor is there a turn if nothing has moved."""
    assert not common_turns(frames_of(printed(3, numerals=False), turns, 5), REACH).clear.any()


def test_light_that_fades_during_a_flight_makes_no_turn_doubtful() -> None:
    """The last frames have less than half of the first ones' contrast."""
    turns = [0, 0, 60, 60, 150, 150]
    frames = frames_of(printed(3), turns, 5)
    frames[3:] = 10.0 + 0.4 * frames[3:]
    found = common_turns(frames, REACH)

    assert found.clear.all()
    assert ((found.rows - found.rows[0]) % ROWS).tolist() == turns


def test_frame_that_shows_no_card_is_left_out() -> None:
    """A hand hides one frame's card; the others are clear without it."""
    turns = [0, 40, 95, 170, 260]
    frames = frames_of(printed(3), turns, 5)
    frames[2] = 150.0 + np.random.default_rng(8).normal(0.0, 2.0, frames[2].shape)
    found = common_turns(frames, REACH)

    assert found.clear.tolist() == [True, True, False, True, True]
    assert ((found.rows - found.rows[0]) % ROWS)[found.clear].tolist() == [0, 40, 170, 260]


def test_frames_at_one_turn_do_not_confirm_each_other() -> None:
    """Between two cards with other numerals there is no turn, however many noisy frames show each of them."""
    frames = np.concatenate([frames_of(printed(3), [0] * 4, 5), frames_of(printed(4), [60] * 4, 6)])
    frames += np.random.default_rng(9).normal(0.0, 30.0, frames.shape).astype(np.float32)

    assert not common_turns(frames, REACH).clear.any()


def test_two_turns_alone_may_have_to_be_clearer() -> None:
    """They cannot contradict each other, as more would."""
    noise = [np.random.default_rng(9 + frame).normal(0.0, 2.0, (ROWS, COLUMNS)) for frame in range(4)]
    two = np.stack([np.roll(printed(3), turn, axis=0) for turn in (0, 0, 60, 60)]) + np.array(noise, np.float32)

    assert common_turns(two, REACH).clear.all()
    assert not common_turns(two, REACH, most_of_two=0.0).clear.any()
