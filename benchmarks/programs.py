"""Running `decode` as its users do, and what that costs."""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

FIXTURES = Path(__file__).parents[1] / "fixtures"
RENDERED = FIXTURES / "rendered"


# What the system reports of a child includes the parent that started it, so the child says itself what it held.
_DECODE_AND_SAY = """
from decoder.learning.fit import reader_from_panel
from decoder.commands.cli import main
try:
    main()
except SystemExit as done:
    if done.code:
        raise
with open("/proc/self/status", encoding="ascii") as status:
    print(next(line for line in status if line.startswith("VmHWM")))
"""

# What it costs to open a flight's pictures with OpenCV and to do nothing else with them.
_DECOMPRESS_AND_SAY = """
import sys, time
from pathlib import Path
import cv2
import numpy as np
from flight_file.reader import open_flight

cv2.setNumThreads(1)
jpegs = [frame.encoded for frame in open_flight([Path(sys.argv[1])]).frames()]
start = time.process_time()
for jpeg in jpegs:
    cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE)
print(time.process_time() - start)
"""

# What it costs to read the flight, from opened file and panel to flight data.
_READ_AND_SAY = """
import sys, time
from pathlib import Path
import cv2
from threadpoolctl import threadpool_limits
from decoder.learning.fit import reader_from_panel
from decoder.timeseries.flight_decoder import decode_flight
from decoder.panel.vocabulary import Method
from decoder.imaging.panel_pictures import panel_from_attachments
from decoder.instruments.panel_reader import PanelReader
from flight_file.reader import open_flight

cv2.setNumThreads(1)
with threadpool_limits(1):
    flight = open_flight([Path(sys.argv[1])])
    panel = panel_from_attachments(flight.attachments, flight=sys.argv[1])
    start = time.process_time()
    decode_flight(flight, reader_from_panel(panel, Method.NORMXCORR), iter)
    print(time.process_time() - start)
"""


def decode(flight: Path, folder: Path, *words: str) -> float:
    """Decodes a flight into a folder; gives the processor seconds that it took, of user and system together.

    Raises
    ------
    SystemExit
        If `decode` fails.
    """
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    _run([str(Path(sys.executable).parent / "decode"), str(flight), "-o", str(folder), *words])
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def peak_memory_mib(flight: Path, folder: Path) -> float:
    """The most memory that a decode of a flight held at once, MiB (Linux only).

    Raises
    ------
    SystemExit
        If `decode` fails.
    """
    said = _run([sys.executable, "-c", _DECODE_AND_SAY, str(flight), "-o", str(folder)])
    (line,) = (line for line in said.splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) / 1024


def decompressed_alone(flight: Path) -> float:
    """Merely decompresses a flight's pictures in grey with OpenCV in a process of its own; gives its processor seconds.

    Neither the process's start nor reading the file is counted.
    """
    return float(_run([sys.executable, "-c", _DECOMPRESS_AND_SAY, str(flight)]))


def read_alone(flight: Path) -> float:
    """Reads a flight in a process of its own; gives its processor seconds, without the process's start."""
    return float(_run([sys.executable, "-c", _READ_AND_SAY, str(flight)]))


def _run(command: list[str]) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command)} ended with {done.returncode}: {done.stderr}")
    return done.stdout
