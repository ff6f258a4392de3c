"""Advice: offers improve the fit of all the sample's frames together, say by how much, and come to an end."""

from __future__ import annotations

import copy
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.real_pictures import PANELS, PICTURES
from decoder.instruments.reading import Status
from decoder.setup.drawn_plane import DrawnPlane
from decoder.setup.proposing.advice import Fit, Sight, advice_answer, advised, shows_the_same
from decoder.setup.requests import TrialQuestion
from decoder.setup.session import SetupSession
from decoder.setup.trial import FrameTrial, NeedleTrial, Trial, tried
from tests.programs import rows_of, write_yaml, yaml_of

COCKPIT = PICTURES / "cockpit_flight"
SETS = {
    "flight_a": (COCKPIT / "flight_a_panel.yaml", COCKPIT / "flight_a_panel.jpg"),
    "sixpack_a": (PANELS / "sixpack.yaml", COCKPIT / "sixpack_a" / "f0020.jpg"),
}
MOST_ROUNDS = 4
# So much of an altitude may be lost where a careful drawing is exchanged for what the flight shows.
WITHIN_FT = 1.0


class Folder:
    """A flight of pictures in a folder."""

    def __init__(self, folder: Path) -> None:
        self.files = sorted(folder.glob("*.jpg"))
        self.name, self.count = folder.name, len(self.files)
        self.sample = tuple(int(each) for each in np.unique(np.linspace(0, self.count - 1, 20).round()))

    def encoded(self, index: int) -> bytes:
        """One picture."""
        return self.files[index].read_bytes()

    def focal_length_mm(self, _index: int) -> None:
        """Not known."""
        return


def moved(gauge: dict[str, Any], drawn: DrawnPlane, off_px: float) -> None:
    """The centre drawn elsewhere, all that was clicked at its place in the picture."""
    there = gauge["centre"][0] + off_px * 0.8, gauge["centre"][1] + off_px * 0.6
    around, outer = drawn.around(there), gauge["radius"][1]

    def carried(angle: float) -> float:
        seen = around.polar(drawn.place(angle, outer))[0]
        return seen - 360.0 * round((seen - angle) / 360.0)

    for own in (gauge, *gauge["needles"]):
        own["scale"] = [[carried(angle), value] for angle, value in own.get("scale", gauge["scale"])]
        own.setdefault("wraps", gauge["wraps"])
    for needle in gauge["needles"]:
        needle["template"]["at"] = carried(needle["template"]["at"])
    gauge["rim"] = [[x + off_px * 0.8, y + off_px * 0.6] for x, y in gauge.get("rim", ())] or None
    gauge["centre"] = list(there)


@pytest.mark.slow
@pytest.mark.shared
@pytest.mark.skipif(not COCKPIT.is_dir(), reason="needs ../shared/data, which is not part of the project")
@pytest.mark.parametrize(("name", "off_px"), [("sixpack_a", 0.0), ("flight_a", 4.0)])
def test_taking_each_offer_comes_to_an_end_and_makes_no_altimeter_worse(
    tmp_path: Path, name: str, off_px: float
) -> None:
    """However its centre is drawn: no round reads less or scores lower, and the altitude is as near at the end."""
    panel, picture = SETS[name]
    document = yaml_of(panel)
    (tmp_path / document["picture"]).write_bytes(picture.read_bytes())
    write_yaml(tmp_path / "panel.yaml", document)
    session = SetupSession(Folder(COCKPIT / name), tmp_path / "panel.yaml", tmp_path / "panel.yaml")
    truth = [float(row["alt_ft"]) for row in rows_of(COCKPIT / f"{name}_truth.csv")]
    key, gauges = session.picture_key, document["gauges"]
    place = next(index for index, gauge in enumerate(gauges) if gauge["name"] == "altimeter")
    own = gauges[place]
    if off_px:
        moved(own, session.planes(document, key).drawn(tuple(own["centre"]), own.get("rim")), off_px)
    own = gauges[place] = {name: value for name, value in own.items() if value is not None}

    def trial() -> tuple[Fit, float]:
        done = tried(session.panel_of_gauge(document, key, place), session.frames(), lambda: False)
        off = [
            each.value - truth[frame.index]
            for frame in done.frames
            for each in frame.readings
            if each.is_together and each.value is not None
        ]
        return Fit.of_trial(done, gauges[place]), float(np.sqrt(np.mean(np.square(off))))

    fit, first_ft = trial()
    error_ft = first_ft
    for round_ in range(MOST_ROUNDS + 1):
        question = TrialQuestion(document=document, picture=key, gauge=place, tab="x")
        offers = advice_answer(session, question, lambda: False)["offers"]
        if not offers:
            break
        assert round_ < MOST_ROUNDS
        (offer,) = offers
        assert "→" in offer["gain"]
        gauges[place] = copy.deepcopy(offer["gauge"])
        before, (fit, error_ft) = fit, trial()
        assert fit.is_better_than(before)
        assert fit.gain_over(before) == offer["gain"]
    assert error_ft <= first_ft + WITHIN_FT


GAUGE: dict[str, Any] = {
    "name": "dial", "centre": [100.0, 100.0], "radius": [10.0, 50.0], "sweep": [0.0, 300.0],
    "scale": [[0.0, 0.0], [300.0, 10.0]], "needles": [{"name": "x", "template": {"at": 90.0, "span": 10.0}}],
}  # fmt: skip
BESIDE_DEG = math.degrees(3.0 / (0.7 * 50.0))  # of a needle straight down, from a centre 3 px to the right


def trial_of(score: float, moved_px: tuple[float, float] | None, axis_deg: float) -> Trial:
    """Ten frames that are all read."""
    reading = NeedleTrial("x", Status.READ, 1.0, 30.0, score)
    return Trial(tuple(FrameTrial(index, None, "", (reading,)) for index in range(10)), moved_px, (), {"x": axis_deg})


def offered(after: dict[str, Trial], off_px: float = 1.0) -> list[str]:
    """Offers for a gauge off by a degree and this distance, by trials with another centre or axis."""

    def tries(gauge: dict[str, Any]) -> Trial:
        if gauge["centre"] != GAUGE["centre"]:
            return after["centre"]
        return after["axis"] if gauge["needles"][0]["template"]["at"] != 90.0 else trial_of(0.95, (off_px, 0.0), 1.0)

    sight = Sight(DrawnPlane.square_on((100.0, 100.0)), is_oblique=False, height_inches=None)
    return [each.gain for each in advised(GAUGE, lambda _: sight, tries, lambda _, near, __: near)]


def test_only_what_fits_better_is_offered() -> None:
    """A centre that scores lower, or only overshoots, is not offered; then only the axis is tried."""
    worse, swung = trial_of(0.94, None, 0.0), trial_of(0.95, (-1.0, 0.0), -1.0)
    assert offered({"centre": worse, "axis": worse}) == []
    assert offered({"centre": swung, "axis": swung}) == []
    (gain,) = offered({"centre": trial_of(0.97, None, 0.0), "axis": worse})
    assert offered({"centre": trial_of(0.97, None, 0.0), "axis": worse}, off_px=3.0) == []  # it shows another value
    assert gain.startswith("values read 10 of 10, mean score 0.950 → 0.970, needles turn 1.00 → 0.00 px off it")
    assert gain.endswith("axes are 1.00 → 0.00° off")
    assert len(offered({"centre": worse, "axis": trial_of(0.95, (1.0, 0.0), 0.0)})) == 1
    assert math.isclose(Fit.of_trial(worse, GAUGE).score, 0.94)


def test_score_of_a_hidden_hand_counts_for_no_drawing() -> None:
    """Where the others put it, whatever lies there matches as it happens to."""
    shown = trial_of(0.99, None, 0.0)
    hidden = FrameTrial(10, None, "", (NeedleTrial("x", Status.HIDDEN, 1.0, 30.0, 0.2),))
    lost = FrameTrial(10, None, "", (NeedleTrial("x", Status.MISSING, None, None, 0.2),))

    scores = [Fit.of_trial(replace(shown, frames=(*shown.frames, last)), GAUGE).score for last in (hidden, lost)]

    assert scores == [0.99, 0.9]


def test_a_centre_from_which_the_needle_shows_another_value_is_not_offered() -> None:
    """Frames show where a needle turns, but not its value there: the scale may move along or stay."""
    moved = copy.deepcopy(GAUGE) | {"centre": [103.0, 100.0]}
    moved["needles"][0]["template"]["at"] = 90.0 + BESIDE_DEG
    along = moved | {"scale": [[BESIDE_DEG, 0.0], [300.0 + BESIDE_DEG, 10.0]]}
    around = {"scale": [[0.0, 0.0], [180.0, 500.0]], "wraps": 1000.0}

    assert not shows_the_same(GAUGE, moved)
    assert shows_the_same(GAUGE, along)
    assert not shows_the_same(GAUGE | around, moved | around)
    nearer = copy.deepcopy(moved | around)
    nearer["needles"][0]["template"]["at"] = 90.0 - 360.0 + 3.5
    assert shows_the_same(GAUGE | around, nearer)
