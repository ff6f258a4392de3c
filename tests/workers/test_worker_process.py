"""One worker process: what is known of it however it ends."""

from __future__ import annotations

import os
from concurrent.futures.process import BrokenProcessPool

import pytest

from decoder.parallel import fork_server
from decoder.parallel.fork_server import WorkerProcess


def test_process_that_dies_as_it_begins_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """It may be gone before anybody can look for it; what it is given fails, and it says how it ended."""
    monkeypatch.setattr(fork_server, "_clean_up_when_told", os.abort)
    worker = WorkerProcess()
    with pytest.raises(BrokenProcessPool):
        worker.submit(os.getpid).result()

    assert worker.last_words() == "was killed (SIGABRT)"
