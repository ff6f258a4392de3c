"""`decode explain` from the command line."""

from __future__ import annotations

import json
from pathlib import Path

from tests.programs import ran

ROW = "0,2018-05-04T12:00:00Z,0.0,51.2,read,0.99,0.5\n"
NEEDLE = {"gauge": "dial", "unit": "kt", "scale_min": 0, "scale_max": 200}
EVEN = {"drawn": 0.3, "pivot": 0.0, "viewed": 0.4, "placed": 0.0}


def test_a_script_gets_the_budget_as_json_and_a_person_in_words(tmp_path: Path) -> None:
    """The same; which frame is meant must be said."""
    flight = tmp_path / "flight.csv"
    flight.write_text("frame,time_utc,time_s,ias_kt,ias_kt_status,ias_kt_score,ias_kt_sigma\n" + ROW)
    flight.with_suffix(".json").write_text(json.dumps({"needles": {"ias_kt": {**NEEDLE, "uncertainty": EVEN}}}))

    words, script = (ran("decode", "explain", flight, "ias_kt", "--at", "0", *more) for more in ((), ("--json",)))
    undecided = ran("decode", "explain", flight, "ias_kt")

    assert [round(share["part"], 2) for share in json.loads(script.stdout)["shares"]] == [0.64, 0.36]
    assert "64%   0.4       parallax between the moving part and the marks" in words.stdout
    assert "95 %     50.2 to 52.2 kt" in words.stdout
    assert (undecided.returncode, "give --frame or --at" in undecided.stderr) == (2, True)


def test_a_csv_alone_tells_what_it_can_and_names_what_is_not_beside_it(tmp_path: Path) -> None:
    """Its value and its band are there; what they are made of is not."""
    flight = tmp_path / "flight.csv"
    flight.write_text("frame,time_utc,time_s,ias_kt,ias_kt_status,ias_kt_score,ias_kt_sigma\n" + ROW)

    told = ran("decode", "explain", flight, "ias_kt", "--frame", "0")

    assert (told.returncode, "95 %     50.2 to 52.2" in told.stdout) == (0, True)
    assert "put flight.json next to the CSV" in told.stdout
