"""The regression test: every committed flight, replayed and decoded, gives its reference flight data."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.programs import rows_of
from tests.references.replayed import FLIGHTS, needles_of, reference_of, replayed_flight_data

# Other versions of OpenCV and NumPy may round otherwise: a twentieth of the fixtures' own reading errors.
VALUE_PART = 2e-5
SCORE_TOLERANCE = 0.002
SIGMA_PART = 0.05
RENEW = "if the change is meant, renew the references with `make refs` and say why"


def test_every_flight_has_a_reference() -> None:
    """The references are those of the committed flights, and there are some."""
    assert len(FLIGHTS) >= 2
    assert sorted(path.stem for path in Path(__file__).parent.glob("*.csv")) == [flight.stem for flight in FLIGHTS]


@pytest.mark.parametrize("flight", FLIGHTS, ids=lambda path: path.stem)
def test_flight_data_are_the_reference(flight: Path, tmp_path: Path) -> None:
    """Frames, times and statuses are equal; values within 0.002 % of the largest, scores 0.002, sigmas 5 %."""
    expected, found = rows_of(reference_of(flight)), rows_of(replayed_flight_data(flight, tmp_path))

    for column in ("frame", "time_utc", "time_s", *(f"{name}_status" for name in needles_of(expected))):
        assert [row[column] for row in found] == [row[column] for row in expected], f"{column}: {RENEW}"
    for name in needles_of(expected):
        values = [float(row[name]) for row in expected if row[name]]
        near = {name: max(map(abs, values)) * VALUE_PART, f"{name}_score": SCORE_TOLERANCE}
        for column, tolerance in near.items():
            assert [float(row[column]) for row in found if row[column]] == pytest.approx(
                [float(row[column]) for row in expected if row[column]], abs=tolerance
            ), f"{column}: {RENEW}"
        sigmas = [[float(row[f"{name}_sigma"]) for row in rows if row[f"{name}_sigma"]] for rows in (found, expected)]
        assert sigmas[0] == pytest.approx(sigmas[1], rel=SIGMA_PART), f"{name}_sigma: {RENEW}"
