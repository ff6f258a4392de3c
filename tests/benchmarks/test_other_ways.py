"""What the benchmarks compare with does what it is for: a comparison with something broken would say nothing."""

from __future__ import annotations

import csv

import pytest
import yaml

from benchmarks.plain_way import Correlate, PlainWay, with_opencv, with_skimage
from benchmarks.sized_flights import Repeated, panel_of
from decoder.imaging.panel_pictures import panel_from_attachments
from decoder.panel.panel import parse_panel
from flight_file.reader import open_flight
from tests.programs import A1, FIXTURES


@pytest.mark.parametrize(("correlate", "frames"), [(with_opencv, 20), (with_skimage, 2)])
def test_thesis_way_reads_the_animation(correlate: Correlate, frames: int) -> None:
    """Within a degree of what each needle shows, which is what a row of its unwrapped gauges allows."""
    flight = open_flight([A1])
    source = panel_from_attachments(flight.attachments, flight=A1.name)
    way = PlainWay(source, correlate)
    with (FIXTURES / "thesis_a1_truth.csv").open(encoding="utf-8", newline="") as stream:
        truth = list(csv.DictReader(stream))
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


@pytest.mark.parametrize("needles", [7, 24])
def test_panel_of_more_needles_is_a_panel(needles: int) -> None:
    """Its gauges stand where they stood, at the size of the pictures, each under a name of its own."""
    panel = parse_panel(yaml.safe_dump(panel_of(1.578125, needles)))
    first = parse_panel((FIXTURES / "panel.yaml").read_text(encoding="utf-8"))

    assert sum(len(gauge.needles) for gauge in panel.gauges) == needles
    assert panel.gauges[0].centre[0] == pytest.approx((first.gauges[0].centre[0] + 0.5) * 1.578125 - 0.5)
    assert {gauge.radius[1] for gauge in panel.gauges} == {52 * 1.578125}


def test_repeated_flight_goes_on_with_the_same_pictures() -> None:
    """Each time with numbers and times of their own, four a second."""
    frames = list(Repeated(open_flight([A1]), 45).frames())

    assert [frame.sequence for frame in frames] == list(range(45))
    assert frames[41].encoded == frames[1].encoded
    assert frames[41].captured_ns - frames[1].captured_ns == 10_000_000_000
