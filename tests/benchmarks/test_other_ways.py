"""The methods that the benchmarks compare with work: a comparison with something broken would be meaningless."""

from __future__ import annotations

import pytest

from benchmarks.plain_way import Correlate, PlainWay, with_opencv, with_skimage
from decoder.imaging.panel_pictures import panel_from_attachments
from flight_file.reader import open_flight
from tests.programs import A1, FIXTURES, rows_of


@pytest.mark.parametrize(("correlate", "frames"), [(with_opencv, 8), (with_skimage, 2)])
def test_thesis_way_reads_the_animation(correlate: Correlate, frames: int) -> None:
    """Within a degree of each needle's angle, as the rows of its unwrapped gauges allow."""
    flight = open_flight([A1])
    source = panel_from_attachments(flight.attachments, flight=A1.name)
    way = PlainWay(source, correlate)
    truth = rows_of(FIXTURES / "thesis_a1_truth.csv")
    widest = {
        needle.name: max(
            abs((after[1] - before[1]) / (after[0] - before[0]))
            for before, after in zip(gauge.scale, gauge.scale[1:], strict=False)
        )
        for gauge in source.panel.gauges
        for needle in gauge.needles
    }

    for frame, row in list(zip(flight.frames(), truth, strict=True))[:frames]:
        for name, value in way.read(frame.encoded).items():
            assert value == pytest.approx(float(row[name]), abs=1.5 * widest[name]), name
