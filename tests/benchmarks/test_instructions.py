"""The reading path's cost, in instructions: they do not depend on the machine's load."""

from __future__ import annotations

import pytest

from benchmarks.instructions import MAX_GROWTH, growth, has_valgrind


@pytest.mark.slow
@pytest.mark.skipif(not has_valgrind(), reason="valgrind, which counts instructions, is not installed")
def test_reading_takes_no_more_instructions_than_it_did() -> None:
    """At most a tenth more than is committed; if that is meant: `python -m benchmarks.instructions --write`."""
    assert growth("read") <= MAX_GROWTH
