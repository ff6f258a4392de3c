"""`recorder verify` and `recorder keygen`: make a key, and check what was signed with it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from flight_file.errors import Finding
from flight_file.signature import load_public_key, make_key_files
from flight_file.untrusted import say, say_json
from flight_file.verification import RecordingCheck, SegmentCheck, Verdict, verdict_of
from flight_file.verification import verify as verify_files
from recorder.cli import DONE_WITH_LOSS, FAILED, failures_as_sentences
from recorder.host import utc_text

_WORDS = {Verdict.FITS: "fits", Verdict.LOSS: "fits as far as it goes", Verdict.FAULT: "DOES NOT FIT"}
_EXIT_CODES = {Verdict.FITS: 0, Verdict.LOSS: DONE_WITH_LOSS, Verdict.FAULT: FAILED}
_WORST_FIRST = (Verdict.FAULT, Verdict.LOSS, Verdict.FITS)


def as_lines(check: RecordingCheck) -> list[str]:
    """Format a line for each segment with its findings below, then the verdict."""
    lines = [line for segment in check.segments for line in _segment_lines(segment)]
    verdict = f"{check.recording}: {_WORDS[check.verdict]}"
    first = check.first_fault
    if first is not None:
        verdict += f"; first: {first.path.name}, {_said(first)}"
    return [*lines, verdict]


def as_json(check: RecordingCheck) -> dict[str, Any]:
    """Convert everything to plain values."""
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
                "signed_by": _hex(segment.signed_by),
                "checkpoints_by": _hex(segment.checkpointed_by),
                "frames_proven": segment.proven_frames,
                "findings": [_finding(finding) for finding in segment.findings],
            }
            for segment in check.segments
        ],
    }


def _segment_lines(check: SegmentCheck) -> list[str]:
    chain = f"chain {check.chain_end[:16]}" if check.chain_end else "no end of chain"
    facts = f"{check.frames} frames, {chain}, {_proof(check)}"
    line = f"{check.segment.path.name}: {_WORDS[verdict_of(check.findings)]} ({facts})"
    return [line, *(f"  {_said(finding)}" for finding in check.findings)]


def _proof(check: SegmentCheck) -> str:
    if check.signed_by is not None:
        return f"signed by {check.signed_by.hex()[:16]}"
    if check.checkpointed_by is not None:
        return f"{check.proven_frames} frames proven by checkpoints of {check.checkpointed_by.hex()[:16]}"
    return "not signed"


def _hex(key: bytes | None) -> str | None:
    return key.hex() if key is not None else None


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


@click.command(
    epilog="""\b
Examples:
  recorder verify flights/*.mcap
  recorder verify --public-key recorder.key.pub flights/20180504T120000Z_*.mcap
  recorder verify --json flight.mcap | jq .[0].first_fault

\b
Exit codes: 0 all fits, 1 something does not fit, 2 wrong usage, 3 it fits as far as it goes: something is missing.""",
)
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--public-key", type=click.Path(path_type=Path), help="Every segment must be signed with this key.")
@click.option("--json", "as_document", is_flag=True, help="Print a JSON document instead of lines.")
@click.pass_context
def verify(context: click.Context, files: tuple[Path, ...], public_key: Path | None, *, as_document: bool) -> None:
    """Check that flights are as they were recorded, and name the first frame that does not fit.

    CRCs and digests show damage, the chain shows what was changed, removed, added or reordered, a signature shows who
    recorded it. Without --public-key a signature proves only that somebody signed.
    """
    with failures_as_sentences():
        checks = verify_files(files, public_key=load_public_key(public_key) if public_key else None)
    if as_document:
        say_json([as_json(check) for check in checks])
    else:
        say(*(line for check in checks for line in as_lines(check)))
    verdicts = {check.verdict for check in checks}
    context.exit(_EXIT_CODES[next(verdict for verdict in _WORST_FIRST if verdict in verdicts)])


@click.command(
    epilog="""\b
Examples:
  recorder keygen /etc/recorder/recorder.key

\b
Then, in recorder.yaml:
  evidence: {key: recorder.key}""",
)
@click.argument("file", type=click.Path(path_type=Path))
def keygen(file: Path) -> None:
    """Make an Ed25519 key to sign recordings with: the private key in FILE, the public one in FILE.pub.

    Only its owner may read FILE. Take FILE.pub off the box at once, by a way that you trust: `recorder verify` is given
    it. An existing key is never replaced.
    """
    with failures_as_sentences():
        public = make_key_files(file)
    say(f"private key: {file}")
    say(f"public key:  {public}")
