"""Times as people and scripts read them."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_LATEST_NS = 253_402_300_799 * 10**9  # the end of the year 9999, where datetime ends


def utc_text(time_ns: float | None) -> str | None:
    """Nanoseconds since the epoch as ISO 8601, to the microsecond; None for what no calendar shows."""
    if time_ns is None or not 0 <= time_ns <= _LATEST_NS:
        return None
    return (_EPOCH + timedelta(microseconds=int(time_ns) // 1000)).isoformat().replace("+00:00", "Z")
