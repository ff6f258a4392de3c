"""What was checked of the recording itself while the report was written, and what was not: said in plain sentences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from flight_file.findings import FindingKind
from flight_file.verification import RecordingCheck, Verdict

MOST_FINDINGS = 20


@dataclass(frozen=True, slots=True)
class Checked:
    """One line: `state` is `good`, `warn`, `bad` or `open` (nobody looked)."""

    state: str
    what: str
    says: str


def checked(recordings: Sequence[RecordingCheck]) -> list[Checked]:
    """What a verification comes to."""
    segments = [segment for recording in recordings for segment in recording.segments]
    findings = [finding for recording in recordings for finding in recording.findings]
    lines = [_chain(recordings, len(segments)), _signatures([segment.signed_by for segment in segments])]
    for finding in findings[:MOST_FINDINGS]:
        frame = "" if finding.sequence is None else f", frame {finding.sequence}"
        state = "bad" if finding.is_fault else "warn"
        lines.append(Checked(state, finding.kind.value, f"{finding.path.name}{frame}: {finding.reason}"))
    if len(findings) > MOST_FINDINGS:
        more = len(findings) - MOST_FINDINGS
        lines.append(Checked("warn", "and more", f"{more} more findings; `recorder verify` lists all"))
    return lines + NOT_CHECKED


def _chain(recordings: Sequence[RecordingCheck], segments: int) -> Checked:
    files = "the flight file" if segments == 1 else f"all {segments} flight files"
    verdicts = {recording.verdict for recording in recordings}
    kinds = {finding.kind for recording in recordings for finding in recording.findings}
    if Verdict.FAULT in verdicts:
        return Checked("bad", "chain and digests", f"{files}: does not fit; what was found is listed below")
    if FindingKind.NO_CHAIN in kinds:
        says = f"pictures of {files} fit their digests, but there is no chain: a removed frame would not show"
        return Checked("warn", "chain and digests", says)
    if Verdict.LOSS in verdicts:
        return Checked("warn", "chain and digests", f"{files}: fits as far as it goes; something is not there")
    says = f"{files}: every picture fits its digest, and every frame follows the one before, none removed or added"
    return Checked("good", "chain and digests", says)


def _signatures(keys: Sequence[bytes | None]) -> Checked:
    signed = [key for key in keys if key is not None]
    if not signed:
        says = "not signed: a chain holds no secret, so whoever rewrites the whole recording leaves one that fits"
        return Checked("open", "signature", says)
    names = ", ".join(sorted({key.hex()[:16] for key in signed}))
    if len(signed) < len(keys):
        says = f"{len(signed)} of {len(keys)} segments signed, by key {names}; the others are not"
        return Checked("warn", "signature", says)
    says = (
        f"signed, every byte, by key {names}. Compare the key with the recorder's own: nothing here says whose it is"
        " (`recorder verify --public-key`)"
    )
    return Checked("good", "signature", says)


NOT_CHECKED = [
    Checked("open", "times", "not checked: they are the recorder's clock, as it was set"),
    Checked("open", "instruments", "not checked: a gauge that shows a wrong value is read as it stands"),
]
