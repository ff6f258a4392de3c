"""`python -m benchmarks.kills [COUNT]`: kills a recorder at random moments, and looks whether anything stored is lost.

Each time a real `recorder run` replays pictures at 50 Hz into segments of 0.7 s, is killed with SIGKILL, and what it
left is recovered: every fourth time while it starts, else at a moment of its recording, however long a busy machine
takes to begin it. What had been reported stored is what arrived two seconds or more before the kill: all of it must be
there, byte for byte and in order, and the chain must fit.
"""

from __future__ import annotations

import io
import json
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from flight_file.errors import FlightFileError
from flight_file.frame import ClockReading
from flight_file.losses import LossKind
from flight_file.reader import open_flight
from flight_file.salvage import recover_segment
from flight_file.segments import parse_segment_name
from flight_file.verification import Verdict, verify

RATE_HZ = 50
SEGMENT_S = 0.7  # so that many kills hit the moment between two segments
PICTURES = 400
LATEST_KILL_S = 4.0
WHILE_STARTING, LATEST_START_S = 4, 1.0  # every so many kills, at most so long after the process was begun
STORED_NS = 2_000_000_000
COUNT = 200
AT_ONCE = 5
LOOK_S = 0.02

_RECORDER = (sys.executable, "-c", "from recorder.cli import main; main()")


@dataclass(frozen=True, slots=True)
class Kill:
    """What one kill cost.

    Attributes
    ----------
    frames
        Frames that are there after recovering.
    stored
        Frames that had been reported stored.
    youngest_ms
        How long before the kill the last frame that is there had arrived, ms; None if there is none.
    faults
        What is not as it must be, in words; empty if all is.
    """

    seed: int
    frames: int
    stored: int
    youngest_ms: float | None
    faults: tuple[str, ...]


def make_pictures(folder: Path) -> list[bytes]:
    """Small pictures, each another, in a folder; gives their bytes in order."""
    folder.mkdir()
    contents = []
    for index in range(PICTURES):
        buffer = io.BytesIO()
        Image.new("RGB", (64, 48), (index % 256, index // 256, 7)).save(buffer, "JPEG", comment=str(index).encode())
        (folder / f"{index:04d}.jpg").write_bytes(buffer.getvalue())
        contents.append(buffer.getvalue())
    return contents


def kill_once(seed: int, folder: Path, pictures: Sequence[bytes]) -> Kill:
    """Record from `folder/pictures` into `folder/SEED`, kill at a random moment, recover and check."""
    work = folder / str(seed)
    work.mkdir()
    config = work / "recorder.yaml"
    camera = {"driver": "replay", "path": str(folder / "pictures"), "rate_hz": RATE_HZ, "pace": "realtime"}
    storage = {"directory": "flights", "segment_s": SEGMENT_S, "keep_free_gib": 0}
    config.write_text(json.dumps({"camera": camera, "storage": storage}), encoding="utf-8")
    with (work / "log").open("wb") as log:
        process = subprocess.Popen([*_RECORDER, "run", "--config", str(config)], stderr=log)
        _wait_for_moment(seed, work, process)
        killed_ns = time.time_ns()
        process.send_signal(signal.SIGKILL)
        process.wait()
    kill = _checked(seed, work, pictures, killed_ns)
    shutil.rmtree(work)
    return kill


def _wait_for_moment(seed: int, work: Path, process: subprocess.Popen[bytes]) -> None:
    starting = seed % WHILE_STARTING == 0
    while not starting and _began_ns(work) is None and process.poll() is None:
        time.sleep(LOOK_S)
    time.sleep(random.Random(seed).uniform(0.0, LATEST_START_S if starting else LATEST_KILL_S))  # noqa: S311 - a moment


def _checked(seed: int, work: Path, pictures: Sequence[bytes], killed_ns: int) -> Kill:
    faults = list(_recover(work / "flights"))
    segments = sorted((work / "flights").glob("*.mcap"))
    frames = list(open_flight(segments).frames()) if segments else []
    # By the recorder's log and the replay's pace, not by what is in the files: so many pictures had been stored.
    recorded_ns = killed_ns - (_began_ns(work) or killed_ns)
    stored = min(max(0, (recorded_ns - STORED_NS) * RATE_HZ // 10**9), len(pictures))
    numbers = [frame.sequence for frame in frames]
    if numbers != sorted(set(numbers)) or any(frame.jpeg != pictures[frame.sequence] for frame in frames):
        faults.append("a frame is not the picture it was, byte for byte and in order")
    if max(numbers, default=-1) + 1 < stored:
        faults.append(f"{max(numbers, default=-1) + 1} frames are there, {stored} had been stored")
    if [parse_segment_name(path) for path in segments] != [
        (segments[0].name.rpartition("_")[0], number) for number in range(len(segments))
    ]:
        faults.append("a segment is missing")
    if segments and verify(segments)[0].verdict is Verdict.FAULT:
        faults.append("the chain does not fit")
    youngest_ms = (killed_ns - frames[-1].times.downloaded.realtime_ns) / 1e6 if frames else None
    return Kill(seed, len(frames), stored, youngest_ms, tuple(faults))


def _began_ns(work: Path) -> int | None:
    """When the recorder said that it began; None before that."""
    for line in (work / "log").read_text(encoding="utf-8").splitlines(keepends=True):
        entry = json.loads(line) if line.endswith("\n") else {}
        if entry.get("event") == "recording_started":
            return round(datetime.fromisoformat(entry["timestamp"]).timestamp() * 1e9)
    return None


def _recover(flights: Path) -> Iterator[str]:
    at = ClockReading(time.time_ns(), time.monotonic_ns())
    for part in flights.glob("*.part"):
        try:
            recovery = recover_segment(part, at=at)
        except FlightFileError as error:
            # A segment that was killed before its first bytes were there has nothing in it.
            if part.stat().st_size > 2**14:
                yield str(error)
            continue
        if any(loss.kind is LossKind.DAMAGED for loss in recovery.losses):
            yield f"{part.name} is damaged inside"


def kills(count: int) -> list[Kill]:
    """So many kills, some at once; seeds count from 0."""
    with TemporaryDirectory() as name, ThreadPoolExecutor(AT_ONCE) as pool:
        folder = Path(name)
        pictures = make_pictures(folder / "pictures")
        return list(pool.map(partial(kill_once, folder=folder, pictures=pictures), range(count)))


def main(words: Sequence[str]) -> int:
    """Kill, and print what it cost; 1 if anything stored is lost."""
    done = kills(int(words[0]) if words else COUNT)
    faulty = [kill for kill in done if kill.faults]
    ages = [kill.youngest_ms for kill in done if kill.youngest_ms is not None]
    print(f"{len(done)} kills, {sum(kill.frames == 0 for kill in done)} of them before the first frame was stored")
    print(f"{sum(kill.stored for kill in done)} frames had been reported stored: older than {STORED_NS / 1e9:.0f} s")
    print(f"{sum(kill.frames for kill in done)} frames recovered")
    print(f"the last frame that is there had arrived {max(ages, default=0):.0f} ms before the kill, at worst")
    print(f"{len(faulty)} kills after which something was missing or wrong")
    for kill in faulty:
        print(f"  seed {kill.seed}: {'; '.join(kill.faults)}")
    return 1 if faulty else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
