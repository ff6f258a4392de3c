"""Dials on which something like a needle moves that no needle accounts for, and needles learned from something else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decoder.imaging.pictures import GreyPicture
from decoder.instruments.panel_reader import read_picture
from decoder.instruments.reading import Reading, Status
from decoder.learning.fit import FittedReader, fit_to_flight
from decoder.learning.unexplained import mistaken_needles
from tests.decoder.instruments.dials import CENTRE, Canvas, Hand, apart, paint, reader_for

LINE_DEG, FIRST_DEG, LAST_DEG, FRAMES = 200.0, 230.0, 400.0, 16
NEEDLE_DEG = np.linspace(FIRST_DEG, LAST_DEG, FRAMES)


def speed(at_deg: float, aside_px: float = 0.0) -> dict[str, Any]:
    """A gauge whose needle is cut at an angle, its centre drawn some pixels to the right."""
    return {
        "name": "speed",
        "centre": [CENTRE[0] + aside_px, CENTRE[1]],
        "radius": [20, 70],
        "sweep": [120, 420],
        "scale": [[120, 0], [420, 300]],
        "needles": [{"name": "speed_kt", "template": {"at": at_deg, "span": 16}}],
    }


def dial(hands: Sequence[tuple[Hand, float]], seed: int = 0, glare_deg: float | None = None) -> GreyPicture:
    """A dial with a printed line as long as a needle, under some hands, and maybe with glare over it."""

    def what(canvas: Canvas) -> None:
        canvas.dial(range(120, 421, 25))
        canvas.bar(LINE_DEG, (20.0, 66.0), (3.0, 3.0), 200.0)
        for mark in range(12):
            canvas.bar(132.0 + 25 * mark, (44.0, 52.0), (3.0, 3.0), 120.0)
        for hand, angle_deg in hands:
            canvas.hand(hand, angle_deg)

    picture = paint(what, seed=seed)
    if glare_deg is None:
        return picture
    angle, (down, across) = np.radians(glare_deg), np.indices(picture.shape)
    off_px = np.hypot(across - CENTRE[0] - 45 * np.cos(angle), down - CENTRE[1] - 45 * np.sin(angle))
    return np.asarray(np.clip(picture + 90.0 * np.exp(-0.5 * (off_px / 18.0) ** 2), 0, 255), np.uint8)


def fitted(gauge: dict[str, Any], panel: GreyPicture, frames: list[GreyPicture]) -> tuple[FittedReader, list[Reading]]:
    """What is found of a gauge and its first needle."""
    fit = fit_to_flight(reader_for([gauge], panel), lambda _: frames)
    return fit, [read_picture(fit.reader, frame).readings[gauge["needles"][0]["name"]] for frame in frames]


@pytest.mark.parametrize(
    "hand",
    [Hand(level=110.0), Hand(tip=45.0)],
    ids=["dim", "short"],
)
def test_print_drawn_as_a_needle_is_not_read_while_the_needle_moves(hand: Hand) -> None:
    """It matches itself perfectly in every frame, and only the rest of the dial tells that it is no needle."""
    fit, found = fitted(
        speed(LINE_DEG), dial([(hand, 300.0)]), [dial([(hand, deg)], 1 + at) for at, deg in enumerate(NEEDLE_DEG)]
    )
    assert max(reading.score for reading in found) > 0.95
    assert not any(reading.status is Status.READ for reading in found)
    assert "speed_kt is not read" in " ".join(fit.findings["speed"])


@pytest.mark.parametrize(
    ("hand", "aside_px"),
    [(Hand(), 10.0), (Hand(level=44.0), 0.0), (Hand(root_half=8.0, tip_half=5.0), 0.0)],
    ids=["another-pivot", "faint", "wide"],
)
def test_needle_that_was_learned_where_it_moves_is_not_read_if_it_is_not_where_it_was_drawn(
    hand: Hand, aside_px: float
) -> None:
    """Print was drawn in its place, and its scale may be drawn for that."""
    fit, found = fitted(
        speed(LINE_DEG, aside_px),
        dial([(hand, 300.0)]),
        [dial([(hand, deg)], 1 + at) for at, deg in enumerate(NEEDLE_DEG)],
    )
    assert not any(reading.status is Status.READ for reading in found)
    assert "from it in the panel picture" in " ".join(fit.findings["speed"])


@pytest.mark.parametrize("beside_deg", [0.0, 2.0, 4.0])
def test_dim_needle_that_the_panel_picture_shows_over_a_bright_line_is_read(beside_deg: float) -> None:
    """What was cut there is mostly the line, but frames show that something moves, and where."""
    hand, at_deg = Hand(level=60.0), LINE_DEG + beside_deg
    frames = [dial([(hand, deg)], 1 + at) for at, deg in enumerate(NEEDLE_DEG)]
    fit, found = fitted(speed(at_deg), dial([(hand, at_deg)]), frames)
    assert [reading.status for reading in found] == [Status.READ] * FRAMES
    assert max(apart(reading.angle_deg, deg) for reading, deg in zip(found, NEEDLE_DEG, strict=True)) < 0.5
    assert "was learned from where the flight shows that it moved" in " ".join(fit.findings["speed"])


@pytest.mark.parametrize(("level", "beside_deg"), [(60.0, 0.0), (60.0, 4.0)])
def test_dim_needle_that_the_panel_picture_shows_over_a_bright_line_is_read_beside_another(
    level: float, beside_deg: float
) -> None:
    """What moves and is not the other needle is the one that was lost."""
    dim, other, away_deg = Hand(level=level), Hand(tip=50.0), np.roll(NEEDLE_DEG, 5)
    own, at_deg = speed(LINE_DEG + beside_deg), LINE_DEG + beside_deg
    own["needles"] += [{"name": "power_pct", "template": {"at": float(away_deg[0]), "span": 16}}]
    frames = [
        dial([(dim, one), (other, two)], 1 + at) for at, (one, two) in enumerate(zip(NEEDLE_DEG, away_deg, strict=True))
    ]
    fit, found = fitted(own, dial([(dim, at_deg), (other, away_deg[0])]), frames)
    assert [reading.status for reading in found] == [Status.READ] * FRAMES
    assert max(apart(reading.angle_deg, deg) for reading, deg in zip(found, NEEDLE_DEG, strict=True)) < 1.0
    assert "speed_kt was learned from where the flight shows that it moved" in " ".join(fit.findings["speed"])


def test_needle_is_not_taken_for_hidden_in_every_frame_while_it_shows_elsewhere() -> None:
    """A lower needle that was cut badly is found nowhere, which alone does not say that it lies under the upper one."""
    low_deg, high_deg = 300.0 + 4.0 * np.sin(2.1 * np.arange(FRAMES)), NEEDLE_DEG.copy()
    high_deg[6] = low_deg[6] + 10.0
    own = speed(float(low_deg[6]))
    own["needles"][0]["covered_by"] = "power_pct"
    own["needles"] += [{"name": "power_pct", "template": {"at": float(high_deg[6]), "span": 16}}]
    low, high = Hand(level=60.0), Hand(tip_half=1.0)
    frames = [
        dial([(low, one), (high, two)], 1 + at) for at, (one, two) in enumerate(zip(low_deg, high_deg, strict=True))
    ]
    fit, found = fitted(own, frames[6], frames)
    valued = [
        (reading, deg) for reading, deg in zip(found, low_deg, strict=True) if reading.status is not Status.MISSING
    ]
    assert all(apart(reading.angle_deg, deg) < 10.0 for reading, deg in valued)
    assert valued or "none of its needles" in " ".join(fit.findings["speed"])


def test_needle_is_read_beside_another_that_was_not_drawn() -> None:
    """It moves itself, so it is no print, though something else does too."""
    other = Hand(level=150.0, root_half=7.0, tip_half=7.0)
    away_deg = np.roll(NEEDLE_DEG, 5)
    frames = [
        dial([(other, two), (Hand(), one)], 1 + at)
        for at, (one, two) in enumerate(zip(NEEDLE_DEG, away_deg, strict=True))
    ]
    fit, found = fitted(speed(FIRST_DEG), frames[0], frames)
    read = [(reading, deg) for reading, deg in zip(found, NEEDLE_DEG, strict=True) if reading.status is Status.READ]
    assert len(read) >= FRAMES - 2
    assert all(apart(reading.angle_deg, deg) < 1.0 for reading, deg in read)
    assert fit.unexplained == {"speed"}


def test_needle_that_stands_still_is_read_while_glare_moves_over_the_dial() -> None:
    """Light that goes by is nothing like a needle."""
    frames = [dial([(Hand(), 300.0)], 1 + at, glare_deg=deg) for at, deg in enumerate(NEEDLE_DEG)]
    fit, found = fitted(speed(300.0), dial([(Hand(), 300.0)]), frames)
    assert sum(reading.status is Status.READ for reading in found) >= FRAMES - 6
    assert not fit.unexplained


def test_needle_learned_from_something_else_is_told_by_where_the_panel_picture_shows_it() -> None:
    """A tail, for example: it is found far from where the needle was drawn, and the needle itself is not."""
    tip, tail = Hand(level=110.0, tip=45.0), Hand(root_half=4.0, tip_half=4.0)
    panel = dial([(tip, 250.0), (tail, 390.0)])
    drawn, other = reader_for([speed(250.0)], panel), reader_for([speed(390.0)], panel)
    bare = reader_for([speed(250.0)], dial([(tip, 250.0)])).appearance.faces
    taught = drawn.with_appearance(replace(other.appearance, faces=bare))

    assert mistaken_needles(taught) == {"speed_kt": pytest.approx(140.0, abs=0.5)}
    assert not mistaken_needles(drawn.with_appearance(replace(drawn.appearance, faces=bare)))


def test_needle_learned_from_something_else_is_not_read_and_the_reason_is_known(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its matches are all of something else, however good they are."""
    panel, frames = dial([(Hand(), 300.0)]), [dial([(Hand(), deg)], 1 + at) for at, deg in enumerate(NEEDLE_DEG)]
    _, found = fitted(speed(300.0), panel, frames)
    monkeypatch.setattr("decoder.learning.fit.mistaken_needles", lambda _: {"speed_kt": 179.0})
    fit, lost = fitted(speed(300.0), panel, frames)

    assert {reading.status for reading in found} == {Status.READ}
    assert {reading.status for reading in lost} == {Status.MISSING}
    assert any("lies 179 degrees from it in the panel picture" in each for each in fit.findings["speed"])
