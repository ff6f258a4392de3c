"""What a store must be able to do: provide flights by their address, and store results atomically.

Temporary folders are removed at their end; those of a killed worker by whatever killed it, or by the machine's next
worker.
"""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from socket import gethostname
from typing import Protocol

_MAGIC = re.compile(r"[*?\[]")
_FILE = "file://"

_PREFIX = "fleet"

MARKER = "fleet.done"  # written last into every flight's results; no output can have this name


def is_url(address: str) -> bool:
    """Whether it is something other than a file of this machine."""
    return "://" in address


def normal(word: str, folder: str | None = None) -> str:
    """Normalize an address; a relative path is relative to `folder`, or to the working folder."""
    if word.startswith(_FILE):
        word = word.removeprefix(_FILE)
    if is_url(word):
        return word.rstrip("/")
    if folder is not None and is_url(folder) and not word.startswith("/"):
        return join(folder, word)
    return os.path.abspath(f"{folder}/{word}" if folder and not word.startswith("/") else word)  # noqa: PTH100 - keeps links


def join(folder: str, *parts: str) -> str:
    """Join a folder's address and names below it."""
    return "/".join([folder.rstrip("/"), *parts])


def parent(address: str) -> str:
    """Return an address without its last name."""
    return address.rpartition("/")[0]


def leaf(address: str) -> str:
    """Return the last name of an address."""
    return address.rpartition("/")[2]


def is_pattern(address: str) -> bool:
    """Whether it contains wildcards: `*`, `?` or `[...]`."""
    return _MAGIC.search(address) is not None


def fixed_part(pattern: str) -> str:
    """Return the folder above everything that a pattern can match."""
    fixed = []
    for part in pattern.split("/"):
        if is_pattern(part):
            break
        fixed.append(part)
    return "/".join(fixed)


@contextmanager
def working_folder() -> Iterator[Path]:
    """Make a folder in the temporary folder (TMPDIR), and remove it at the end."""
    remove_abandoned()
    with tempfile.TemporaryDirectory(
        prefix=f"{_PREFIX}-{gethostname()}-{os.getpid()}-", ignore_cleanup_errors=True
    ) as name:
        yield Path(name)


def remove_abandoned() -> None:
    """Remove the folders of processes that no longer exist, except those of other machines."""
    prefix = f"{_PREFIX}-{gethostname()}-"
    for folder in Path(tempfile.gettempdir()).glob(f"{prefix}*"):
        process = folder.name.removeprefix(prefix).partition("-")[0]
        if process.isdecimal() and not _lives(int(process)):
            shutil.rmtree(folder, ignore_errors=True)


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True  # somebody else's
    return True


@dataclass(frozen=True, slots=True)
class Stamp:
    """A cheap indication of whether a file has changed.

    Attributes
    ----------
    changed
        The store's own mark of its content, a time or an ETag; empty if it has none.
    """

    name: str
    size_bytes: int
    changed: str

    def proves(self, other: Stamp) -> bool:
        """Whether both certainly have the same content."""
        return self == other and bool(self.changed)


class Store(Protocol):
    """A place that holds files, by their addresses; every method raises StoreError, a sentence with the address."""

    def found(self, pattern: str) -> list[str]:
        """List the files that match a pattern, sorted."""
        ...

    def has(self, address: str) -> bool:
        """Whether there is such a file."""
        ...

    def stamp(self, address: str) -> Stamp:
        """Return that of one file."""
        ...

    def read(self, address: str) -> bytes | None:
        """Read a small file; None if there is no such file."""
        ...

    def fetch(self, addresses: Sequence[str], folder: Path) -> list[Path]:
        """Return files as paths on this machine; what has to be copied for that goes into `folder`."""
        ...

    def put(self, file: Path, address: str) -> None:
        """Copy one file to an address, whole or not at all, replacing what was there."""
        ...

    def results(self, folder: str, earlier: Sequence[str]) -> AbstractContextManager[Path]:
        """Make a working folder whose files are put at `folder` at its end; if an error ends it, none is.

        `earlier` names the files that an earlier run left there, which are replaced. The file `MARKER` comes last.
        """
        ...

    def strangers(self, folder: str, earlier: Sequence[str]) -> list[str]:
        """List names in a results' folder that no earlier run left there, and that results would replace."""
        ...
