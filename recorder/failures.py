"""The one place where expected failures become one sentence and an exit code.

Anything else is a bug and keeps its traceback.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import click

from camera_drivers.errors import CameraError
from flight_file.errors import FlightFileError
from recorder.errors import ConfigurationError, RecorderError

FAILED = 1
DONE_WITH_LOSS = 3
WRONG_CONFIGURATION = 78  # EX_CONFIG of sysexits.h; systemd is told not to start again after it

_EXIT_CODES: tuple[tuple[type[Exception], int], ...] = (
    (ConfigurationError, WRONG_CONFIGURATION),
    (RecorderError, FAILED),
    (CameraError, FAILED),
    (FlightFileError, FAILED),
)


@contextmanager
def failures_as_sentences() -> Iterator[None]:
    """Turn our own errors into click's, with their exit codes."""
    try:
        yield
    except tuple(kind for kind, _ in _EXIT_CODES) as error:
        failure = click.ClickException(str(error))
        failure.exit_code = next(  # type: ignore[misc]  # click reads it from the instance
            code for kind, code in _EXIT_CODES if isinstance(error, kind)
        )
        raise failure from error
