"""A box's signatures: of a finished segment in `NAME.mcap.sig`, of one in work in the checkpoints inside.

Both are a short text and its Ed25519 signature (RFC 8032); keys and signatures are written in base64, in its only
canonical form. Each line of a text ends with a line feed.

The file `NAME.mcap.sig` has four lines, of which the first three are signed:

    flight signature 1
    sha256 9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08
    public-key 11qYAYKxCrfVS/7TyWQHOg7hcvPapiMlrwIaaPcHURo=
    signature ...

It covers every byte of the file, including the index at its end, and can be checked without knowledge of MCAP.

A checkpoint is an MCAP metadata record `checkpoint` after each chunk. Its item `text` is what is signed, its item
`signature` the signature; `bytes` is where the record begins, `sha256` covers everything before it:

    flight checkpoint 1
    bytes 73612
    sha256 60303ae22b998861bce3b28f33eec1be758a213c86c93c076dbe9f558c11c752
    public-key 11qYAYKxCrfVS/7TyWQHOg7hcvPapiMlrwIaaPcHURo=

So a truncated segment is proven up to its last checkpoint. `verification` explains what a signature proves.

Keys are Ed25519 in PEM files, as openssl reads and writes them. Only the functions that use a key load the package
`cryptography`: a box that does not sign does not pay for it.
"""

from __future__ import annotations

import base64
import binascii
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from flight_file.errors import FlightNotReadableError
from flight_file.files import replace_durably
from flight_file.session import sealed
from flight_file.thresholds import MAX_SMALL_BYTES
from flight_file.untrusted import open_regular

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from flight_file.errors import KeyFileError
from flight_file.files import sync_directory

SIGNATURE_SUFFIX = ".sig"
_FILE = re.compile(rb"(?P<text>.*\n)signature (?P<signature>[^\n]*)\n", re.DOTALL)
_SIGNATURE = re.compile(rb"flight signature 1\nsha256 (?P<sha256>[0-9a-f]{64})\npublic-key (?P<key>[^\n]*)\n")
_CHECKPOINT = re.compile(
    rb"flight checkpoint 1\nbytes (?P<bytes>[1-9][0-9]{0,18})\nsha256 (?P<sha256>[0-9a-f]{64})\n"
    rb"public-key (?P<key>[^\n]*)\n"
)
_KEY_BYTES, _SIGNATURE_BYTES = 32, 64
PUBLIC_SUFFIX = ".pub"
_PRIVATE_MODE = 0o600
_PUBLIC_MODE = 0o644
_OTHERS = 0o077  # any right of the group or of others; with an ACL, the group's bits are its mask


@dataclass(frozen=True, slots=True)
class Signature:
    """A text that was signed.

    Attributes
    ----------
    sha256
        Of the covered bytes, hexadecimal.
    covered_bytes
        Number of covered bytes, from the start of the file; None for all.
    public_key
        Of the signer, 32 bytes.
    message, signature
        What was signed, and the 64 bytes that prove it.
    """

    sha256: str
    covered_bytes: int | None
    public_key: bytes
    message: bytes
    signature: bytes


class MalformedSignatureError(ValueError):
    """A signature's file or a checkpoint is malformed."""


def signature_path(segment: Path) -> Path:
    """Return the path of a finished segment's signature."""
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
    text = b"flight signature 1\n" + _about(sha256, signer)
    replace_durably(signature_path(segment), text + b"signature %s\n" % base64.b64encode(signer.sign(text)))


def checkpoint(covered_bytes: int, sha256: str, signer: Signer) -> dict[str, str]:
    """Make the metadata record that proves the bytes before it, given their count and SHA-256 (hexadecimal)."""
    text = b"flight checkpoint 1\nbytes %d\n" % covered_bytes + _about(sha256, signer)
    return sealed({"text": text.decode("ascii"), "signature": base64.b64encode(signer.sign(text)).decode("ascii")})


def _about(sha256: str, signer: Signer) -> bytes:
    return b"sha256 %s\npublic-key %s\n" % (sha256.encode("ascii"), base64.b64encode(signer.public_key))


def read_signature(segment: Path) -> Signature | None:
    """Read the signature of a segment; None if there is none.

    Raises
    ------
    MalformedSignatureError
        If its file is something else.
    FlightNotReadableError
        If it cannot be read.
    """
    path = signature_path(segment)
    try:
        with os.fdopen(open_regular(path), "rb") as file:
            text = file.read(MAX_SMALL_BYTES)
    except FileNotFoundError:
        return None
    except OSError as error:
        reason = f"cannot be read ({error.strerror}); check the file and its permissions"
        raise FlightNotReadableError(path, reason=reason) from error
    match = _FILE.fullmatch(text)
    try:
        if match is not None:
            return _parsed(_SIGNATURE, match["text"], match["signature"])
    except MalformedSignatureError:
        pass
    raise MalformedSignatureError(f"{path.name} is no signature")


def read_checkpoint(record: Mapping[str, str]) -> Signature:
    """Parse a metadata record `checkpoint`; raises MalformedSignatureError."""
    return _parsed(_CHECKPOINT, record.get("text", "").encode(), record.get("signature", "").encode())


def _parsed(kind: re.Pattern[bytes], text: bytes, signature: bytes) -> Signature:
    match = kind.fullmatch(text)
    if match is None:
        raise MalformedSignatureError(text)
    facts = match.groupdict()
    return Signature(
        sha256=facts["sha256"].decode("ascii"),
        covered_bytes=int(facts["bytes"]) if "bytes" in facts else None,
        public_key=_from_base64(facts["key"], _KEY_BYTES),
        message=text,
        signature=_from_base64(signature, _SIGNATURE_BYTES),
    )


def _from_base64(text: bytes, length: int) -> bytes:
    try:
        content = base64.b64decode(text, validate=True)
    except binascii.Error as error:
        raise MalformedSignatureError(text) from error
    # Base64 has unused bits in its last letter: without this, several texts would be the same signature.
    if len(content) != length or base64.b64encode(content) != text:
        raise MalformedSignatureError(text)
    return content


@dataclass(frozen=True, slots=True)
class Signer:
    """A private key that signs."""

    key: Ed25519PrivateKey

    @property
    def public_key(self) -> bytes:
        """The public half, 32 bytes."""
        return self.key.public_key().public_bytes_raw()

    def sign(self, message: bytes) -> bytes:
        """Signature of the message, 64 bytes."""
        return self.key.sign(message)


def make_key_files(path: Path) -> Path:
    """Make a new private key in this file and its public half beside it; return the public one's path.

    Raises
    ------
    KeyFileError
        If either file exists already, or cannot be written.
    """
    from cryptography.hazmat.primitives import serialization
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    key = Ed25519PrivateKey.generate()
    public = path.with_name(path.name + PUBLIC_SUFFIX)
    for target in (path, public):
        if target.exists():
            raise KeyFileError(target, reason="exists already; give the key another name, a key is never replaced")
    private_pem = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    public_pem = key.public_key().public_bytes(
        serialization.Encoding.PEM, serialization.PublicFormat.SubjectPublicKeyInfo
    )
    _write_new(path, private_pem, _PRIVATE_MODE)
    _write_new(public, public_pem, _PUBLIC_MODE)
    sync_directory(path.parent)
    return public


def load_signer(path: Path) -> Signer:
    """Load the private key from a file that only its owner may read.

    Raises
    ------
    KeyFileError
        If it cannot be read, others may read it too, or it is no Ed25519 private key without a password.
    """
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives import serialization
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    try:
        key = serialization.load_pem_private_key(_content(path, private=True), password=None)
    except (ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise KeyFileError(path, reason="is no private key; make one with `recorder keygen`") from error
    if not isinstance(key, Ed25519PrivateKey):
        raise KeyFileError(path, reason="is a private key, but not Ed25519; make one with `recorder keygen`")
    return Signer(key)


def load_public_key(path: Path) -> bytes:
    """Load the public key from a file, 32 bytes.

    Raises
    ------
    KeyFileError
        If it cannot be read, or is no Ed25519 public key.
    """
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives import serialization
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    try:
        key = serialization.load_pem_public_key(_content(path))
    except (ValueError, UnsupportedAlgorithm) as error:
        raise KeyFileError(path, reason="is no public key; give the file that ends in .pub") from error
    if not isinstance(key, Ed25519PublicKey):
        raise KeyFileError(path, reason="is a public key, but not Ed25519; give the one that `recorder keygen` made")
    return key.public_bytes_raw()


def is_genuine(signature: Signature) -> bool:
    """Whether the signature was made with the key that it names."""
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    try:
        Ed25519PublicKey.from_public_bytes(signature.public_key).verify(signature.signature, signature.message)
    except InvalidSignature:
        return False
    return True


def _content(path: Path, *, private: bool = False) -> bytes:
    try:
        descriptor = open_regular(path)
        with os.fdopen(descriptor, "rb") as file:
            if private and os.fstat(descriptor).st_mode & _OTHERS:
                reason = "may be used by others than its owner; take their rights away (chmod 600)"
                raise KeyFileError(path, reason=reason)
            return file.read(MAX_SMALL_BYTES)
    except OSError as error:
        reason = f"cannot be read ({error.strerror}); check its name and permissions, and that its disk is there"
        raise KeyFileError(path, reason=reason) from error


def _write_new(path: Path, content: bytes, mode: int) -> None:
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode)
        with os.fdopen(descriptor, "wb") as file:
            os.fchmod(descriptor, mode)
            file.write(content)
            file.flush()
            os.fsync(descriptor)
    except OSError as error:
        reason = f"cannot be written ({error.strerror}); check the directory and its permissions"
        raise KeyFileError(path, reason=reason) from error
