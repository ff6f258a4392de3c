"""Whether a segment's signature fits, and is from whom it should be."""

from __future__ import annotations

from dataclasses import dataclass

from flight_file.findings import Finding, FindingKind
from flight_file.segment import Segment, digest_of, opened
from flight_file.signature import MalformedSignatureError, Signature, read_signature


@dataclass(frozen=True, slots=True)
class SignatureCheck:
    """Whose signature it is (32 bytes, None if there is none that fits), and what is wrong with it."""

    signed_by: bytes | None
    finding: Finding | None = None


def check_signature(segment: Segment, public_key: bytes | None) -> SignatureCheck:
    """Check the signature beside a segment.

    Parameters
    ----------
    public_key
        Who must have signed every finished segment, 32 bytes; None: nobody must, and whoever did may have.

    Raises
    ------
    FlightNotReadableError
        If a file cannot be read.
    """
    try:
        signature = read_signature(segment.path)
    except MalformedSignatureError as error:
        return _wrong(segment, FindingKind.WRONG_SIGNATURE, str(error))
    if signature is not None:
        return _check(segment, signature, public_key)
    if public_key is None or not segment.finished:
        return SignatureCheck(None)
    return _wrong(segment, FindingKind.NOT_SIGNED, "it is not signed")


def _check(segment: Segment, signature: Signature, public_key: bytes | None) -> SignatureCheck:
    # A desk that checks no signature shall not load the package for it.
    from flight_file.keys import is_genuine  # noqa: PLC0415

    if not is_genuine(signature):
        reason = "its signature was not made with the key that it names"
        return _wrong(segment, FindingKind.WRONG_SIGNATURE, reason)
    if public_key is not None and signature.public_key != public_key:
        return _wrong(segment, FindingKind.OTHER_KEY, "it was signed with another key than the one given")
    with opened(segment.path) as source:
        if digest_of(source) != signature.sha256:
            return _wrong(segment, FindingKind.WRONG_SIGNATURE, "its bytes are not those that were signed")
    return SignatureCheck(signature.public_key)


def _wrong(segment: Segment, kind: FindingKind, reason: str) -> SignatureCheck:
    return SignatureCheck(None, Finding(kind, segment.path, reason))
