"""Accuracy on pictures by others: a simulator's cockpit, a filmed steam gauge, photographs of a gauge, borrowed dials.

They lie beside the checkout (`../shared/data`) and never in it; without them there is nothing to measure. The panels
are in `panels`, written as a user writes them. The last six are in it: instruments that others drew, filmed by a
camera of ours (`fixtures/borrowed`), all of whose frames `make fixtures` renders. Beside our numbers stand those of
ppf.angauge in the same run.
"""

from __future__ import annotations

import csv
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from benchmarks.angauge import values_by_needle
from benchmarks.error_plot import Track
from benchmarks.programs import FIXTURES, decode
from decoder.imaging.panel_pictures import panel_from_file
from decoder.instruments.reading import Status
from decoder.panel.arrays import Floats
from decoder.panel.scale import Quantity
from decoder.panel.thresholds import CONFIDENCE_SIGMAS
from decoder.timeseries.tables import Table, read_table
from fixtures.recordings import record_flight

PICTURES = Path(__file__).parents[2] / "shared" / "data"
PANELS = Path(__file__).with_name("panels")
QUALITY = 95
GROSS_PCT_FS = 2.0


@dataclass(frozen=True, slots=True)
class Source:
    """Some pictures in a row, their panel, the picture it is drawn on, and what is known of them.

    Attributes
    ----------
    pictures, panel_picture, truth
        In `folder`; a row of the truth is of the picture that it names, or else of the one with its number.
    tolerance
        The column with the doubt of a truth that was read by eye; without it the truth is exact.
    renamed
        Columns of the truth by the name that the panel has for them.
    stops
        Values at which a needle has its stops: it shows no more.
    same_view
        Whether the camera stood still, and the panel picture is one of the pictures.
    """

    title: str
    pictures: str
    panel: Path
    panel_picture: str
    truth: str
    tolerance: str | None = None
    renamed: Mapping[str, str] = field(default_factory=dict)
    stops: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    same_view: bool = True
    folder: Path = PICTURES


STOPS = {"vsi_fpm": (-2000.0, 2000.0), "slip_ball": (-1.6233, 1.6233)}
FLIGHT_A = PICTURES / "cockpit_flight" / "flight_a_panel.yaml", "cockpit_flight/flight_a_panel.jpg"


def borrowed(title: str, flight: str, picture: str) -> Source:
    """A flight over borrowed instruments, whose panel was drawn on one of its frames."""
    home = f"borrowed/{flight}"
    return Source(
        title,
        f"rendered/{home}/*.jpg",
        FIXTURES / home / "panel.yaml",
        f"{home}/{picture}",
        f"{home}/truth.csv",
        same_view=False,
        folder=FIXTURES,
    )


BORROWED = (
    borrowed("borrowed instruments, daylight", "daylight", "0032.jpg"),
    borrowed("borrowed instruments, oblique with reflections", "oblique", "0004.jpg"),
    borrowed("borrowed instruments, night", "night", "0008.jpg"),
)
ATTITUDES = (
    borrowed("borrowed attitude indicator, daylight", "attitude_daylight", "0010.jpg"),
    borrowed("borrowed attitude indicator, oblique", "attitude_oblique", "0005.jpg"),
    borrowed("borrowed attitude indicator, night", "attitude_night", "0005.jpg"),
)
SOURCES = (
    Source(
        "simulator cockpit, camera fixed",
        "simulator/engine/*.jpg",
        PANELS / "cessna_172p.yaml",
        "simulator/engine/0000.jpg",
        "simulator/engine_truth.csv",
    ),
    Source(
        "simulator cockpit, camera moving",
        "simulator/engine_shake/*.jpg",
        PANELS / "cessna_172p.yaml",
        "simulator/engine/0000.jpg",
        "simulator/engine_shake_truth.csv",
        same_view=False,
    ),
    Source(
        "simulator flight, oblique",
        "cockpit_flight/flight_a/*.jpg",
        *FLIGHT_A,
        "cockpit_flight/flight_a_truth.csv",
        renamed={"clock_s": "clock_local_s"},
        stops=STOPS,
    ),
    Source(
        "simulator flight, bad lens",
        "cockpit_flight/flight_a_real/*.jpg",
        *FLIGHT_A,
        "cockpit_flight/flight_a_real_truth.csv",
        renamed={"clock_s": "clock_local_s"},
        stops=STOPS,
    ),
    Source(
        "simulator's attitude indicator, oblique",
        "cockpit_flight/flight_a/*.jpg",
        PANELS / "flight_a_attitude.yaml",
        "cockpit_flight/flight_a_panel.jpg",
        "cockpit_flight/flight_a_truth.csv",
    ),
    Source(
        "simulator's attitude indicator, bad lens",
        "cockpit_flight/flight_a_real/*.jpg",
        PANELS / "flight_a_attitude.yaml",
        "cockpit_flight/flight_a_panel.jpg",
        "cockpit_flight/flight_a_real_truth.csv",
    ),
    Source(
        "simulator flight, six instruments",
        "cockpit_flight/sixpack_a/*.jpg",
        PANELS / "sixpack.yaml",
        "cockpit_flight/sixpack_a/f0020.jpg",
        "cockpit_flight/sixpack_a_truth.csv",
        stops=STOPS,
    ),
    Source(
        "simulator's attitude indicator, straight on",
        "cockpit_flight/sixpack_a/*.jpg",
        PANELS / "sixpack_attitude.yaml",
        "cockpit_flight/sixpack_a/f0020.jpg",
        "cockpit_flight/sixpack_a_truth.csv",
    ),
    Source(
        "steam gauge",
        "boiler/*.jpg",
        PANELS / "boiler.yaml",
        "boiler/0456.jpg",
        "boiler/truth.csv",
        "uncertainty_psi",
    ),
    Source(
        "pressure gauge",
        "pressure_gauge/*.png",
        PANELS / "pressure_gauge.yaml",
        "pressure_gauge/0004.png",
        "pressure_gauge/truth.csv",
        "uncertainty_mpa",
    ),
    Source(
        "tachometer at night",
        "tachometer/[0-9]*.jpg",
        PICTURES / "tachometer/panel.yaml",
        "tachometer/panel.jpg",
        "tachometer/truth.csv",
        "doubt",
    ),
    Source(
        "thermometer, rolled",
        "thermometer/t*.jpg",
        PICTURES / "thermometer/panel.yaml",
        "thermometer/panel.jpg",
        "thermometer/truth.csv",
        "doubt",
    ),
    Source(
        "vacuum gauge, pivot below the picture",
        "penning/[0-9]*.jpg",
        PICTURES / "penning/panel.yaml",
        "penning/panel.jpg",
        "penning/truth.csv",
        "doubt",
    ),
    *BORROWED,
    *ATTITUDES,
)


@dataclass(frozen=True, slots=True)
class Read:
    """One needle over a source, errors in percent of full scale; NaN where there is nothing to average.

    Attributes
    ----------
    frames, compared
        Of the source, and those with a truth.
    valued, read
        Parts of all frames; where the truth was logged, of those in which it shows anything.
    mean, largest
        Mean and largest error over frames with status `read`.
    gross
        Frames with status `read` that are more than `GROSS_PCT_FS` off, beyond the doubt of a truth read by eye, or in
        which nothing is shown, as on a dark display.
    within_95, bridged_within_95
        Part of the compared frames with a value, and with an interpolated one, whose truth lies within 1.96 sigma and
        the doubt of a truth that was read by eye.
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
    gross: int
    within_95: float
    bridged_within_95: float
    theirs_valued: float
    theirs_mean: float


def available() -> list[Source]:
    """The sources whose pictures are there."""
    return [source for source in SOURCES if any(source.folder.glob(source.pictures))]


@dataclass(frozen=True, slots=True)
class Series:
    """A needle over a flight: values and sigmas in its unit, NaN where missing, and the statuses."""

    name: str
    full_scale: float
    wraps: float | None
    value: Floats
    sigma: Floats
    status: NDArray[np.str_]

    def error(self, truth: Floats) -> Floats:
        """Value less truth, the short way round where values begin again."""
        off = self.value - truth
        return off if self.wraps is None else (off + self.wraps / 2) % self.wraps - self.wraps / 2


@dataclass(frozen=True, slots=True)
class Decoded:
    """A source's flight data beside its truth.

    Attributes
    ----------
    panel, pictures
        What it was decoded with and from.
    series, truth, tolerance
        One for each needle that has a truth; the truth in the pictures' order, NaN where there is none; the doubt of
        a truth that was read by eye, 0 elsewhere.
    """

    panel: Path
    pictures: list[Path]
    series: list[Series]
    truth: list[Floats]
    tolerance: Floats


def decode_source(source: Source, folder: Path, *, every: int = 1) -> Decoded:
    """Records a source's pictures in a folder, all or one of so many of them, and decodes the flight."""
    taken = sorted(source.folder.glob(source.pictures))
    pictures = _as_jpegs(taken[::every], folder / "pictures")
    panel = _with_picture(source, folder)
    record_flight(pictures, panel, folder / "flight.mcap")
    decode(folder / "flight.mcap", folder)
    flight = read_table(folder / "flight.csv")
    truth = {name: each[::every] for name, each in truth_of(source, [picture.stem for picture in taken]).items()}
    known = [quantity for quantity in panel_from_file(panel).panel.quantities if quantity.name in truth]
    shown = {name: np.clip(values, *source.stops.get(name, (-np.inf, np.inf))) for name, values in truth.items()}
    return Decoded(
        panel=panel,
        pictures=pictures,
        series=[_series(flight, quantity) for quantity in known],
        truth=[shown[quantity.name] for quantity in known],
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
            series.error(truth) / series.full_scale * 100,
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
        quantity.wraps,
        flight.numbers(quantity.name, quantity.written),
        flight.numbers(f"{quantity.name}_sigma") if quantity.is_measured else np.zeros(len(flight.columns["frame"])),
        np.array(flight.columns[f"{quantity.name}_status"]),
    )


def _read(series: Series, truth: Floats, tolerance: Floats, theirs: Floats) -> Read:
    error, their_error = np.abs(series.error(truth)), np.abs(theirs - truth)
    known, valued, found = np.isfinite(truth), np.isfinite(error), np.isfinite(their_error)
    # Where the truth was logged, a frame without one shows nothing, such as a dark display: no value is right there.
    shows = known if not tolerance.any() and known.any() else np.ones_like(known)
    is_read, is_bridged = series.status == Status.READ, series.status == Status.INTERPOLATED
    pct_fs = 100 / series.full_scale
    is_wrong = ((error - np.nan_to_num(tolerance)) * pct_fs > GROSS_PCT_FS) | ~shows
    within = error <= CONFIDENCE_SIGMAS * series.sigma + tolerance
    return Read(
        needle=series.name,
        frames=len(truth),
        compared=int(known.sum()),
        valued=float(np.isfinite(series.value)[shows].mean()),
        read=float(is_read[shows].mean()),
        mean=_mean(error[is_read & known] * pct_fs),
        largest=float((error[is_read & known] * pct_fs).max(initial=0.0)),
        gross=int((is_wrong & is_read).sum()),
        within_95=_mean(within[valued].astype(float)),
        bridged_within_95=_mean(within[valued & is_bridged].astype(float)),
        theirs_valued=float(found.sum() / max(known.sum(), 1)),
        theirs_mean=_mean(their_error[found]) * pct_fs,
    )


def _mean(values: Floats) -> float:
    return float(values.mean()) if values.size else float("nan")


def truth_of(source: Source, stems: Sequence[str]) -> dict[str, Floats]:
    """By column the truth in the pictures' order, NaN where a picture has none; the doubt under `tolerance`."""
    with (source.folder / source.truth).open(encoding="utf-8", newline="") as stream:
        rows = {
            Path(row["file"]).stem if "file" in row else stems[int(row["frame"])]: row for row in csv.DictReader(stream)
        }
    names = next(iter(rows.values())).keys() - {"file", "frame", "time_s"}
    columns = {name: np.array([_number(rows.get(stem, {}).get(name)) for stem in stems]) for name in names}
    columns |= {name: columns[theirs] for name, theirs in source.renamed.items()}
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
    _as_jpegs([source.folder / source.panel_picture], folder / "panel")
    return Path(shutil.copyfile(source.panel, folder / "panel" / "panel.yaml"))
