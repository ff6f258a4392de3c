"""Verification of a recording: names, CRCs, digests, chain, proof; and the first frame that does not fit.

A genuine signature beside a segment proves every byte; a genuine checkpoint inside proves every byte before it, and
nothing after it. docs/evidence.md describes the model, and what each check shows.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Self

from flight_file.chain_check import ChainCheck, Counted
from flight_file.errors import Finding, FindingKind, FlightNotReadableError, MixedFlightsError
from flight_file.records import ByteSource
from flight_file.scan import Checkpoint
from flight_file.segment import Segment, open_segment, opened
from flight_file.session import PART_SUFFIX, claimed_place, is_unproven
from flight_file.signature import MalformedSignatureError, Signature, is_genuine, read_checkpoint, read_signature
from flight_file.summary import Contents, unfitting_index
from flight_file.thresholds import BLOCK_BYTES


@dataclass(frozen=True, slots=True)
class Proof:
    """What is known about who wrote a file.

    Attributes
    ----------
    signed_by
        Public key of a genuine signature over all bytes, 32 bytes; None if there is none.
    checkpointed_by
        Public key of the last genuine checkpoint, 32 bytes; None if there is none.
    proven_bytes
        Number of proven bytes, from the start of the file.
    finding
        Error in signature or checkpoints.
    """

    signed_by: bytes | None = None
    checkpointed_by: bytes | None = None
    proven_bytes: int = 0
    finding: Finding | None = None

    @property
    def key(self) -> bytes | None:
        """Key that proves the file, or its beginning; None if there is none."""
        return self.signed_by or self.checkpointed_by


def prove(segment: Segment, public_key: bytes | None) -> Proof:
    """Find what proves a segment.

    Parameters
    ----------
    public_key
        Key whose signature and checkpoints count, 32 bytes; None for any.

    Raises
    ------
    FlightNotReadableError
        If a file cannot be read.
    """
    with opened(segment.path) as source:
        return prove_file(segment.path, source, segment.checkpoints, public_key)


def prove_file(path: Path, source: ByteSource, checkpoints: Sequence[Checkpoint], public_key: bytes | None) -> Proof:
    """Find what proves an open file.

    A signature beside a file in work may be its own, if only the final name is missing, or belong to the result of an
    interrupted recovery. So it counts there only if it fits.
    """
    in_work = path.name.endswith(PART_SUFFIX)
    try:
        signature = _signature_beside(path)
    except MalformedSignatureError as error:
        return Proof(finding=Finding(FindingKind.WRONG_SIGNATURE, path, str(error)))
    if signature is None and not checkpoints:
        return Proof()
    digests = _digests(source, {source.size, *(point.offset for point in checkpoints)})
    misfit = _misfit(signature, digests[source.size], public_key) if signature is not None else None
    if in_work and misfit is not None:
        signature = misfit = None
    seals = [(point, _parsed(point)) for point in checkpoints]
    keys = {seal.public_key for seal in (signature, *(seal for _, seal in seals)) if seal is not None}
    if misfit is None and len(keys) > 1:
        misfit = (FindingKind.OTHER_KEY, "its signature and checkpoints were not made with one key")
    if misfit is None and signature is not None:
        return Proof(signature.public_key, None, source.size)
    by, proven_bytes, unfitting = None, 0, None
    for point, seal in reversed(seals):
        found = _misfit(seal, digests[point.offset], public_key, point.offset)
        if found is None and seal is not None:
            by, proven_bytes = seal.public_key, point.end
            break
        unfitting = found
    misfit = misfit or unfitting
    return Proof(None, by, proven_bytes, Finding(misfit[0], path, misfit[1]) if misfit is not None else None)


def _signature_beside(path: Path) -> Signature | None:
    """Read the signature beside a file; beside a file in work, one that cannot be read counts as none."""
    try:
        return read_signature(path.with_name(path.name.removesuffix(PART_SUFFIX)))
    except (MalformedSignatureError, FlightNotReadableError):
        if path.name.endswith(PART_SUFFIX):
            return None
        raise


def _misfit(
    seal: Signature | None, sha256: str, public_key: bytes | None, covered_bytes: int | None = None
) -> tuple[FindingKind, str] | None:
    """Return why a signature, or the checkpoint at this byte, proves nothing; None if it does."""
    what = "its signature" if covered_bytes is None else f"its checkpoint at byte {covered_bytes}"
    if seal is None or not is_genuine(seal):
        return FindingKind.WRONG_SIGNATURE, f"{what} was not made with the key that it names"
    if public_key is not None and seal.public_key != public_key:
        return FindingKind.OTHER_KEY, f"{what} was made with another key than the one given"
    if (seal.covered_bytes, seal.sha256) != (covered_bytes, sha256):
        which = "its bytes" if covered_bytes is None else f"the bytes before {what}"
        return FindingKind.WRONG_SIGNATURE, f"{which} are not those that were signed"
    return None


def _parsed(point: Checkpoint) -> Signature | None:
    try:
        return read_checkpoint(point.record)
    except MalformedSignatureError:
        return None


def _digests(source: ByteSource, ends: Iterable[int]) -> dict[int, str]:
    """Compute the SHA-256, hexadecimal, of the bytes before each of these offsets."""
    digest, position, found = hashlib.sha256(), 0, {}
    for end in sorted(ends):
        for offset in range(position, end, BLOCK_BYTES):
            digest.update(source.read_at(offset, min(BLOCK_BYTES, end - offset)))
        position, found[end] = end, digest.hexdigest()
    return found


class Verdict(Enum):
    """The result of a verification."""

    FITS = "fits"
    LOSS = "fits as far as it goes"
    FAULT = "does not fit"


@dataclass(frozen=True, slots=True)
class SegmentCheck:
    """One segment.

    Attributes
    ----------
    frames
        Frames whose record exists.
    chain_end
        Value of the chain by its end record; empty if there is none.
    signed_by
        Public key of a signature that fits, 32 bytes; None if there is none.
    findings
        In the order of the segment.
    checkpointed_by
        Public key of the last genuine checkpoint, if no signature fits, 32 bytes; None if there is none.
    proven_frames
        Number of its frames proven by the signature or that checkpoint.
    """

    segment: Segment
    frames: int
    chain_end: str
    signed_by: bytes | None
    findings: tuple[Finding, ...]
    checkpointed_by: bytes | None = None
    proven_frames: int = 0

    @classmethod
    def of(cls, segment: Segment, counted: Counted, proof: Proof, findings: Sequence[Finding]) -> Self:
        """Combine the findings on a segment."""
        return cls(
            segment=segment,
            frames=counted.frames,
            chain_end=segment.end.chain if segment.end is not None else "",
            signed_by=proof.signed_by,
            findings=tuple(findings),
            checkpointed_by=proof.checkpointed_by,
            proven_frames=counted.frames - counted.behind if proof.key is not None else 0,
        )


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
        """The first fault: that of the first frame, if any is about a frame."""
        faults = [finding for finding in self.findings if finding.is_fault]
        return next((fault for fault in faults if fault.sequence is not None), faults[0] if faults else None)

    @property
    def verdict(self) -> Verdict:
        """The verdict over all findings."""
        return verdict_of(self.findings)


def verdict_of(findings: Sequence[Finding]) -> Verdict:
    """Judge findings by the worst of them."""
    if any(finding.is_fault for finding in findings):
        return Verdict.FAULT
    return Verdict.LOSS if any(finding.is_loss for finding in findings) else Verdict.FITS


def verify(paths: Sequence[Path], *, public_key: bytes | None = None) -> list[RecordingCheck]:
    """Verify flight files; those of one recording are checked together.

    Files belong together by their names, `RECORDING_0000.mcap`, and each name is compared with the file's contents. A
    file with another name belongs where its own session says.

    Parameters
    ----------
    public_key
        Key that must have signed, 32 bytes. None: no signature is needed; but if a part of a recording is signed, the
        same key must have signed all of it.

    Raises
    ------
    FlightNotReadableError, NotAFlightError
        A file cannot be read, or is not MCAP.
    MixedFlightsError
        A segment of a recording is given twice.
    """
    groups: dict[str, list[Segment]] = {}
    for path in sorted(paths):
        segment, _ = open_segment(path)
        recording, _ = claimed_place(path) or (segment.session.recording, 0)
        groups.setdefault(recording, []).append(segment)
    return [_verify_recording(name, segments, public_key) for name, segments in sorted(groups.items())]


def _verify_recording(recording: str, segments: list[Segment], public_key: bytes | None) -> RecordingCheck:
    own = _in_their_places(recording, segments)
    proofs = [prove(segment, public_key) for segment in own]
    key = public_key or next((proof.key for proof in proofs if proof.key is not None), None)
    chain = ChainCheck()
    checks = [_verify_segment(segment, chain, proof, key) for segment, proof in zip(own, proofs, strict=True)]
    done = len(chain.findings)
    chain.finish()
    if checks:
        checks[-1] = replace(checks[-1], findings=(*checks[-1].findings, *chain.findings[done:]))
    return RecordingCheck(recording, (*checks, *(_set_apart(segment) for segment in segments if segment not in own)))


def _in_their_places(recording: str, segments: Sequence[Segment]) -> list[Segment]:
    """Order the segments of a recording, leaving out those that cannot belong to it."""
    places: dict[int, Segment] = {}
    for segment in segments:
        if segment.session.recording != recording or is_unproven(segment.path):
            continue
        number = segment.session.segment
        other = places.setdefault(number, segment)
        if other is segment or _misnamed(segment) is not None:
            continue
        if _misnamed(other) is None:
            raise MixedFlightsError(f"{other.path} and {segment.path} are both segment {number}; give one of them.")
        places[number] = segment
    return [segment for _, segment in sorted(places.items())]


def _misnamed(segment: Segment) -> Finding | None:
    """Find a wrong claim of a segment's name."""
    claimed, session = claimed_place(segment.path), segment.session
    if claimed is None or claimed == (session.recording, session.segment):
        return None
    if claimed[0] != session.recording:
        reason = f"it is a segment of the recording {session.recording}, not of {claimed[0]}"
        return Finding(FindingKind.OTHER_RECORDING, segment.path, reason)
    reason = f"it is segment {session.segment} under the name of segment {claimed[1]}"
    return Finding(FindingKind.CHANGED_SEGMENT, segment.path, reason)


def _set_apart(segment: Segment) -> SegmentCheck:
    misnamed = _misnamed(segment)
    reason = "by its own name nothing proves it: a recovery found it where no signature or checkpoint vouches for it"
    finding = misnamed or Finding(FindingKind.UNPROVEN, segment.path, reason)
    counted = ChainCheck().check(segment, Contents(), proven_bytes=0)
    return SegmentCheck.of(segment, counted, Proof(), [finding])


def _verify_segment(segment: Segment, chain: ChainCheck, proof: Proof, key: bytes | None) -> SegmentCheck:
    done = len(chain.findings)
    contents = Contents()
    counted = chain.check(segment, contents, proven_bytes=proof.proven_bytes)
    misnamed = _misnamed(segment)
    findings = [*([misnamed] if misnamed is not None else []), *chain.findings[done:]]
    if not any(finding.is_fault for finding in findings):
        findings += _findings_outside(segment, contents)
    findings += _findings_of_proof(segment, proof, counted, key)
    return SegmentCheck.of(segment, counted, proof, findings)


def _findings_outside(segment: Segment, contents: Contents) -> Iterator[Finding]:
    if contents.misfit and segment.is_ours:
        yield Finding(FindingKind.CHANGED_SEGMENT, segment.path, contents.misfit)
    if segment.finished:
        with opened(segment.path) as source:
            unfitting = unfitting_index(segment, source, contents)
        if unfitting is not None:
            yield Finding(unfitting[0], segment.path, unfitting[1])


def _findings_of_proof(segment: Segment, proof: Proof, counted: Counted, key: bytes | None) -> Iterator[Finding]:
    """Find what a segment's proof lacks; `key` must have signed it, or any or none if it is None."""
    path = segment.path
    if proof.finding is not None:
        yield proof.finding
    elif key is None and not segment.finished:
        yield Finding(FindingKind.UNPROVEN, path, "it is neither finished nor signed: it proves nothing")
    elif key is not None and proof.key is None:
        yield Finding(FindingKind.NOT_SIGNED, path, "it has neither a signature nor a checkpoint: it proves nothing")
    elif key is not None and proof.key != key:
        yield Finding(FindingKind.OTHER_KEY, path, "it was signed with another key than the segments before it")
    elif proof.key is not None and proof.signed_by is None:
        yield from _findings_of_checkpoints(segment, counted)


def _findings_of_checkpoints(segment: Segment, counted: Counted) -> Iterator[Finding]:
    if segment.finished and not segment.path.name.endswith(PART_SUFFIX):
        reason = (
            f"it is finished but has no signature; its checkpoints prove {counted.frames - counted.behind} frame(s)"
        )
        yield Finding(FindingKind.NOT_SIGNED, segment.path, reason)
    elif counted.behind:
        which = f"its last {counted.behind} frame(s), from frame {counted.first_behind} on"
        reason = f"{which}, stand behind its last checkpoint: nothing proves them"
        yield Finding(FindingKind.UNPROVEN, segment.path, reason)
    elif segment.end is not None:
        reason = "it was cut off before it was signed: nothing proves its end record"
        yield Finding(FindingKind.UNPROVEN, segment.path, reason)
