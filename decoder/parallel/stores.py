"""Which store an address belongs to, and folders of this machine as a store."""

from __future__ import annotations

import glob
import os
import shutil
import uuid
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

from decoder.panel.errors import OutputError, StoreError
from decoder.parallel.store import Stamp, Store, is_url, leaf
from flight_file.thresholds import MAX_READ_BYTES
from flight_file.untrusted import read_regular

INSTALL = "pip install 'image-flight-recorder[cluster]'"


class LocalStore:
    """Files by their absolute paths; see `Store`."""

    def found(self, pattern: str) -> list[str]:
        """List the files that match a pattern, sorted; `**` matches folders at any depth.

        A broken link counts too, so that whoever linked an archive's flight is told that it is missing.
        """
        paths = glob.glob(pattern, recursive=True)  # noqa: PTH207 - any root
        return sorted(path for path in paths if Path(path).is_file() or not Path(path).exists())

    def has(self, address: str) -> bool:
        """Whether there is such a file."""
        return Path(address).is_file()

    def stamp(self, address: str) -> Stamp:
        """Return size and modification time."""
        try:
            known = Path(address).stat()
        except OSError as error:
            raise _unreadable(address, error) from error
        return Stamp(leaf(address), known.st_size, str(known.st_mtime_ns))

    def read(self, address: str) -> bytes | None:
        """Read a small file; None if there is no such file."""
        try:
            return read_regular(Path(address), limit_bytes=MAX_READ_BYTES)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise _unreadable(address, error) from error

    def fetch(self, addresses: Sequence[str], folder: Path) -> list[Path]:  # noqa: ARG002 - nothing to copy
        """Return the paths, as nothing needs copying."""
        return [Path(address) for address in addresses]

    def put(self, file: Path, address: str) -> None:
        """Copy one file to a path, whole or not at all."""
        final = Path(address)
        part = final.with_name(f".{final.name}.part-{uuid.uuid4().hex}")
        with _writing(final.parent):
            try:
                shutil.copyfile(file, part)
                _to_disk(part)
                part.replace(final)
            finally:
                part.unlink(missing_ok=True)

    @contextmanager
    def results(self, folder: str, earlier: Sequence[str]) -> Iterator[Path]:  # noqa: ARG002 - goes with the folder
        """Make a folder beside the final one, which replaces it at the end."""
        final = Path(folder)
        with _writing(final.parent):
            _sweep(final)
            part = final.with_name(f".{final.name}.part-{uuid.uuid4().hex}")
            try:
                part.mkdir()
                yield part
                for file in part.iterdir():
                    _to_disk(file)
                _replace(part, final)
            finally:
                shutil.rmtree(part, ignore_errors=True)

    def strangers(self, folder: str, earlier: Sequence[str]) -> list[str]:
        """List whatever else is among the results, since the folder is replaced as a whole."""
        path = Path(folder)
        if not path.is_dir():
            return [path.name] if path.exists() else []
        return sorted({each.name for each in path.iterdir()} - set(earlier))


def _sweep(final: Path) -> None:
    """Remove what a killed worker left of this flight."""
    for kind in ("part", "old"):
        for leftover in final.parent.glob(f".{glob.escape(final.name)}.{kind}-*"):
            shutil.rmtree(leftover, ignore_errors=True)


def _replace(part: Path, final: Path) -> None:
    old = final.with_name(f".{final.name}.old-{uuid.uuid4().hex}")
    if final.exists():
        final.rename(old)
    part.rename(final)
    shutil.rmtree(old, ignore_errors=True)


def _to_disk(file: Path) -> None:
    descriptor = os.open(file, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    """Make the folder; turn disk errors into a sentence."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written: {error.strerror}; choose another with -o") from error


def _unreadable(address: str, error: OSError) -> StoreError:
    if isinstance(error, FileNotFoundError):
        return StoreError(f"{address}: there is no such file; check the name")
    return StoreError(f"{address}: cannot be read: {error.strerror}; check the file and its permissions")


def store_of(address: str) -> Store:
    """Find the store that holds an address.

    Raises
    ------
    StoreError
        If there is no such kind, or what it needs is not installed.
    """
    if not is_url(address):
        return LocalStore()
    if find_spec("fsspec") is None:
        raise StoreError(f"{address}: needs fsspec: {INSTALL}")
    from decoder.parallel.url_store import UrlStore  # noqa: PLC0415 - fsspec is an extra

    return UrlStore.of(address)
