"""`decode accuracy` against a flight data recorder with names, units and a clock of its own."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.programs import ran

OFFSET_S = -41.37
NAMES = "ias_kt: {name: IAS, unit: km/h}\nn1_pct: N1\n"


def curve(time_s: float, phase: float) -> float:
    """A smooth value between 60 and 140 without a period."""
    return float(100 + 20 * np.sin(time_s / 7.3 + phase) + 20 * np.sin(time_s / 3.1 + 2 * phase))


@pytest.fixture
def tables(tmp_path: Path) -> tuple[Path, Path, Path]:
    """Flight data, the recorder's table at 1 Hz in its own time of the day, and the mapping."""
    lines = ["frame,time_utc,time_s," + ",".join(f"{n},{n}_status,{n}_score,{n}_sigma" for n in ("ias_kt", "n1_pct"))]
    for frame in range(400):
        time_s = frame * 0.25
        utc = f"2018-05-04T12:{int(time_s) // 60:02d}:{time_s % 60:09.6f}Z"
        cells = ",".join(f"{curve(time_s, phase):.4f},read,0.99,0.05" for phase in (0.0, 1.0))
        lines.append(f"{frame},{utc},{time_s},{cells}")
    needle = {"scale_min": 0, "scale_max": 200}
    (tmp_path / "flight.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "flight.json").write_text(
        json.dumps({"needles": {"ias_kt": {"unit": "kt"} | needle, "n1_pct": {"unit": "%"} | needle}})
    )
    rows = ["TIME,IAS,N1"]
    for second in range(-5, 106):
        own = 12 * 3600 + second - OFFSET_S
        clock = f"{int(own // 3600):02d}:{int(own % 3600 // 60):02d}:{own % 60:05.2f}"
        rows.append(f"{clock},{curve(second, 0.0) * 1.852:.2f},{curve(second, 1.0):.2f}")
    (tmp_path / "fdr.csv").write_text("\n".join(rows) + "\n")
    (tmp_path / "names.yaml").write_text(NAMES)
    return tmp_path / "flight.csv", tmp_path / "fdr.csv", tmp_path / "names.yaml"


def test_offset_is_shown_and_not_applied(tables: tuple[Path, Path, Path]) -> None:
    """Without `--offset` the curves' offset is told with its uncertainty, and nothing is added."""
    flight, fdr, names = tables
    done = ran("decode", "accuracy", flight, fdr, "--map", names, "--time", "TIME")
    words = done.stdout.splitlines()[0]

    assert done.returncode == 0, done.stderr
    assert words.startswith("clock: nothing was added to the truth's times; the curves suggest -41.3")
    assert "sigma 0.0" in words
    assert words.endswith("to apply it: --offset auto")


def test_offset_is_applied_on_demand(tables: tuple[Path, Path, Path]) -> None:
    """`--offset auto` and the number itself give errors that are the interpolation's; both say what was added."""
    flight, fdr, names = tables
    for offset in ("auto", str(OFFSET_S)):
        done = ran("decode", "accuracy", flight, fdr, "--map", names, "--time", "TIME", "--offset", offset, "--json")
        found = json.loads(done.stdout)

        assert found["clock"]["applied_s"] == pytest.approx(OFFSET_S, abs=0.02)
        assert found["clock"]["told"]["offset_s"] == pytest.approx(OFFSET_S, abs=0.02)
        assert 0 < found["clock"]["told"]["sigma_s"] < 0.05
        assert {row["needle"]: row["by_status"]["all"]["mean_abs"] < 0.5 for row in found["needles"]} == {
            "ias_kt": True,
            "n1_pct": True,
        }


def test_limits_are_judged_with_their_sources(tables: tuple[Path, Path, Path]) -> None:
    """Each parameter passes or fails by the published tables, which are named in full."""
    flight, fdr, names = tables
    words = ["accuracy", flight, fdr, "--map", names, "--time", "TIME", "--limits"]
    good, bad = (ran("decode", *words, "--offset", offset) for offset in ("auto", "-30"))
    table = [line.split() for line in good.stdout.splitlines() if line.startswith(("ias_kt", "n1_pct"))]

    assert [line[-1] for line in table if "14" in line or "EASA" in line] == ["pass"] * 8
    assert "14 CFR Part 135 Appendix C" in good.stdout
    assert "what the recording may add" in good.stdout
    assert "EASA Easy Access Rules for Air Operations, AMC5 CAT.IDE.A.190" in good.stdout
    assert [line.split()[-1] for line in bad.stdout.splitlines() if "EASA AMC5" in line][:2] == ["fail", "fail"]


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (["--offset", "soon"], 2, "'soon' is neither auto nor a number of seconds"),
        (["--offset", "auto", "--window", "10"], 1, "--offset SECONDS"),
        (["--time", "CLOCK"], 1, "has no column CLOCK"),
    ],
)
def test_what_cannot_be_done_says_why(tables: tuple[Path, Path, Path], words: list[str], code: int, says: str) -> None:
    """A wrong offset, a window too small and a column that is not there are a sentence each."""
    flight, fdr, names = tables
    done = ran("decode", "accuracy", flight, fdr, "--map", names, "--time", "TIME", *words)

    assert done.returncode == code
    assert says in done.stderr


def test_columns_that_are_left_out_are_named(tables: tuple[Path, Path, Path], tmp_path: Path) -> None:
    """A needle that the truth does not have, and one that has no value where the truth has one; JSON stays as it is."""
    flight, _, _ = tables
    truth = tmp_path / "truth.csv"
    truth.write_text("frame,ias_kt\n0,100\n1,101\n")
    lines = flight.read_text().splitlines()
    head = lines[0].split(",")
    rows = [dict(zip(head, line.split(","), strict=True)) for line in lines[1:]]
    blank = {"ias_kt": "", "ias_kt_status": "missing", "ias_kt_sigma": ""}
    flight.write_text("\n".join([lines[0], *(",".join((row | blank).values()) for row in rows)]) + "\n")
    done = ran("decode", "accuracy", flight, truth, "--json")

    assert "n1_pct left out: the truth has no such column" in done.stderr
    assert "ias_kt left out: it has no value where the truth has one" in done.stderr
    json.loads(done.stdout)
