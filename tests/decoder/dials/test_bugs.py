"""Bugs, lines and bands of a needle's brightness: they neither take its place nor pull at it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from decoder.panel_reader import PanelReader
from decoder.pictures import GreyPicture
from decoder.reading import Status

Paint = Callable[..., GreyPicture]
Draw = Callable[..., GreyPicture]
CENTRE = (104.4, 94.7)
FULL_SCALE_DEG = 300.0
GAUGE: dict[str, Any] = {
    "name": "itt",
    "radius": [20, 66],
    "sweep": [120, 420],
    "scale": [[120, 0], [420, 300]],
    "needles": [{"name": "itt_c", "template": {"at": 214.0, "span": 16}}],
}
# Radii and half width of a bug, and how far either half of it lies from its middle in degrees.
BUGS = {
    "block": ((58, 70), 3.5, 0.0),
    "vee": ((58, 70), 2.0, 3.5),
    "line": ((40, 70), 1.4, 0.0),
    "long line": ((22, 70), 1.6, 0.0),
}


def band(canvas: Any, first_deg: float, last_deg: float) -> None:  # noqa: ANN401
    """A coloured arc at the rim, in grey as bright as the needle."""
    turn = np.radians(np.arange(first_deg, last_deg + 0.5, 0.5))
    outer, inner = ([(CENTRE[0] + r * np.cos(a), CENTRE[1] + r * np.sin(a)) for a in turn] for r in (66, 60))
    canvas.polygon([*outer, *inner[::-1]], 228)


@pytest.fixture(scope="module")
def draw(paint: Paint, hand: Any) -> Draw:  # noqa: ANN401
    """Draws a dial with a band, two fixed lines, a movable bug and the needle."""

    def make(angle_deg: float, bug_deg: float, kind: str, seed: int = 0) -> GreyPicture:
        radii, half, apart_deg = BUGS[kind]

        def what(canvas: Any) -> None:  # noqa: ANN401
            canvas.dial(range(0, 360, 30))
            band(canvas, 200, 300)
            canvas.bar(300, (48, 72), (1.5, 1.5), 228)
            canvas.bar(156, (30, 72), (1.5, 1.5), 228)
            for side in (-apart_deg, apart_deg):
                canvas.bar(bug_deg + side, radii, (half, half), 225)
            canvas.hand(hand(tip=66.0), angle_deg)

        return paint(what, seed=seed)

    return make


@pytest.fixture(scope="module", params=list(BUGS))
def kind(request: pytest.FixtureRequest) -> str:
    """Each form of a bug."""
    return str(request.param)


@pytest.fixture(scope="module")
def reader(draw: Draw, kind: str, reader_for: Callable[..., PanelReader]) -> PanelReader:
    """A reader tuned to frames with the bug anywhere."""
    rng = np.random.default_rng(5)
    frames = [draw(123.0 + 18.75 * step, rng.uniform(120, 420), kind, 100 + step) for step in range(16)]
    return reader_for([GAUGE], draw(214.0, 330.0, kind, 1), frames)


def test_bug_elsewhere_is_no_needle(reader: PanelReader, draw: Draw, kind: str) -> None:
    """With the bug away from it the needle is read as if there were none."""
    rng = np.random.default_rng(6)
    errors, statuses = [], []
    for seed, angle_deg in enumerate(rng.uniform(130, 410, 30)):
        bug_deg = 120 + (angle_deg - 120 + rng.uniform(20, 280)) % 300
        reading = reader.read(draw(angle_deg, bug_deg, kind, seed)).readings["itt_c"]
        statuses.append(reading.status)
        if reading.status is Status.READ:
            errors.append(abs(reading.angle_deg - angle_deg))

    assert statuses.count(Status.READ) >= 28
    assert max(errors) < 0.01 * FULL_SCALE_DEG
    assert np.mean(errors) < 0.1


def test_bug_beside_the_needle_does_not_take_its_place(reader: PanelReader, draw: Draw, kind: str) -> None:
    """Under the needle or beside it a bug leaves a reading that is right, or none."""
    rng = np.random.default_rng(7)
    errors, missing = [], 0
    for seed, angle_deg in enumerate(rng.uniform(130, 410, 40)):
        bug_deg = angle_deg + rng.uniform(-14, 14)
        reading = reader.read(draw(angle_deg, bug_deg, kind, seed)).readings["itt_c"]
        missing += reading.status is Status.MISSING
        if reading.status in (Status.READ, Status.EDGE):
            errors.append(abs(reading.angle_deg - angle_deg))

    assert max(errors) < 0.01 * FULL_SCALE_DEG
    if kind in ("block", "vee"):  # at the rim alone
        assert np.mean(errors) < 0.1
        assert missing == 0
