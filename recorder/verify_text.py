"""What a verification found, as lines for people and as JSON for scripts."""

from __future__ import annotations

from typing import Any

from flight_file.findings import Finding
from flight_file.verification import RecordingCheck, SegmentCheck, Verdict, verdict_of
from recorder.utc import utc_text

_WORDS = {Verdict.FITS: "fits", Verdict.LOSS: "fits as far as it goes", Verdict.FAULT: "DOES NOT FIT"}


def as_lines(check: RecordingCheck) -> list[str]:
    """One line for each segment with what was found in it below, then the verdict."""
    lines = [line for segment in check.segments for line in _segment_lines(segment)]
    verdict = f"{check.recording}: {_WORDS[check.verdict]}"
    first = check.first_fault
    if first is not None:
        verdict += f"; first: {first.path.name}, {_said(first)}"
    return [*lines, verdict]


def as_json(check: RecordingCheck) -> dict[str, Any]:
    """Everything as plain values."""
    first = check.first_fault
    return {
        "recording": check.recording,
        "verdict": check.verdict.value,
        "first_fault": _finding(first) if first is not None else None,
        "segments": [
            {
                "path": str(segment.segment.path),
                "segment": segment.segment.session.segment,
                "verdict": verdict_of(segment.findings).value,
                "frames": segment.frames,
                "chain_start": segment.segment.session.chain or None,
                "chain_end": segment.chain_end or None,
                "signed_by": segment.signed_by.hex() if segment.signed_by is not None else None,
                "findings": [_finding(finding) for finding in segment.findings],
            }
            for segment in check.segments
        ],
    }


def _segment_lines(check: SegmentCheck) -> list[str]:
    signed = "not signed" if check.signed_by is None else f"signed by {check.signed_by.hex()[:16]}"
    chain = f"chain {check.chain_end[:16]}" if check.chain_end else "no end of chain"
    facts = f"{check.frames} frames, {chain}, {signed}"
    line = f"{check.segment.path.name}: {_WORDS[verdict_of(check.findings)]} ({facts})"
    return [line, *(f"  {_said(finding)}" for finding in check.findings)]


def _said(finding: Finding) -> str:
    if finding.sequence is None:
        return f"{finding.kind.value}: {finding.reason}"
    when = utc_text(finding.captured_ns)
    frame = f"frame {finding.sequence}" + (f" ({when})" if when else "")
    return f"{finding.kind.value}: {frame}: {finding.reason}"


def _finding(finding: Finding) -> dict[str, Any]:
    return {
        "kind": finding.kind.value,
        "path": str(finding.path),
        "reason": finding.reason,
        "frame": finding.sequence,
        "captured_utc": utc_text(finding.captured_ns),
        "fault": finding.is_fault,
    }
