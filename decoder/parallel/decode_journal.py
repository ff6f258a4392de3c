"""The journal of a long decode, beside its outputs: with it, an interrupted decode continues where it was.

JSON writes each double with enough digits to restore it exactly; NaN is written as `NaN`, which Python reads.

It records every batch that is read. It belongs to one decode, identified by everything that its readings depend on;
begins only when there is something to lose; and is removed when the flight data are written.
"""

from __future__ import annotations

import errno
import json
import os
import zlib
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from hashlib import sha256
from itertools import chain
from pathlib import Path
from typing import IO, Any

from decoder.imaging.pictures import GreyPicture
from decoder.instruments.frame_batch import Batch, LeftOut, Outcome, ReadBatches
from decoder.instruments.panel_reader import PanelReader
from decoder.panel.errors import OutputError
from decoder.parallel.order import installed
from decoder.parallel.worker import pack, unpack
from decoder.timeseries.flight_part import FlightPart
from flight_file.reader import Flight

# About as many batches as are read in two seconds, so that short decodes leave no file behind.
BEGIN_AFTER = 32

Identity = Mapping[str, object]
"""All that readings depend on, by what it is called."""
Results = Iterator[tuple[Batch, list[Outcome]]]


def line_of(content: object) -> bytes:
    """Write content as a line with its own CRC-32."""
    body = json.dumps(content, separators=(",", ":"), default=float).encode()
    return b"%08x %s\n" % (zlib.crc32(body), body)


def content_of(line: bytes) -> Any:  # noqa: ANN401 - whatever was written
    """Read a line back; None if it is not intact."""
    crc, _, body = line.rstrip(b"\n").partition(b" ")
    if not line.endswith(b"\n") or crc != b"%08x" % zlib.crc32(body):
        return None
    return json.loads(body)


def plain_batch(batch: Batch, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Record a batch's frames by number and time, and their outcomes; none if one of them was left out."""
    is_read = not any(isinstance(outcome, LeftOut) for outcome in outcomes)
    return {
        "frames": [[frame.sequence, frame.captured_ns] for frame in batch],
        "read": [pack(outcome) for outcome in outcomes] if is_read else [],
    }


def outcomes_of(content: dict[str, Any], batch: Batch) -> list[Outcome] | None:
    """Undo `plain_batch`; the list is empty if the batch must be read again, and None if it has other frames."""
    if content["frames"] != [[frame.sequence, frame.captured_ns] for frame in batch]:
        return None
    return [unpack(each) for each in content["read"]]


def identity_of(flight: Flight, part: FlightPart | None, reader: PanelReader) -> dict[str, object]:
    """Identify a decode with this reader; reads the whole flight file.

    Raises
    ------
    FlightNotReadableError
        If a file cannot be read.
    """
    source, versions = reader.source, installed()
    return {
        "flight file": list(flight.sha256_of_files().values()),
        "panel": [source.sha256, _digest(source.pictures), [str(each) for each in source.mixtures]],
        "camera": sha256(repr(source.camera).encode()).hexdigest(),
        "method": reader.method.value,
        "part": None if part is None else [part.ranks.start, part.ranks.stop, part.ranks.step],
        "software": [versions.software, *versions.libraries],
    }


def _digest(pictures: Mapping[str, GreyPicture]) -> str:
    digest = sha256()
    for name, picture in sorted(pictures.items()):
        digest.update(f"{name} {picture.shape} ".encode())
        digest.update(picture.tobytes())
    return digest.hexdigest()


class DecodeJournal:
    """The journal at a path.

    Parameters
    ----------
    identity
        Of this decode, once its reader exists.
    resume
        Whether to continue what is at the path, if it is of the same decode.
    tell
        Gets a sentence if an existing journal is not used, or is replaced.
    begin_after
        Batches that are read before anything is written.

    Attributes
    ----------
    frames
        How many frames of this decode the file contains.
    """

    def __init__(
        self,
        path: Path,
        identity: Callable[[PanelReader], Identity],
        *,
        resume: bool,
        tell: Callable[[str], None],
        begin_after: int = BEGIN_AFTER,
    ) -> None:
        self.path = path
        self.frames = 0
        self._identity = identity
        self._resume = resume
        self._tell = tell
        self._begin_after = begin_after
        self._is_ours = False
        self._stream: IO[bytes] | None = None
        self._waiting: list[bytes] = []
        self._waiting_frames = 0

    def around(self, read: ReadBatches) -> ReadBatches:
        """Read batches as `read` does, except those that the journal contains, and record them.

        The iterator raises OutputError if the journal cannot be read or written.
        """

        def read_on(reader: PanelReader, cut: Iterable[Batch]) -> Results:
            coming, unknown = iter(cut), list[Batch]()
            self._is_ours = self._is_begun_by(reader)
            if self._is_ours and self._resume:
                yield from self._known(coming, unknown, lambda batch: read(reader, [batch]))
            for batch, outcomes in read(reader, chain(unknown, coming)):
                self._note(reader, batch, outcomes)
                yield batch, outcomes

        return read_on

    def remove(self) -> None:
        """Close the journal, and remove it if it is of this decode."""
        self.close()
        if self._is_ours:
            self.path.unlink(missing_ok=True)

    def close(self) -> None:
        """Close the file and leave it as it is."""
        if self._stream is not None:
            self._stream.close()
            self._stream = None

    def _is_begun_by(self, reader: PanelReader) -> bool:
        """Whether there is a journal of this decode to continue; if not, say why an existing one is not used."""
        lines = self._lines()
        first = next(lines, None)
        if first is None:
            if self._resume:
                self._tell(f"{self.path} is not there, so this decode starts at the beginning")
            return False
        found, ours = content_of(first), dict(self._identity(reader))
        if found == ours and not self._resume:
            frames = sum(len(content["frames"]) for content in map(content_of, lines) if content is not None)
            self._tell(
                f"{self.path}: an earlier decode was interrupted after {frames} frames; this one starts over, "
                "--resume would have continued from there"
            )
        if found != ours and self._resume:
            self._tell(f"{self.path} {_difference(found, ours)}, so this decode starts at the beginning")
        return bool(found == ours)

    def _lines(self) -> Generator[bytes]:
        """Read the file's lines: an empty one if it is empty, none if there is no file; raises OutputError."""
        try:
            if self.path.is_symlink():
                raise OSError(errno.ELOOP, "it is a link")  # noqa: TRY301 - reported like any other reason
            if not self.path.is_file():
                return
            with self.path.open("rb") as stream:
                yield stream.readline()
                yield from stream
        except OSError as error:
            raise OutputError(
                f"{self.path}: the journal cannot be read: {error.strerror}; remove it,"
                " or choose another folder with -o"
            ) from error

    def _known(self, coming: Iterator[Batch], unknown: list[Batch], read: Callable[[Batch], Results]) -> Results:
        """Yield the batches that were read before; the first that was not goes to `unknown`.

        Batches with frames that were left out are read again, since the journal records only their position.
        """
        lines = self._lines()
        whole_bytes = len(next(lines, b""))
        for line in lines:
            content = content_of(line)
            batch = None if content is None else next(coming, None)
            if batch is None:
                break
            outcomes = outcomes_of(content, batch)
            if outcomes is None:
                unknown.append(batch)
                break
            whole_bytes += len(line)
            self.frames += len(batch)
            yield from [(batch, outcomes)] if outcomes else read(batch)
        lines.close()
        with self._failing_as_output():
            os.truncate(self.path, whole_bytes)
            self._stream = self.path.open("ab")

    def _note(self, reader: PanelReader, batch: Batch, outcomes: list[Outcome]) -> None:
        self._waiting.append(line_of(plain_batch(batch, outcomes)))
        self._waiting_frames += len(batch)
        if self._stream is None and len(self._waiting) < self._begin_after:
            return
        with self._failing_as_output():
            stream = self._stream or self._begun(reader)
            stream.writelines(self._waiting)
            stream.flush()
        self.frames += self._waiting_frames
        self._waiting, self._waiting_frames = [], 0

    def _begun(self, reader: PanelReader) -> IO[bytes]:
        if self.path.exists() and not self._is_ours:
            self._tell(f"{self.path}: the journal of another decode is replaced")
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.path.unlink(missing_ok=True)
        self._stream = self.path.open("xb")  # does not follow a link
        self._stream.write(line_of(self._identity(reader)))
        self._is_ours = True
        return self._stream

    @contextmanager
    def _failing_as_output(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise OutputError(
                f"{self.path}: cannot be written: {error.strerror}; choose another folder with -o"
            ) from error


def _difference(found: object, ours: Identity) -> str:
    """Say how a journal's decode differs from ours."""
    if not isinstance(found, dict):
        return "is no journal of a decode"
    names = [name for name, value in ours.items() if found.get(name) != value]
    return f"is of another decode ({', '.join(names)})"
