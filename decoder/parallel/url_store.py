"""URLs as a store, through fsspec: `s3://bucket/...` and whatever else it knows; needs the extra `cluster`.

Object stores cannot rename, but each object is written atomically. So a flight's results are its files and then the
marker: without the marker, they do not count.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fsspec

from decoder.panel.errors import OutputError, StoreError
from decoder.parallel.store import MARKER, Stamp, join, leaf, working_folder

_CHANGED = ("ETag", "etag", "mtime", "LastModified", "last_modified", "updated", "created")
_FOREIGN_ERRORS = (("botocore.exceptions", "BotoCoreError"), ("aiohttp", "ClientError"))


@dataclass(frozen=True, slots=True)
class UrlStore:
    """Files by their URLs; see `Store`."""

    system: Any

    @staticmethod
    def of(address: str) -> UrlStore:
        """Return the store of a URL.

        Raises
        ------
        StoreError
            If fsspec does not know its kind, or lacks the package for it.
        """
        try:
            return UrlStore(fsspec.core.url_to_fs(address)[0])
        except (ValueError, ImportError) as error:
            raise StoreError(f"{address}: {_first_line(error)}") from error

    def found(self, pattern: str) -> list[str]:
        """List the files that match a pattern, sorted; `**` matches folders at any depth."""
        with _reading(pattern):
            self.system.invalidate_cache()
            return sorted(self.system.unstrip_protocol(name) for name in self.system.glob(pattern))

    def has(self, address: str) -> bool:
        """Whether there is such a file."""
        with _reading(address):
            self.system.invalidate_cache()
            return bool(self.system.isfile(address))

    def stamp(self, address: str) -> Stamp:
        """Return the size, and the first of ETag and times that this store provides."""
        with _reading(address):
            self.system.invalidate_cache()
            known = self.system.info(address)
        changed = next((str(known[key]) for key in _CHANGED if known.get(key)), "")
        return Stamp(leaf(address), int(known["size"] or 0), changed)

    def read(self, address: str) -> bytes | None:
        """Read a small file; None if there is no such file."""
        with _reading(address):
            self.system.invalidate_cache()
            try:
                return bytes(self.system.cat_file(address))
            except FileNotFoundError:
                return None

    def fetch(self, addresses: Sequence[str], folder: Path) -> list[Path]:
        """Copy them into `folder`, if there is room."""
        wanted = sum(self.stamp(address).size_bytes for address in addresses)
        free = shutil.disk_usage(folder).free
        if wanted > free:
            raise StoreError(
                f"{addresses[0]}: {wanted >> 20} MiB do not fit into {folder.parent} with {free >> 20} MiB free; "
                "set TMPDIR to a larger folder"
            )
        paths = []
        for address in addresses:
            paths.append(folder / leaf(address))
            with _reading(address):
                self.system.get_file(address, str(paths[-1]))
        return paths

    def put(self, file: Path, address: str) -> None:
        """Copy one file to a URL; an object store shows it once it is complete."""
        with _writing(address):
            self.system.put_file(str(file), address)

    @contextmanager
    def results(self, folder: str, earlier: Sequence[str]) -> Iterator[Path]:
        """Make a temporary folder whose files go to the store at the end, the marker last."""
        with working_folder() as working:
            yield working
            files = sorted(working.iterdir(), key=lambda file: (file.name == MARKER, file.name))
            with _writing(folder):
                for old in sorted(earlier, key=lambda each: (each != MARKER, each)):
                    self.system.rm_file(join(folder, old))
                self.system.makedirs(folder, exist_ok=True)
            for file in files:
                self.put(file, join(folder, file.name))

    def strangers(self, folder: str, earlier: Sequence[str]) -> list[str]:  # noqa: ARG002 - nothing else is replaced
        """Return none, as only what an earlier run left is ever removed."""
        return []


@contextmanager
def _reading(address: str) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError as error:
        raise StoreError(f"{address}: there is no such file; check the address") from error
    except _errors() as error:
        raise StoreError(
            f"{address}: cannot be read: {_first_line(error)}; check the address and your rights there"
        ) from error


@contextmanager
def _writing(address: str) -> Iterator[None]:
    try:
        yield
    except _errors() as error:
        raise OutputError(
            f"{address}: cannot be written: {_first_line(error)}; check -o and your rights there"
        ) from error


def _errors() -> tuple[type[Exception], ...]:
    """List what stores' packages raise besides OSError, for those that are loaded."""
    modules = ((sys.modules.get(module), name) for module, name in _FOREIGN_ERRORS)
    return (OSError, *(getattr(module, name) for module, name in modules if module is not None))


def _first_line(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return lines[0].rstrip(".") if lines else type(error).__name__
