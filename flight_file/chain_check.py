"""Follow the chain through the segments of a recording, and say of each break what made it.

A frame that the recorder never stored leaves a gap in the sequence numbers, but none in the chain; a frame that was
removed later leaves both. That is how the two are told apart.
"""

from __future__ import annotations

from dataclasses import replace

from flight_file.chain import first_value, link
from flight_file.findings import Finding, FindingKind
from flight_file.losses import Loss, LossKind
from flight_file.pairing import Unpaired
from flight_file.record_walk import Record, walk_records
from flight_file.segment import Segment
from flight_file.segments import NEXT_SEGMENT


class ChainCheck:
    """Feed it the segments of a recording in their order.

    Attributes
    ----------
    findings
        All so far, in the order of the recording.
    """

    def __init__(self) -> None:
        self.findings: list[Finding] = []
        self._before: Segment | None = None
        self._value: str | None = None  # None: not known, the next frame's own value is believed
        self._expected: int | None = None
        self._excused = False  # something before the next frame is damaged and has been reported
        self._in_disorder = False
        self._torn: list[Loss] = []
        self._removed: dict[int, int] = {}  # missing sequence number: index of its finding

    def check(self, segment: Segment) -> int:
        """Check one more segment; gives the number of its frames' records.

        Raises
        ------
        FlightNotReadableError
            If the disk fails.
        """
        self._check_joint(segment)
        self._check_outline(segment)
        self._value = segment.start_of_chain or None
        self._excused = self._in_disorder = False
        frames = 0
        stated = False
        for item in walk_records(segment):
            if isinstance(item, Record):
                frames += 1
                stated = stated or bool(item.stated)
                self._check_record(segment, item)
            elif isinstance(item, Unpaired):
                self._check_unpaired(segment, item)
            else:
                self._torn.append(item)
                self._excused = True
        self._end_torn(segment)
        if frames and not stated and not segment.session.chain:
            self._find(FindingKind.NO_CHAIN, segment, "it carries no chain: a frame removed from it would not show")
        self._check_end(segment, frames)
        self._before = segment
        return frames

    def finish(self) -> None:
        """There are no more segments."""
        last = self._before
        if last is not None and last.end is not None and last.end.reason == NEXT_SEGMENT:
            self._find(FindingKind.MISSING_SEGMENT, last, "the segments after it were not given")

    def _find(self, kind: FindingKind, segment: Segment, reason: str, record: Record | None = None) -> None:
        frame = record.frame if record is not None else None
        sequence, captured_ns = (frame.sequence, frame.captured_ns) if frame is not None else (None, None)
        self.findings.append(Finding(kind, segment.path, reason, sequence, captured_ns))

    def _check_joint(self, segment: Segment) -> None:
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
            cut = before.end is None or before.end.recovered
            self._expected = None
            kind = FindingKind.RECOVERED if cut else FindingKind.CHANGED_SEGMENT
            reason = (
                "frames between it and the segment before, which was cut off, are lost"
                if cut
                else "it does not begin where the segment before it ends: one of the two was replaced or shortened"
            )
            self._find(kind, segment, reason)
        elif before.start_of_chain and not segment.start_of_chain and not segment.losses:
            self._find(FindingKind.CHANGED_SEGMENT, segment, "it carries no chain, but the segment before it does")

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
                continue  # comes up where it lies
            if loss.kind is LossKind.DAMAGED:
                recovered = segment.end is not None and segment.end.recovered
                self._find(FindingKind.RECOVERED if recovered else FindingKind.DAMAGED, segment, loss.reason)
            elif segment.finished:
                self._find(FindingKind.CHANGED_SEGMENT, segment, "it is finished, but its end record is gone")
            else:
                self._find(FindingKind.CUT, segment, loss.reason)

    def _check_record(self, segment: Segment, record: Record) -> None:
        for loss in self._torn:
            self._find_damaged(segment, loss)
        self._torn.clear()
        sequence = record.frame.sequence
        fits = self._value is None or link(self._value, record.content) == record.stated
        if not record.stated and not segment.session.chain:
            fits = True
        if fits:
            self._in_disorder = False
            self._note_drops(segment, record)
        elif not self._excused and not self._in_disorder:
            self._find_break(segment, record)
        self._value = record.stated or None
        self._expected = max(self._expected or 0, sequence + 1)
        self._excused = False

    def _note_drops(self, segment: Segment, record: Record) -> None:
        sequence = record.frame.sequence
        if self._expected is not None and sequence > self._expected and not self._excused:
            why = "never stored: the chain goes on without a break" if record.stated else "not stored, or removed later"
            self._find(FindingKind.DROPPED, segment, _which("frame", self._expected, sequence - 1, why), record)

    def _find_break(self, segment: Segment, record: Record) -> None:
        sequence, expected = record.frame.sequence, self._expected
        if segment.end is not None and sequence in segment.end.lost_before:
            reason = "what was recorded before it was damaged and could not be recovered"
            self._find(FindingKind.RECOVERED, segment, reason, record)
        elif expected is not None and sequence > expected:
            reason = _which("frame", expected, sequence - 1, "removed before it")
            self._removed |= dict.fromkeys(range(expected, min(sequence, expected + 1000)), len(self.findings))
            self._find(FindingKind.REMOVED, segment, reason, record)
        elif expected is not None and sequence < expected:
            self._find_disorder(segment, record)
        else:
            reason = "its record is not what was recorded, or does not belong behind the frame before it"
            self._find(FindingKind.CHANGED_RECORD, segment, reason, record)

    def _find_disorder(self, segment: Segment, record: Record) -> None:
        self._in_disorder = True
        index = self._removed.get(record.frame.sequence)
        if index is None:
            self._find(FindingKind.REORDERED, segment, "it does not stand where it was recorded", record)
        else:
            reason = f"it stands before frame {record.frame.sequence}, which was recorded before it"
            self.findings[index] = replace(self.findings[index], kind=FindingKind.REORDERED, reason=reason)

    def _check_unpaired(self, segment: Segment, unpaired: Unpaired) -> None:
        frame = unpaired.frame
        sequence, captured_ns = (frame.sequence, frame.captured_ns) if frame is not None else (self._expected, None)
        self.findings.append(Finding(FindingKind.CHANGED_PICTURE, segment.path, unpaired.reason, sequence, captured_ns))
        self._excused = self._excused or frame is None

    def _find_damaged(self, segment: Segment, loss: Loss) -> None:
        reason = f"{loss.reason} (byte {loss.offset})"
        self.findings.append(Finding(FindingKind.DAMAGED, segment.path, reason, self._expected or 0))

    def _end_torn(self, segment: Segment) -> None:
        # What is torn at the end of a file that was never finished is what a power cut leaves.
        for loss in self._torn:
            if segment.finished:
                self._find_damaged(segment, loss)
            else:
                self._find(FindingKind.CUT, segment, f"{loss.reason} (byte {loss.offset})")
        self._torn.clear()

    def _check_end(self, segment: Segment, frames: int) -> None:
        end = segment.end
        if end is None:
            return
        known = not self._excused
        if known and end.frames > frames:
            which = f"its last {end.frames - frames} frame(s) were removed"
            self.findings.append(Finding(FindingKind.REMOVED, segment.path, which, self._expected or 0))
        elif known and (end.frames != frames or (self._value is not None and end.chain != self._value)):
            self._find(FindingKind.CHANGED_SEGMENT, segment, "its end record does not fit its frames")
        if end.recovered:
            reason = f"{end.reason}; what had not been stored by then is not in it"
            self._find(FindingKind.CUT, segment, reason)
        self._value = end.chain or None


def _which(word: str, first: int, last: int, what: str) -> str:
    return f"{word} {first} was {what}" if first == last else f"{word}s {first} to {last} were {what}"
