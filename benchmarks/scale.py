"""`python -m benchmarks.scale [--write]`: measures one core, says what an archive takes; --write puts it into docs/."""

from __future__ import annotations

import json
import math
import re
import statistics
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.archive import (
    HOUR_S,
    MONTH_S,
    NIGHT_S,
    Archive,
    Measured,
    Prices,
    Site,
    core_s,
    cores,
    decode_dollars,
    fed_cores,
    fetch_s,
    least_s,
    network_bps,
    processes,
    storage_dollars_month,
    stored_bytes,
)
from benchmarks.fleet_simulation import drawn_flights, simulate
from benchmarks.pages import machine, markdown
from benchmarks.programs import RENDERED
from decoder.fleet.flights import FleetFlight
from decoder.fleet.one_flight import decode_one
from decoder.fleet.order import Order, make_order
from decoder.fleet.outcome import State
from decoder.pictures import grey_picture
from flight_file.frame import ClockReading, Frame
from flight_file.reader import Flight, open_flight
from flight_file.reports import CameraStatus
from flight_file.segments import FlightWriter, Plan

PAGE = Path(__file__).parents[1] / "docs" / "scale.md"
FLIGHTS = ("plain", "reflections", "table_3_2")
ROUNDS = 5
SHORT_FRAMES = 40
SEED = 2018

YEAR = Archive(flights=10_000 * 1000, flight_s=3600.0, rate_hz=4.0)
DAY = replace(YEAR, flights=YEAR.flights // 365)
SITE = Site(link_bps=1e9, store_bps=math.inf)
SPARE = 1.25  # what the store gives, times what is taken from it on average
SOURCES = {
    "a disk, 200 MB/s": 200e6,
    "a SATA SSD, 500 MB/s": 500e6,
    "an NVMe SSD, 3 GB/s": 3e9,
    "a network of 1 Gbit/s": 1e9 / 8,
    "a network of 10 Gbit/s": 10e9 / 8,
    "a network of 100 Gbit/s": 100e9 / 8,
}
PRICES = Prices(core_hour=0.04, terabyte_month=23.0, million_reads=0.4, million_writes=5.0)
CASES = {
    "all of it in a night of 10 hours": (YEAR, NIGHT_S),
    "all of it in a month of 30 days": (YEAR, MONTH_S),
    "what one day adds, in a night": (DAY, NIGHT_S),
}
MOST_PROCESSES, MOST_FLIGHTS = 250, 50_000  # in a simulation


def measured() -> Measured:
    """Decodes the rendered flights as a worker of a fleet does, and short pieces, which tell the cost of a flight."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        order = make_order(
            str(folder / "out"), method="normxcorr", formats=("csv",), with_images=False, panel=None, camera=None
        )
        wholes = [RENDERED / f"{flight}.mcap" for flight in FLIGHTS]
        shorts = [_shortened(open_flight([path]), folder / path.stem) for path in wholes]
        counts = [open_flight([path]).count() for path in wholes]
        rounds = [[_decode_ms(path, order) for path in [*wholes, *shorts]] for _ in range(ROUNDS)]
        best = [min(took) for took in zip(*rounds, strict=True)]
        whole_ms, short_ms = sum(best[: len(wholes)]), sum(best[len(wholes) :])
        frame_ms = (whole_ms - short_ms) / (sum(counts) - SHORT_FRAMES * len(wholes))
        speeds = [took / count for each in rounds for took, count in zip(each[: len(wholes)], counts, strict=True)]
        results = [path for path in (folder / "out").rglob("*.*") if path.parent.name in FLIGHTS]
        return Measured(
            frame_ms=_short(frame_ms),
            flight_ms=_short((short_ms - SHORT_FRAMES * len(wholes) * frame_ms) / len(wholes)),
            decompress_ms=_short(_decompress_ms(wholes)),
            frame_bytes=_short(sum(path.stat().st_size for path in wholes) / sum(counts)),
            result_bytes=_short(sum(path.stat().st_size for path in results) / sum(counts)),
            spread=tuple(sorted(round(speed / statistics.fmean(speeds), 3) for speed in speeds)),
        )


def _shortened(flight: Flight, folder: Path) -> Path:
    folder.mkdir()
    frames: Sequence[Frame] = list(flight.sample_frames(SHORT_FRAMES))
    writer = FlightWriter(
        Plan(folder, replace(flight.session, chain=""), flight.attachments, segment_ns=10**15),
        status=CameraStatus("connected"),
        at=ClockReading(0, 0),
    )
    for number, frame in enumerate(frames):
        writer.write_frame(frame, ClockReading(number, number))
    (path,) = writer.finish("stopped", ClockReading(len(frames), len(frames)))
    return path.rename(folder / f"{folder.name}_short.mcap")


def _decode_ms(path: Path, order: Order) -> float:
    anew = replace(order, output=f"{order.output}/{time.monotonic_ns()}")
    start = time.process_time()
    outcome = decode_one(FleetFlight(path.stem, (str(path),)), anew)
    took_ms = (time.process_time() - start) * 1e3
    if outcome.status is not State.DECODED:
        raise SystemExit(f"{path}: {outcome.reason}")
    return took_ms


def _decompress_ms(paths: Sequence[Path]) -> float:
    jpegs = [frame.jpeg for path in paths for frame in open_flight([path]).frames()]
    rounds = []
    for _ in range(ROUNDS):
        start = time.process_time()
        for jpeg in jpegs:
            grey_picture(jpeg)
        rounds.append((time.process_time() - start) * 1e3 / len(jpegs))
    return min(rounds)


def page(found: Measured, where: str) -> str:
    """docs/scale.md: everything in it follows from what was measured, on which machine, and the constants above."""
    sections = [_head(where), _one_core(found), _limits(found), _archive(found), _simulation(found), _assumed(found)]
    return "\n".join(sections)


def _head(where: str) -> str:
    return f"""# Scale

Written by `python -m benchmarks.scale --write`. {where}

What it takes to decode the archive of 10,000 aircraft that flew 1,000 hours each, photographed four times a second:
{YEAR.frames:.3g} frames of 1024 x 768 with seven needles, in flights of an hour. A test repeats the
arithmetic. Prices and networks are assumptions, stated below.
"""


def _one_core(found: Measured) -> str:
    rows = [
        ["processor time a frame", f"{found.frame_ms:.2f} ms"],
        ["of that, opening the picture", f"{found.decompress_ms:.2f} ms, {_share(found)}"],
        ["processor time a flight besides (panel, needles and pivots are learned)", f"{found.flight_ms / 1e3:.2f} s"],
        ["flight file, a frame", f"{found.frame_bytes / 1e3:.1f} kB"],
        ["flight data, a frame", f"{found.result_bytes / 1e3:.2f} kB"],
        ["a million frames", f"{found.frame_ms * 1e3 / HOUR_S:.2f} core-hours, {found.frame_bytes / 1e3:.1f} GB"],
    ]
    return f"""## One core

The rendered flights, with and without reflections, as a worker of a fleet decodes them; the least of {ROUNDS} rounds.

{markdown(["what", "measured"], rows)}
"""


def _limits(found: Measured) -> str:
    rows = [[name, f"{fed_cores(found, rate):.0f}"] for name, rate in SOURCES.items()]
    rate_mb_s = found.frame_bytes / found.frame_ms / 1e3
    return f"""## What limits

A core takes {rate_mb_s:.0f} MB/s of flight file. Up to so many cores the processor limits, beyond them what feeds it:

{markdown(["fed by", "cores"], rows)}

Of the processor's time {_share(found)} is opening pictures, which no reading of them can save. To scheduler
and index a flight is some kilobytes, and a core takes {_flight_s(found):.0f} s for it.
"""


def _archive(found: Measured) -> str:
    frames, each_s, wait_s = YEAR.frames_in_flight, _flight_s(found), fetch_s(found, YEAR, SITE)
    rows = [_case_row(found, name) for name in CASES]
    dollars = [
        ["decoding all of it, once", f"{decode_dollars(found, YEAR, PRICES):,.0f}"],
        ["decoding what one day adds", f"{decode_dollars(found, DAY, PRICES):,.0f}"],
        ["keeping the flight files, a month", f"{storage_dollars_month(found, YEAR, PRICES):,.0f}"],
    ]
    return f"""## The archive

- Frames: 10,000 aircraft x 1,000 h x 3,600 s x 4 Hz = {YEAR.frames:.3g}, in {YEAR.flights:,} flights of {frames:,.0f}.
- A flight: {frames:,.0f} x {found.frame_ms:.2f} ms + {found.flight_ms / 1e3:.2f} s = {each_s:.1f} s of a core.
- Core-hours: {YEAR.flights:,} x {each_s:.1f} s / 3,600 = {core_s(found, YEAR) / HOUR_S:,.0f}.
- Flight files: {YEAR.frames:.3g} x {found.frame_bytes / 1e3:.1f} kB = {stored_bytes(found, YEAR) / 1e15:.1f} PB.
- Flight data: {YEAR.frames:.3g} x {found.result_bytes / 1e3:.2f} kB = {YEAR.frames * found.result_bytes / 1e12:.0f} TB.
- A process fetches a flight ({frames * found.frame_bytes / 1e9:.2f} GB, {wait_s:.1f} s at 1 Gbit/s) before decoding it.
  So that no core waits, there are more processes than cores: cores x (1 + {wait_s:.1f} / {each_s:.1f}).

{markdown(["what", "frames", "core-hours", "cores", "processes", "Gbit/s"], rows)}

{markdown(["what", "US dollars"], dollars)}

A night for everything asks more of the network than of processors; what one day adds is a night's work for a few
machines. Keeping the pictures for a month costs more than decoding them once.

The program that is started holds its flights' names, 1 kB each, and the scheduler a connection to each worker: an
archive of this size is decoded in parts, by month or by aircraft. No cluster larger than two workers was tried.
"""


def _case_row(found: Measured, name: str) -> list[str]:
    archive, within_s = CASES[name]
    return [
        name,
        f"{archive.frames:.3g}",
        f"{core_s(found, archive) / HOUR_S:,.0f}",
        f"{cores(found, archive, within_s):,}",
        f"{processes(found, archive, SITE, within_s):,}",
        f"{network_bps(found, archive, within_s) / 1e9:,.1f}",
    ]


def _simulation(found: Measured) -> str:
    rows = [_simulated_row(found, name) for name in CASES]
    header = ["what", "flights", "processes", "arithmetic, h", "simulated, h", "difference", "decoding"]
    return f"""## Checked by a simulation

`benchmarks/fleet_simulation.py` plays a fleet in events: flights of different lengths (log-normal), their speeds drawn
from those measured, processes that share the store's network, and an end at which most of them have nothing left to
do. Where there would be more than {MOST_PROCESSES} processes, they and the store are made smaller together,
and no more than {MOST_FLIGHTS:,} flights are played.

{markdown(header, rows)}

`decoding` is the part of all processes' time in which they decode; the rest is fetching, and the end of the run.
"""


def _simulated_row(found: Measured, name: str) -> list[str]:
    part, site, workers = scaled(found, *CASES[name])
    run = simulate(drawn_flights(found, part, SEED), site, workers)
    expected_s = least_s(found, part, site, workers)
    return [
        name,
        f"{part.flights:,}",
        f"{workers}",
        f"{expected_s / HOUR_S:,.2f}",
        f"{run.elapsed_s / HOUR_S:,.2f}",
        f"{run.elapsed_s / expected_s - 1:+.1%}",
        f"{run.busy:.0%}",
    ]


def scaled(found: Measured, archive: Archive, within_s: float) -> tuple[Archive, Site, int]:
    """A part of an archive that can be played in a second, with processes and store as large in proportion."""
    wanted = processes(found, archive, SITE, within_s)
    divisor = math.ceil(wanted / MOST_PROCESSES)
    site = replace(SITE, store_bps=network_bps(found, archive, within_s) * SPARE / divisor)
    return replace(archive, flights=min(archive.flights // divisor, MOST_FLIGHTS)), site, wanted // divisor


def _assumed(found: Measured) -> str:
    return f"""## Assumed, and measured

- A core-hour costs {PRICES.core_hour} dollars, a terabyte a month {PRICES.terabyte_month:.0f},
  a million reads {PRICES.million_reads}, a million writes {PRICES.million_writes:.0f}:
  the order of large clouds' list prices in 2026. Traffic between store and machines of one region is free there;
  elsewhere it may cost more than all the rest.
- A process gets {SITE.link_bps / 1e9:.0f} Gbit/s, and the store {SPARE - 1:.0%} more than is taken on average.
- Frames are the animation's, JPEGs of 1024 x 768 of {found.frame_bytes / 1e3:.0f} kB. Larger pictures take more
  room, network and time to open them; the time to read them hardly grows.

The measurements that all of this is made of:

```json
{json.dumps(asdict(found))}
```
"""


def _share(found: Measured) -> str:
    return f"{found.decompress_ms / found.frame_ms:.0%}"


def _flight_s(found: Measured) -> float:
    return core_s(found, YEAR) / YEAR.flights


def measured_in(text: str) -> Measured:
    """The measurements that a page was made of."""
    (block,) = re.findall(r"^```json\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    values = json.loads(block)
    return Measured(**{**values, "spread": tuple(values["spread"])})


def main(words: list[str]) -> None:
    """Prints, and with --write writes, the page."""
    found = measured()
    text = page(found, machine())
    sys.stdout.write(text)
    if "--write" in words:
        PAGE.write_text(text, encoding="utf-8")


def _short(value: float) -> float:
    """Four digits are more than can be measured."""
    return round(value, 3 - math.floor(math.log10(abs(value)))) if value else 0.0


if __name__ == "__main__":
    main(sys.argv[1:])
