"""Displays in a cockpit that others drew, made worse by blur, noise, drifting exposure and reflections."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from benchmarks.real_pictures import PICTURES
from decoder.imaging.unwrapping import WindowGrid
from decoder.instruments.kinds.windows.digits import DigitsReader
from decoder.instruments.kinds.windows.display import Row, in_picture
from decoder.instruments.reading import Status
from decoder.panel.arrays import Floats
from decoder.panel.kinds.digits import Digits
from decoder.panel.window import Corners
from tests.programs import rows_of

COCKPIT = PICTURES / "cockpit_flight"
SHOWN_IN = 78
EVERY = 3
# Column of the truth, its pattern, what picture 78 shows, and the corners there.
DISPLAYS: dict[str, tuple[str, str, Corners]] = {
    "txt_com1_use": ("000.000", "121.725", ((1219.5, 415.5), (1281.0, 413.0), (1279.5, 429.5), (1217.5, 432.0))),
    "txt_nav1_stby": ("000.00", "110.35", ((1433.0, 409.5), (1483.5, 407.5), (1482.5, 423.5), (1432.0, 426.0))),
    "txt_adf_right": ("000", "415", ((1344.0, 644.5), (1389.0, 641.5), (1388.0, 663.0), (1343.0, 665.5))),
    "txt_dme_right": ("##0", " 31", ((1431.5, 723.5), (1472.5, 721.0), (1471.5, 740.5), (1430.5, 743.0))),
    "txt_kap140": ("00 000", "10 500", ((1364.5, 813.5), (1419.0, 810.0), (1418.0, 824.2), (1363.5, 827.5))),
}

pytestmark = [
    pytest.mark.shared,
    pytest.mark.skipif(not COCKPIT.exists(), reason="needs ../shared/data, which is not part of the project"),
]


def sampled(grid: WindowGrid, flight: str, number: int) -> Floats:
    """(R, C): a display in one picture."""
    picture = cv2.imread(str(COCKPIT / flight / f"f{number:04d}.jpg"), cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    x, y = grid.points()
    return cv2.remap(picture, x, y, cv2.INTER_LINEAR).astype(np.float32)


@pytest.mark.slow
@pytest.mark.parametrize("column", DISPLAYS)
def test_what_is_read_is_right_and_nearly_all_is(column: str) -> None:
    """Nothing false is read; drawn on a sharp picture, 97 of 100 blurred ones are read."""
    pattern, shows, corners = DISPLAYS[column]
    digits, grid = Digits(name="own", pattern=pattern, shows=shows), WindowGrid.of(corners, Digits.margin_part)
    row = Row(digits.symbols, np.array(digits.before, float), digits.points, np.array(digits.may_be_blank))
    truth = [row[column] for row in rows_of(COCKPIT / "flight_a_truth.csv")][::EVERY]
    strips = np.stack([sampled(grid, "flight_a_real", number * EVERY) for number in range(len(truth))])
    display = in_picture(sampled(grid, "flight_a", SHOWN_IN), row, grid.margin)
    assert display is not None

    found = [own["own"] for own in DigitsReader(digits, display.taught(strips)).read(strips, np.zeros(len(strips)))]

    read = [(one.angle_deg, shown) for one, shown in zip(found, truth, strict=True) if one.status is Status.READ]
    assert [value for value, _ in read] == pytest.approx([float(shown) for _, shown in read])
    assert len(read) >= 0.97 * sum(bool(shown) for shown in truth)
