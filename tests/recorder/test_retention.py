"""Which segments go, and which never do."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from recorder.errors import ConfigurationError
from recorder.journal import Journal
from recorder.retention import Candidate, Retention, Rules, older_than, recorded_ns
from recorder.run import record
from recorder.settings import RecorderConfig
from recorder.testing import ManualClock, fixed_host

Configure = Callable[..., RecorderConfig]

MIB = 2**20
HOUR_NS = 3600 * 10**9


class SmallDisk:
    """A directory of segments of one hour and one MiB each, on a disk of ten MiB."""

    def __init__(self, directory: Path, segments: int, **rules: int | None) -> None:
        self.directory = directory
        self.log = io.StringIO()
        for number in range(segments):
            self.path(number).write_bytes(bytes(MIB))
        wanted = Rules(**{"reserve_bytes": 0, "keep_ns": 0, **rules})  # type: ignore[arg-type]
        self.retention = Retention(
            directory, wanted, free_bytes=self.free, journal=Journal(self.log), span_ns=lambda _path: HOUR_NS
        )

    def path(self, number: int) -> Path:
        """Of a segment."""
        return self.directory / f"20180504T120000Z_{number:04d}.mcap"

    def free(self, _path: Path) -> int:
        """Room left, bytes."""
        return 10 * MIB - sum(path.stat().st_size for path in self.directory.iterdir())

    def left(self) -> list[int]:
        """Numbers of the segments that are there."""
        return [number for number in range(20) if self.path(number).exists()]


def test_oldest_go_until_the_reserve_is_free(tmp_path: Path) -> None:
    """No more than needed, and a second time nothing."""
    disk = SmallDisk(tmp_path, 8, reserve_bytes=5 * MIB)

    assert disk.retention.make_room()
    assert disk.left() == [3, 4, 5, 6, 7]
    assert not disk.retention.make_room()
    assert [json.loads(line)["event"] for line in disk.log.getvalue().splitlines()] == ["segment_deleted"] * 3


def test_newest_hours_are_never_deleted(tmp_path: Path) -> None:
    """Even if the reserve cannot be kept, and even if the disk is full."""
    disk = SmallDisk(tmp_path, 8, reserve_bytes=100 * MIB, keep_ns=5 * HOUR_NS)
    first = disk.retention.make_room(disk_is_full=True)

    assert (first, disk.retention.make_room(disk_is_full=True)) == (True, False)
    assert disk.left() == [3, 4, 5, 6, 7]


def test_full_disk_costs_one_segment_whatever_seems_free(tmp_path: Path) -> None:
    """The system's figure includes room that we may not use."""
    disk = SmallDisk(tmp_path, 4)

    assert disk.retention.make_room(disk_is_full=True)
    assert disk.left() == [1, 2, 3]


def test_old_ones_go_by_hours_of_recording(tmp_path: Path) -> None:
    """Although there is room."""
    disk = SmallDisk(tmp_path, 8, max_ns=3 * HOUR_NS)

    assert disk.retention.make_room()
    assert disk.left() == [5, 6, 7]


def test_marked_ones_and_strangers_stay_and_signatures_go_along(tmp_path: Path) -> None:
    """A mark lies beside its segment; what has another name than the recorder gives is not the recorder's."""
    disk = SmallDisk(tmp_path, 6, reserve_bytes=100 * MIB)
    (tmp_path / "20180504T120000Z_0001.mcap.keep").touch()
    (tmp_path / "20180504T120000Z_0001.mcap.sig").touch()
    (tmp_path / "20180504T120000Z_0002.mcap.sig").touch()
    (tmp_path / "20180504T120000Z_0003.mcap").unlink()
    (tmp_path / "20180504T120000Z_0003.mcap").mkdir()
    strangers = ["flight_0000.mcap", "20180504T120000Z_0009.mcap.part", "20180504.mcap", "notes.txt"]
    for name in strangers:
        (tmp_path / name).touch()
    disk.retention.make_room()

    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        [
            "20180504T120000Z_0001.mcap",
            "20180504T120000Z_0001.mcap.keep",
            "20180504T120000Z_0001.mcap.sig",
            "20180504T120000Z_0003.mcap",
            *strangers,
        ]
    )


def test_directory_that_is_gone_needs_no_room(tmp_path: Path) -> None:
    """Whoever writes to it notices."""
    retention = Retention(
        tmp_path / "gone",
        Rules(reserve_bytes=MIB, keep_ns=0),
        free_bytes=lambda _path: None,
        journal=Journal(io.StringIO()),
    )

    assert not retention.make_room(disk_is_full=True)


def test_waiting_without_a_camera_does_not_age_a_flight() -> None:
    """Segments without pictures have no length, so the hours that are kept are hours of flight."""
    flight = [Candidate(Path(str(number)), HOUR_NS, marked=False) for number in range(3)]
    waiting = [Candidate(Path(str(number)), 0, marked=False) for number in range(3, 9)]

    assert older_than([*flight, *waiting], 2 * HOUR_NS) == flight[:1]


def test_length_is_read_from_the_index(configure: Configure, tmp_path: Path) -> None:
    """Of log times, which no wall clock moves; what cannot be read has none."""
    outcome = record(configure(), host=fixed_host(ManualClock(0)), journal=Journal(io.StringIO()))
    (tmp_path / "x.mcap").write_bytes(b"\x89MCAP0\r\n")

    assert recorded_ns(outcome.paths[0]) == 9_750_000_000
    assert recorded_ns(tmp_path / "x.mcap") == 0
    assert recorded_ns(tmp_path / "gone.mcap") == 0


def test_most_hours_are_not_less_than_the_kept_ones(configure: Configure) -> None:
    """It would contradict itself."""
    with pytest.raises(ConfigurationError, match="max_hours must not be less than keep_hours"):
        configure(storage={"keep_hours": 5, "max_hours": 4})
