"""Automatic finding of dials: drawn dials are found where they were drawn, and inconsistent ones are not proposed."""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from decoder.imaging.alignment import IDENTITY
from decoder.imaging.panel_pictures import panel_from_file
from decoder.setup.drawn_plane import XY, DrawnPlane, Planes
from decoder.setup.finding.bank import bank_of
from decoder.setup.finding.dials import FoundDial, amid_numerals, dials_seen, page_of, seen_around
from decoder.setup.finding.geared import lowest
from decoder.setup.finding.hands import Hands, together, what_is_not_told
from decoder.setup.finding.legends import legend_of
from decoder.setup.finding.marks import Marked, marked
from decoder.setup.finding.numerals import Text, is_there, level_deg, numbers_at, parts_of, texts_in
from decoder.setup.finding.proposal import ProposedGauge
from decoder.setup.finding.scales import fits
from decoder.setup.finding.strokes import strokes_in
from decoder.setup.finding.ticks import comb_about, comb_around
from decoder.setup.proposals import Pictures
from decoder.setup.proposing.draft import drafted
from decoder.setup.proposing.search import Anchors
from decoder.setup.session import SetupSession
from decoder.setup.sources import open_source
from tests.programs import A1, FIXTURES, ran, rows_of, yaml_of

CENTRE = (203.4, 198.7)
RADIUS_PX = 120.0
SHARED = Path(__file__).parents[2].parent / "shared" / "data"
EVEN = {value: 135.0 + 2.7 * value for value in range(0, 101, 10)}
BENT = dict(zip(range(40, 180, 20), (305.0, 358.0, 411.0, 464.0, 507.0, 548.0, 590.0), strict=True))
AROUND = {value: 270.0 + 36.0 * value for value in range(10)}
# Numbers as they lie around a dial, and where in a picture.
NUMBERS = {
    value: (round(190 + 110 * math.cos(math.radians(angle))), round(150 + 110 * math.sin(math.radians(angle))))
    for value, angle in EVEN.items()
    if value
}
# Hands turn here, and the flight was there, in turns of the finest.
PIVOT = (206.0, 201.5)
FLOWN = (34.3, 27.05, 28.6, 31.9, 36.2, 39.72, 41.35, 46.6, 52.1, 57.48, 61.95, 66.3)


def drawn(
    ticks_deg: Iterable[float],
    long_deg: Iterable[float],
    flat: float = 1.0,
    inner_parts: tuple[float, float] = (0.92, 0.85),
) -> NDArray[np.uint8]:
    """A dark face with light ticks; `flat` is how it is seen from below."""
    large = np.full((1600, 1600), 40, np.uint8)
    for angles, inner in zip((ticks_deg, long_deg), inner_parts, strict=True):
        for angle_deg in angles:
            _stroke(large, CENTRE, math.radians(angle_deg), (inner * RADIUS_PX, RADIUS_PX), 10, flat)
    return _photographed(large, 7)


def _stroke(
    large: NDArray[np.uint8], at: XY, angle: float, reach: tuple[float, float], wide: int, flat: float = 1.0
) -> None:
    """A light stroke along a ray, on a picture that is four times as large."""
    ends = [(4 * (at[0] + px * math.cos(angle)) + 1.5, 4 * (at[1] + flat * px * math.sin(angle)) + 1.5) for px in reach]
    one, other = ((round(x * 16), round(y * 16)) for x, y in ends)
    cv2.line(large, one, other, 220, wide, cv2.LINE_AA, 4)


def _photographed(large: NDArray[np.uint8], seed: int) -> NDArray[np.uint8]:
    """Shrunk to a quarter, blurred and noisy."""
    small = cv2.resize(large, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA).astype(np.float64)
    noise = np.random.default_rng(seed).normal(0, 2, small.shape)
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


def test_ticks_too_short_to_aim_are_found_by_their_numerals(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ticks of four pixels aim anywhere, but the numerals around them tell where their ring is."""
    picture = drawn([], EVEN.values(), inner_parts=(0.97, 0.965))

    (dial,) = found(picture, printed(EVEN), monkeypatch)
    scale = scale_of(dial)

    assert math.dist(dial.centre, CENTRE) < 1.0
    assert scale.doubt == ""
    assert {mark.value: mark.angle_deg % 360 for mark in scale.marks} == pytest.approx(
        {value: angle % 360 for value, angle in EVEN.items()}, abs=0.7
    )


def test_strokes_of_numerals_are_no_ticks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Upright strokes within the numerals aim at the pivot above and below it, and are bolder than the ticks."""
    large = np.full((1600, 1600), 40, np.uint8)
    for turn in np.radians(list(AROUND.values())).tolist():
        _stroke(large, CENTRE, turn, (0.66 * RADIUS_PX, 0.74 * RADIUS_PX), 16)
        _stroke(large, CENTRE, turn, (0.95 * RADIUS_PX, RADIUS_PX), 5)

    (dial,) = found(_photographed(large, 7), printed(AROUND, off_deg=0.0), monkeypatch)

    assert dial.comb.ring_px == pytest.approx((0.95 * RADIUS_PX, RADIUS_PX), abs=2.0)


def test_what_a_whole_ring_shows_explains_more_than_a_part_of_it() -> None:
    """An altimeter's setting between its 9 and 2: the run from 2 to 9 leaves it out, but explains no more of it."""
    setting = [
        Text(said, (CENTRE[0] + 74.0 * math.cos(turn), CENTRE[1] + 74.0 * math.sin(turn)), (14.0, 11.0), 0.0, 0.98)
        for said, turn in (("30.0", -1.0), ("29.9", -1.3), ("21", -0.7), ("4", -1.9))
    ]
    texts = [*printed({value: angle for value, angle in AROUND.items() if value > 1}), *setting]

    first = fits(seen_around(texts, DrawnPlane.square_on(CENTRE)))[0]

    assert first.family is not None
    assert first.family.name == "altimeter"


def test_false_numbers_among_glyphs_spoil_no_scale_of_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts of turned numerals are read as other digits; the lines of text agree without them."""
    false = [replace(text, by_glyphs=True) for text in printed({3: 150.0, 7: 175.0, 5: 205.0, 8: 240.0, 2: 290.0})]

    (dial,) = found(drawn(between(EVEN, 4), EVEN.values()), [*printed(EVEN), *false], monkeypatch)

    assert scale_of(dial).doubt == ""
    assert [mark.value for mark in scale_of(dial).marks] == list(EVEN)


@pytest.mark.parametrize("flat", [1.0, 0.85])
def test_numerals_tell_what_they_stand_around(flat: float) -> None:
    """Square on or oblique, with the numerals of a radio beside them."""
    radio = [Text(said, (380.0, 20.0 * row), (18.0, 11.0), 0.0, 0.9) for row, said in enumerate(("118", "25", "7"), 1)]

    first = next(amid_numerals([*printed(EVEN, flat=flat), *radio]))

    assert math.dist(first, CENTRE) < 0.08 * RADIUS_PX


def test_numerals_in_a_line_make_no_dial() -> None:
    """Read a pixel or two beside their line, the numerals of a straight scale lie on a large circle."""
    places = {100: (207.0, 150.0), 80: (211.0, 196.0), 60: (212.0, 241.0), 40: (212.0, 286.0), 20: (213.0, 332.0)}
    texts = [Text(str(value), at, (22.0, 12.0), 0.0, 0.98) for value, at in places.items()]

    assert fits(seen_around(texts, DrawnPlane.square_on((395.0, 241.0)))) == []


@pytest.mark.skipif(not is_there(), reason="numerals are read by the extra `ocr`")
def test_small_light_numerals_on_a_dark_ground_are_read() -> None:
    """Most of them, and no fewer than dark ones on a light ground, which the recognizer has learned from."""
    picture = np.full((300, 420), 45, np.uint8)
    for number, place in NUMBERS.items():
        cv2.putText(picture, str(number), place, cv2.FONT_HERSHEY_SIMPLEX, 0.3, 150, 1, cv2.LINE_AA)
    picture = np.asarray(cv2.GaussianBlur(picture, (0, 0), 0.8), np.uint8)

    light, dark = (
        sum(text.value in NUMBERS for part in parts_of(shown) if part.scale > 1 for text in texts_in(shown, part))
        for shown in (picture, 255 - picture)
    )

    assert light >= dark > len(NUMBERS) / 2


@pytest.mark.skipif(not is_there(), reason="numerals are read by the extra `ocr`")
@pytest.mark.parametrize(("ink", "ground"), [(60, 225), (190, 35)], ids=["dark", "light"])
def test_single_digits_are_read_by_their_glyphs(ink: int, ground: int) -> None:
    """A clock's hours, but for its lone 1, which may as well be a tick; on lines alone the recognizer finds few."""
    picture = np.full((300, 420), ground, np.uint8)
    for hour in range(1, 13):
        turn = math.radians(30 * hour - 90)
        at = round(205 + 100 * math.cos(turn)), round(155 + 100 * math.sin(turn))
        cv2.putText(picture, str(hour), at, cv2.FONT_HERSHEY_SIMPLEX, 0.45, ink, 1, cv2.LINE_AA)
    picture = np.asarray(cv2.GaussianBlur(picture, (0, 0), 0.6), np.uint8)

    read = [text.value for text in numbers_at(picture, 2.0)]

    assert set(read) <= set(range(2, 13))
    assert len(set(read)) >= 9


@pytest.mark.skipif(not is_there(), reason="numerals are read by the extra `ocr`")
@pytest.mark.parametrize("blur_px", [0.0, 2.5])
def test_noise_has_no_glyphs(blur_px: float) -> None:
    """A dark panel at high sensitivity, or a textured one, would keep the recognizer busy for minutes."""
    grain = np.random.default_rng(1).normal(128, 40 * (1.0 + 2.0 * blur_px), (300, 300))
    picture = np.asarray(grain.clip(0, 255), np.uint8)
    if blur_px:
        picture = np.asarray(cv2.GaussianBlur(picture, (0, 0), blur_px), np.uint8)

    assert numbers_at(picture, 2.0) == []


def test_a_grille_takes_little_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of its holes may be a glyph, and a table of all their pairs would take gigabytes for a large one."""
    rows: list[object] = []
    monkeypatch.setattr("decoder.setup.finding.numerals._read_row", lambda _, row, __: rows.append(row))
    picture = np.full((600, 600), 170, np.uint8)
    for column, row in np.ndindex(40, 40):
        cv2.circle(picture, (20 + 14 * column, 20 + 14 * row), 3, 40, -1, cv2.LINE_AA)

    tracemalloc.start()
    numbers_at(picture, 2.0)
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()

    assert len(rows) >= 1600
    assert peak_bytes < 60e6


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.parametrize("flat", [0.92, 0.8])
def test_ticks_part_of_the_way_around_are_found_as_their_circles_show_them(
    flat: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three quarters of a ring determine no plane, but the rim around them is a circle in one only."""
    large = np.full((1600, 1600), 40, np.uint8)
    for angles, inner in ((between(EVEN, 5), 0.92), (EVEN.values(), 0.85)):
        for angle_deg in angles:
            _stroke(large, CENTRE, math.radians(angle_deg), (inner * RADIUS_PX, RADIUS_PX), 10, flat)
    middle = round(4 * CENTRE[0] + 1.5), round(4 * CENTRE[1] + 1.5)
    rim_px = 4.6 * RADIUS_PX
    cv2.ellipse(large, middle, (round(rim_px), round(flat * rim_px)), 0, 0, 360, 140, 12, cv2.LINE_AA)

    (dial,) = found(_photographed(large, 7), printed(EVEN, flat=flat), monkeypatch)

    assert not dial.comb.is_all_round
    assert math.dist(dial.centre, CENTRE) < 1.5
    assert dial.comb.shape[1, 1] / dial.comb.shape[0, 0] == pytest.approx(flat, abs=0.02)


def test_a_number_that_begins_with_its_point_is_one() -> None:
    """As on scales below 1; a full stop before a word is none."""
    values = [Text(said, (0.0, 0.0), (9.0, 9.0), 0.0, 0.9).value for said in (".5", ".25", "0.5", ".", "..5", ".a")]

    assert values[:3] == [0.5, 0.25, 0.5]
    assert values[3] is None
    assert values[5] is None


@pytest.mark.slow
def test_a_rose_begins_at_its_own_mark_however_fine_its_ticks_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a tick every 3 degrees, and long ones behind a needle: a step further on, all numerals have ticks, too."""
    marks = {value: 270.0 + value for value in range(0, 360, 30)}
    fine = [angle for angle in np.arange(0.0, 360.0, 3.0) if angle not in {60.0, 240.0}]

    (dial,) = found(
        drawn(fine, [angle for angle in marks.values() if angle % 180.0 != 60.0]), printed(marks), monkeypatch
    )
    scale = scale_of(dial)

    assert scale.doubt == ""
    assert [(mark.angle_deg - mark.value) % 360 for mark in scale.marks] == pytest.approx([270.0] * 12, abs=0.5)


@pytest.mark.slow
def test_numerals_that_disagree_make_no_scale(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two numerals exchanged, as a recognizer may misread them, and nothing is proposed without a word of doubt."""
    wrong = dict(zip([0, 10, 70, 30, 60, 50, 40, 20, 80, 90, 100], EVEN.values(), strict=True))

    (dial,) = found(drawn(between(EVEN, 5), EVEN.values()), printed(wrong), monkeypatch)

    assert all(marked(fit, dial.comb).doubt for fit in dial.fits)


def test_three_numerals_are_not_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """Numerals that may be in order by chance are reported, and not proposed."""
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
        (["SPEED", "100 FEET PER MIN"], "vertical speed", "fpm", 100.0),
        (["OIL", "C"], "oil temperature", "degC", 1.0),
        (["C"], "", "", 1.0),
        (["PUSH", "LTAA"], "", "", 1.0),
    ],
)
def test_legends_tell_name_unit_and_factor(words: list[str], name: str, unit: str, factor: float) -> None:
    """Also half hidden by a needle; a letter by itself tells nothing."""
    legend = legend_of(words)

    assert (legend.name, legend.unit, legend.factor) == (name, unit, factor)


def test_speed_beside_a_scale_about_zero_is_vertical() -> None:
    """Where a needle hides the other half of the name, the numerals tell: an airspeed never falls below 0."""
    assert legend_of(["SPEED"]).about_zero().name == "vertical speed"
    assert legend_of(["KNOTS", "AIRSPEED"]).about_zero().name == "airspeed"
    assert legend_of(["EGT"]).about_zero().name == "exhaust gas temperature"


def test_numbers_too_small_for_their_unit_are_doubted() -> None:
    """A tachometer of 3 to 35 counts hundreds: where "x100" was not read, its scale is a hundred times too low."""
    assert legend_of(["RPM"]).lacks_factor(35.0)
    assert not legend_of(["RPM", "X100"]).lacks_factor(35.0)
    assert legend_of(["FEET", "ALT"]).lacks_factor(9.0)
    assert not legend_of(["KNOTS"]).lacks_factor(160.0)


def hands_at(
    turns: float, lengths: Sequence[float], turns_of: Sequence[float], tail: float = 0.25
) -> NDArray[np.uint8]:
    """A dark face with marks and hands, the first on top: each with its tail, about a pivot beside the middle."""
    large = np.full((1600, 1600), 40, np.uint8)
    x, y = PIVOT
    for step in range(10):
        _stroke(large, CENTRE, math.radians(270.0 + 36.0 * step), (0.9 * RADIUS_PX, RADIUS_PX), 10)
    for part, turn in reversed([*zip(lengths, turns_of, strict=True)]):
        angle = math.radians(270.0 + 360.0 * turns / turn)
        _stroke(large, (x, y), angle, (-tail * RADIUS_PX, part * RADIUS_PX), round(26 - 18 * part))
    return _photographed(large, round(1000 * turns))


def altimeter(flown: Sequence[float], lengths: Sequence[float], turns_of: Sequence[float]) -> Hands | str:
    """Findings on hands with these ratios to the finest's turns; two are searched for, and a third."""
    picture, *others = (hands_at(turns, lengths, turns_of) for turns in flown)
    seen = Pictures(picture, [(other, IDENTITY) for other in others])
    return together(seen, DrawnPlane.square_on(CENTRE), 0.9 * RADIUS_PX, 270.0, (10,), further=10)


def test_the_flight_tells_which_hand_is_which() -> None:
    """The short hand counts for the long one in all pictures; a third counts theirs, and all turn about one pivot."""
    found = altimeter(FLOWN, (0.85, 0.55, 0.35), (1.0, 10.0, 100.0))

    assert isinstance(found, Hands)
    assert math.dist(found.centre, PIVOT) < 0.5
    assert [angle % 360 for angle in found.angles_deg] == pytest.approx(
        [(270 + 360 * FLOWN[0] / turn) % 360 for turn in (1.0, 10.0)], abs=0.7
    )
    assert found.is_counted
    assert sum(min(abs(each - turns) for each in found.turns) < 0.05 for turns in FLOWN) >= 0.75 * len(FLOWN)


@pytest.mark.parametrize(("tail", "across"), [(0.25, False), (0.7, True)])
def test_a_tail_as_long_as_the_tip_is_told(tail: float, *, across: bool) -> None:
    """Which end of a needle points is unknown if both are equally long."""
    turned = [0.61, *(0.1 * step for step in range(8))]

    assert ("reaches as far" in needle_of([hands_at(turns, (0.75,), (1.0,), tail) for turns in turned])) == across


@pytest.mark.parametrize(("turns_of", "several"), [((1.0, 2.7), True), ((1.0, 1e6), False)], ids=["moves", "stands"])
def test_two_needles_on_one_scale_are_told(turns_of: tuple[float, float], *, several: bool) -> None:
    """Of two moving hands it is unknown which is meant; one that stands still does not count."""
    turned = [0.61, *(0.07 + 0.1 * step for step in range(8))]

    assert (
        "more than one needle" in needle_of([hands_at(turns, (0.85, 0.7), turns_of) for turns in turned])
    ) == several


def needle_of(pictures: Sequence[NDArray[np.uint8]]) -> str:
    """What is left open about the moving parts of a dial, the first picture being the panel picture."""
    picture, *others = pictures
    seen = Pictures(picture, [(other, IDENTITY) for other in others])
    return what_is_not_told(seen, DrawnPlane.square_on(CENTRE), 0.9 * RADIUS_PX, 270.0 + 360.0 * 0.61)


@pytest.mark.parametrize("turns_of", [(1.0, 7.0, 100.0), (1.0, 1e6, 1e6)], ids=["another gear", "only one moves"])
def test_hands_that_do_not_count_for_each_other_are_none(turns_of: tuple[float, ...]) -> None:
    """Hands of which no one follows another in every picture are not told apart, and that is said."""
    assert isinstance(altimeter(FLOWN, (0.85, 0.55, 0.35), turns_of), str)


@pytest.mark.parametrize(
    ("values", "is_counted", "begins"),
    [
        ([1700.0, 3850.0, 10200.0], True, 900.0),
        ([3000.0, 9750.0, 5800.0], False, 1300.0),
        ([300.0, 4000.0], False, -500.0),
        ([200.0, 9700.0], False, None),
        ([500.0, 9000.0, 12000.0, 14000.0], True, None),
        ([99980.0, 200.0, 3000.0], True, -500.0),
        ([1700.0, 3850.0, 10200.0, 49600.0], True, 900.0),
    ],
)
def test_values_begin_where_the_flight_never_was(
    values: list[float], begins: float | None, *, is_counted: bool
) -> None:
    """Two hands give an altitude within 10,000 ft: around the altitudes flown, or not at all."""
    assert lowest(np.array(values), (1000.0, 10000.0), is_counted=is_counted) == begins


def test_ticks_tell_from_where_they_radiate() -> None:
    """On three quarters of a ring, and looked at from four pixels beside, to half a pixel."""
    picture = drawn(between(EVEN, 5), EVEN.values())
    planes = Planes.of({}, (400, 400), None)
    comb = comb_around(picture, planes, strokes_in(picture), CENTRE, 0.75 * RADIUS_PX)
    assert comb is not None
    assert not comb.is_all_round

    again = comb_about(picture, planes, comb, DrawnPlane.square_on((CENTRE[0] + 4, CENTRE[1] - 2)))

    assert again is not None
    assert math.dist(again.rim.centre, CENTRE) < 0.6


@pytest.mark.parametrize("bank_deg", [0.0, -37.0])
def test_a_bank_scale_is_known_by_its_marks(bank_deg: float) -> None:
    """Also from beside its pivot; a ring with a mark every 10 degrees is none."""
    zero_deg = 270.0 - bank_deg
    bank = [zero_deg + mark for mark in (-90, -60, -30, -20, -10, 0, 10, 20, 30, 60, 90)]
    ring = [zero_deg + 10.0 * step for step in range(36)]
    told = []
    for marks in (bank, ring):
        picture = drawn([], marks)
        comb = comb_around(
            picture, Planes.of({}, (400, 400), None), strokes_in(picture), (CENTRE[0], CENTRE[1] + 3), RADIUS_PX
        )
        assert comb is not None
        told.append(bank_of(comb, np.eye(2)))

    found, none = told
    assert none is None
    assert found is not None
    assert math.dist(found[0].centre, CENTRE) < 1.0
    assert found[1] == pytest.approx(zero_deg % 360, abs=0.6)


def test_words_tell_what_is_level() -> None:
    """Seen obliquely their directions vary over the panel; a few askew change nothing, and too few give nothing."""
    words = [Text("WORD", (x, y), (60.0, 14.0), 4.0 - x / 200, 0.9) for x in range(0, 800, 100) for y in (50, 400)]
    askew = [Text("WORD", (300.0, 90.0), (60.0, 14.0), 15.0, 0.9)]

    assert level_deg([*words, *askew], (500.0, 200.0), (600, 800)) == pytest.approx(1.5, abs=0.2)
    assert level_deg(words[:4], (500.0, 200.0), (600, 800)) is None


def test_a_number_far_beyond_the_others_is_none_of_the_scale(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was read beside the first numeral of an uneven scale is left out of it."""
    texts = [*printed(BENT), *printed({1: 270.0})]

    (dial,) = found(drawn([*between(BENT, 4), 270.0], BENT.values()), texts, monkeypatch)

    assert {mark.value for mark in scale_of(dial).marks} <= set(BENT)


WHOLE = {
    "airspeed_kt": "asi_kt", "vertical_speed_fpm": "vsi_fpm", "engine_speed_rpm": "tach_rpm",
    "altitude_ft": "alt_ft", "clock_s": "clock_local_s", "compass_deg": "hi_heading_deg",
    "compass_2_deg": "nav1_obs_deg", "compass_3_deg": "nav2_obs_deg",
    "automatic_direction_finder_deg": "adf_needle_deg", "bank_deg": "ai_roll_deg",
}  # fmt: skip
EVERY = 3


@pytest.mark.shared
@pytest.mark.slow
@pytest.mark.untraced
@pytest.mark.skipif(not is_there(), reason="numerals are read by the extra `ocr`")
@pytest.mark.skipif(not SHARED.exists(), reason="../shared is absent")
def test_a_drawn_cockpit_is_found(tmp_path: Path) -> None:
    """Ten dials of a whole panel from aside: all of them read right, one of three frames, and no other."""
    frames, pictures = tmp_path / "frames", sorted((SHARED / "cockpit_flight" / "flight_a").glob("*.jpg"))
    frames.mkdir()
    for picture in pictures:
        (frames / picture.name).symlink_to(picture)
    flight, panel = tmp_path / "flight.mcap", tmp_path / "panel.yaml"
    ran("recorder", "replay", frames, "-o", flight, "--rate", "4")

    drafted(SetupSession(open_source([flight]), None, panel))
    ran("decode", flight, "--panel", panel, "-o", tmp_path, "--format", "csv", "--every", str(EVERY))

    truth = rows_of(SHARED / "cockpit_flight" / "flight_a_truth.csv")[::EVERY]
    told = rows_of(tmp_path / "flight.csv")
    gauges = yaml_of(panel)["gauges"]
    columns = [(gauge.get("combined") or gauge.get("card") or gauge["needles"][0])["name"] for gauge in gauges]
    assert set(columns) == set(WHOLE)
    for column, name in WHOLE.items():
        turn = 360.0 if column.endswith("_deg") else 12 * 3600.0 if column == "clock_s" else math.inf
        read = [(row, other) for row, other in zip(told, truth, strict=True) if row[f"{column}_status"] == "read"]
        assert len(read) >= 0.8 * len(told), column
        # The needle rests at its stop, whatever the aircraft does.
        stop = 2000.0 if column == "vertical_speed_fpm" else math.inf
        off = np.array([float(row[column]) - min(max(float(other[name]), -stop), stop) for row, other in read])
        off -= turn * np.round(off / turn) if math.isfinite(turn) else 0.0
        sigma = np.array([float(row[f"{column}_sigma"]) for row, _ in read])
        assert np.mean(np.abs(off) <= 1.96 * sigma) >= 0.9, (column, off, sigma)
        assert np.abs(off).max() < 4 * sigma.max(), (column, off, sigma)


def test_proposing_begins_a_panel_and_edits_none(tmp_path: Path) -> None:
    """`--propose` beside `--panel` is wrong usage, said before any picture is read."""
    done = ran(
        "decode", "setup", FIXTURES / "panel.jpg", "--propose", tmp_path / "a.yaml", "--panel", tmp_path / "b.yaml"
    )

    assert done.returncode == 2
    assert "leave out --panel" in done.stderr


def test_a_second_draft_in_a_folder_has_a_picture_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Minutes of finding do not end in a refusal: the first draft's picture stays, and the second names its own."""
    document = yaml_of(FIXTURES / "panel.yaml")
    gauge = proposed_gauge(document["gauges"][0])
    monkeypatch.setattr(
        "decoder.setup.proposing.draft.tried_search", lambda *_: iter([Anchors(document["anchors"], 3), gauge])
    )
    (tmp_path / "panel.jpg").write_bytes(b"of the first draft")

    drafted(SetupSession(open_source([A1]), None, tmp_path / "second.yaml", is_new=True))

    assert (tmp_path / "panel.jpg").read_bytes() == b"of the first draft"
    assert (picture := panel_from_file(tmp_path / "second.yaml").panel.picture) == "panel_2.jpg"
    assert (tmp_path / picture).stat().st_size > 10_000


def proposed_gauge(gauge: dict[str, Any]) -> ProposedGauge:
    """A whole proposal of a gauge that was drawn."""
    return ProposedGauge(gauge, gauge, (0.0, 0.0), (), str(gauge["name"]), (), (), ())


def test_a_picture_without_dials_is_said(tmp_path: Path) -> None:
    """Nothing is written where nothing is whole, and the end is an ordinary one."""
    blank, panel = tmp_path / "blank.jpg", tmp_path / "panel.yaml"
    cv2.imwrite(str(blank), np.full((300, 400), 90, np.uint8))

    done = ran("decode", "setup", blank, "--propose", panel)

    assert (done.returncode, done.stderr) == (0, "")
    assert "nothing was written" in done.stdout.lower()
    assert not panel.exists()
