"""A double of rpicam-vid: takes the options that it has, refuses others, and writes pictures and metadata as it does.

It does what the JSON in the variable RPICAM says:

| key      | meaning                                                        |
| -------- | -------------------------------------------------------------- |
| source   | file with the pictures, one after the other                    |
| sizes    | how many bytes each of them has                                |
| skip     | numbers of pictures that the sensor takes and nobody gets      |
| then     | after the last: `wait` (sends no more), `exit` with an error   |
| metadata | `txt`, `none`, or `wrong`: times of another clock              |
| lacks    | an option that it is too old for                               |
| ledger   | file that gets a line for each picture: its sensor's time, ns  |
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import sys
import time
from pathlib import Path
from typing import IO

EXPOSURE_US, FRAME_US = 8_000, 20_000
SWITCHES = ("--nopreview", "--flush", "--inline")
OPTIONS = (
    "--camera --codec --output --timeout --metadata --metadata-format --rotation --framerate --shutter --gain"
    " --awbgains --flicker-period --width --height --autofocus-mode --lens-position --quality --intra --bitrate"
)


def installed(folder: Path, pictures: list[bytes], **plan: object) -> str:
    """Make it a program in a folder, which shows these pictures and does what the plan says; return its path."""
    (folder / "source").write_bytes(b"".join(pictures))
    sizes = list(map(len, pictures))
    told = {"source": str(folder / "source"), "sizes": sizes, "ledger": str(folder / "ledger"), **plan}
    path = folder / "rpicam-vid"
    command = f'RPICAM={shlex.quote(json.dumps(told))} exec {sys.executable} -I {__file__} "$@"'
    path.write_text(f"#!/bin/sh\n{command}\n")
    path.chmod(0o755)
    return str(path)


def asked(*, lacks: str = "") -> argparse.Namespace:
    """The command line, as strictly as boost's program_options take it."""
    parser = argparse.ArgumentParser(allow_abbrev=False)
    for name in SWITCHES:
        parser.add_argument(name, action="store_true")
    for name in OPTIONS.split():
        if name != lacks:
            parser.add_argument(name)
    wanted, unknown = parser.parse_known_args()
    if unknown:
        sys.exit(f"ERROR: *** unrecognised option '{unknown[0]}' ***")
    return wanted


def record(metadata: IO[str], sensor_ns: int) -> None:
    """Write the metadata of a picture, in the format `txt`."""
    values = {
        "ExposureTime": EXPOSURE_US,
        "ColourGains": "[ 1.6, 2.3 ]",
        "SensorTimestamp": sensor_ns,
        "FrameDuration": FRAME_US,
    }
    for name, value in values.items():
        metadata.write(f"{name}={value}\n")
        metadata.flush()
    metadata.write("\n")
    metadata.flush()


def main() -> None:
    """Write the pictures at the rate that was asked for."""
    plan = json.loads(os.environ["RPICAM"])
    wanted = asked(lacks=plan.get("lacks", ""))
    sys.stderr.write("[0:08:34.894] [1857]  INFO Camera camera_manager.cpp:293 libcamera v0.6\n")
    assert (wanted.metadata_format, wanted.output, wanted.timeout) == ("txt", "-", "0")
    content = Path(plan["source"]).read_bytes()
    sensor_ns, position = time.monotonic_ns(), 0
    with Path(wanted.metadata).open("w") as metadata, Path(plan["ledger"]).open("a", encoding="utf-8") as ledger:
        for number, size in enumerate(plan["sizes"]):
            sensor_ns += FRAME_US * 1000 * (1 + plan.get("skip", []).count(number))
            time.sleep(max(0.0, (sensor_ns + 5_000_000 - time.monotonic_ns()) / 1e9))
            ledger.write(f"{sensor_ns}\n")
            ledger.flush()
            sys.stdout.buffer.write(content[position : position + size])
            sys.stdout.buffer.flush()
            position += size
            if plan.get("metadata", "txt") != "none":
                record(metadata, sensor_ns + (10**15 if plan.get("metadata") == "wrong" else 0))
        if plan.get("then") == "exit":
            sys.exit("[0:08:35.1] [1861] ERROR: *** failed to acquire camera imx708@1a ***")
        time.sleep(600)


if __name__ == "__main__":
    main()
