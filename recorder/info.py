"""What is in a flight, in numbers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from flight_file.frame import Frame
from flight_file.losses import Loss, LossKind
from flight_file.reader import Flight


@dataclass(slots=True)
class Range:
    """Smallest and largest of what was seen; both None if nothing was."""

    least: float | None = None
    most: float | None = None

    def add(self, value: float | None) -> None:
        """See one more; None is nothing."""
        if value is not None:
            self.least = value if self.least is None else min(self.least, value)
            self.most = value if self.most is None else max(self.most, value)


@dataclass(slots=True)
class FrameFacts:
    """What the frames say, taken together."""

    frames: int = 0
    missing: int = 0
    captured_ns: Range = field(default_factory=Range)
    focal_length_mm: Range = field(default_factory=Range)
    jpeg_bytes: Range = field(default_factory=Range)
    sizes_px: set[tuple[int, int]] = field(default_factory=set)

    @property
    def duration_s(self) -> float:
        """From the first picture to the last, s."""
        if self.captured_ns.least is None or self.captured_ns.most is None:
            return 0.0
        return (self.captured_ns.most - self.captured_ns.least) / 1e9

    @property
    def rate_hz(self) -> float | None:
        """Mean rate, Hz; None with fewer than two pictures."""
        return (self.frames - 1) / self.duration_s if self.frames > 1 and self.duration_s > 0 else None


@dataclass(frozen=True, slots=True)
class FlightInfo:
    """A flight, the facts of its frames, and what was lost."""

    flight: Flight
    facts: FrameFacts
    losses: tuple[Loss, ...]

    @property
    def dropped(self) -> int:
        """Frames that the recorder took but did not store, by the last end record there is."""
        return max((segment.end.dropped for segment in self.flight.segments if segment.end is not None), default=0)


def inspect(flight: Flight) -> FlightInfo:
    """Read the whole flight once.

    Raises
    ------
    FlightNotReadableError
        If the disk fails.
    """
    facts = summarize(flight.frames())
    return FlightInfo(flight=flight, facts=facts, losses=tuple(flight.losses))


def summarize(frames: Iterable[Frame]) -> FrameFacts:
    """The facts of these frames."""
    facts = FrameFacts()
    expected: int | None = None
    for frame in frames:
        facts.frames += 1
        facts.missing += max(0, frame.sequence - expected) if expected is not None else 0
        expected = frame.sequence + 1
        facts.captured_ns.add(frame.captured_ns)
        facts.focal_length_mm.add(frame.exif.focal_length_mm)
        facts.jpeg_bytes.add(len(frame.jpeg))
        if frame.width_px is not None and frame.height_px is not None:
            facts.sizes_px.add((frame.width_px, frame.height_px))
    return facts


def gaps(losses: Iterable[Loss]) -> int:
    """How many times frames are missing in a row."""
    return sum(loss.kind is LossKind.GAP for loss in losses)
