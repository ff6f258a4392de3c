"""The box at work: `recorder run` as a process of its own, with large pictures, over a day, and over many calls."""

from __future__ import annotations

import json
import math
import os
import random
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import yaml

from benchmarks.recorders import RECORDER
from camera_drivers.qx10.simulator.behaviour import Behaviour
from camera_drivers.qx10.simulator.simulator import SimulatedQx10
from recorder.host import SystemClock

RATE_HZ = 4.0
PICTURE_BYTES = 5_000_000  # what a QX10 makes of 18 megapixels
PICTURES = 100
SETTLED_S = 3.0  # what starting costs is not what recording costs

STILLS = 5000
FIRST_STILLS = 200  # until then what is used for the first time is loaded

DAY_S = 86_400
DAY_RATE_HZ = 0.5
SAMPLE_S = 0.1

# Start and end of image; an application segment of comment would do, but no camera sends one of five megabytes.
_JPEG = (b"\xff\xd8\xff\xda", b"\xff\xd9")


@dataclass(frozen=True, slots=True)
class Sample:
    """A process at one moment: resident memory and its peak so far (MiB), open files, threads, processor time (s)."""

    at_s: float
    resident_mib: float
    peak_mib: float
    files: int
    threads: int
    processor_s: float
    loads_opencv: bool


@dataclass(frozen=True, slots=True)
class Sustained:
    """What recording large pictures took.

    Attributes
    ----------
    stored, dropped
        Pictures.
    processor_part
        Of one core; NaN if it was over before it had settled.
    """

    stored: int
    dropped: int
    processor_part: float
    peak_mib: float
    loads_opencv: bool


@dataclass(frozen=True, slots=True)
class Day:
    """A day of recording.

    Attributes
    ----------
    took_s
        By the wall clock.
    segments
        Files that are there afterwards.
    samples
        Of the process, in order.
    """

    took_s: float
    stored: int
    dropped: int
    segments: tuple[Path, ...]
    samples: tuple[Sample, ...]

    def growth_mib(self) -> float:
        """By how much the largest memory of the last tenth exceeds that of the first half, MiB."""
        early, late = self.samples[: len(self.samples) // 2], self.samples[-max(len(self.samples) // 10, 1) :]
        return max(each.resident_mib for each in late) - max(each.resident_mib for each in early)

    def most_files(self) -> int:
        """Open files."""
        return max(each.files for each in self.samples)


@dataclass(frozen=True, slots=True)
class Called:
    """A camera that was called over HTTP for so many stills.

    Attributes
    ----------
    samples
        Of the recorder, in order, each with the stills that the camera had delivered by then.
    """

    samples: tuple[tuple[int, Sample], ...]

    @property
    def settled(self) -> tuple[tuple[int, Sample], ...]:
        """After the first stills."""
        return tuple((stills, each) for stills, each in self.samples if stills >= FIRST_STILLS)

    def growth_mib(self) -> float:
        """By how much the largest memory after the first stills exceeds that right after them, MiB."""
        (_, first), *later = self.settled
        return max(each.resident_mib for _, each in later) - first.resident_mib

    def at(self, stills: int) -> Sample:
        """The first sample with so many stills."""
        return next(each for delivered, each in self.samples if delivered >= stills)


def called(count: int = STILLS) -> Called:
    """Record so many stills, and the first ones before, from the simulated camera, as fast as both can."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        ledger, config = folder / "ledger", folder / "recorder.yaml"
        command = [sys.executable, "-c", f"from benchmarks.box import be_camera; be_camera({str(ledger)!r})"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True) as simulated:
            url = (simulated.stdout or sys.stdin).readline().strip()
            camera = {"driver": "qx10", "url": url, "interval_s": 0}
            storage = {"directory": str(folder / "flights"), "keep_free_gib": 0}
            config.write_text(yaml.safe_dump({"camera": camera, "storage": storage}), encoding="utf-8")
            samples = tuple(_until(FIRST_STILLS + count, config, ledger))
            simulated.communicate()
    return Called(samples)


def be_camera(ledger: str) -> None:
    """Be a camera that takes no time, until standard input ends; its address is printed."""
    with Path(ledger).open("w", encoding="utf-8", buffering=1) as file:
        camera = SimulatedQx10(SystemClock(), behaviour=Behaviour(shot_s=0.0, save_s=0.0), ledger_file=file)
        with camera:
            sys.stdout.write(camera.url + "\n")
            sys.stdout.flush()
            sys.stdin.read()


def _until(stills: int, config: Path, ledger: Path) -> Iterator[tuple[int, Sample]]:
    command = [*RECORDER, "run", "--config", str(config)]
    log, delivered = config.with_name("log"), 0
    with log.open("wb") as stream, subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=stream) as process:
        with ledger.open("rb") as lines:
            for sample in _samples(process):
                delivered += lines.read().count(b"\n")
                yield delivered, sample
                if delivered >= stills:
                    break
        process.terminate()
    if process.returncode != 0:
        raise SystemExit(f"the recorder ended with {process.returncode}: {log.read_text(encoding='utf-8')[-500:]}")


def sustained(count: int = PICTURES, *, pace: str = "realtime") -> Sustained:
    """Record so many pictures of 5 MB at four a second; with another `pace`, `fastest`, as fast as the disk allows."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        pictures = folder / "pictures"
        _link_pictures(pictures, _different(8, PICTURE_BYTES), count)
        camera = {"driver": "replay", "path": str(pictures), "rate_hz": RATE_HZ, "pace": pace}
        storage = {"directory": str(folder / "flights"), "keep_free_gib": 0}
        samples, log = _run(folder, {"camera": camera, "storage": storage})
    return Sustained(
        stored=log["stored"],
        dropped=log["dropped"],
        processor_part=_processor_part([each for each in samples if each.at_s >= SETTLED_S]),
        peak_mib=samples[-1].peak_mib,
        loads_opencv=any(each.loads_opencv for each in samples),
    )


def day(folder: Path, directory: Path, *, seconds: int = DAY_S, **storage: Any) -> Day:  # noqa: ANN401 - recorder.yaml's
    """Record a day of small pictures as fast as the disk allows.

    Parameters
    ----------
    folder
        For the pictures.
    directory
        For the recordings.
    storage
        Further settings of recorder.yaml.
    """
    pictures = folder / "pictures"
    _link_pictures(pictures, _different(8, 1000), round(seconds * DAY_RATE_HZ))
    camera = {"driver": "replay", "path": str(pictures), "rate_hz": DAY_RATE_HZ, "pace": "fastest"}
    start_s = time.monotonic()
    samples, log = _run(folder, {"camera": camera, "storage": {"directory": str(directory), **storage}})
    took_s = time.monotonic() - start_s
    segments = tuple(sorted(directory.iterdir()))
    return Day(took_s, log["stored"], log["dropped"], segments, tuple(samples))


def _processor_part(samples: list[Sample]) -> float:
    if len(samples) < 2:  # noqa: PLR2004 - a beginning and an end
        return math.nan
    first, last = samples[0], samples[-1]
    return (last.processor_s - first.processor_s) / (last.at_s - first.at_s)


def _different(count: int, size_bytes: int) -> list[bytes]:
    chance = random.Random(1)  # noqa: S311 - pictures, not secrets
    start, end = _JPEG
    return [start + chance.randbytes(size_bytes - len(start) - len(end)) + end for _ in range(count)]


def _link_pictures(folder: Path, contents: list[bytes], count: int) -> None:
    folder.mkdir()
    originals = []
    for number, content in enumerate(contents):
        path = folder.parent / f"original_{number}"
        path.write_bytes(content)
        originals.append(path)
    for number in range(count):
        os.link(originals[number % len(originals)], folder / f"{number:06d}.jpg")


def _run(folder: Path, document: dict[str, Any]) -> tuple[list[Sample], dict[str, Any]]:
    config, log = folder / "recorder.yaml", folder / "log"
    config.write_text(yaml.safe_dump(document), encoding="utf-8")
    command = [*RECORDER, "run", "--config", str(config)]
    with log.open("wb") as stream, subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=stream) as process:
        samples = list(_samples(process))
    lines = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
    if process.returncode != 0:
        raise SystemExit(f"the recorder ended with {process.returncode}: {lines[-1]}")
    return samples, next(line for line in reversed(lines) if line["event"] == "recording_finished")


def _samples(process: subprocess.Popen[bytes]) -> Iterator[Sample]:
    own, start_s = Path(f"/proc/{process.pid}"), time.monotonic()
    while process.poll() is None:
        try:
            status = dict(line.split(":", 1) for line in (own / "status").read_text("ascii").splitlines())
            ticks = (own / "stat").read_text("ascii").rpartition(")")[2].split()[11:13]
            yield Sample(
                at_s=time.monotonic() - start_s,
                resident_mib=int(status["VmRSS"].split()[0]) / 1024,
                peak_mib=int(status["VmHWM"].split()[0]) / 1024,
                files=len(list((own / "fd").iterdir())),
                threads=int(status["Threads"]),
                processor_s=sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK"),
                loads_opencv="cv2" in (own / "maps").read_text("utf-8", "replace"),
            )
        except (FileNotFoundError, ProcessLookupError, KeyError):
            return  # it has just ended
        time.sleep(SAMPLE_S)
