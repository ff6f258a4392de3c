"""`python -m benchmarks.reliability [--part PART] [--write]`: harms recorders, and counts what is lost.

Each trial runs a real `recorder run` with a key, on pictures that are replayed or on the simulated camera, does one
thing to it, lets it go on, stops it as systemd does, recovers what it left in work, and holds what is there against
what it had said is stored. `--write` puts the table into docs/reliability.md.
"""

from __future__ import annotations

import errno
import json
import math
import subprocess
import sys
from argparse import ArgumentParser
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks import kills
from benchmarks.box import STILLS, Called, called
from benchmarks.harm import (
    HARMED,
    LIMITS,
    QUICK,
    TAKEN,
    Disk,
    faults_of,
    fill_with_odd_things,
    mounted_disk,
    order_all_faults,
    take_away,
)
from benchmarks.pages import called_table, machine, markdown
from benchmarks.recorders import Box, Kept, eventually, judged, kept, make_pictures
from camera_drivers.qx10.simulator.faults import DESCRIPTION, DOWNLOAD, SHOT, STREAM
from camera_drivers.qx10.simulator.simulator import SimulatedQx10
from flight_file.signature import load_signer, make_key_files
from flight_file.verification import Verdict
from recorder.host import SystemClock

PAGE = Path(__file__).parents[1] / "docs" / "reliability.md"
BEGIN = "<!-- `make reliability` writes from here -->\n"
END = "<!-- to here -->\n"

MEMORY_LEGEND = """\
### Memory, open files and threads over time

A recorder takes stills with the simulated camera, a process of its own that takes no time, as fast as both can. Every
tenth of a second the recorder was looked at; a row has when it had so many stills, its resident memory then, and the
most since the row above.
"""

AT_ONCE = 4
RATE_HZ = 20
PICTURES = 4000
MORE = 20  # pictures that are stored after the harm
YEARS_S = 10 * 365 * 86_400
MOST_HOURS = 1000  # so that nothing is deleted to make room
DISK_ERRORS = (errno.EIO, errno.ENOSPC, errno.EROFS, errno.ENODEV)

STILL_FAULTS = [name for place in (SHOT, DOWNLOAD, DESCRIPTION) for name in faults_of(place)]
COUNTED = ("said", "lost", "dropped")
VERDICTS = {
    Verdict.FITS: "verify: fits",
    Verdict.LOSS: "verify: fits as far as it goes",
    Verdict.FAULT: "verify: does not fit",
}


@dataclass(frozen=True, slots=True)
class Bench:
    """Where trials are made: `folder` has the key and the pictures, whose bytes are `pictures`."""

    folder: Path
    pictures: Sequence[bytes]

    @property
    def key(self) -> Path:
        """The recorders' private key."""
        return self.folder / kills.KEY

    def box(self, work: Path, camera: dict[str, Any], **storage: Any) -> Box:  # noqa: ANN401 - values of recorder.yaml
        """Start a recorder that can be harmed, in a folder of its own."""
        document = {
            "camera": camera,
            "storage": {"directory": "flights", "keep_free_gib": 0, "keep_hours": MOST_HOURS, **storage},
            "evidence": {"key": str(self.key)},
        }
        config = work / "recorder.yaml"
        config.write_text(json.dumps(document), encoding="utf-8")
        return Box(config, HARMED)


Trial = Callable[[Bench, Path, int], Kept]
"""Something that is tried, in a folder of its own, for the so manieth time."""
Harm = Callable[[Box, int], None]


def replayed(harm: Harm, bench: Bench, work: Path, number: int, **storage: Any) -> Kept:  # noqa: ANN401
    """Harm a recorder that replays pictures, and let it store some more."""
    camera = {"driver": "replay", "path": str(bench.folder / "pictures"), "rate_hz": RATE_HZ, "pace": "realtime"}
    box = bench.box(work, camera, **storage)
    try:
        harm(box, number)
        enough = box.said_stored() + MORE
        eventually(lambda: box.said_stored() >= enough)
        box.stop()
    finally:
        box.kill()
    return kept(box, bench.pictures, load_signer(bench.key))


def lose_file(how: str, box: Box, _number: int) -> None:
    """Take the file in work away."""
    take_away(box.in_work_soon(), how)
    eventually(lambda: box.events("segment_salvaged"))


def fail_disk(box: Box, number: int) -> None:
    """Let the kernel refuse every write and sync for a while."""
    box.in_work_soon()
    box.order("disk", DISK_ERRORS[number % len(DISK_ERRORS)])
    eventually(lambda: box.events("disk_failed"))
    box.order("disk", 0)
    eventually(lambda: box.events("disk_back"))


def set_clock(by_s: int, box: Box, _number: int) -> None:
    """Set the wall clock."""
    box.in_work_soon()
    box.order("clock", by_s)
    eventually(lambda: box.events("wall_clock_set"))


def among_odd_things(bench: Bench, work: Path, number: int) -> Kept:
    """Record into a directory of strange files, with a reserve that can never be free, so that all are looked at."""
    fill_with_odd_things(work / "flights")
    before = {path.name for path in (work / "flights").iterdir()}

    def go_on(box: Box, _number: int) -> None:
        eventually(lambda: len(box.finished()) > 2)  # noqa: PLR2004 - a few
        missing = before - {path.name for path in box.directory.iterdir()}
        if missing:
            raise AssertionError(f"the recorder deleted what is not its own: {sorted(missing)}")

    return replayed(go_on, bench, work, number, keep_free_gib=1e6, segment_s=0.5)


def on_a_disk(harm: Callable[[Box, Disk], None], bench: Bench, work: Path, number: int, *, how: str = "rw") -> Kept:
    """Record onto a small disk of its own, which is mounted `how`, and harm that."""
    with mounted_disk(work) as disk:
        (disk.path / "flights").mkdir()
        disk.remount(how)
        return replayed(lambda box, _: harm(box, disk), bench, work, number, directory=str(disk.path / "flights"))


def fill(box: Box, disk: Disk) -> None:
    """Let the disk run full, with nothing that may be deleted."""
    box.in_work_soon()
    with suppress(OSError), (disk.path / "ballast").open("wb", buffering=0) as ballast:
        while True:
            ballast.write(bytes(4096))
    eventually(lambda: box.events("disk_failed"))
    (disk.path / "ballast").unlink()
    eventually(lambda: box.events("disk_back"))


def let_write(box: Box, disk: Disk) -> None:
    """Mount a disk for writing that was not."""
    eventually(lambda: box.events("disk_failed"))
    disk.remount("rw")
    eventually(lambda: box.events("disk_back"))


def pull(box: Box, disk: Disk) -> None:
    """Pull the disk out, and bring it back."""
    box.in_work_soon()
    disk.pull()
    eventually(lambda: box.events("disk_failed"))
    disk.plug()
    eventually(lambda: box.events("segment_salvaged"))


def stills(bench: Bench, work: Path, _number: int) -> Kept:
    """Take pictures with a camera that makes every mistake it can, one after the other."""
    with SimulatedQx10(SystemClock(), behaviour=QUICK) as camera:
        shots = order_all_faults(camera)
        box = bench.box(work, {"driver": "qx10", "url": camera.url, "interval_s": 0, "limits": LIMITS}, segment_s=3)
        return _photographed(camera, box, bench, lambda _: len(camera.ledger.taken) >= shots)


def liveview(bench: Bench, work: Path, _number: int) -> Kept:
    """Record a stream that has junk in it, ends and stalls."""
    with SimulatedQx10(SystemClock(), behaviour=QUICK) as camera:
        for number, name in enumerate(faults_of(STREAM)):
            camera.fault_schedule.order(name, at=MORE * (number + 1))
        settings = {"driver": "qx10", "url": camera.url, "mode": "liveview", "limits": LIMITS | {"stall_s": 2.0}}
        return _photographed(camera, bench.box(work, settings), bench, lambda box: box.said_stored() >= 5 * MORE)


def _photographed(camera: SimulatedQx10, box: Box, bench: Bench, enough: Callable[[Box], bool]) -> Kept:
    try:
        eventually(lambda: enough(box))
        box.stop()
    finally:
        box.kill()
    faults, frames = list(box.recover(load_signer(bench.key))), box.frames()
    there, ended = {frame.sha256 for frame in frames}, box.events("recording_finished")[-1]
    # The box may have been stopped while a last picture was on its way.
    missing = set(camera.ledger.delivered()[:-1]) - there
    said, dropped, lost = ended["stored"], ended["dropped"], max(ended["stored"] - len(there), len(missing))
    return judged(box, frames, load_signer(bench.key), said=said, lost=lost, dropped=dropped, faults=faults)


@dataclass(frozen=True, slots=True)
class Kind:
    """Something that is tried `times` times; `what` says it in the table."""

    what: str
    times: int
    trial: Trial


KINDS = (
    Kind(f"each of the camera's {len(STILL_FAULTS)} faults with a still, one after the other", 5, stills),
    Kind("the liveview stream has junk in it, ends, stalls", 5, liveview),
    Kind("disk full, nothing may be deleted; then room again", 10, partial(on_a_disk, fill)),
    Kind("disk read-only from the start; then writable", 10, partial(on_a_disk, let_write, how="ro")),
    Kind("disk pulled out while it records; then back", 10, partial(on_a_disk, pull)),
    Kind("every write and sync fails for a while: EIO, ENOSPC, EROFS, ENODEV", 20, partial(replayed, fail_disk)),
    *(Kind(f"file in work {how}d", 10, partial(replayed, partial(lose_file, how))) for how in TAKEN),
    Kind("fifos, loops, `/dev/zero`, files of 4 TB and strange names among the recordings", 5, among_odd_things),
    Kind("wall clock set ten years forward", 10, partial(replayed, partial(set_clock, YEARS_S))),
    Kind("wall clock set ten years back", 10, partial(replayed, partial(set_clock, -YEARS_S))),
)


@dataclass(frozen=True, slots=True)
class Row:
    """What came of one kind; `undone` are the reasons of trials that could not be made."""

    what: str
    done: Sequence[Kept]
    undone: Sequence[str] = ()

    @property
    def faults(self) -> list[str]:
        """Of all its trials."""
        return [f"{self.what}: {fault}" for each in self.done for fault in each.faults] + [
            f"{self.what}: not tried: {reason}" for reason in self.undone
        ]

    @property
    def fields(self) -> list[str]:
        """Of the table."""
        verdicts = Counter(each.verdict for each in self.done)
        counts = [len(self.done), *(sum(getattr(each, name) for each in self.done) for name in COUNTED)]
        return [self.what, *map(str, counts), *(str(verdicts[verdict]) for verdict in Verdict)]


def tried(kind: Kind, bench: Bench, pool: ThreadPoolExecutor, part: float) -> Row:
    """All trials of a kind, or a part of them."""

    def trial(number: int) -> Kept | str:
        with TemporaryDirectory(dir=bench.folder) as name:
            try:
                return kind.trial(bench, Path(name), number)
            except (AssertionError, OSError, TimeoutError, subprocess.SubprocessError) as error:
                return f"{type(error).__name__}: {error}"

    came = list(pool.map(trial, range(math.ceil(kind.times * part))))
    return Row(
        kind.what, [each for each in came if isinstance(each, Kept)], [each for each in came if isinstance(each, str)]
    )


def rows(part: float) -> list[Row]:
    """Everything that is tried; each row is printed when it is there."""
    with TemporaryDirectory() as name, ThreadPoolExecutor(AT_ONCE) as pool:
        folder = Path(name)
        bench = Bench(folder, make_pictures(folder / "pictures", PICTURES))
        make_key_files(bench.key)
        found = []
        for kind in KINDS:
            found.append(tried(kind, bench, pool, part))
            print(*found[-1].fields, *found[-1].faults, sep=" | ", flush=True)
    killed = kills.kills(math.ceil(kills.COUNT * part))
    found.insert(0, Row("killed at a random moment, every fourth time while it starts", [kill.kept for kill in killed]))
    return found


def section(found: Sequence[Row], calls: Called) -> str:
    """What the page says, as Markdown."""
    header = ["what was tried", "times", "frames stored", "lost", "dropped, and said so", *VERDICTS.values()]
    names = ", ".join(f"`{name}`" for name in (*STILL_FAULTS, *faults_of(STREAM)))
    faults = [fault for row in found for fault in row.faults]
    return "\n".join(
        [
            f"Written by `make reliability`. {machine()}",
            "",
            markdown(header, [row.fields for row in found]),
            "",
            *(f"- {fault}" for fault in faults),
            f"The camera's faults, by the names that `recorder simulate` has for them: {names}.",
            "",
            MEMORY_LEGEND,
            called_table(calls),
            "",
        ]
    )


def main() -> None:
    """Ends with 1 where anything was lost or could not be tried."""
    parser = ArgumentParser(prog="python -m benchmarks.reliability", description=__doc__)
    parser.add_argument("--part", type=float, default=1.0, help="of the trials and stills; 1 is all of them")
    parser.add_argument("--write", action="store_true", help="put the table into docs/reliability.md")
    asked = parser.parse_args()
    found = rows(asked.part)
    text = section(found, called(math.ceil(STILLS * asked.part)))
    print(text)
    if asked.write:
        before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
        PAGE.write_text(before + BEGIN + "\n" + text + "\n" + END + rest.partition(END)[2], encoding="utf-8")
    sys.exit(any(row.faults for row in found))


if __name__ == "__main__":
    main()
