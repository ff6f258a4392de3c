"""What a store must be able to do: give flights, and take results so that they are there whole or not at all."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

MARKER = "fleet.done"  # in every flight's results, the last to come; no output can have this name


@dataclass(frozen=True, slots=True)
class Stamp:
    """What tells cheaply whether a file was changed.

    Attributes
    ----------
    changed
        The store's own mark of its content, a time or an ETag; empty where it has none.
    """

    name: str
    size_bytes: int
    changed: str

    def proves(self, other: Stamp) -> bool:
        """Whether both are certainly of the same content."""
        return self == other and bool(self.changed)


class Store(Protocol):
    """A place that holds files, by their addresses; every method raises StoreError, a sentence with the address."""

    def found(self, pattern: str) -> list[str]:
        """The files that fit a pattern, sorted."""
        ...

    def has(self, address: str) -> bool:
        """Whether there is such a file."""
        ...

    def stamp(self, address: str) -> Stamp:
        """Of one file."""
        ...

    def read(self, address: str) -> bytes | None:
        """A small file's content; None if there is no such file."""
        ...

    def fetch(self, addresses: Sequence[str], folder: Path) -> list[Path]:
        """Files as paths of this machine; what has to be copied for that goes into `folder`."""
        ...

    def put(self, file: Path, address: str) -> None:
        """Copies one file to an address, whole or not at all; what was there is replaced."""
        ...

    def results(self, folder: str, earlier: Sequence[str]) -> AbstractContextManager[Path]:
        """A working folder whose files are put at `folder` at its end; nothing is if an error ends it.

        `earlier` names the files that an earlier run left there; they are replaced. The file `MARKER` comes last.
        """
        ...

    def strangers(self, folder: str, earlier: Sequence[str]) -> list[str]:
        """Names in a results' folder that no earlier run left there, and that results would replace."""
        ...
