"""Follow the chain through the segments of a recording, and determine the cause of each break.

A frame that the recorder never stored leaves a gap in the sequence numbers, but none in the chain; a frame that was
removed later leaves both. That is how the two are told apart. A frame whose number was changed is not taken for a
removed one, because the heads of its messages still have its number. After a frame that does not fit, the chain's value
is unknown, so the next frame's own is accepted: the first fault is named, and no others are invented.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, replace

from flight_file.errors import Finding, FindingKind, Loss, LossKind
from flight_file.flight_writer import NEXT_SEGMENT
from flight_file.segment import Segment
from flight_file.session import first_value, link
from flight_file.summary import Contents
from flight_file.walk import ChunkRecords, FrameRecord, walk_records


@dataclass(frozen=True, slots=True)
class Counted:
    """The frames of a segment.

    Attributes
    ----------
    frames
        Those whose record exists.
    behind
        How many of them are after its proven bytes.
    first_behind
        Number of the first of these; None if there are none.
    """

    frames: int
    behind: int = 0
    first_behind: int | None = None


@dataclass(frozen=True, slots=True)
class _PendingDamage:
    """Damage not reported yet, since what follows determines its kind; `number` is the frame it hit, if known."""

    reason: str
    number: int | None = None


@dataclass(frozen=True, slots=True)
class _Place:
    """The frame a finding is about, and when it was taken, ns; None if its record cannot be read."""

    number: int
    captured_ns: int | None


class ChainCheck:
    """Follows the chain through the segments of a recording, given in their order.

    Attributes
    ----------
    findings
        All so far, in the order of the recording.
    """

    def __init__(self) -> None:
        self.findings: list[Finding] = []
        self._before: Segment | None = None
        self._before_is_signed = False
        self._value: str | None = None  # None: not known, the next frame's own value is accepted
        self._expected: int | None = None
        self._at_start = True  # no frame has been seen; counting begins with 0 if this is the first segment
        self._excused = False  # something before the next frame is damaged or changed, and has been reported
        self._incomplete = False  # of this segment: frames may be missing that have been reported
        self._in_disorder = False
        self._torn: list[_PendingDamage] = []
        self._lost_before: frozenset[int] = frozenset()
        self._removed: list[tuple[int, int, int]] = []  # missing frames, first and last, rising; index of the finding

    def check(self, segment: Segment, contents: Contents, *, proven_bytes: int) -> Counted:
        """Check one more segment.

        Parameters
        ----------
        contents
            Receives what the chunks contain.
        proven_bytes
            How much of it, from its start, is proven by a key.

        Raises
        ------
        FlightNotReadableError
            If the disk fails.
        """
        self._check_joint(segment, is_proven=proven_bytes > 0)
        self._check_outline(segment)
        self._value = segment.start_of_chain or None
        self._lost_before = frozenset() if segment.end is None else frozenset(segment.end.lost_before)
        self._at_start = self._before is None and segment.session.segment == 0
        self._excused = self._incomplete = self._in_disorder = False
        numbers: list[tuple[int, bool]] = []
        stated = False
        for item in walk_records(segment, contents):
            if isinstance(item, Loss):
                self._tear(_PendingDamage(f"{item.reason} (byte {item.offset})"))
                continue
            if item.damage:
                self._check_damaged(segment, item)
                continue
            for record in item.frames:
                stated = stated or bool(record.stated)
                numbers.append((self._check_record(segment, record), item.place.offset >= proven_bytes))
        self._end_torn(segment)
        if numbers and not stated and not segment.session.chain:
            self._find(FindingKind.NO_CHAIN, segment, "it carries no chain: a frame removed from it would not show")
        self._check_end(segment, len(numbers))
        self._before, self._before_is_signed = segment, proven_bytes >= segment.size_bytes
        behind = [number for number, is_behind in numbers if is_behind]
        return Counted(len(numbers), len(behind), behind[0] if behind else None)

    def finish(self) -> None:
        """End the check after the last segment."""
        last = self._before
        if last is not None and last.end is not None and last.end.reason == NEXT_SEGMENT:
            self._find(FindingKind.MISSING_SEGMENT, last, "the segments after it were not given")

    def _find(self, kind: FindingKind, segment: Segment, reason: str, frame: _Place | None = None) -> None:
        number, captured_ns = (frame.number, frame.captured_ns) if frame is not None else (None, None)
        self.findings.append(Finding(kind, segment.path, reason, number, captured_ns))

    def _check_joint(self, segment: Segment, *, is_proven: bool) -> None:
        before, session = self._before, segment.session
        if before is None:
            self._check_beginning(segment)
            return
        missing = session.segment - before.session.segment - 1
        if missing:
            self._expected = None
            reason = _which("segment", before.session.segment + 1, session.segment - 1, "not given")
            self._find(FindingKind.MISSING_SEGMENT, segment, reason)
        elif self._value is not None and segment.start_of_chain and session.chain != self._value:
            self._expected = None
            self._find(*self._broken_joint(before, segment, is_proven=is_proven))
        elif before.start_of_chain and not segment.start_of_chain and not segment.losses:
            self._find(FindingKind.CHANGED_SEGMENT, segment, "it carries no chain, but the segment before it does")

    def _broken_joint(self, before: Segment, segment: Segment, *, is_proven: bool) -> tuple[FindingKind, Segment, str]:
        # A recorder continues from what it has synced. So if this segment is proven to be the box's, the break is only
        # explained if the segment itself states that the one before lost something.
        declared = before.end is not None and before.end.recovered and (self._before_is_signed or not is_proven)
        if declared or (before.end is None and not is_proven):
            reason = "frames between it and the segment before, which was cut off, are lost"
            return FindingKind.RECOVERED, segment, reason
        reason = "it does not begin where the segment before it ends: one of the two was replaced or shortened"
        return FindingKind.CHANGED_SEGMENT, segment, reason

    def _check_beginning(self, segment: Segment) -> None:
        session = segment.session
        if session.segment:
            reason = _which("segment", 0, session.segment - 1, "not given")
            self._find(FindingKind.MISSING_SEGMENT, segment, reason)
        elif session.chain and session.chain != first_value(session):
            reason = "its chain does not begin with its recording's name, start and machine"
            self._find(FindingKind.CHANGED_SEGMENT, segment, reason)

    def _check_outline(self, segment: Segment) -> None:
        for loss in segment.losses:
            if loss.length:
                continue  # is reported at its place
            if loss.kind is LossKind.DAMAGED:
                recovered = segment.end is not None and segment.end.recovered
                self._find(FindingKind.RECOVERED if recovered else FindingKind.DAMAGED, segment, loss.reason)
            elif segment.finished:
                self._find(FindingKind.CHANGED_SEGMENT, segment, "it is finished, but its end record is gone")
            else:
                self._find(FindingKind.CUT, segment, loss.reason)

    def _check_record(self, segment: Segment, record: FrameRecord) -> int:
        """Check one frame; return its number."""
        fits = self._fits(segment, record)
        self._report_torn(segment, frames_are_lost=not fits)
        self._value = record.stated or None
        number = self._number(record, fits=fits)
        frame = _Place(number, record.captured_ns)
        if record.record_misfit:
            self._find_changed(segment, record.record_misfit, frame)
        elif fits:
            self._note_drops(segment, frame, is_chained=bool(record.stated))
            self._in_disorder = self._excused = False
        elif self._excused or self._in_disorder:
            self._excused = False
        else:
            self._find_break(segment, frame, is_renumbered=number != record.sequence)
        if record.picture_misfit:
            self._find(FindingKind.CHANGED_PICTURE, segment, record.picture_misfit, frame)
        self._count(number)
        return number

    def _count(self, number: int) -> None:
        self._expected = max(self._expected or 0, number + 1)
        self._at_start = False

    def _next(self) -> int | None:
        """Predict the number of the next frame if none is missing; None if unknown."""
        return 0 if self._at_start else self._expected

    def _number(self, record: FrameRecord, *, fits: bool) -> int:
        """Return the frame's number: as its record says, unless that was changed."""
        if record.sequence is not None and (fits or record.head_number != self._next()):
            return record.sequence
        return max(record.head_number, self._next() or 0)

    def _fits(self, segment: Segment, record: FrameRecord) -> bool:
        if not record.stated and not segment.session.chain:
            return True
        return self._value is None or link(self._value, record.content) == record.stated

    def _note_drops(self, segment: Segment, frame: _Place, *, is_chained: bool) -> None:
        if self._expected is not None and frame.number > self._expected and not self._excused:
            why = "never stored: the chain goes on without a break" if is_chained else "not stored, or removed later"
            self._find(FindingKind.DROPPED, segment, _which("frame", self._expected, frame.number - 1, why), frame)

    def _find_changed(self, segment: Segment, reason: str, frame: _Place) -> None:
        self._find(FindingKind.CHANGED_RECORD, segment, reason, frame)
        self._excused = self._incomplete = True

    def _find_break(self, segment: Segment, frame: _Place, *, is_renumbered: bool) -> None:
        number, expected = frame.number, self._expected
        if number in self._lost_before:
            reason = "what was recorded before it was damaged and could not be recovered"
            self._find(FindingKind.RECOVERED, segment, reason, frame)
        elif expected is None or number == expected or is_renumbered:
            reason = "its record is not what was recorded, or does not belong behind the frame before it"
            self._find_changed(segment, reason, frame)
        elif number > expected:
            reason = _which("frame", expected, number - 1, "removed before it")
            self._removed.append((expected, number - 1, len(self.findings)))
            self._find(FindingKind.REMOVED, segment, reason, frame)
        else:
            self._find_disorder(segment, frame)

    def _find_disorder(self, segment: Segment, frame: _Place) -> None:
        self._in_disorder = True
        place = bisect_right(self._removed, frame.number, key=lambda missing: missing[0]) - 1
        if place < 0 or frame.number > self._removed[place][1]:
            self._find(FindingKind.REORDERED, segment, "it does not stand where it was recorded", frame)
        else:
            index = self._removed[place][2]
            reason = f"it stands before frame {frame.number}, which was recorded before it"
            self.findings[index] = replace(self.findings[index], kind=FindingKind.REORDERED, reason=reason)

    def _check_damaged(self, segment: Segment, chunk: ChunkRecords) -> None:
        """Find the damaged frame of a damaged chunk, by what can still be read of it."""
        hit, misfit = None, ""
        for record in chunk.frames:
            fits = self._fits(segment, record)
            number = self._number(record, fits=fits)
            if hit is None and (record.misfit or not fits):
                hit, misfit = number, record.misfit
            self._value = record.stated or None
            self._count(number)
        if not chunk.complete:
            hit = self._next() if hit is None else hit
            self._value = self._expected = None
            self._at_start = False
        why = f"{chunk.damage} (byte {chunk.place.offset})"
        self._tear(_PendingDamage(f"{misfit}; {why}" if misfit else why, hit))

    def _tear(self, torn: _PendingDamage) -> None:
        self._torn.append(torn)
        self._excused = self._incomplete = True

    def _report_torn(self, segment: Segment, *, frames_are_lost: bool) -> None:
        for torn in self._torn:
            number = self._next() if torn.number is None and frames_are_lost else torn.number
            self.findings.append(Finding(FindingKind.DAMAGED, segment.path, torn.reason, number))
        self._torn.clear()

    def _end_torn(self, segment: Segment) -> None:
        if segment.finished:
            end = segment.end
            self._report_torn(segment, frames_are_lost=end is None or end.chain != self._value)
        # A power cut leaves just this: an unfinished file with a torn end.
        for torn in self._torn:
            self._find(FindingKind.CUT, segment, torn.reason)
        self._torn.clear()

    def _check_end(self, segment: Segment, frames: int) -> None:
        end = segment.end
        if end is None:
            return
        other_frames = end.frames != frames and not self._incomplete
        other_chain = self._value is not None and end.chain != self._value
        if other_frames and end.frames > frames:
            which = f"its last {end.frames - frames} frame(s) were removed"
            self.findings.append(Finding(FindingKind.REMOVED, segment.path, which, self._expected or 0))
        elif not self._excused and (other_frames or other_chain):
            self._find(FindingKind.CHANGED_SEGMENT, segment, "its end record does not fit its frames")
        if end.recovered:
            reason = f"{end.reason}; what had not been stored by then is not in it"
            self._find(FindingKind.CUT, segment, reason)
        self._value = end.chain or None


def _which(word: str, first: int, last: int, what: str) -> str:
    return f"{word} {first} was {what}" if first == last else f"{word}s {first} to {last} were {what}"
