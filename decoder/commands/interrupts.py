"""Ctrl-C while `decode` is still being imported: there is nothing to clear up yet, so the process ends there and then.

An exception would have to find its way through half-imported libraries, and shows as their traceback.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

EXIT_FAILED = 1
INTERRUPTED = "decode: interrupted; nothing was written"


@contextmanager
def ends_at_once() -> Iterator[None]:
    """Inside the `with` block Ctrl-C ends the process with a sentence; for imports, by the main thread only.

    Where somebody else has a say in what Ctrl-C does, or it is ignored, it stays so.
    """
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, _end)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _end(_signal: int, _frame: FrameType | None) -> None:
    os.write(2, f"{INTERRUPTED}\n".encode())
    os._exit(EXIT_FAILED)
