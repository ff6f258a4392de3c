"""The signature of a finished segment: `NAME.mcap.sig` beside `NAME.mcap`.

A text of four lines. The first three are what is signed, each with its line feed; the keys and the signature are
Ed25519 (RFC 8032), in base64:

    flight signature 1
    sha256 9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08
    public-key 11qYAYKxCrfVS/7TyWQHOg7hcvPapiMlrwIaaPcHURo=
    signature ...

It covers every byte of the file, the index at its end included, and can be checked without knowing what MCAP is.
Nothing here needs the package `cryptography`: what signs, and what checks, is passed in (see `keys`).
"""

from __future__ import annotations

import base64
import binascii
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from flight_file.durable_file import replace_durably
from flight_file.errors import FlightNotReadableError

SIGNATURE_SUFFIX = ".sig"

_MAX_BYTES = 4096
_TEXT = re.compile(
    rb"(?P<message>flight signature 1\nsha256 (?P<sha256>[0-9a-f]{64})\npublic-key (?P<key>[A-Za-z0-9+/]{43}=)\n)"
    rb"signature (?P<signature>[A-Za-z0-9+/]{86}==)\n"
)


class Signer(Protocol):
    """A private key."""

    @property
    def public_key(self) -> bytes:
        """The public half, 32 bytes."""
        ...

    def sign(self, message: bytes) -> bytes:
        """Signature of the message, 64 bytes."""
        ...


@dataclass(frozen=True, slots=True)
class Signature:
    """What stands in a signature's file.

    Attributes
    ----------
    sha256
        Of the segment's file, hexadecimal.
    public_key
        Of who signed, 32 bytes.
    message, signature
        What was signed, and the 64 bytes that prove it.
    """

    sha256: str
    public_key: bytes
    message: bytes
    signature: bytes


class MalformedSignatureError(ValueError):
    """A signature's file that does not say what it should."""


def signature_path(segment: Path) -> Path:
    """Where the signature of a finished segment lies."""
    return segment.with_name(segment.name + SIGNATURE_SUFFIX)


def write_signature(segment: Path, sha256: str, signer: Signer) -> None:
    """Sign a file by its digest.

    Parameters
    ----------
    segment
        The segment's final path.
    sha256
        Of all its bytes, hexadecimal.

    Raises
    ------
    FlightNotWrittenError
        If the disk fails.
    """
    key = base64.b64encode(signer.public_key)
    message = b"flight signature 1\nsha256 %s\npublic-key %s\n" % (sha256.encode("ascii"), key)
    signature = base64.b64encode(signer.sign(message))
    replace_durably(signature_path(segment), message + b"signature %s\n" % signature)


def read_signature(segment: Path) -> Signature | None:
    """The signature of a segment; None if there is none.

    Raises
    ------
    MalformedSignatureError
        If its file is something else.
    FlightNotReadableError
        If it cannot be read.
    """
    path = signature_path(segment)
    try:
        with path.open("rb") as file:
            text = file.read(_MAX_BYTES)
    except FileNotFoundError:
        return None
    except OSError as error:
        reason = f"cannot be read ({error.strerror}); check the file and its permissions"
        raise FlightNotReadableError(path, reason=reason) from error
    match = _TEXT.fullmatch(text)
    if match is None:
        raise MalformedSignatureError(f"{path.name} is no signature")
    try:
        key, signature = (base64.b64decode(match[name], validate=True) for name in ("key", "signature"))
    except binascii.Error as error:
        raise MalformedSignatureError(f"{path.name} is no signature") from error
    return Signature(match["sha256"].decode("ascii"), key, match["message"], signature)
