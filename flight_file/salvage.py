"""Put a segment together again that a power cut or a bad disk left behind.

Chunk by chunk, with one of them in memory: from a chunk that fits its CRC, every frame is kept whose picture fits its
SHA-256, byte for byte and with the times it was written with. The result is a finished segment like any other; only its
`end` record says that it was recovered, and where something is missing.

| what there is                     | what becomes of it                                                      |
| --------------------------------- | ----------------------------------------------------------------------- |
| `NAME.mcap.part`, whole           | renamed to `NAME.mcap`: only that had been left to do                   |
| `NAME.mcap.part`, cut or damaged  | `NAME.mcap`; the `.part` is removed once the new file is synced, proved |
| `NAME.mcap.part`, somebody's work | left alone                                                              |
| `NAME.mcap`, cut or damaged       | `NAME.recovered.mcap`; the damaged file is kept                         |
| `NAME.mcap`, whole                | left alone                                                              |

Doing it again after it was cut off itself does no harm: the new file is made aside, as `NAME.mcap.recovering`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from itertools import count, zip_longest
from pathlib import Path

from flight_file.durable_file import DurableFile, rename_durably, sync_directory
from flight_file.errors import FlightFileError, FlightNotWrittenError, NothingToRecoverError
from flight_file.frame import ClockReading, Frame
from flight_file.locks import claimed
from flight_file.losses import Loss
from flight_file.repacking import Repacked, repack
from flight_file.scan import FileScan, scan_file
from flight_file.segment import Segment, digest_of, open_segment, opened, understood
from flight_file.signature import Signer, write_signature
from flight_file.walk import walk
from flight_file.writer import PART_SUFFIX

_ASIDE_SUFFIX = ".recovering"
_NOTHING = "nothing that was recorded is left in it; delete it"


class Outcome(Enum):
    """What was done with a file."""

    RECOVERED = "recovered"
    FINISHED = "finished"
    """It was whole and only had to be given its final name."""
    NOTHING_TO_DO = "nothing to do"
    IN_WORK = "in work"
    """Somebody writes it at this moment: left alone."""


@dataclass(frozen=True, slots=True)
class Recovery:
    """What became of one file.

    Attributes
    ----------
    source
        The file that was given.
    path
        Where its flight is now.
    frames
        Frames in it; not counted where nothing was done.
    losses
        What could not be recovered; that there was no end record is not among them.
    """

    source: Path
    path: Path
    outcome: Outcome
    frames: int = 0
    losses: tuple[Loss, ...] = ()


def recover_segment(path: Path, *, at: ClockReading, signer: Signer | None = None) -> Recovery:
    """Recover one file.

    Parameters
    ----------
    at
        The clocks now; stands in the `end` record.
    signer
        Signs what was recovered; None for no signature.

    Raises
    ------
    FlightNotReadableError, NotAFlightError
        The file cannot be read, or is no MCAP.
    NothingToRecoverError
        Nothing that was recorded is left in it.
    FlightNotWrittenError
        There is no room for the new file, or it may not be written. The file that was given is untouched.
    """
    if not path.name.endswith(PART_SUFFIX):
        return _Recovery(path, at, signer).of_finished_file()
    with claimed(path) as ours:
        if not ours:
            return Recovery(path, path, Outcome.IN_WORK)
        return _Recovery(path, at, signer).of_file_in_work()


class _Recovery:
    """One recovery: what was found in the file, and who signs."""

    def __init__(self, path: Path, at: ClockReading, signer: Signer | None) -> None:
        self._path = path
        self._at = at
        self._signer = signer
        with opened(path) as source:
            self._scan: FileScan = scan_file(path, source)
        self._segment: Segment = understood(self._scan)[0]

    def of_file_in_work(self) -> Recovery:
        """Give it its final name, whole or put together again."""
        target = self._path.with_name(self._path.name.removesuffix(PART_SUFFIX))
        if not target.exists() and _is_whole(self._segment):
            if self._signer is not None:
                with opened(self._path) as source:
                    write_signature(target, digest_of(source), self._signer)
            rename_durably(self._path, target)
            return Recovery(self._path, target, Outcome.FINISHED, _count_frames(target))
        recovery = self._put_together(target)
        _remove(self._path)
        return recovery

    def of_finished_file(self) -> Recovery:
        """Put what is whole of it into a file of its own."""
        if _is_whole(self._segment):
            return Recovery(self._path, self._path, Outcome.NOTHING_TO_DO)
        return self._put_together(_recovered_name(self._path, 1))

    def _put_together(self, wanted: Path) -> Recovery:
        aside = wanted.with_name(wanted.name + _ASIDE_SUFFIX)
        try:
            repacked = self._repack_into(aside)
            # A name that holds these frames already is left from a recovery that was itself cut off.
            names = (name for name in _names(wanted) if name != self._path)
            target = next(name for name in names if not name.exists() or _same_frames(name, aside))
            if not target.exists():
                if self._signer is not None:
                    write_signature(target, repacked.sha256, self._signer)
                rename_durably(aside, target)
        finally:
            with suppress(OSError):
                aside.unlink(missing_ok=True)
        return Recovery(self._path, target, Outcome.RECOVERED, repacked.frames, repacked.losses)

    def _repack_into(self, aside: Path) -> Repacked:
        if not self._segment.chunks:
            raise NothingToRecoverError(self._path, reason=_NOTHING)
        _remove(aside)
        file = DurableFile(aside, digested=True)
        try:
            with opened(self._path) as source:
                repacked = repack(self._scan, source, file, at=self._at)
            file.sync()
        finally:
            file.close()
        if not repacked.chunks:
            raise NothingToRecoverError(self._path, reason=_NOTHING)
        _inherit_owner(aside, self._path)
        if _count_frames(aside) != repacked.frames:
            raise FlightNotWrittenError(aside, reason="does not read back as it was written; check the disk")
        return repacked


def _is_whole(segment: Segment) -> bool:
    return segment.finished and not segment.losses and not any(isinstance(found, Loss) for found in walk(segment))


def _names(wanted: Path) -> Iterator[Path]:
    yield wanted
    yield from (_recovered_name(wanted, number) for number in count(1))


def _recovered_name(path: Path, number: int) -> Path:
    if ".recovered" in path.suffixes:
        path = path.with_name(path.name[: path.name.index(".recovered")] + ".mcap")
    ending = ".recovered.mcap" if number == 1 else f".recovered-{number}.mcap"
    return path.with_name(path.name.removesuffix(".mcap") + ending)


def _frames(path: Path) -> Iterator[Frame]:
    segment, _ = open_segment(path)
    for found in walk(segment):
        if not isinstance(found, Loss):
            yield found[1]


def _count_frames(path: Path) -> int:
    return sum(1 for _ in _frames(path))


def _same_frames(one: Path, two: Path) -> bool:
    try:
        return all(left == right for left, right in zip_longest(_frames(one), _frames(two)))
    except FlightFileError:
        return False


def _inherit_owner(path: Path, from_path: Path) -> None:
    # An operator may recover as root what the recorder shall manage afterwards.
    with suppress(PermissionError):
        owner = from_path.stat()
        os.chown(path, owner.st_uid, owner.st_gid)


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        reason = f"cannot be removed ({error.strerror}); check who may write in its directory"
        raise FlightNotWrittenError(path, reason=reason) from error
    sync_directory(path.parent)
