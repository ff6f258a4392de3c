"""Working folders for what has to be copied first.

They are removed at their end; those of a worker that was killed by whoever killed it, or by the machine's next worker.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from socket import gethostname

_PREFIX = "fleet"


@contextmanager
def working_folder() -> Iterator[Path]:
    """A folder of its own in the temporary folder (TMPDIR)."""
    remove_abandoned()
    with tempfile.TemporaryDirectory(
        prefix=f"{_PREFIX}-{gethostname()}-{os.getpid()}-", ignore_cleanup_errors=True
    ) as name:
        yield Path(name)


def remove_abandoned() -> None:
    """Removes the folders of processes that are no more; other machines' are not ours to judge."""
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
