"""The dial behind a panel picture's needles: learned from whatever frames show it, never from a needle that stayed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pytest

from decoder.imaging.pictures import GreyPicture
from decoder.imaging.unwrapping import polar
from decoder.instruments.panel_reader import PanelReader, read_picture, unwrapped
from decoder.instruments.reading import Reading, Status
from decoder.learning.fit import FittedReader, fit_to_flight
from decoder.learning.flight_appearance import lit_views
from decoder.learning.seen_faces import with_seen_faces
from decoder.panel.arrays import Floats, Mask
from tests.decoder.instruments.dials import CENTRE, Canvas, Hand, apart, paint, reader_for

Fitted = tuple[FittedReader, list[Reading]]

SLOW, FAST = Hand(tip=44.0, root_half=5.0, tip_half=3.5), Hand()
SLOW_DEG, FAST_DEG = 300.0, 220.0
DIAL = {
    "name": "dial",
    "radius": [16, 66],
    "sweep": [180, 520],
    "unit": "pct",
    "scale": [[180, 0], [520, 100]],
    "needles": [
        {"name": "slow_pct", "template": {"at": SLOW_DEG, "span": 60}, "covered_by": "fast_pct"},
        {"name": "fast_pct", "template": {"at": FAST_DEG, "span": 20}},
    ],
}


def drawn(slow_deg: float, fast_deg: float, seed: int = 0) -> GreyPicture:
    """Draws a wide needle under a narrow one."""

    def what(canvas: Canvas) -> None:
        canvas.dial(range(0, 360, 10))
        canvas.hand(SLOW, slow_deg)
        canvas.hand(FAST, fast_deg)

    return paint(what, seed=seed)


@pytest.mark.parametrize("moved_deg", [1.5, 3.0])
def test_needle_that_moved_by_less_than_its_width_is_no_face(moved_deg: float) -> None:
    """Most of it stays as in the panel picture: only its edges uncover the dial, while another needle turns."""
    truth = [{"slow_pct": SLOW_DEG + moved_deg, "fast_pct": 190.0 + 20.0 * frame} for frame in range(16)]
    frames = [drawn(*angles.values(), seed=1 + frame) for frame, angles in enumerate(truth)]
    reader = fit_to_flight(reader_for([DIAL], drawn(SLOW_DEG, FAST_DEG)), lambda _: frames).reader
    found = [read_picture(reader, frame).readings for frame in frames]

    read = [(own[name], deg) for own, angles in zip(found, truth, strict=True) for name, deg in angles.items()]
    certain = [(reading, deg) for reading, deg in read if reading.status is Status.READ]
    assert len(certain) >= 28  # of 32; the narrow needle goes over the wide one
    assert all(apart(reading.angle_deg, deg) < 0.5 for reading, deg in certain)


BUG_DEG, BUG_MOVED_DEG = 203.0, 291.0
EGT = {
    "name": "egt",
    "radius": [16, 72],
    "sweep": [180, 360],
    "unit": "norm",
    "scale": [[180, 0], [360, 1]],
    "needles": [
        {"name": "bug_norm", "template": {"at": BUG_DEG, "span": 24}, "covered_by": "egt_norm"},
        {"name": "egt_norm", "template": {"at": 240.0, "span": 24}},
    ],
}
FLIGHT = [(BUG_MOVED_DEG if frame % 3 == 2 else BUG_DEG, 215.0 + 65.0 * frame / 15) for frame in range(16)]


def with_bug(
    angles_deg: tuple[float, float], level: float, print_at_deg: Mapping[float, float], seed: int = 0
) -> GreyPicture:
    """Draws a needle over a bug that is darker than the print at some places."""
    bug_deg, needle_deg = angles_deg

    def what(canvas: Canvas) -> None:
        canvas.dial(range(0, 360, 10))
        for at_deg, print_level in print_at_deg.items():
            for stroke_deg in (-6.0, 0.0, 6.0):
                canvas.bar(at_deg + stroke_deg, (40.0, 58.0), (2.0, 2.0), print_level)
        canvas.bar(bug_deg, (50.0, 70.0), (2.0, 4.0), level)
        canvas.hand(Hand(), needle_deg)

    return paint(what, seed=seed)


def fitted(level: float, print_at_deg: Mapping[float, float], flight: Sequence[tuple[float, float]]) -> Fitted:
    """A reader that was fitted to a flight, and the bug's readings in it."""
    frames = [with_bug(angles, level, print_at_deg, 1 + number) for number, angles in enumerate(flight)]
    first = with_bug((BUG_DEG, 240.0), level, print_at_deg)
    reader = fit_to_flight(reader_for([EGT], first), lambda _: frames)
    return reader, [read_picture(reader.reader, frame).readings["bug_norm"] for frame in frames]


@pytest.mark.parametrize("level", [50.0, 60.0, 100.0])
def test_print_behind_a_bug_is_not_read_for_it(level: float) -> None:
    """It is there in the panel picture and most frames; the others show only the print."""
    _, found = fitted(level, {BUG_DEG: 150.0, BUG_MOVED_DEG: 150.0}, FLIGHT)

    assert sum(reading.status is Status.READ for reading in found) >= 14
    for reading, (bug_deg, _) in zip(found, FLIGHT, strict=True):
        assert reading.status is Status.MISSING or apart(reading.angle_deg, bug_deg) < 1.5


def test_dial_is_learned_from_frames_in_which_a_needle_is_likely() -> None:
    """The bug is found over print only once the print is known, from frames without the bug there."""
    _, found = fitted(120.0, {BUG_MOVED_DEG: 140.0}, FLIGHT)
    moved = [reading for reading, (bug_deg, _) in zip(found, FLIGHT, strict=True) if bug_deg == BUG_MOVED_DEG]

    assert {reading.status for reading in moved} == {Status.READ}
    assert min(reading.score for reading in moved) > 0.9
    assert all(apart(reading.angle_deg, BUG_MOVED_DEG) < 1.5 for reading in moved)


def test_bug_that_was_set_elsewhere_for_a_while_is_no_print() -> None:
    """It does not come from the hub, so it may be print beyond a needle's tip; print does not move."""
    moved, _ = fitted(120.0, {}, FLIGHT)
    still, _ = fitted(120.0, {}, [(BUG_DEG, needle_deg) for _, needle_deg in FLIGHT])

    assert moved.sigma_deg("bug_norm", np.array([BUG_DEG])) < 2.0
    assert still.sigma_deg("bug_norm", np.array([BUG_DEG])) > 45.0  # anywhere along its sweep


def hand_over_print(at_deg: float, level: float, tail: float = 0.0, seed: int = 0) -> GreyPicture:
    """Draws a needle from the hub over print at two places, and at the place opposite the first."""

    def what(canvas: Canvas) -> None:
        canvas.dial(range(0, 360, 10))
        for print_deg in (BUG_DEG, BUG_DEG + 180.0, BUG_MOVED_DEG):
            for stroke_deg in (-6.0, 0.0, 6.0):
                canvas.bar(print_deg + stroke_deg, (40.0, 58.0), (2.0, 2.0), 150.0)
        canvas.hand(Hand(tip=66.0, tail=tail, level=level), at_deg)

    return paint(what, seed=seed)


def test_dial_behind_a_needle_is_learned_wherever_the_grid_shows_it() -> None:
    """A round dial's grid shows what is near its seam twice, and with a tail all of it once more across the centre."""
    round_ = {"radius": [16, 62], "sweep": [200, 560], "wraps": 360, "scale": [[200, 0], [380, 180]], "tail": True}
    needle = {"name": "hand_deg", "template": {"at": BUG_DEG, "span": 24}}
    dial = {"name": "dial", "unit": "deg", **round_, "needles": [needle]}
    frames = [hand_over_print((BUG_DEG, BUG_MOVED_DEG)[seed % 2], 100.0, 40.0, 1 + seed) for seed in range(16)]
    reader = reader_for([dial], hand_over_print(BUG_DEG, 100.0, 40.0))
    samples = unwrapped(reader, frames)

    def read(known: PanelReader) -> list[Mapping[str, Reading]]:
        return [frame.readings for frame in known.read_unwrapped(samples)]

    bared, _ = with_seen_faces(reader, lit_views(reader, samples), read(reader), read)
    (face,), (first,), grid = bared.appearance.faces, reader.appearance.faces, polar(reader.grids[0])
    turn, tail = round(360.0 / grid.step_deg), grid.tail_columns

    assert np.abs(face - first).max() > 50.0
    assert np.abs(face[turn:] - face[:-turn]).max() < 0.1
    assert np.abs(face[turn // 2 :, :tail] - face[: -turn // 2, tail:][:, ::-1]).max() < 0.1


@pytest.mark.parametrize("away", [{15}, {2, 7, 12}])
def test_print_behind_a_needle_that_was_hardly_ever_elsewhere_is_not_read_for_it(away: set[int]) -> None:
    """Too few frames show the print alone to learn it, but it matches less well than with the needle over it."""
    one = {**EGT, "needles": [{"name": "egt_norm", "template": {"at": BUG_DEG, "span": 24}}]}
    truth_deg = [BUG_MOVED_DEG if frame in away else BUG_DEG for frame in range(16)]
    frames = [hand_over_print(at_deg, 60.0, seed=1 + frame) for frame, at_deg in enumerate(truth_deg)]
    reader = fit_to_flight(reader_for([one], hand_over_print(BUG_DEG, 60.0)), lambda _: frames).reader
    found = [read_picture(reader, frame).readings["egt_norm"] for frame in frames]

    assert sum(reading.status is Status.READ for reading in found) >= 12
    for reading, at_deg in zip(found, truth_deg, strict=True):
        assert reading.status is Status.MISSING or apart(reading.angle_deg, at_deg) < max(1.0, 2.0 * reading.sigma_deg)


def test_bug_that_is_not_found_is_not_taken_for_hidden() -> None:
    """It could be below the needle in any frame; such frames do not teach the dial, which would then show the bug."""
    flight = [
        (BUG_MOVED_DEG if frame % 8 == 2 else BUG_DEG, needle_deg) for frame, (_, needle_deg) in enumerate(FLIGHT)
    ]
    _, found = fitted(60.0, {BUG_MOVED_DEG: 150.0}, flight)
    at_home = [reading for reading, (bug_deg, _) in zip(found, flight, strict=True) if bug_deg == BUG_DEG]

    assert sum(reading.status is Status.READ for reading in at_home) >= 10
    assert all(reading.status is Status.MISSING or apart(reading.angle_deg, BUG_DEG) < 1.5 for reading in at_home)


def test_dim_needle_is_not_learned_anew_from_marks_beside_it() -> None:
    """Likely matches in some frames do not move it by one mark in all the others, in which it was found before."""
    one = {**EGT, "needles": [{"name": "egt_norm", "template": {"at": BUG_DEG, "span": 24}}]}

    def dim(canvas: Canvas) -> None:
        canvas.dial(range(0, 360, 10))
        canvas.hand(Hand(tip=66.0, level=50.0), BUG_DEG)

    frames = [paint(dim, seed=1 + seed) for seed in range(16)]
    reader = fit_to_flight(reader_for([one], paint(dim)), lambda _: frames).reader
    found = [read_picture(reader, frame).readings["egt_norm"] for frame in frames]

    assert sum(reading.status is Status.READ for reading in found) >= 12
    assert all(reading.status is Status.MISSING or apart(reading.angle_deg, BUG_DEG) < 1.0 for reading in found)


LONE = {
    "name": "oil",
    "radius": [36, 70],
    "sweep": [300, 420],
    "unit": "psi",
    "scale": [[310, 100], [410, 0]],
    "needles": [{"name": "oil_psi", "template": {"at": 384.0, "span": 20}}],
}


def oil(angle_deg: float, seed: int, mirrored: Callable[[Floats], Mask] | None = None) -> GreyPicture:
    """Draws a thin needle over a dark dial, under glass that mirrors a window: where, by pixels right of the pivot."""

    def what(canvas: Canvas) -> None:
        canvas.disc(CENTRE, 80.0, 25.0)
        for mark in range(310, 411, 10):
            canvas.bar(mark, (52, 68), (1.2, 1.2), 190.0)
            canvas.bar(mark + 2.0, (44, 49), (1.8, 1.8), 170.0)
        canvas.bar(angle_deg, (0, 70), (1.3, 1.3), 200.0)

    frame = paint(what, seed=seed).astype(np.float64)
    if mirrored is None:
        return frame.astype(np.uint8)
    y, x = np.indices(frame.shape)
    is_dial = np.hypot(x - CENTRE[0], y - CENTRE[1]) < 80.0
    light = 120.0 * (mirrored(x - CENTRE[0] + 0.9 * (y - CENTRE[1])) & is_dial)
    return np.clip(frame + light, 0, 255).astype(np.uint8)


def test_reflection_in_the_panel_picture_is_not_taken_for_print() -> None:
    """A window mirrored across the dial there is elsewhere in frames, or nowhere: their median shows the dial."""
    angles_deg = [320.0 + 5.0 * number for number in range(16)]
    frames = [
        oil(deg, 1 + number, None if number % 4 else lambda right, edge=4.0 * number: right > edge)
        for number, deg in enumerate(angles_deg)
    ]
    panel = oil(384.0, 50, lambda right: right > 64.0)
    reader = fit_to_flight(reader_for([LONE], panel), lambda _: frames).reader

    found = [read_picture(reader, frame).readings["oil_psi"] for frame in frames]
    is_read = [reading.status is Status.READ for reading in found]

    assert sum(is_read) >= 8
    assert all(
        apart(reading.angle_deg, deg) < 1.0 for reading, deg, own in zip(found, angles_deg, is_read, strict=True) if own
    )
