"""Addresses: where a file is, as text. An absolute path on this machine, or a URL such as `s3://bucket/flight.mcap`."""

from __future__ import annotations

import os
import re

_MAGIC = re.compile(r"[*?\[]")
_FILE = "file://"


def is_url(address: str) -> bool:
    """Whether it names something that is not simply a file of this machine."""
    return "://" in address


def normal(word: str, folder: str | None = None) -> str:
    """What somebody wrote as an address; a relative path is taken from `folder`, or else from the working folder."""
    if word.startswith(_FILE):
        word = word.removeprefix(_FILE)
    if is_url(word):
        return word.rstrip("/")
    if folder is not None and is_url(folder) and not word.startswith("/"):
        return join(folder, word)
    return os.path.abspath(f"{folder}/{word}" if folder and not word.startswith("/") else word)  # noqa: PTH100 - keeps links


def join(folder: str, *parts: str) -> str:
    """An address below a folder's."""
    return "/".join([folder.rstrip("/"), *parts])


def parent(address: str) -> str:
    """The folder that something is in."""
    return address.rpartition("/")[0]


def leaf(address: str) -> str:
    """The name without its folder."""
    return address.rpartition("/")[2]


def is_pattern(address: str) -> bool:
    """Whether it stands for all that fit it: `*`, `?` or `[...]`."""
    return _MAGIC.search(address) is not None


def fixed_part(pattern: str) -> str:
    """The folder above everything that a pattern can name."""
    fixed = []
    for part in pattern.split("/"):
        if is_pattern(part):
            break
        fixed.append(part)
    return "/".join(fixed)
