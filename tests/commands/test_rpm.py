"""`decode rpm`: from a film with sound to speeds, beside the tachometer of the flight data."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.programs import ran, rows_of
from tests.sounds import RATE_HZ, engine, mixed, noise, recorded, times_s
from tests.videos import film

ROOT = Path(__file__).parents[2]
SECONDS = 20
GOPRO = ROOT.parent / "shared" / "data" / "gopro" / "max-heromode.mp4"


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A film whose engine turns 2400 times a minute, AAC, made a flight."""
    folder, rng = tmp_path_factory.mktemp("rpm"), np.random.default_rng(7)
    rpm = np.full(SECONDS * RATE_HZ, 2400.0)
    sound = recorded(mixed(engine(rpm, rng, blades=2), noise(len(times_s(SECONDS)), rng, slope=1), 10))
    video = film(folder / "cockpit.mp4", ticks=range(0, SECONDS * 12_000, 12_000), sound=sound)
    assert ran("recorder", "replay", video, "-o", folder / "flight.mcap").returncode == 0
    return folder / "flight.mcap"


def tachometer(folder: Path, rpm: float, name: str = "engine_rpm") -> None:
    """Flight data beside the output, with a tachometer that shows this."""
    rows = [f"{second},,{second}.000000,{rpm},read,0.99,5.0" for second in range(SECONDS)]
    header = f"frame,time_utc,time_s,{name},{name}_status,{name}_score,{name}_sigma"
    (folder / "flight.csv").write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")


def test_film_becomes_speeds_over_time(tmp_path: Path, flight: Path) -> None:
    """A row for each window, with sigma and status; the same bytes each time."""
    words = ["rpm", flight, "--cylinders", "4", "--blades", "2", "-o"]
    done = ran("decode", *words, tmp_path / "rpm.csv")
    again = ran("decode", *words, tmp_path / "again.csv")
    rows = rows_of(tmp_path / "rpm.csv")
    rpm = np.array([float(row["rpm"]) for row in rows if row["rpm_status"] == "read"])

    assert done.returncode == again.returncode == 0
    assert "median 2400, sigma" in done.stdout
    assert len(rpm) > 0.95 * len(rows) > 70
    assert np.abs(rpm / 2400 - 1).max() < 0.005
    assert float(rows[0]["time_s"]) == pytest.approx(0.375, abs=0.03)
    assert {row["time_utc"] for row in rows} == {""}
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "rpm.csv").read_bytes()


@pytest.mark.parametrize(("shown", "beyond"), [(2400.0, 0), (2300.0, 1)])
def test_tachometer_that_disagrees_is_pointed_out_and_never_averaged(
    tmp_path: Path, flight: Path, shown: float, beyond: float
) -> None:
    """The flight data of that name beside the output are held against the sound, which stays as it is."""
    tachometer(tmp_path, shown)
    done = ran("decode", "rpm", flight, "--cylinders", "4", "--blades", "2", "-o", tmp_path / "rpm.csv", "--json")
    document = json.loads(done.stdout)
    (held,) = document["tachometers"]

    assert held["name"] == "engine_rpm"
    assert held["apart_rpm"] == pytest.approx(2400 - shown, abs=1)
    assert held["beyond"] / held["windows"] == pytest.approx(beyond, abs=0.05)
    assert document["rpm"]["median"] == pytest.approx(2400, abs=1)


def test_what_is_ambiguous_is_listed(tmp_path: Path, flight: Path) -> None:
    """Nothing is known of the engine: no value, and the speeds that it may be."""
    done = ran("decode", "rpm", flight, "-o", tmp_path / "rpm.csv")

    assert done.returncode == 0
    assert "no speed can be found from the sound" in done.stdout
    assert "ambiguous: about " in done.stdout
    assert "2400" in done.stdout.split("ambiguous: about ")[1]
    assert {row["rpm"] for row in rows_of(tmp_path / "rpm.csv")} == {""}


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["fixtures/thesis_a1.mcap", "--cylinders", "4"], "holds no sound: it was not made from a film"),
        (["fixtures/thesis_a1.mcap", "--cylinders", "0", "--blades", "0"], "there is nothing to hear"),
        (["fixtures/thesis_a1.mcap", "--range", "3000-500"], "no range from a speed to a higher one"),
    ],
)
def test_what_cannot_be_done_is_said_in_a_sentence(words: list[str], sentence: str) -> None:
    """Of a flight without a film, and of options that make no sense."""
    done = ran("decode", "rpm", ROOT / words[0], *words[1:])

    assert done.returncode != 0
    assert sentence in " ".join(done.stderr.split())


def test_silent_film_is_named(tmp_path: Path) -> None:
    """The film has no sound: that is what is said, not that something failed."""
    video = film(tmp_path / "silent.mp4")
    ran("recorder", "replay", video, "-o", tmp_path / "flight.mcap")
    done = ran("decode", "rpm", tmp_path / "flight.mcap", "--cylinders", "4")

    assert done.returncode == 1
    assert "flight.mcap: holds no sound: silent.mp4 has none" in done.stderr


@pytest.mark.shared
@pytest.mark.skipif(not GOPRO.exists(), reason="needs the shared pictures")
@pytest.mark.parametrize("known", [[], ["--cylinders", "4", "--blades", "2"], ["--cylinders", "6"]])
def test_film_of_no_engine_gives_no_speed(tmp_path: Path, known: list[str]) -> None:
    """A real action camera's, with a faint steady hum of 58 Hz in it."""
    ran("recorder", "replay", GOPRO, "-o", tmp_path / "flight.mcap")
    done = ran("decode", "rpm", tmp_path / "flight.mcap", *known, "-o", tmp_path / "rpm.csv")

    assert done.returncode == 0, done.stderr
    assert {row["rpm_status"] for row in rows_of(tmp_path / "rpm.csv")} == {"missing"}
