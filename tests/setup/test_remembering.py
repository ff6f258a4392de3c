"""What was found in a frame is remembered, and so is that nothing was."""

from __future__ import annotations

import traceback

import numpy as np
import pytest

from decoder.alignment import IDENTITY, Alignment
from decoder.errors import AlignmentLost
from decoder.setup.remembering import AlignmentMemory

NAME = ("align", 1, None, IDENTITY.elements)


def test_a_failure_is_remembered_and_does_not_grow() -> None:
    """However often it is asked for; the frame is looked at once."""
    memory, frame, looks = AlignmentMemory(), np.zeros((4, 4), np.uint8), []

    def find() -> Alignment:
        looks.append(1)
        raise AlignmentLost("not found")

    depths = []
    for _ in range(4):
        with pytest.raises(AlignmentLost) as caught:
            memory.recall(NAME, frame, find)
        depths.append(len(traceback.extract_tb(caught.value.__traceback__)))

    assert looks == [1]
    assert len(set(depths[1:])) == 1
