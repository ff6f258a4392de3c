"""Touching pairs: two needles of one dial at any distance, read in many frames at once as by the gauge reader."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from decoder.many_frames import ManyFrames, PlacedFrame
from decoder.panel_reader import PanelReader
from decoder.pictures import GreyPicture
from decoder.reading import Status

Draw = Callable[..., GreyPicture]
APART_DEG = np.concatenate([np.arange(-20.0, 20.5, 1.3), [-0.4, -0.2, 0.0, 0.2, 0.4]]).tolist()


@pytest.mark.parametrize("cover_deg", [119.0, 233.3, 300.0, 417.0])
def test_pairs_are_read_as_the_gauge_reader_reads_them(reader: PanelReader, draw: Draw, cover_deg: float) -> None:
    """Also at the ends of the scale: no status differs, and no angle by more than a hundredth of a degree."""
    panel, tuning = reader.source.panel, reader.tuning
    frames = [draw({"al_lb": cover_deg + apart, "fr_lb": cover_deg}) for apart in APART_DEG]
    whole = [True] * len(panel.gauges)
    placed = [PlacedFrame(frame, reader.aligner.align(frame), whole) for frame in frames]
    quick, slow = (
        ManyFrames(panel.gauges, reader.grids, tuning, reader._gauges, is_quick=is_quick).read(placed)
        for is_quick in (True, False)
    )

    statuses = set()
    for one, other in zip(quick, slow, strict=True):
        for own, expected in zip(one, other, strict=True):
            for name, reading in own.items():
                statuses.add(reading.status)
                assert reading.status is expected[name].status
                assert reading.angle_deg == pytest.approx(expected[name].angle_deg, abs=0.01)
    assert statuses >= {Status.READ, Status.EDGE, Status.HIDDEN}
