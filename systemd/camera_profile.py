"""Print the profile of the camera's Wi-Fi: `camera_profile.py SSID INTERFACE`, with the password on standard input.

Values are written as NetworkManager reads them: as text with the escapes of GLib's key files, or, where a name of a
Wi-Fi as text would be read as another one, as its bytes in decimal.
"""

from __future__ import annotations

import getpass
import os
import re
import sys
from pathlib import Path

TEMPLATE = Path(__file__).with_name("camera.nmconnection")

MAX_SSID_BYTES = 32
PASSPHRASE_BYTES = range(8, 64)

_ESCAPES = {"\\": "\\\\", "\n": "\\n", "\r": "\\r", "\t": "\\t"}
_HEX_KEY = re.compile(rb"[0-9A-Fa-f]{64}")
_INTERFACE = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,14}", re.ASCII)  # the kernel has room for 15
_LIST = re.compile(r"[\d\s;]*;\s*", re.ASCII)  # what NetworkManager may take for bytes in decimal


def profile(ssid: bytes, interface: str, password: bytes) -> str:
    """The profile; raises ValueError, in one sentence, if there can be no such Wi-Fi or interface."""
    if not 0 < len(ssid) <= MAX_SSID_BYTES:
        raise ValueError(f"the name of a Wi-Fi has 1 to {MAX_SSID_BYTES} bytes, not {len(ssid)}; see the sticker.")
    if not _INTERFACE.fullmatch(interface):
        raise ValueError(f"{interface!r} cannot be the name of a network interface; `ip link` lists them.")
    values = {"@SSID@": _ssid(ssid), "@INTERFACE@": interface, "@PASSWORD@": _password(password)}
    return re.sub("|".join(values), lambda name: values[name[0]], TEMPLATE.read_text(encoding="utf-8"))


def _ssid(ssid: bytes) -> str:
    try:
        text = ssid.decode("utf-8")
    except UnicodeDecodeError:
        text = ""
    # NetworkManager takes `\;` for a semicolon, after GLib has taken its own escapes out.
    plain = "\\;" not in text and not _LIST.fullmatch(text)
    if plain and all(letter.isprintable() or letter in _ESCAPES for letter in text) and text:
        return _escaped(text)
    return "".join(f"{byte};" for byte in ssid)


def _password(password: bytes) -> str:
    try:
        text = password.decode("utf-8")
    except UnicodeDecodeError:
        text = "\0"
    fits = len(password) in PASSPHRASE_BYTES and not re.search(r"[\0-\x1f\x7f]", text)
    if not fits and not _HEX_KEY.fullmatch(password):
        raise ValueError("a Wi-Fi's password has 8 to 63 characters, without control characters, or 64 hex digits.")
    return _escaped(text)


def _escaped(text: str) -> str:
    inner = text.strip(" ")
    before, _, after = text.partition(inner) if inner else (text, "", "")
    return "\\s" * len(before) + "".join(_ESCAPES.get(letter, letter) for letter in inner) + "\\s" * len(after)


def _ask() -> bytes:
    if sys.stdin.isatty():
        return os.fsencode(getpass.getpass("Password of the Wi-Fi (inside the camera's battery cover): "))
    return sys.stdin.buffer.read().removesuffix(b"\n")


def main() -> None:
    """Print it, or end with the sentence that says what is wrong."""
    _, ssid, interface = sys.argv
    try:
        text = profile(os.fsencode(ssid), interface, _ask())
    except ValueError as error:
        sys.exit(f"install.sh: {error}")
    sys.stdout.buffer.write(text.encode("utf-8"))


if __name__ == "__main__":
    main()
