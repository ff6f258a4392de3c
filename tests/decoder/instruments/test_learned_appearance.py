"""Learned appearance: many frames teach what one picture cannot, and never teach it wrong."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

from decoder.imaging.alignment import IDENTITY
from decoder.imaging.pictures import GreyPicture
from decoder.imaging.unwrapping import Unwrapper
from decoder.instruments.panel_reader import PanelReader, read_picture
from decoder.instruments.reading import Status
from decoder.learning.fit import fit_to_flight, tune
from tests.decoder import cockpit
from tests.decoder.cockpit import BETWEEN_MARKS_DEG, angles_of, between_marks, reader_of

draw = functools.partial(cockpit.draw, ticks=True)  # marks are what a flight is brought into one light by
NEEDLES = ("speed_kt", "al_lb", "fr_lb")


@pytest.fixture(scope="module")
def reader() -> PanelReader:
    """A reader of dials with tick marks."""
    return reader_of(between_marks, panel=draw(BETWEEN_MARKS_DEG))


@pytest.fixture(scope="module")
def noisy_reader() -> PanelReader:
    """A reader whose templates are cut from a noisy panel picture."""
    picture = draw(BETWEEN_MARKS_DEG, noise=6.0, seed=81)
    return reader_of(between_marks, panel=picture)


@pytest.fixture(scope="module")
def tuned(noisy_reader: PanelReader) -> PanelReader:
    """The same reader after twenty-four noisy frames, shifted as one."""
    return tune(
        noisy_reader, [draw(angles_of(seed), noise=6.0, seed=seed, shift_px=(2.4, -1.3)) for seed in range(200, 224)]
    )


def errors_deg(reader: PanelReader) -> np.ndarray:
    """(frames, needles): errors on a dozen clean frames."""
    rows = []
    for seed in range(300, 312):
        truth = angles_of(seed)
        readings = read_picture(reader, draw(truth)).readings
        assert {readings[name].status for name in NEEDLES} == {Status.READ}
        rows.append([readings[name].angle_deg - truth[name] for name in NEEDLES])
    return np.array(rows)


def test_tuned_templates_read_no_worse(noisy_reader: PanelReader, tuned: PanelReader) -> None:
    """Errors spread no wider than before, as far as a dozen frames can tell (to a fifth), and a needle's zero stays."""
    before, after = errors_deg(noisy_reader), errors_deg(tuned)
    spread_before, spread_after = before.std(axis=0), after.std(axis=0)

    assert spread_after.mean() < 1.2 * spread_before.mean()
    assert (spread_after < 1.5 * spread_before + 0.005).all()
    assert (np.abs(after.mean(axis=0)) < np.maximum(np.abs(before.mean(axis=0)), 0.05) + 0.05).all()


def test_face_is_the_dial_without_needles(tuned: PanelReader) -> None:
    """The learned dial is what it shows with all needles taken off, its marks in place."""
    bare = Unwrapper(tuned.grids).unwrap(draw({}), IDENTITY)
    for learned, plain in zip(tuned.appearance.faces, bare, strict=True):
        assert np.abs(learned - plain).mean() < 3.0


@pytest.mark.parametrize(
    "frames",
    [
        [draw(angles_of(seed)) for seed in range(4)],
        [np.zeros((220, 360), np.uint8)] * 12,
        [np.zeros((100, 100), np.uint8)] * 12,
    ],
    ids=["fewer than a median needs", "without the panel", "of another size"],
)
def test_frames_that_tell_nothing_teach_nothing(reader: PanelReader, frames: list[GreyPicture]) -> None:
    """The reader stays as the panel made it; what is wrong with frames is reported where the flight is read."""
    assert tune(reader, frames) is reader


def test_needle_that_stands_still_is_still_read(reader: PanelReader) -> None:
    """A needle that never moves in the sample is not learned away as part of the dial."""
    still = [draw({**angles_of(seed), "speed_kt": 305.0}, noise=3.0, seed=seed) for seed in range(500, 516)]
    tuned = tune(reader, still)
    for angle_deg in (305.0, 180.0):
        reading = read_picture(tuned, draw({**angles_of(1), "speed_kt": angle_deg})).readings["speed_kt"]
        assert reading.status is Status.READ
        assert reading.angle_deg == pytest.approx(angle_deg, abs=0.15)


def test_needle_that_few_frames_show_must_match_as_one_that_was_learned(reader: PanelReader) -> None:
    """A match may be with the dial behind it in the panel picture, where nothing else was ever seen."""
    dark = {"speed_kt": 42.0}  # as the dial
    flight = [draw(angles_of(seed), levels=dark if seed % 4 else None, seed=seed, noise=2.0) for seed in range(16)]
    fitted = fit_to_flight(reader, lambda _: flight).reader
    doubtful = draw({**BETWEEN_MARKS_DEG, "speed_kt": 231.0}, levels={"speed_kt": 100.0}, noise=11.0, seed=3)
    believing = fitted.with_appearance(replace(fitted.appearance, doubted=frozenset()))

    assert fitted.appearance.doubted == {"speed_kt"}
    assert fit_to_flight(reader, lambda _: flight[::4] * 4).reader.appearance.doubted == frozenset()
    assert read_picture(believing, doubtful).readings["speed_kt"].status is Status.READ
    assert read_picture(fitted, doubtful).readings["speed_kt"].status is Status.MISSING
    assert read_picture(fitted, flight[4]).readings["speed_kt"].status is Status.READ
