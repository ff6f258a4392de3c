"""`decode rpm FLIGHT`: the engine's speed by its sound, a tachometer independent of the panel's."""

from __future__ import annotations

import csv
import math
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import IO, Any

import click
import numpy as np

from decoder.commands.options import end_with_losses, flights_argument
from decoder.outputs.csv_output import utc_text
from decoder.outputs.outputs import as_text, output_name, refuse_overwriting, write_all
from decoder.panel.errors import SoundMissing, TableError
from decoder.timeseries.engine_sound import Engine, EngineSpeed, SpeedStatus, engine_speed
from decoder.timeseries.tables import flight_table, read_table
from decoder.timeseries.truth_comparison import HeldAgainstSound, held_against_sound
from flight_file.frame import NS_PER_S, SoundPeaks
from flight_file.reader import Flight, open_flight
from flight_file.untrusted import say, say_json

_MORE = "--cylinders, --blades and --range narrow it down"
_MOST_OFTEN = 3
COLUMNS = (
    "time_utc",
    "time_s",
    "rpm",
    "rpm_status",
    "rpm_sigma",
    "rpm_evidence",
    "rpm_lead",
    "rpm_others",
)
EPILOG = """\b
A firing is every cylinder once in two turns: 4 cylinders fire as often as 2 blades without a gear pass by. What the
sound cannot tell apart has no value, and the possible speeds are listed; more options narrow them down.

\b
rpm_status   read, ambiguous (see rpm_others) or missing; rpm_sigma is one standard deviation
rpm_evidence how much better the speed explains the sound around than chance does, rpm_lead than any other (nats)

\b
Exit codes: 0 done, 1 failed, 2 wrong usage, 3 done with loss (the flight file is damaged or unfinished).

\b
Examples:
  decode rpm flight.mcap --cylinders 4 --blades 2
  decode rpm flight.mcap -o results/rpm.csv --cylinders 4 --blades 3 --gearing 2.43 --range 1400-5800
  decode rpm flight.mcap --cylinders 0 --blades 4 --gearing 15 --range 12000-34000
"""


def _range(_context: click.Context, _option: click.Parameter, value: str) -> tuple[float, float]:
    try:
        low, high = map(float, value.split("-"))
    except ValueError as error:
        raise click.BadParameter(f"{value!r} is not like 500-3500") from error
    if not 0 < low < high < math.inf:
        raise click.BadParameter(f"{value!r} is no range from a speed to a higher one")
    return low, high


@click.command("rpm", epilog=EPILOG)
@flights_argument
@click.option(
    "-o", "--output", "file", type=click.Path(path_type=Path, dir_okay=False), metavar="CSV",
    help="Where the speeds go.  [default: NAME_rpm.csv in the current folder]",
)  # fmt: skip
@click.option(
    "--cylinders",
    type=click.IntRange(0, 48),
    metavar="N",
    help="Of a four-stroke engine; 0 for none: a turbine, a motor.",
)
@click.option("--blades", type=click.IntRange(0, 16), metavar="N", help="Of the propeller; 0 if none can be heard.")
@click.option(
    "--gearing", type=click.FloatRange(0.01, 100), default=1.0, show_default=True, metavar="RATIO",
    help="Turns of the engine for each turn of the propeller.",
)  # fmt: skip
@click.option(
    "--range", "rpm_range", callback=_range, default="500-3500", show_default=True, metavar="LOW-HIGH",
    help="The engine's slowest and fastest speed, rpm.",
)  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print JSON for a script to read.")
def command(
    flights: tuple[Path, ...],
    file: Path | None,
    *,
    cylinders: int | None,
    blades: int | None,
    gearing: float,
    rpm_range: tuple[float, float],
    as_json: bool,
) -> None:
    """Read the engine's speed out of the sound of FLIGHT, which was made of a film.

    Flight data of that name beside CSV are held against it: each tachometer that is among them. The two are never
    averaged.
    """
    if cylinders == 0 and blades == 0:
        raise click.UsageError("without cylinders and blades there is nothing to hear; leave one of the two out")
    flight = open_flight(flights)
    file = file or Path(f"{output_name(flight)}_rpm.csv")
    flight_data = file.parent / f"{output_name(flight)}.csv"
    refuse_overwriting([*flight.paths, flight_data], [file])
    peaks = [sound for sound in flight.heard() if isinstance(sound, SoundPeaks)]
    if not peaks:
        raise SoundMissing(_why_silent(flight))
    speed = engine_speed(peaks, Engine(cylinders, blades, gearing, rpm_range))
    began_ns = flight.captured_ns(0) or 0
    beside = _beside(flight_data, speed, began_ns)
    knows_time = flight.session.knows_time_of_day

    def write(stream: IO[str]) -> None:
        write_speeds(speed, stream, began_ns=began_ns, knows_time_of_day=knows_time)

    (written,) = write_all(file.parent, {file.name: as_text(write)})
    if as_json:
        say_json(_document(speed, beside, written))
    else:
        say(*_lines(speed, beside), "", str(written))
    end_with_losses(flight.losses)


def _why_silent(flight: Flight) -> str:
    originals = flight.session.originals
    name = flight.paths[0].name
    if not originals:
        return f"{name}: holds no sound: it was not made from a film; `recorder replay` makes a flight file from one"
    if not any(original.has_sound for original in originals):
        return f"{name}: holds no sound: {originals[0].name} has none"
    return (
        f"{name}: holds no sound, or less than a second; make it again from {originals[0].name} with `recorder replay`"
    )


def _beside(flight_data: Path, speed: EngineSpeed, began_ns: int) -> list[HeldAgainstSound]:
    """Compare the tachometers of the flight data beside the output with the sound; none without such data."""
    try:
        return held_against_sound(flight_table(read_table(flight_data)), speed, began_ns)
    except TableError as error:
        if flight_data.exists():
            say(f"not compared with the tachometer: {error}", err=True)
        return []


def write_speeds(speed: EngineSpeed, stream: IO[str], *, began_ns: int, knows_time_of_day: bool) -> None:
    """Write one row for each window of sound; times count from the flight's first frame, as in its flight data."""
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row, time_ns in enumerate(speed.time_ns.tolist()):
        numbers = (speed.rpm[row], 2), (speed.sigma[row], 3)
        rpm, sigma = (f"{number:.{places}f}" if math.isfinite(number) else "" for number, places in numbers)
        writer.writerow(
            [
                utc_text(time_ns) if knows_time_of_day else "",
                f"{(time_ns - began_ns) / NS_PER_S:.6f}",
                rpm,
                speed.status[row].value,
                sigma,
                f"{speed.evidence[row]:.1f}",
                f"{speed.lead[row]:.1f}",
                ";".join(map(str, speed.others[row])),
            ]
        )


def _counts(speed: EngineSpeed) -> dict[str, int]:
    counted = Counter(speed.status)
    return {status.value: counted[status] for status in SpeedStatus}


def _often(speed: EngineSpeed) -> list[list[int]]:
    """List possible speeds, to a hundred rpm, the most frequent first."""
    counted = Counter(tuple(sorted({100 * round(each / 100) for each in others})) for others in speed.others if others)
    return [list(others) for others, _ in counted.most_common(_MOST_OFTEN)]


def _lines(speed: EngineSpeed, beside: list[HeldAgainstSound]) -> list[str]:
    counts = _counts(speed)
    words = ", ".join(f"{count} {status}" for status, count in counts.items())
    lines = [f"{len(speed.status)} windows of sound: {words}"]
    if counts[SpeedStatus.READ.value]:
        known = speed.rpm[np.isfinite(speed.rpm)]
        sigma = float(np.nanmedian(speed.sigma))
        lines.append(
            f"engine: {known.min():.0f} to {known.max():.0f} rpm, median {np.median(known):.0f}, sigma {sigma:.1f}"
        )
    else:
        lines.append("engine: no speed can be found from the sound")
    lines += [f"ambiguous: about {' or '.join(map(str, others))} rpm; {_MORE}" for others in _often(speed)]
    return lines + [one.words for one in beside]


def _document(speed: EngineSpeed, beside: list[HeldAgainstSound], written: Path) -> Any:  # noqa: ANN401 - what JSON may be
    known = speed.rpm[np.isfinite(speed.rpm)]
    return {
        "windows": _counts(speed),
        "rpm": {"min": float(known.min()), "median": float(np.median(known)), "max": float(known.max())}
        if known.size
        else None,
        "ambiguous_rpm": _often(speed),
        "tachometers": [asdict(one) for one in beside],
        "file": str(written),
    }
