"""Ed25519 keys in files: PEM, as openssl reads and writes them.

The only module that loads the package `cryptography`. Import it where a key is used, not before: a box that does not
sign shall not pay for it.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

from flight_file.durable_file import sync_directory
from flight_file.errors import KeyFileError
from flight_file.signature import Signature

PUBLIC_SUFFIX = ".pub"

_PRIVATE_MODE = 0o600
_PUBLIC_MODE = 0o644


@dataclass(frozen=True, slots=True)
class KeySigner:
    """A private key that signs; a `Signer`."""

    key: Ed25519PrivateKey

    @property
    def public_key(self) -> bytes:
        """The public half, 32 bytes."""
        return self.key.public_key().public_bytes_raw()

    def sign(self, message: bytes) -> bytes:
        """Signature of the message, 64 bytes."""
        return self.key.sign(message)


def make_key_files(path: Path) -> Path:
    """Make a new private key in this file, and its public half beside it; gives the path of the public one.

    Raises
    ------
    KeyFileError
        If either file exists already, or cannot be written.
    """
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


def load_signer(path: Path) -> KeySigner:
    """The private key in a file.

    Raises
    ------
    KeyFileError
        If it cannot be read, or is no Ed25519 private key without a password.
    """
    try:
        key = serialization.load_pem_private_key(_content(path), password=None)
    except (ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise KeyFileError(path, reason="is no private key; make one with `recorder keygen`") from error
    if not isinstance(key, Ed25519PrivateKey):
        raise KeyFileError(path, reason="is a private key, but not Ed25519; make one with `recorder keygen`")
    return KeySigner(key)


def load_public_key(path: Path) -> bytes:
    """The public key in a file, 32 bytes.

    Raises
    ------
    KeyFileError
        If it cannot be read, or is no Ed25519 public key.
    """
    try:
        key = serialization.load_pem_public_key(_content(path))
    except (ValueError, UnsupportedAlgorithm) as error:
        raise KeyFileError(path, reason="is no public key; give the file that ends in .pub") from error
    if not isinstance(key, Ed25519PublicKey):
        raise KeyFileError(path, reason="is a public key, but not Ed25519; give the one that `recorder keygen` made")
    return key.public_bytes_raw()


def is_genuine(signature: Signature) -> bool:
    """Whether the signature was made with the key that it names."""
    try:
        Ed25519PublicKey.from_public_bytes(signature.public_key).verify(signature.signature, signature.message)
    except InvalidSignature:
        return False
    return True


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise KeyFileError(path, reason=f"cannot be read ({error.strerror}); check its name and permissions") from error


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
