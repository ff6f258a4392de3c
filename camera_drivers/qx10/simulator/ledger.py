"""A record of what the simulated camera has done, to compare a recording with."""

from __future__ import annotations

import hashlib
import json
import threading
from dataclasses import asdict, dataclass
from typing import TextIO


@dataclass(frozen=True, slots=True)
class Delivery:
    """One download of a picture.

    Attributes
    ----------
    name
        Of the picture.
    sha256
        Of the bytes to be sent.
    complete
        Whether all of them were sent; it is set just before the last byte goes.
    intact
        Whether they were a picture without fault.
    """

    name: str
    sha256: str
    complete: bool
    intact: bool


class Ledger:
    """Pictures taken and delivered; for several threads.

    Parameters
    ----------
    file
        Gets a JSON line for each delivery, at once; None for none.
    """

    def __init__(self, file: TextIO | None = None) -> None:
        self._lock = threading.Lock()
        self._file = file
        self._deliveries: list[Delivery] = []
        self._taken: list[str] = []

    @property
    def taken(self) -> tuple[str, ...]:
        """Names of the pictures that were taken, in order."""
        with self._lock:
            return tuple(self._taken)

    @property
    def deliveries(self) -> tuple[Delivery, ...]:
        """All downloads, in order."""
        with self._lock:
            return tuple(self._deliveries)

    def delivered(self) -> list[str]:
        """SHA-256 of each picture that was delivered whole and without fault, in order, each picture once."""
        return list(dict.fromkeys(each.sha256 for each in self.deliveries if each.complete and each.intact))

    def take(self, name: str) -> None:
        """Note that a picture was taken."""
        with self._lock:
            self._taken.append(name)

    def deliver(self, name: str, content: bytes, *, complete: bool, intact: bool) -> None:
        """Note that a picture, or a part of it, was sent."""
        delivery = Delivery(name, hashlib.sha256(content).hexdigest(), complete, intact)
        with self._lock:
            self._deliveries.append(delivery)
            if self._file is not None:
                self._file.write(json.dumps(asdict(delivery)) + "\n")
                self._file.flush()
