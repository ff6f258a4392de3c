"""A recorder that is killed at a random moment loses nothing that it had reported stored."""

from __future__ import annotations

import pytest

from benchmarks.kills import kills

COUNT = 25  # `make kills` does 200


@pytest.mark.slow
@pytest.mark.untraced
def test_killed_recorder_loses_nothing_stored() -> None:
    """Every frame older than two seconds is there after recovering, byte for byte and in order; the chain fits."""
    done = kills(COUNT)

    assert [kill for kill in done if kill.faults] == []
    assert sum(kill.stored > 0 for kill in done) >= COUNT // 5
