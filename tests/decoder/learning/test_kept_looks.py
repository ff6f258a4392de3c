"""What a gauge learned is kept only where its needles are found as before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from decoder.instruments.panel_reader import unwrapped
from decoder.instruments.reading import Status
from decoder.learning.flight_appearance import kept_where_better, learn_appearance, lit_views
from tests.decoder.cockpit import BETWEEN_MARKS_DEG, angles_of, between_marks, draw, reader_of


def test_gauge_that_learned_noise_keeps_its_look() -> None:
    """The others keep what they learned."""
    reader = reader_of(between_marks, panel=draw(BETWEEN_MARKS_DEG, ticks=True))
    samples = unwrapped(reader, [draw(angles_of(seed), ticks=True, noise=2.0, seed=seed) for seed in range(200, 212)])
    views, found = lit_views(reader, samples), [frame.readings for frame in reader.read_unwrapped(samples)]
    learned = learn_appearance(reader, views, found)
    good = learned.appearance.templates["speed_kt"]
    noise = np.random.default_rng(3).uniform(0.0, 1.0, good.pixels.shape).astype(np.float32)
    spoiled = replace(good, light=200.0 * noise, transparency=1.0 - noise)
    templates = {**learned.appearance.templates, "speed_kt": spoiled}

    kept, again = kept_where_better(
        reader, learned.with_appearance(replace(learned.appearance, templates=templates)), samples, views, found
    )

    assert {readings["speed_kt"].status for readings in again} == {Status.READ}
    for name in ("al_lb", "fr_lb"):
        assert np.array_equal(kept.appearance.templates[name].light, learned.appearance.templates[name].light)
    assert kept.appearance.templates["speed_kt"] is reader.appearance.templates["speed_kt"]
