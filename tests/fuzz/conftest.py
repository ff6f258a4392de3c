"""What the tests of hostile files share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from fuzzing.judge import Judge


@pytest.fixture(scope="session")
def judge() -> Iterator[Judge]:
    """The programs, loaded once."""
    with Judge() as judge:
        yield judge
