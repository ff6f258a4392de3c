"""When pictures were sent that came more or less late."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from camera_drivers.live.delay import Delay

MS = 1_000_000


@given(delays=st.lists(st.integers(0, 900), min_size=1, max_size=30))
def test_bursts_do_not_move_the_exposure(delays: list[int]) -> None:
    """Pictures at an even pace, each more or less late, are placed as if the quickest so far were not late at all."""
    delay = Delay()
    arrived, least = 0, 10**6
    for index, late in enumerate(delays):
        shown = index * 70
        arrived = max(arrived, 5000 + shown + late)
        least = min(least, arrived - shown)
        taken_ns = delay.taken_ns(shown * MS, arrived * MS)
        # The quickest is forgotten at the pace at which clocks drift.
        assert 0 <= taken_ns - (shown + least) * MS <= arrived * MS * Delay.DRIFT + 1


def test_pictures_that_waited_for_a_long_stall_keep_their_times() -> None:
    """The network or the recorder stood still for 20 s: what then arrives at once was taken at its own time."""
    delay = Delay()
    delay.taken_ns(0, 5_000 * MS)
    late = [delay.taken_ns(shown * MS, 25_000 * MS) for shown in range(70, 20_000, 70)]

    for shown, taken_ns in zip(range(70, 20_000, 70), late, strict=True):
        assert 0 <= taken_ns - (5_000 + shown) * MS <= 20_000 * MS * Delay.DRIFT + 1


def test_timestamps_that_begin_anew_are_believed() -> None:
    """A jump of the timestamps begins a new count."""
    delay = Delay()
    delay.taken_ns(100_000 * MS, 5_000 * MS)

    assert delay.taken_ns(0, 6_000 * MS) == 6_000 * MS
