"""Faces: what a dial shows where no needle is."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from decoder.faces import ALIKE_LEVELS, learn_face

SHAPE = (3, 4)


@given(st.integers(1, 20), st.floats(0.0, 1.0), st.integers(0, 2**32 - 1))
def test_the_face_is_the_median_of_what_no_needle_covers(frames: int, covered: float, seed: int) -> None:
    """Pixel by pixel, to the bit; of two values that differ, or fewer, nothing is learned."""
    rng = np.random.default_rng(seed)
    strips = rng.integers(0, 30, (frames, *SHAPE)).astype(np.float32)
    places = rng.random((frames, *SHAPE)) < covered
    fallback = np.full(SHAPE, 200.0, np.float32)

    face = learn_face(list(strips), [np.flatnonzero(place) for place in places], fallback)

    for at in np.ndindex(*SHAPE):
        seen = strips[:, *at][~places[:, *at]]
        tells = len(seen) > 2 or (len(seen) == 2 and np.ptp(seen) <= ALIKE_LEVELS)
        assert face[at] == (np.median(seen) if tells else 200.0)
