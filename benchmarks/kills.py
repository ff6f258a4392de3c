"""`python -m benchmarks.kills [COUNT]`: kills a recorder at random moments, and looks whether anything stored is lost.

Each time a real `recorder run` replays pictures at 50 Hz into segments of 0.7 s, is killed with SIGKILL, and what it
left is recovered: every fourth time while it starts, else at a moment of its recording, however long a busy machine
takes to begin it. What it had told systemd was stored, two seconds or more before the kill, must all be there, byte for
byte and in order, and the chain must fit. The recorder has a key: all of it must also be signed.
"""

from __future__ import annotations

import json
import random
import shutil
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.recorders import Box, Kept, kept, make_pictures
from flight_file.session import parse_segment_name
from flight_file.signature import load_signer, make_key_files

RATE_HZ = 50
SEGMENT_S = 0.7  # so that many kills hit the moment between two segments
PICTURES = 2000
LATEST_KILL_S = 5.0
WHILE_STARTING, LATEST_START_S = 4, 1.0  # every so many kills, at most so long after the process was begun
STORED_NS = 2_000_000_000
COUNT = 200
AT_ONCE = 5
LOOK_S = 0.02
KEY = "recorder.key"


@dataclass(frozen=True, slots=True)
class Kill:
    """What one kill cost.

    Attributes
    ----------
    youngest_ms
        How long before the kill the last frame that is there had arrived, ms; None if there is none.
    """

    seed: int
    kept: Kept
    youngest_ms: float | None


def kill_once(seed: int, folder: Path, pictures: Sequence[bytes]) -> Kill:
    """Record from `folder/pictures` into `folder/SEED`, kill at a random moment, recover and check."""
    work = folder / str(seed)
    work.mkdir()
    config = work / "recorder.yaml"
    camera = {"driver": "replay", "path": str(folder / "pictures"), "rate_hz": RATE_HZ, "pace": "realtime"}
    storage = {"directory": "flights", "segment_s": SEGMENT_S, "keep_free_gib": 0}
    evidence = {"key": str(folder / KEY)}
    config.write_text(json.dumps({"camera": camera, "storage": storage, "evidence": evidence}), encoding="utf-8")
    box = Box(config)
    _wait_for_moment(seed, box)
    killed_ns, killed_monotonic_ns = time.time_ns(), time.monotonic_ns()
    box.kill()
    found = kept(
        box, pictures, load_signer(folder / KEY), said=box.said_stored(before_ns=killed_monotonic_ns - STORED_NS)
    )
    segments = box.finished()
    names = [(segments[0].name.rpartition("_")[0], number) for number in range(len(segments))]
    if [parse_segment_name(path) for path in segments] != names:
        found = replace(found, faults=(*found.faults, "a segment is missing"))
    shutil.rmtree(work)
    return Kill(seed, found, None if found.newest_ns is None else (killed_ns - found.newest_ns) / 1e6)


def _wait_for_moment(seed: int, box: Box) -> None:
    starting = seed % WHILE_STARTING == 0
    while not starting and not box.events("recording_started") and box.process.poll() is None:
        time.sleep(LOOK_S)
    time.sleep(random.Random(seed).uniform(0.0, LATEST_START_S if starting else LATEST_KILL_S))  # noqa: S311 - a moment


def kills(count: int) -> list[Kill]:
    """So many kills, some at once; seeds count from 0."""
    with TemporaryDirectory() as name, ThreadPoolExecutor(AT_ONCE) as pool:
        folder = Path(name)
        pictures = make_pictures(folder / "pictures", PICTURES)
        make_key_files(folder / KEY)
        return list(pool.map(partial(kill_once, folder=folder, pictures=pictures), range(count)))


def main(words: Sequence[str]) -> int:
    """Kill, and print what it cost; 1 if anything stored is lost."""
    done = kills(int(words[0]) if words else COUNT)
    faulty = [kill for kill in done if kill.kept.faults]
    ages = [kill.youngest_ms for kill in done if kill.youngest_ms is not None]
    print(f"{len(done)} kills, {sum(kill.kept.found == 0 for kill in done)} of them before the first frame was stored")
    print(f"{sum(kill.kept.said for kill in done)} frames had been reported stored {STORED_NS / 1e9:.0f} s before")
    print(f"{sum(kill.kept.found for kill in done)} frames recovered, {sum(kill.kept.lost for kill in done)} lost")
    print(f"the last frame that is there had arrived {max(ages, default=0):.0f} ms before the kill, at worst")
    print(f"{len(faulty)} kills after which something was missing or wrong")
    for kill in faulty:
        print(f"  seed {kill.seed}: {'; '.join(kill.kept.faults)}")
    return 1 if faulty else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
