"""Whether a recording fits: CRCs, digests, chain, signatures; and if not, which frame is the first that does not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise
from pathlib import Path

from flight_file.chain_check import ChainCheck
from flight_file.errors import MixedFlightsError
from flight_file.findings import Finding, FindingKind
from flight_file.section_crcs import unfitting_section
from flight_file.segment import Segment, open_segment, opened
from flight_file.segments import parse_segment_name
from flight_file.signature_check import check_signature


class Verdict(Enum):
    """What a verification comes to."""

    FITS = "fits"
    LOSS = "fits as far as it goes"
    FAULT = "does not fit"


@dataclass(frozen=True, slots=True)
class SegmentCheck:
    """One segment.

    Attributes
    ----------
    frames
        Frames whose record is there.
    chain_end
        Value of the chain by its end record; empty if there is none.
    signed_by
        Public key of a signature that fits, 32 bytes; None if there is none.
    findings
        What was found in it, in its order.
    """

    segment: Segment
    frames: int
    chain_end: str
    signed_by: bytes | None
    findings: tuple[Finding, ...]


@dataclass(frozen=True, slots=True)
class RecordingCheck:
    """All segments of one recording that were given."""

    recording: str
    segments: tuple[SegmentCheck, ...]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings, in the order of the recording."""
        return tuple(finding for segment in self.segments for finding in segment.findings)

    @property
    def first_fault(self) -> Finding | None:
        """What does not fit first: the first frame, if it is about a frame at all."""
        faults = [finding for finding in self.findings if finding.is_fault]
        return next((fault for fault in faults if fault.sequence is not None), faults[0] if faults else None)

    @property
    def verdict(self) -> Verdict:
        """What it comes to."""
        return verdict_of(self.findings)


def verdict_of(findings: Sequence[Finding]) -> Verdict:
    """What findings come to."""
    if any(finding.is_fault for finding in findings):
        return Verdict.FAULT
    return Verdict.LOSS if any(finding.is_loss for finding in findings) else Verdict.FITS


def verify(paths: Sequence[Path], *, public_key: bytes | None = None) -> list[RecordingCheck]:
    """Verify flight files; those of one recording are checked together.

    Which files belong together is told by their names, `RECORDING_0000.mcap`, so that a segment of another recording
    under such a name is noticed. A file with any other name belongs where its own session says.

    Parameters
    ----------
    public_key
        Who must have signed, 32 bytes; None if nobody must.

    Raises
    ------
    FlightNotReadableError, NotAFlightError
        A file cannot be read, or is no MCAP.
    MixedFlightsError
        A segment of a recording is given twice.
    """
    groups: dict[str, list[Segment]] = {}
    for path in sorted(paths):
        segment, _ = open_segment(path)
        recording, _ = parse_segment_name(path) or (segment.session.recording, 0)
        groups.setdefault(recording, []).append(segment)
    return [_verify_recording(segments, public_key) for _, segments in sorted(groups.items())]


def _verify_recording(segments: list[Segment], public_key: bytes | None) -> RecordingCheck:
    names = [segment.session.recording for segment in segments]
    recording = max(names, key=names.count)  # the first of the most frequent
    own = sorted(
        (segment for segment in segments if segment.session.recording == recording),
        key=lambda segment: segment.session.segment,
    )
    for before, after in pairwise(own):
        if before.session.segment == after.session.segment:
            number = after.session.segment
            raise MixedFlightsError(f"{before.path} and {after.path} are both segment {number}; give one of them.")
    chain = ChainCheck()
    checks = [_verify_segment(segment, chain, public_key) for segment in own]
    done = len(chain.findings)
    chain.finish()
    checks[-1] = _with(checks[-1], chain.findings[done:])
    foreign = [segment for segment in segments if segment.session.recording != recording]
    return RecordingCheck(recording, (*checks, *(_foreign(segment, recording) for segment in foreign)))


def _verify_segment(segment: Segment, chain: ChainCheck, public_key: bytes | None) -> SegmentCheck:
    done = len(chain.findings)
    frames = chain.check(segment)
    findings = chain.findings[done:]
    named = parse_segment_name(segment.path)
    if named is not None and named[1] != segment.session.segment:
        reason = f"it is segment {segment.session.segment} under the name of segment {named[1]}"
        findings.insert(0, Finding(FindingKind.CHANGED_SEGMENT, segment.path, reason))
    if segment.finished and not any(finding.is_fault for finding in findings):
        with opened(segment.path) as source:
            unfitting = unfitting_section(source)
        if unfitting is not None:
            findings.append(Finding(FindingKind.DAMAGED, segment.path, unfitting))
    signature = check_signature(segment, public_key)
    if signature.finding is not None:
        findings.append(signature.finding)
    chain_end = segment.end.chain if segment.end is not None else ""
    return SegmentCheck(segment, frames, chain_end, signature.signed_by, tuple(findings))


def _foreign(segment: Segment, recording: str) -> SegmentCheck:
    reason = f"it is a segment of the recording {segment.session.recording}, not of {recording}"
    return SegmentCheck(segment, 0, "", None, (Finding(FindingKind.OTHER_RECORDING, segment.path, reason),))


def _with(check: SegmentCheck, findings: Sequence[Finding]) -> SegmentCheck:
    return SegmentCheck(check.segment, check.frames, check.chain_end, check.signed_by, (*check.findings, *findings))
