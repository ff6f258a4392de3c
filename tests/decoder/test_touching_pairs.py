"""Touching pairs: two needles of one dial at any distance, read in many frames at once as by the gauge reader."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from decoder.flight_tuning import tune
from decoder.many_frames import ManyFrames, PlacedFrame
from decoder.panel_reader import PanelReader
from decoder.pictures import GreyPicture
from decoder.reading import Status

Draw = Callable[..., GreyPicture]
# What templates of a single picture leave of two needles that touch.
KNOWN_DEG = 0.35
APART_DEG = np.concatenate([np.arange(-20.0, 20.5, 1.3), [-0.4, -0.2, 0.0, 0.2, 0.4]]).tolist()


@pytest.fixture(scope="module")
def tuned(reader: PanelReader, draw: Draw) -> PanelReader:
    """The drawn cockpit's reader, fitted to frames of it."""
    rng = np.random.default_rng(5)
    places_deg = rng.uniform(125.0, 415.0, (24, 2)).tolist()
    return tune(
        reader,
        [draw({"al_lb": al, "fr_lb": fr}, noise=2.0, seed=seed) for seed, (al, fr) in enumerate(places_deg)],
    )


@pytest.mark.parametrize("cover_deg", [119.0, 233.3, 300.0, 417.0])
def test_pairs_are_read_as_the_gauge_reader_reads_them(reader: PanelReader, draw: Draw, cover_deg: float) -> None:
    """Also at the ends of the scale: no status differs, and no angle by more than three hundredths of a degree."""
    panel, tuning = reader.source.panel, reader.tuning
    frames = [draw({"al_lb": cover_deg + apart, "fr_lb": cover_deg}) for apart in APART_DEG]
    whole = [True] * len(panel.gauges)
    placed = [PlacedFrame(frame, reader.aligner.align(frame), whole) for frame in frames]
    surely = np.zeros((len(frames), len(whole)))
    quick, slow = (
        ManyFrames(panel.gauges, reader.grids, tuning, reader._gauges, is_quick=is_quick).read(placed, surely)
        for is_quick in (True, False)
    )

    statuses = set()
    for one, other in zip(quick, slow, strict=True):
        for own, expected in zip(one, other, strict=True):
            for name, reading in own.items():
                statuses.add(reading.status)
                assert reading.status is expected[name].status
                assert reading.angle_deg == pytest.approx(expected[name].angle_deg, abs=0.03)
    assert statuses >= {Status.READ, Status.EDGE, Status.HIDDEN}


@pytest.mark.parametrize("cover_deg", [233.3, 300.0])
def test_pairs_at_any_distance_are_read_many_at_once(tuned: PanelReader, draw: Draw, cover_deg: float) -> None:
    """Also where the lower needle draws the upper one's peak aside, or lies just out of its reach.

    Between these distances the upper needle may not match by itself: that is for the gauge reader.
    """
    panel, whole = tuned.source.panel, [True] * len(tuned.source.panel.gauges)
    apart_deg = np.array([*APART_DEG, 13.2, 13.55])
    frames = [draw({"al_lb": cover_deg + apart, "fr_lb": cover_deg}, noise=2.0, seed=7) for apart in apart_deg]
    quick = ManyFrames(panel.gauges, tuned.grids, tuned.tuning, tuned._gauges, is_quick=True)._quick
    assert quick is not None
    plain = quick.read([PlacedFrame(frame, tuned.aligner.align(frame), whole).quick(quick.grids) for frame in frames])
    fuel = [number for number, needle in enumerate(quick.needles) if needle.name in {"al_lb", "fr_lb"}]

    assert plain.settled[(abs(apart_deg) < 6.0) | (abs(apart_deg) > 13.0)][:, fuel].all()


def test_what_is_read_of_a_pair_does_not_depend_on_the_frames_beside_it(tuned: PanelReader, draw: Draw) -> None:
    """To the last bit, the uncertainty too."""
    panel, whole = tuned.source.panel, [True] * len(tuned.source.panel.gauges)
    frames = [draw({"al_lb": 300.0 + apart, "fr_lb": 300.0}, noise=2.0, seed=7) for apart in APART_DEG]
    quick = ManyFrames(panel.gauges, tuned.grids, tuned.tuning, tuned._gauges, is_quick=True)._quick
    assert quick is not None
    pixels = [PlacedFrame(frame, tuned.aligner.align(frame), whole).quick(quick.grids) for frame in frames]
    together, alone = quick.read(pixels), [quick.read([own]) for own in pixels]

    assert together.settled.any()
    for name in ("settled", "status", "row", "sigma_rows", "score"):
        expected = np.concatenate([getattr(plain, name) for plain in alone])
        np.testing.assert_array_equal(getattr(together, name), expected)


@pytest.mark.parametrize("is_quick", [True, False])
@pytest.mark.parametrize("apart_deg", [-4.5, -3.7, -3.0, -2.5, -2.0, -1.5, 1.5, 2.0, 2.5, 3.0, 3.7, 4.5])
def test_mirrored_pair_is_no_surer_than_it_is(
    reader: PanelReader, draw: Draw, apart_deg: float, *, is_quick: bool
) -> None:
    """Two needles of one shade look the same with the one on either side: then neither is told, or sigma spans both."""
    panel, whole = reader.source.panel, [True] * len(reader.source.panel.gauges)
    rng, covers_deg = np.random.default_rng(79), (150.3, 233.0, 287.2, 341.0)
    frames = []
    for cover_deg in covers_deg:
        frame = draw({"al_lb": cover_deg + apart_deg, "fr_lb": cover_deg})
        noisy = np.clip(frame + rng.normal(0.0, 4.0, frame.shape), 0, 255).astype(np.uint8)
        frames.append(PlacedFrame(noisy, reader.aligner.align(noisy), whole))
    surely = np.zeros((len(frames), len(whole)))
    many = ManyFrames(panel.gauges, reader.grids, reader.tuning, reader._gauges, is_quick=is_quick)
    read = many.read(frames, surely)

    for cover_deg, gauges in zip(covers_deg, read, strict=True):
        (_, fuel), there_deg = gauges, {"al_lb": cover_deg + apart_deg, "fr_lb": cover_deg}
        for name, reading in fuel.items():
            if reading.status is not Status.MISSING:
                assert abs(reading.angle_deg - there_deg[name]) < 3 * reading.sigma_deg + KNOWN_DEG


@pytest.mark.parametrize("apart_deg", [-5.0, -4.2, 4.2, 5.0])
def test_learned_needles_tell_on_which_side_the_lower_one_lies(
    tuned: PanelReader, draw: Draw, apart_deg: float
) -> None:
    """From four degrees apart on, two needles of one shade are both read in their places, for all their soft edges."""
    for cover_deg in (152.3, 233.0, 287.2, 341.0):
        there_deg = {"al_lb": cover_deg + apart_deg, "fr_lb": cover_deg}
        readings = tuned.read(draw(there_deg, noise=2.0, seed=int(cover_deg))).readings
        assert readings["al_lb"].status is Status.EDGE
        assert readings["fr_lb"].status is Status.READ
        for name, angle_deg in there_deg.items():
            assert readings[name].angle_deg == pytest.approx(angle_deg, abs=0.35)


def test_hidden_needle_s_sigma_spans_where_it_may_be(reader: PanelReader, draw: Draw) -> None:
    """Three degrees apart, with a mirrored pair as likely, the lower needle is less sure than right below its cover."""
    apart, below = (reader.read(draw({"al_lb": 233.0 + off, "fr_lb": 233.0})).readings["al_lb"] for off in (2.5, 0.0))

    assert apart.status is below.status is Status.HIDDEN
    assert apart.sigma_deg > 1.5 * below.sigma_deg
