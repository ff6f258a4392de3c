"""How many of a gauge's values are missing in a sample: this decides what else is tried, and whether it is kept."""

from __future__ import annotations

from collections.abc import Sequence

from decoder.imaging.thresholds import HALF
from decoder.instruments.needle_learner import Readings
from decoder.instruments.reading import Status
from decoder.panel.gauge import Gauge


def is_lost(gauge: Gauge, found: Sequence[Readings]) -> bool:
    """Whether some value of a gauge is missing in most frames."""
    return missing_part(gauge, found) > HALF


def is_unread(gauge: Gauge, found: Sequence[Readings]) -> bool:
    """Whether every value of a gauge is missing in every frame."""
    return min(_missing_parts(gauge, found), default=0.0) == 1.0


def missing_part(gauge: Gauge, found: Sequence[Readings]) -> float:
    """Return the part of frames in which a gauge's value is missing; of several, the one missing most often."""
    return max(_missing_parts(gauge, found), default=0.0)


def mostly_missing(found: Sequence[Readings]) -> frozenset[str]:
    """List the values that are missing in most frames."""
    return frozenset(
        name for name in found[0] if sum(own[name].status is Status.MISSING for own in found) > HALF * len(found)
    )


def finds_more(gauge: Gauge, before: Sequence[Readings], after: Sequence[Readings]) -> bool:
    """Whether fewer values of a gauge are missing than before, and none is lost, or fewer than before.

    So a bug that is lost either way does not count against a change that finds the card below it.
    """
    were, are = (_missing_parts(gauge, found) for found in (before, after))
    were_lost, are_lost = (sum(part > HALF for part in parts) for parts in (were, are))
    return sum(are) < sum(were) and (are_lost == 0 or are_lost < were_lost)


def _missing_parts(gauge: Gauge, found: Sequence[Readings]) -> list[float]:
    """Return for each quantity of a gauge the part of frames in which it is missing."""
    together = () if gauge.combination is None else (gauge.combination.quantity,)
    missing = [[own[each.name].status is Status.MISSING for own in found] for each in (*gauge.quantities, *together)]
    return [sum(each) / max(len(found), 1) for each in missing]
