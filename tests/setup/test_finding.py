"""Dials found by themselves: what is drawn is found where it was drawn, and what does not agree is not proposed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from decoder.panel.scale import Scale
from decoder.setup.drawn_plane import DrawnPlane, Planes
from decoder.setup.finding.dials import FoundDial, dials_seen, page_of, seen_around
from decoder.setup.finding.legends import legend_of
from decoder.setup.finding.marks import Marked, marked
from decoder.setup.finding.numerals import Text, is_there
from decoder.setup.finding.scales import fits
from decoder.setup.proposing.draft import drafted
from decoder.setup.session import SetupSession
from decoder.setup.sources import open_source
from tests.programs import FIXTURES, ran

CENTRE = (203.4, 198.7)
RADIUS_PX = 120.0
SHARED = Path(__file__).parents[2].parent / "shared" / "data"
EVEN = {value: 135.0 + 2.7 * value for value in range(0, 101, 10)}
BENT = dict(zip(range(40, 180, 20), (305.0, 358.0, 411.0, 464.0, 507.0, 548.0, 590.0), strict=True))
AROUND = {value: 270.0 + 36.0 * value for value in range(10)}


def drawn(ticks_deg: Iterable[float], long_deg: Iterable[float], flat: float = 1.0) -> NDArray[np.uint8]:
    """A dark face with light ticks, four times as large and then shrunk; `flat` is how it is seen from below."""
    large = np.full((1600, 1600), 40, np.uint8)
    for angles, inner in ((ticks_deg, 0.92), (long_deg, 0.85)):
        for angle_deg in angles:
            angle = math.radians(angle_deg)
            ends = [
                (4 * (CENTRE[0] + part * RADIUS_PX * math.cos(angle)) + 1.5,
                 4 * (CENTRE[1] + flat * part * RADIUS_PX * math.sin(angle)) + 1.5)
                for part in (inner, 1.0)
            ]  # fmt: skip
            one, other = ((round(x * 16), round(y * 16)) for x, y in ends)
            cv2.line(large, one, other, 220, 10, cv2.LINE_AA, 4)
    small = cv2.resize(large, (400, 400), interpolation=cv2.INTER_AREA).astype(np.float64)
    noise = np.random.default_rng(7).normal(0, 2, small.shape)
    return np.asarray(np.clip(cv2.GaussianBlur(small, (0, 0), 0.7) + noise, 0, 255), np.uint8)


def printed(marks: Mapping[int, float], off_deg: float = 1.0, flat: float = 1.0) -> list[Text]:
    """The numerals as a recognizer would give them: some degrees beside their marks."""
    found = []
    for number, (value, angle_deg) in enumerate(marks.items()):
        angle = math.radians(angle_deg + off_deg * (-1) ** number)
        at = CENTRE[0] + 0.7 * RADIUS_PX * math.cos(angle), CENTRE[1] + 0.7 * flat * RADIUS_PX * math.sin(angle)
        found.append(Text(str(value), at, (18.0, 11.0), 0.0, 0.98))
    return found


def between(marks: Mapping[int, float], parts: int) -> list[float]:
    """The angles of small ticks between marks."""
    angles = list(marks.values())
    return [low + (high - low) * part / parts for low, high in pairwise(angles) for part in range(1, parts)]


def found(picture: NDArray[np.uint8], texts: list[Text], monkeypatch: pytest.MonkeyPatch) -> list[FoundDial]:
    """The dials of a picture whose print is known."""
    monkeypatch.setattr("decoder.setup.finding.dials.is_there", lambda: False)
    page = page_of(picture, picture, Planes.of({}, (400, 400), None), texts)
    return [step for step in dials_seen(page) if isinstance(step, FoundDial)]


def scale_of(dial: FoundDial) -> Marked:
    """The surest scale of a dial."""
    return marked(dial.fits[0], dial.comb)


@pytest.mark.parametrize("marks", [EVEN, BENT], ids=["even", "uneven"])
def test_a_scale_is_found_where_it_is_drawn(marks: dict[int, float], monkeypatch: pytest.MonkeyPatch) -> None:
    """The pivot is found to half a pixel, and each value at the angle of its mark, not of its numeral."""
    picture = drawn(between(marks, 4), marks.values())

    (dial,) = found(picture, printed(marks), monkeypatch)
    scale = scale_of(dial)

    assert math.dist(dial.centre, CENTRE) < 0.5
    assert scale.doubt == ""
    assert {mark.value: mark.angle_deg % 360 for mark in scale.marks} == pytest.approx(
        {value: angle % 360 for value, angle in marks.items()}, abs=0.5
    )


def test_an_oblique_dial_is_squared_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Seen from 25 degrees above, its angles are those of the dial seen square on."""
    flat = math.cos(math.radians(25))
    picture = drawn([6.0 * step for step in range(60)], AROUND.values(), flat)

    (dial,) = found(picture, printed(AROUND, flat=flat), monkeypatch)
    scale = scale_of(dial)

    assert dial.comb.rim.points is not None
    assert scale.turn == 10.0
    assert [mark.angle_deg % 360 for mark in scale.marks] == pytest.approx(
        [(270.0 + 36.0 * mark.value) % 360 for mark in scale.marks], abs=0.7
    )


def test_numerals_that_disagree_make_no_scale(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two numerals exchanged, as a recognizer may misread them, and nothing is proposed without a word of doubt."""
    wrong = dict(zip([0, 10, 70, 30, 60, 50, 40, 20, 80, 90, 100], EVEN.values(), strict=True))

    (dial,) = found(drawn(between(EVEN, 5), EVEN.values()), printed(wrong), monkeypatch)

    assert all(marked(fit, dial.comb).doubt for fit in dial.fits)


def test_three_numerals_are_not_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """What stands in order by chance is said, and not proposed."""
    few = {value: EVEN[value] for value in (20, 50, 80)}

    (dial,) = found(drawn(between(EVEN, 5), EVEN.values()), printed(few), monkeypatch)

    assert "only 3 numerals" in scale_of(dial).doubt


def test_a_scale_about_zero_rises_to_both_sides() -> None:
    """The numerals of a vertical speed indicator are signed: those anticlockwise of 0 are negative."""
    places = {5: 136.0, 10: 92.0, 15: 48.0}
    texts = printed({0: 180.0, **places})[:4] + printed({5: 224.0, 10: 268.0, 15: 312.0})

    fit, *_ = fits(seen_around(texts, DrawnPlane.square_on(CENTRE)))

    assert fit.is_centred
    assert sorted(fit.values) == [-15, -10, -5, 0, 5, 10, 15]


@pytest.mark.parametrize(
    ("words", "name", "unit", "factor"),
    [
        (["KNOTS", "AIRSPEED"], "airspeed", "kt", 1.0),
        (["RPM", "X1O0"], "engine speed", "rpm", 100.0),
        (["RPMx100"], "engine speed", "rpm", 100.0),
        (["VERTI AL SPEED", "100 FEET PE MIN"], "vertical speed", "fpm", 100.0),
        (["OIL", "C"], "oil temperature", "degC", 1.0),
        (["C"], "", "", 1.0),
        (["PUSH", "LTAA"], "", "", 1.0),
    ],
)
def test_legends_tell_name_unit_and_factor(words: list[str], name: str, unit: str, factor: float) -> None:
    """Also half hidden by a needle; a letter by itself tells nothing."""
    legend = legend_of(words)

    assert (legend.name, legend.unit, legend.factor) == (name, unit, factor)


def test_numbers_too_small_for_their_unit_are_doubted() -> None:
    """A tachometer of 3 to 35 counts hundreds: where "x100" was not read, its scale is a hundred times too low."""
    assert legend_of(["RPM"]).lacks_factor(35.0)
    assert not legend_of(["RPM", "X100"]).lacks_factor(35.0)
    assert legend_of(["FEET", "ALT"]).lacks_factor(9.0)
    assert not legend_of(["KNOTS"]).lacks_factor(160.0)


@pytest.mark.shared
@pytest.mark.slow
@pytest.mark.skipif(not is_there(), reason="numerals are read by the extra `ocr`")
@pytest.mark.skipif(not SHARED.exists(), reason="../shared is absent")
def test_a_drawn_cockpit_is_found(tmp_path: Path) -> None:
    """Of four dials with numerals three have one hand or a rose: their scales are right, and their draft is valid."""
    frames = tmp_path / "frames"
    frames.mkdir()
    for number in range(0, 90, 9):
        name = f"f{number:04}.jpg"
        (frames / name).symlink_to(SHARED / "cockpit_flight" / "sixpack_a" / name)
    flight, panel = tmp_path / "flight.mcap", tmp_path / "panel.yaml"
    ran("recorder", "replay", frames, "-o", flight, "--rate", "4")

    done = drafted(SetupSession(open_source([flight]), None, panel))

    assert "3 of 4 dials" in done.text
    assert "it has several hands" in done.text
    gauges = {gauge["name"]: gauge for gauge in yaml.safe_load(panel.read_text(encoding="utf-8"))["gauges"]}
    assert set(gauges) == {"airspeed", "compass", "vertical speed"}
    truth = {
        "airspeed": {40: 311, 60: 361, 80: 413, 100: 467, 120: 510, 140: 552, 160: 594},
        "vertical speed": {-1500: 47, -1000: 92, -500: 136, 0: 180, 500: 224, 1000: 268, 1500: 313},
    }
    for name, marks in truth.items():
        scale = Scale.of(tuple(map(tuple, gauges[name]["scale"])))
        values = scale.values_at(np.array(list(marks.values()), np.float64))
        assert values == pytest.approx(list(marks), abs=0.02 * (max(marks) - min(marks)))


def test_proposing_begins_a_panel_and_edits_none(tmp_path: Path) -> None:
    """`--propose` beside `--panel` is wrong usage, said before any picture is read."""
    done = ran(
        "decode", "setup", FIXTURES / "panel.jpg", "--propose", tmp_path / "a.yaml", "--panel", tmp_path / "b.yaml"
    )

    assert done.returncode == 2
    assert "leave out --panel" in done.stderr


def test_a_picture_without_dials_is_said(tmp_path: Path) -> None:
    """Nothing is written where nothing is whole, and the end is an ordinary one."""
    blank, panel = tmp_path / "blank.jpg", tmp_path / "panel.yaml"
    cv2.imwrite(str(blank), np.full((300, 400), 90, np.uint8))

    done = ran("decode", "setup", blank, "--propose", panel)

    assert (done.returncode, done.stderr) == (0, "")
    assert "nothing was written" in done.stdout.lower()
    assert not panel.exists()
