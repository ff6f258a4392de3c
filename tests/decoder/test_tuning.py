"""Tuning: many frames teach what one picture cannot, and never teach it wrong."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decoder.alignment import IDENTITY
from decoder.flight_fitting import fit_to_flight
from decoder.flight_tuning import tune
from decoder.panel_reader import PanelReader
from decoder.pictures import GreyPicture
from decoder.reading import Status
from decoder.unwrapping import Unwrapper

Draw = Callable[..., GreyPicture]
MakeReader = Callable[..., PanelReader]
NEEDLES = ("speed_kt", "al_lb", "fr_lb")
PANEL_HANDS = {"speed_kt": 225.0, "al_lb": 195.0, "fr_lb": 345.0}  # midway between marks


def between_marks(content: dict[str, Any]) -> None:
    """The panel of a picture whose needles lie midway between tick marks."""
    for gauge in content["gauges"]:
        for needle in gauge["needles"]:
            needle["template"]["at"] = PANEL_HANDS[needle["name"]]


@pytest.fixture(scope="module", name="draw")
def draw_with_ticks(draw: Draw) -> Draw:
    """Draws dials with tick marks: what a flight is brought into one light by."""
    return functools.partial(draw, ticks=True)


@pytest.fixture(scope="module", name="reader")
def reader_with_ticks(reader_of: MakeReader, draw: Draw) -> PanelReader:
    """A reader of dials with tick marks."""
    return reader_of(between_marks, panel=draw(PANEL_HANDS))


def angles_of(seed: int) -> dict[str, float]:
    """Needles in random places, those of the fuel gauge well apart."""
    rng = np.random.default_rng(seed)
    return {"speed_kt": rng.uniform(125, 415), "al_lb": rng.uniform(125, 240), "fr_lb": rng.uniform(290, 415)}


@pytest.fixture(scope="module")
def noisy_reader(reader_of: MakeReader, draw: Draw) -> PanelReader:
    """A reader whose templates are cut from a noisy panel picture."""
    picture = draw(PANEL_HANDS, noise=6.0, seed=81)
    return reader_of(between_marks, panel=picture)


@pytest.fixture(scope="module")
def tuned(noisy_reader: PanelReader, draw: Draw) -> PanelReader:
    """The same reader after twenty-four noisy frames, shifted as one."""
    return tune(
        noisy_reader, [draw(angles_of(seed), noise=6.0, seed=seed, shift_px=(2.4, -1.3)) for seed in range(200, 224)]
    )


def errors_deg(reader: PanelReader, draw: Draw) -> np.ndarray:
    """(frames, needles): errors on a dozen clean frames."""
    rows = []
    for seed in range(300, 312):
        truth = angles_of(seed)
        readings = reader.read(draw(truth)).readings
        assert {readings[name].status for name in NEEDLES} == {Status.READ}
        rows.append([readings[name].angle_deg - truth[name] for name in NEEDLES])
    return np.array(rows)


def test_tuned_templates_read_no_worse(noisy_reader: PanelReader, tuned: PanelReader, draw: Draw) -> None:
    """Each needle's errors spread no wider than before, as far as a dozen frames can tell (to a fifth)."""
    before, after = (errors_deg(each, draw).std(axis=0) for each in (noisy_reader, tuned))

    assert after.mean() < 1.2 * before.mean()
    assert (after < 1.5 * before + 0.005).all()


def test_tuned_reader_keeps_the_needles_zero(noisy_reader: PanelReader, tuned: PanelReader, draw: Draw) -> None:
    """The axis stays where the panel says it is, to what the noisy panel picture can tell."""
    before, after = (np.abs(errors_deg(each, draw).mean(axis=0)) for each in (noisy_reader, tuned))

    assert (after < np.maximum(before, 0.05) + 0.05).all()


def test_tuned_templates_are_less_noisy(noisy_reader: PanelReader, tuned: PanelReader, reader: PanelReader) -> None:
    """A learned needle is nearer to the clean one than the needle cut from the noisy picture."""
    for name in NEEDLES:
        outline = reader.tuning.templates[name].outline
        clean, cut, learned = (each.tuning.templates[name].pixels[outline] for each in (reader, noisy_reader, tuned))
        assert (learned - clean).std() < (cut - clean).std()


def test_usual_alignment_is_where_the_camera_was(tuned: PanelReader) -> None:
    """The flight's usual shift is learned, so that searches start there."""
    assert tuned.tuning.usual.to_frame((160.0, 110.0)) == pytest.approx((162.4, 108.7), abs=0.2)


def test_face_is_the_dial_without_needles(tuned: PanelReader, draw: Draw) -> None:
    """The learned dial is what it shows with all needles taken off, its marks in place."""
    bare = Unwrapper(tuned.grids).unwrap(draw({}), IDENTITY)
    for learned, plain in zip(tuned.tuning.faces, bare, strict=True):
        assert np.abs(learned - plain).mean() < 3.0


@pytest.mark.parametrize("count", [0, 1, 4])
def test_too_few_frames_teach_nothing(reader: PanelReader, draw: Draw, count: int) -> None:
    """With fewer frames than a median needs the reader stays as the panel made it."""
    frames = [draw(angles_of(seed)) for seed in range(count)]

    assert tune(reader, frames) is reader


def test_frames_without_panel_teach_nothing(reader: PanelReader) -> None:
    """Black frames are no sample of anything."""
    assert tune(reader, [np.zeros((220, 360), np.uint8)] * 12) is reader


def test_frames_of_another_size_teach_nothing(reader: PanelReader) -> None:
    """Pictures of another size are left out, not refused: the flight itself reports them."""
    assert tune(reader, [np.zeros((100, 100), np.uint8)] * 12) is reader


def test_tuning_is_the_same_twice(reader: PanelReader, draw: Draw) -> None:
    """The same frames teach the same bytes."""
    frames = [draw(angles_of(seed), noise=3.0, seed=seed) for seed in range(400, 408)]
    first, second = tune(reader, frames).tuning, tune(reader, frames).tuning

    for name in NEEDLES:
        assert first.templates[name].pixels.tobytes() == second.templates[name].pixels.tobytes()
    assert first.usual == second.usual


def test_needle_that_stands_still_is_still_read(reader: PanelReader, draw: Draw) -> None:
    """A needle that never moves in the sample is not learned away as part of the dial."""
    still = [draw({**angles_of(seed), "speed_kt": 305.0}, noise=3.0, seed=seed) for seed in range(500, 516)]
    tuned = tune(reader, still)
    for angle_deg in (305.0, 180.0):
        reading = tuned.read(draw({**angles_of(1), "speed_kt": angle_deg})).readings["speed_kt"]
        assert reading.status is Status.READ
        assert reading.angle_deg == pytest.approx(angle_deg, abs=0.15)


def test_needle_that_few_frames_show_must_match_as_one_that_was_learned(reader: PanelReader, draw: Draw) -> None:
    """What is found of it may be what lay behind it in the panel picture, where nothing else was ever seen."""
    dark = {"speed_kt": 42.0}  # as the dial
    flight = [draw(angles_of(seed), levels=dark if seed % 4 else None, seed=seed, noise=2.0) for seed in range(16)]
    fitted = fit_to_flight(reader, lambda _: flight).reader
    doubtful = draw({**PANEL_HANDS, "speed_kt": 231.0}, levels={"speed_kt": 100.0}, noise=11.0, seed=3)
    believing = fitted.tuned(replace(fitted.tuning, doubted=frozenset()))

    assert fitted.tuning.doubted == {"speed_kt"}
    assert believing.read(doubtful).readings["speed_kt"].status is Status.READ
    assert fitted.read(doubtful).readings["speed_kt"].status is Status.MISSING
    assert fitted.read(flight[4]).readings["speed_kt"].status is Status.READ


def test_needles_that_most_frames_show_are_not_doubted(reader: PanelReader, draw: Draw) -> None:
    """A glare here and there says nothing."""
    dark = {"speed_kt": 42.0}
    flight = [draw(angles_of(seed), levels=None if seed % 4 else dark, seed=seed, noise=2.0) for seed in range(16)]

    assert fit_to_flight(reader, lambda _: flight).reader.tuning.doubted == frozenset()
