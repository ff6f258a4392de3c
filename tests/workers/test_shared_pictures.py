"""Pictures in shared memory: what is put there is what is taken, whatever was there before."""

from __future__ import annotations

import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.frame_batch import Batch, RawFrame
from decoder.shared_pictures import PicturesGiven, PicturesTaken

BATCHES = st.lists(st.lists(st.binary(max_size=9000), min_size=1, max_size=5), min_size=1, max_size=6)


def frames(pictures: list[bytes]) -> Batch:
    """A batch of these pictures."""
    return tuple(RawFrame(number, 1000 * number, jpeg, 4.45 + number) for number, jpeg in enumerate(pictures))


@given(pictures=BATCHES)
def test_taken_is_what_was_put(pictures: list[list[bytes]]) -> None:
    """Batch after batch, larger and smaller ones, empty pictures too; what was taken before stays as it was."""
    given_side = PicturesGiven()
    taking_side = PicturesTaken(given_side.descriptor)
    sent = [frames(each) for each in pictures]
    taken = [taking_side.take(given_side.put(batch)) for batch in sent]
    given_side.close()

    assert taken == sent


def test_memory_is_let_go() -> None:
    """No descriptor is left behind."""
    side = PicturesGiven()
    side.put(frames([b"picture"]))
    side.close()

    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(side.descriptor)
