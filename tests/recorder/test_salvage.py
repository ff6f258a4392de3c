"""What an earlier life left in work is finished in the background."""

from __future__ import annotations

import io
import json
import threading
from collections.abc import Callable
from itertools import chain, repeat
from pathlib import Path
from typing import Any

import pytest

from flight_file.errors import NothingToRecoverError
from flight_file.reader import open_flight
from recorder import assembly, salvage
from recorder.journal import Journal
from recorder.salvage import Salvager, files_in_work

Daemon = Any  # of the conftest
StartDaemon = Callable[..., Daemon]
Eventually = Callable[[Callable[[], object]], None]


def leave_in_work(start_daemon: StartDaemon) -> tuple[Path, list[bytes]]:
    """A recording of which the power was cut: its last file lacks its end."""
    given = [bytes([number]) * 100_000 for number in range(5)]
    daemon = start_daemon()
    daemon.feed(*given)
    (finished,) = daemon.finish().paths
    part = finished.with_name(finished.name + ".part")
    part.write_bytes(finished.read_bytes()[:-3000])
    finished.unlink()
    return part, given


def test_segment_of_yesterday_is_finished(start_daemon: StartDaemon, eventually: Eventually) -> None:
    """With all its pictures, beside the new recording, which has a name of its own."""
    part, given = leave_in_work(start_daemon)
    daemon = start_daemon()
    daemon.feed(b"new")
    eventually(lambda: daemon.events("segment_salvaged"))
    outcome = daemon.finish()

    assert not part.exists()
    assert [frame.jpeg for frame in open_flight([part.with_suffix("")]).frames()] == given
    assert [frame.jpeg for frame in open_flight(outcome.paths).frames()] == [b"new"]


def test_recording_does_not_wait_for_the_salvage(
    start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch, eventually: Eventually
) -> None:
    """The first frame is on the disk while an old segment is still being read."""
    leave_in_work(start_daemon)
    begun, released = threading.Event(), threading.Event()
    recover = assembly.recover_segment

    def slow_recover(path: Path, **arguments: Any) -> Any:  # noqa: ANN401 - as the real one
        begun.set()
        released.wait(120)
        return recover(path, **arguments)

    monkeypatch.setattr(assembly, "recover_segment", slow_recover)
    daemon = start_daemon()
    daemon.feed(b"1", b"2", b"3", b"4")
    eventually(begun.is_set)
    stored = [path for path in daemon.directory.glob("*.part") if b"frame" in path.read_bytes()]
    released.set()
    eventually(lambda: daemon.events("segment_salvaged"))

    assert len(stored) == 2
    daemon.finish()


def test_what_cannot_be_salvaged_is_said_and_left(tmp_path: Path, eventually: Eventually) -> None:
    """No room, nothing in it, or gone: one line each, and the next one is tried."""
    names = ["R_0000.mcap.part", "R_0001.mcap.part", "R_0002.mcap.part"]
    for name in names[:2]:
        (tmp_path / name).write_bytes(bytes(100))
    free = chain([150], repeat(10**9))
    log = io.StringIO()

    def recover(path: Path) -> str:
        raise NothingToRecoverError(path, reason="nothing that was recorded is left in it; delete it")

    salvager = Salvager(recover, free_bytes=lambda _path: next(free), journal=Journal(log))
    salvager.start()
    for name in names:
        salvager.submit(tmp_path / name)
    eventually(lambda: log.getvalue().count("\n") == 3)
    reasons = [json.loads(line)["reason"] for line in log.getvalue().splitlines()]

    assert reasons[0] == "there is no room for it now"
    assert "nothing that was recorded" in reasons[1]
    assert reasons[2] == "No such file or directory"


def test_room_is_looked_for_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, eventually: Eventually) -> None:
    """A segment for which the disk was too full is tried again later."""
    monkeypatch.setattr(salvage, "_AGAIN_S", 0.01)
    path = tmp_path / "R_0000.mcap.part"
    path.write_bytes(bytes(100))
    free = [0, 0, 10**9]
    recovered: list[Path] = []

    def recover(path: Path) -> str:
        recovered.append(path)
        return "recovered"

    salvager = Salvager(recover, free_bytes=lambda _path: free.pop(0), journal=Journal(io.StringIO()))
    salvager.start()
    salvager.submit(path)
    eventually(lambda: recovered)

    assert recovered == [path]


def test_files_in_work_are_found_by_their_names(tmp_path: Path) -> None:
    """Nothing else is touched, and a directory that is gone has none."""
    for name in ("R_0001.mcap.part", "R_0000.mcap.part", "R_0002.mcap", "x.part", "R_0003.mcap.recovering"):
        (tmp_path / name).touch()

    assert [path.name for path in files_in_work(tmp_path)] == ["R_0000.mcap.part", "R_0001.mcap.part"]
    assert files_in_work(tmp_path / "gone") == []
