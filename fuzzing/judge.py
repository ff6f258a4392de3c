"""Run a program on files in a process of its own, with limits, and say what it did that no input may make it do.

A program may fail, but with one of its exit codes and a sentence; it may not crash, hang, swell, or write anywhere but
where it was told to. The programs are loaded once, into a process that does nothing but fork: one that has run threads
before, as OpenCV does, would leave its child waiting for locks and threads that are not there.
"""

from __future__ import annotations

import csv
import gc
import json
import os
import resource
import signal
import subprocess
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import NoReturn, Self

from decoder.parallel.processes import ONE_EACH

ROOT = Path(__file__).parents[1]
LIMIT_S = 10  # of processor time; a busy machine is no fault
HANG_S = 120.0  # by the clock: for what sleeps
LIMIT_BYTES = 2**30  # above what the process had when it was forked
EXIT_CODES = frozenset((0, 1, 2, 3, 78))
FILE_MAX_BYTES = 2**30
_CRASHED, _WRONG_CONFIGURATION = 70, 78
_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")

Fault = str
Program = Callable[[], object]


@dataclass(frozen=True, slots=True)
class Target:
    """A command that is fuzzed.

    Attributes
    ----------
    words
        The program and its arguments; `in` holds the files that were made, `out` is where it may write.
    writes_beside
        Whether it is meant to write beside its input.
    fails_in_words
        Whether a failure is a sentence on stderr; a verdict stands on stdout.
    exit_codes
        With which it may end.
    """

    words: tuple[str, ...]
    writes_beside: bool = False
    fails_in_words: bool = True
    exit_codes: frozenset[int] = EXIT_CODES


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of one input: exit code (negative: the signal), processor time, memory, and what may not be."""

    code: int
    seconds: float
    memory_bytes: int
    said: str
    faults: tuple[Fault, ...]


class Judge:
    """Runs programs on files; a context manager that ends the process they are forked from.

    Parameters
    ----------
    programs
        What runs, by the first word of a command; has to be picklable.
    limit_s
        Of processor time that a program may take.
    """

    def __init__(self, programs: Mapping[str, Program] | None = None, limit_s: int = LIMIT_S) -> None:
        self._programs, self._limit_s = programs or PROGRAMS, limit_s

    def __enter__(self) -> Self:
        self._asks, answers = Pipe()
        with answers:
            command = [sys.executable, "-c", f"from fuzzing.judge import serve; serve({answers.fileno()})"]
            self._forking = subprocess.Popen(command, pass_fds=[answers.fileno()], cwd=ROOT)  # noqa: S603 - ourselves
        self._asks.send((self._programs, self._limit_s))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._asks.close()
        self._forking.wait()

    def __call__(self, target: Target, files: Mapping[str, bytes]) -> Outcome:
        """Run a command on files, by their names in `in`."""
        with TemporaryDirectory(prefix="fuzz-") as name:
            folder = Path(name)
            for file, content in files.items():
                path = folder / "in" / file
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)
                path.chmod(0o600)  # a key is to be its owner's alone
            before = _snapshot(folder)
            self._asks.send((target.words, folder))
            outcome: Outcome = self._asks.recv()
            faults = [
                *_faults(target, outcome, self._limit_s),
                *_strays(target, before, _snapshot(folder)),
                *_unreadable(folder / "out"),
            ]
            return replace(outcome, faults=tuple(faults))


def serve(descriptor: int) -> None:
    """Fork when asked to through a connection, until nobody is at its other end."""
    asked = Connection(descriptor)
    programs, limit_s = asked.recv()
    _load_programs()
    with suppress(EOFError):
        while True:
            words, folder = asked.recv()
            asked.send(_run(programs[words[0]], words, folder, limit_s))


def _load_programs() -> None:
    os.environ.update(ONE_EACH)
    import decoder.commands.cli  # noqa: PLC0415 - the thread limits must be set before
    import recorder.cli  # noqa: PLC0415

    for module, _ in (*decoder.commands.cli.COMMANDS.values(), *recorder.cli.COMMANDS.values()):
        __import__(module.partition(":")[0])
    for module in ("decoder.commands.flight_work", "decoder.parallel.worker", "decoder.calibration.march"):
        __import__(module)
    gc.freeze()


def _run(program: Program, words: Sequence[str], folder: Path, limit_s: int) -> Outcome:
    told, tells = os.pipe()
    child = os.fork()
    if child == 0:
        os.write(tells, _resident_bytes().to_bytes(8))
        _become(program, words, folder, limit_s)
    os.close(tells)
    with _killed_after(child, HANG_S):
        _, status, usage = os.wait4(child, 0)
    base_bytes = int.from_bytes(os.read(told, 8))
    os.close(told)
    printed = folder / "printed"
    said = printed.read_text(encoding="utf-8", errors="backslashreplace") if printed.exists() else ""
    printed.unlink(missing_ok=True)
    (folder / "page").unlink(missing_ok=True)
    swollen = max(usage.ru_maxrss * 1024 - base_bytes, 0)
    return Outcome(os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime, swollen, said, ())


def _become(program: Program, words: Sequence[str], folder: Path, limit_s: int) -> NoReturn:
    code = _CRASHED
    try:
        os.chdir(folder)
        for descriptor, file in ((1, "page"), (2, "printed")):
            opened = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(opened, descriptor)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        sys.stdout, sys.stderr = (open(number, "w", encoding="utf-8", closefd=False) for number in (1, 2))  # noqa: SIM115 - until the process ends
        most = _virtual_bytes() + LIMIT_BYTES
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s + 1))
        resource.setrlimit(resource.RLIMIT_FSIZE, (FILE_MAX_BYTES, FILE_MAX_BYTES))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        code = _exit_code(program, words)
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(code)


def _exit_code(program: Program, words: Sequence[str]) -> int:
    sys.argv = list(words)
    try:
        program()
    except SystemExit as done:
        return done.code if isinstance(done.code, int) else 0 if done.code is None else 1
    except BaseException:  # noqa: BLE001 - told as what it is: a crash
        traceback.print_exc()
        return _CRASHED
    return 0


def _decode() -> None:
    from decoder.start import main  # noqa: PLC0415 - loaded before, if anything is

    main()


def _recorder() -> None:
    from recorder.cli import main  # noqa: PLC0415

    main(prog_name="recorder")


PROGRAMS: Mapping[str, Program] = {"decode": _decode, "recorder": _recorder}


def _faults(target: Target, outcome: Outcome, limit_s: int) -> list[Fault]:
    faults = []
    if outcome.code == -signal.SIGXCPU:
        faults.append(f"it took more than {limit_s} s")
    elif outcome.code == -signal.SIGKILL:
        faults.append("it hung, or was killed")
    elif outcome.code not in target.exit_codes:
        faults.append(f"it ended with {outcome.code}")
    if "Traceback" in outcome.said or "MemoryError" in outcome.said:
        faults.append("it printed a traceback: " + outcome.said.strip().splitlines()[-1][:300])
    if outcome.memory_bytes > LIMIT_BYTES:
        faults.append(f"it took {outcome.memory_bytes / 1e6:.0f} MB")
    if outcome.code in (1, 78) and target.fails_in_words and not outcome.said.strip():
        faults.append("it failed without a word")
    if outcome.code == _WRONG_CONFIGURATION and len(outcome.said.strip().splitlines()) != 1:
        faults.append("it refused its configuration in other than one sentence")
    return faults


def _snapshot(folder: Path) -> dict[str, tuple[int, int]]:
    return {
        str(path.relative_to(folder)): (path.stat().st_size, path.stat().st_mtime_ns)
        for path in folder.rglob("*")
        if path.is_file()
    }


def _strays(target: Target, before: Mapping[str, tuple[int, int]], after: Mapping[str, tuple[int, int]]) -> list[Fault]:
    changed = [name for name in {*before, *after} if before.get(name) != after.get(name)]
    allowed = ("out/", "in/") if target.writes_beside else ("out/",)
    return [f"it wrote {name!r}" for name in sorted(changed) if not name.startswith(allowed)]


def _unreadable(folder: Path) -> list[Fault]:
    faults = []
    for path in folder.rglob("*") if folder.is_dir() else ():
        try:
            if path.suffix == ".json":
                json.loads(path.read_text(encoding="utf-8"))
            elif path.suffix == ".csv":
                with path.open(encoding="utf-8", newline="") as stream:
                    lengths = {len(row) for row in csv.reader(stream)}
                if len(lengths) != 1:
                    faults.append(f"{path.name} has rows of {sorted(lengths)} fields")
        except (ValueError, csv.Error, RecursionError) as error:
            faults.append(f"{path.name} cannot be read: {error}")
    return faults


def _virtual_bytes() -> int:
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * _PAGE_BYTES


def _resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * _PAGE_BYTES


@contextmanager
def _killed_after(child: int, seconds: float) -> Iterator[None]:
    def kill(_signal: int, _frame: object) -> None:
        os.kill(child, signal.SIGKILL)

    earlier = signal.signal(signal.SIGALRM, kill)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, earlier)
