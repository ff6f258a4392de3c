"""Accuracy on pictures that nobody of us made: a simulator's cockpit, a filmed steam gauge, photographs of a gauge.

They lie beside the checkout (`../shared/data`) and never in it; without them there is nothing to measure. The panels
are in `panels`, written as a user writes them. Beside our numbers stand those of ppf.angauge in the same run.
"""

from __future__ import annotations

import csv
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from benchmarks.angauge import values_by_needle
from benchmarks.error_plot import Track
from benchmarks.programs import decode
from decoder.accuracy import CONFIDENCE_SIGMAS
from decoder.arrays import Floats
from decoder.panel_pictures import panel_from_file
from decoder.quantity import Quantity
from decoder.reading import Status
from decoder.tables import Table, read_table
from fixtures.recordings import record_flight

PICTURES = Path(__file__).parents[2] / "shared" / "data"
PANELS = Path(__file__).with_name("panels")
QUALITY = 95


@dataclass(frozen=True, slots=True)
class Source:
    """Some pictures in a row, their panel, the picture it is drawn on, and what is known of them.

    `tolerance` is the column with the doubt of a truth that was read by eye; without it the truth is exact.
    """

    title: str
    pictures: str
    panel: str
    panel_picture: str
    truth: str
    tolerance: str | None = None


SOURCES = (
    Source(
        "simulator cockpit, camera fixed",
        "simulator/engine/*.jpg",
        "cessna_172p.yaml",
        "simulator/engine/0000.jpg",
        "simulator/engine_truth.csv",
    ),
    Source(
        "simulator cockpit, camera moving",
        "simulator/engine_shake/*.jpg",
        "cessna_172p.yaml",
        "simulator/engine/0000.jpg",
        "simulator/engine_shake_truth.csv",
    ),
    Source("steam gauge", "boiler/*.jpg", "boiler.yaml", "boiler/0456.jpg", "boiler/truth.csv", "uncertainty_psi"),
    Source(
        "pressure gauge",
        "pressure_gauge/*.png",
        "pressure_gauge.yaml",
        "pressure_gauge/0004.png",
        "pressure_gauge/truth.csv",
        "uncertainty_mpa",
    ),
)


@dataclass(frozen=True, slots=True)
class Read:
    """One needle over a source, errors in percent of full scale; NaN where there is nothing to average.

    Attributes
    ----------
    frames, compared
        Of the source, and those with a truth.
    valued, read
        Parts of all frames.
    mean, largest
        Mean and largest error over frames with status `read`.
    within_95
        Part of the compared frames with a value whose truth lies within 1.96 sigma, or within the doubt of a truth
        that was read by eye.
    theirs_valued, theirs_mean
        The same of ppf.angauge, over its valued frames.
    """

    needle: str
    frames: int
    compared: int
    valued: float
    read: float
    mean: float
    largest: float
    within_95: float
    theirs_valued: float
    theirs_mean: float


def available() -> list[Source]:
    """The sources whose pictures are there."""
    return [source for source in SOURCES if (PICTURES / source.truth).exists()]


@dataclass(frozen=True, slots=True)
class Series:
    """A needle over a flight: values and sigmas in its unit, NaN where missing, and where the status is `read`."""

    name: str
    full_scale: float
    value: Floats
    sigma: Floats
    is_read: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Decoded:
    """A source's flight data beside its truth.

    Attributes
    ----------
    panel, pictures
        What it was decoded with and from.
    series, truth, tolerance
        One for each needle that has a truth; the truth in the pictures' order, NaN where there is none; the doubt of a
        truth that was read by eye, 0 elsewhere.
    """

    panel: Path
    pictures: list[Path]
    series: list[Series]
    truth: list[Floats]
    tolerance: Floats


def decode_source(source: Source, folder: Path, *, every: int = 1) -> Decoded:
    """Records a source's pictures in a folder, all or one of so many of them, and decodes the flight."""
    pictures = _as_jpegs(sorted(PICTURES.glob(source.pictures))[::every], folder / "pictures")
    panel = _with_picture(source, folder)
    record_flight(pictures, panel, folder / "flight.mcap")
    decode(folder / "flight.mcap", folder)
    flight = read_table(folder / "flight.csv")
    truth = _truth(source, [picture.stem for picture in pictures])
    known = [quantity for quantity in panel_from_file(panel).panel.quantities if quantity.name in truth]
    return Decoded(
        panel=panel,
        pictures=pictures,
        series=[_series(flight, quantity) for quantity in known],
        truth=[truth[quantity.name] for quantity in known],
        tolerance=truth.get("tolerance", np.zeros(len(pictures))),
    )


def reads(decoded: Decoded, theirs: Mapping[str, Floats] | None = None) -> list[Read]:
    """Every needle held against the truth, and beside it what another program read of it, if that is given."""
    nothing = np.full(len(decoded.pictures), np.nan)
    return [
        _read(series, truth, decoded.tolerance, (theirs or {}).get(series.name, nothing))
        for series, truth in zip(decoded.series, decoded.truth, strict=True)
    ]


def seen_tracks(decoded: Decoded) -> list[Track]:
    """Every needle's errors over the flight; the doubt of a truth that was read by eye widens the band."""
    return [
        Track(
            series.name,
            (series.value - truth) / series.full_scale * 100,
            (CONFIDENCE_SIGMAS * series.sigma + decoded.tolerance) / series.full_scale * 100,
        )
        for series, truth in zip(decoded.series, decoded.truth, strict=True)
    ]


@dataclass(frozen=True, slots=True)
class Seen:
    """A source, measured: what was read beside what ppf.angauge reads, and the errors over the flight."""

    reads: list[Read]
    tracks: list[Track]


def measure_source(source: Source, folder: Path) -> Seen:
    """Decodes a source in a folder, reads it with ppf.angauge too, and holds both against the truth."""
    decoded = decode_source(source, folder)
    return Seen(reads(decoded, angauge_values(decoded)), seen_tracks(decoded))


def angauge_values(decoded: Decoded) -> Mapping[str, Floats]:
    """What ppf.angauge reads on the same dials."""
    return values_by_needle(panel_from_file(decoded.panel), (picture.read_bytes() for picture in decoded.pictures))


def _series(flight: Table, quantity: Quantity) -> Series:
    return Series(
        quantity.name,
        quantity.full_scale,
        flight.numbers(quantity.name),
        flight.numbers(f"{quantity.name}_sigma"),
        np.array(flight.columns[f"{quantity.name}_status"]) == Status.READ,
    )


def _read(series: Series, truth: Floats, tolerance: Floats, theirs: Floats) -> Read:
    error, their_error = np.abs(series.value - truth), np.abs(theirs - truth)
    known, valued, found = np.isfinite(truth), np.isfinite(error), np.isfinite(their_error)
    read = error[series.is_read & known] / series.full_scale * 100
    within = error[valued] <= CONFIDENCE_SIGMAS * series.sigma[valued] + tolerance[valued]
    return Read(
        needle=series.name,
        frames=len(truth),
        compared=int(known.sum()),
        valued=float(np.isfinite(series.value).mean()),
        read=float(series.is_read.mean()),
        mean=_mean(read),
        largest=float(read.max(initial=0.0)),
        within_95=_mean(within.astype(float)),
        theirs_valued=float(found.sum() / max(known.sum(), 1)),
        theirs_mean=_mean(their_error[found]) / series.full_scale * 100,
    )


def _mean(values: Floats) -> float:
    return float(values.mean()) if values.size else float("nan")


def _truth(source: Source, stems: list[str]) -> dict[str, Floats]:
    """By column the truth in the pictures' order, NaN where a picture has none; the doubt under `tolerance`."""
    with (PICTURES / source.truth).open(encoding="utf-8", newline="") as stream:
        rows = {Path(row["file"]).stem: row for row in csv.DictReader(stream)}
    names = next(iter(rows.values())).keys() - {"file", "frame", "time_s"}
    columns = {name: np.array([_number(rows.get(stem, {}).get(name)) for stem in stems]) for name in names}
    return columns if source.tolerance is None else columns | {"tolerance": columns[source.tolerance]}


def _number(field: str | None) -> float:
    try:
        return float(field or "nan")
    except ValueError:
        return float("nan")


def _as_jpegs(pictures: list[Path], folder: Path) -> list[Path]:
    """The pictures as a camera would have sent them: JPEGs are copied, others compressed."""
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for picture in pictures:
        target = folder / f"{picture.stem}.jpg"
        if picture.suffix == ".jpg":
            shutil.copyfile(picture, target)
        else:
            Image.open(picture).convert("RGB").save(target, "JPEG", quality=QUALITY)
        made.append(target)
    return made


def _with_picture(source: Source, folder: Path) -> Path:
    """The panel and its picture, beside each other."""
    (folder / "panel").mkdir(parents=True, exist_ok=True)
    _as_jpegs([PICTURES / source.panel_picture], folder / "panel")
    return Path(shutil.copyfile(PANELS / source.panel, folder / "panel" / "panel.yaml"))
