"""Working folders for what has to be copied first.

They are removed at their end, and by the next worker of this machine if the one that made them was killed.
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
    _sweep(Path(tempfile.gettempdir()))
    with tempfile.TemporaryDirectory(
        prefix=f"{_PREFIX}-{gethostname()}-{os.getpid()}-", ignore_cleanup_errors=True
    ) as name:
        yield Path(name)


def _sweep(temporary: Path) -> None:
    """Removes the folders of processes that are no more; other machines' are not ours to judge."""
    prefix = f"{_PREFIX}-{gethostname()}-"
    for folder in temporary.glob(f"{prefix}*"):
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
