"""What is known of the camera's clock: intervals that hold the truth, and get narrower."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from camera_drivers.qx10.camera_clock import CameraClock, Interval
from recorder.testing import ManualClock

S = 1_000_000_000
NOW = 1_800_000_000 * S


class Reports:
    """A reporter that remembers."""

    def __init__(self) -> None:
        self.reasons: list[str] = []

    def report(self, status: Any) -> None:  # noqa: ANN401 - a status
        """Remember it."""
        self.reasons.append(status.reason)

    def lost(self, reason: str) -> None:
        """Nothing is."""

    def waiting(self, reason: str) -> None:
        """No news."""


SHOTS = st.lists(st.tuples(st.integers(1, 10**4 * S), st.integers(0, 3 * S), st.floats(0, 1)), min_size=1, max_size=20)


@given(offset=st.integers(-(10**18), 10**18), shots=SHOTS)
def test_interval_always_holds_the_true_offset(offset: int, shots: list[tuple[int, int, float]]) -> None:
    """Whole seconds, written at any moment of the shot: the truth is never excluded, and the interval never grows."""
    reports = Reports()
    clock = CameraClock(ManualClock(NOW), reports)
    width = None
    for at, took, share in shots:
        earliest, latest = NOW + at, NOW + at + took
        written = earliest + round(took * share)
        clock.compare((written + offset) // S * S, earliest, latest)
        assert clock.offset is not None
        assert clock.offset.low_ns <= offset <= clock.offset.high_ns
        new = clock.offset.high_ns - clock.offset.low_ns
        assert width is None or new <= width
        width = new

    assert reports.reasons == ["the camera's clock shows in its pictures"]


def test_clock_that_was_set_is_noticed() -> None:
    """A time that does not fit what was known begins anew."""
    reports = Reports()
    clock = CameraClock(ManualClock(NOW), reports)
    clock.compare(NOW, NOW, NOW + S)
    clock.compare(NOW - 100 * S, NOW, NOW + S)

    assert reports.reasons[1:] == ["a clock was set, the camera's or the box's"]
    assert clock.offset == Interval(-101 * S, -99 * S)


def test_uncertainty_is_that_of_an_even_distribution() -> None:
    """An interval of a second has a standard deviation of 0.29 s."""
    assert Interval(0, S).sigma_ns == round(S / 12**0.5)
    assert Interval(-S, S).middle_ns == 0
