"""Uncertainty beyond a frame's own: by the pivot, and by how well dials are found."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decoder.imaging.panel_pictures import PanelPictures, panel_from_file
from decoder.imaging.pictures import GreyPicture
from decoder.imaging.planes import DialPlane, Squeeze
from decoder.instruments.panel_reader import PanelReader
from decoder.learning.budget import Cause
from decoder.learning.drawn_points import (
    backward_findings,
    marks_missed_px,
    seen_from,
    slip_findings,
    slips_deg,
    uneven_deg,
)
from decoder.learning.fit import fit_to_flight
from decoder.learning.pivot_path import PivotPath
from decoder.learning.thresholds import HAND_PX
from decoder.learning.uncertainty import (
    FOUND_PX,
    HEIGHT_PART,
    NEEDLE_HEIGHT_PART,
    USUAL_VIEW,
    QuantityUncertainty,
    quantity_uncertainties,
)
from decoder.panel.arrays import Floats
from decoder.panel.camera import parse_camera
from decoder.panel.gauge import Gauge
from decoder.panel.scale import Quantity, Scale
from decoder.panel.thresholds import CONFIDENCE_SIGMAS
from decoder.registration.pivot import Pivot
from tests.decoder.cockpit import reader_of
from tests.decoder.instruments import dials
from tests.programs import FIXTURES

KNOWN = Pivot((0.0, 0.0), np.zeros((2, 2)))
STAYED = PivotPath()
AT_DEG = np.array([200.0])


def uncertainties_of(
    drawn: PanelPictures,
    *,
    told: Sequence[Gauge] | None = None,
    pivot: Pivot = KNOWN,
    path: PivotPath = STAYED,
    log_odds: float = 0.0,
    care_part: float = 0.0,
    dials_move: bool = False,
    squared_up: Sequence[Squeeze | None] = (),
    squeezes: Sequence[Squeeze | None] = (),
) -> dict[str, QuantityUncertainty]:
    """Of a panel whose gauges are all alike."""
    count = len(drawn.panel.gauges)
    return quantity_uncertainties(
        drawn,
        told or drawn.panel.gauges,
        [pivot] * count,
        paths=[path] * count,
        log_odds=log_odds,
        care_part=care_part,
        dials_move=dials_move,
        squared_up=squared_up,
        squeezes=squeezes,
    )


def uncertainty_of_speed(reader: PanelReader, *, pivot: Pivot = KNOWN, dials_move: bool = False) -> QuantityUncertainty:
    """Of a panel's first gauge, all pivots alike."""
    return uncertainties_of(reader.source, pivot=pivot, dials_move=dials_move)["speed_kt"]


def _drawn_sigma_deg(uncertainty: QuantityUncertainty, angles_deg: Floats) -> Floats:
    """(N,): the part from the panel's drawing: its marks and its pivot."""
    parts = uncertainty.parts_deg(angles_deg)
    sigma_deg: Floats = np.hypot(parts[Cause.DRAWN], parts[Cause.PIVOT])
    return sigma_deg


def test_tilts_that_scatter_say_that_dials_are_not_where_they_are_unwrapped() -> None:
    """Scatter below a needle's own noise is not significant."""
    scattered, quiet = replace(KNOWN, scatter_px2=0.09, tilts=40), replace(KNOWN, scatter_px2=-0.02, tilts=40)
    reader = reader_of()

    assert uncertainty_of_speed(reader, pivot=scattered).place_px == pytest.approx(0.3)
    assert uncertainty_of_speed(reader, pivot=quiet).place_px == 0.0
    assert uncertainty_of_speed(reader, pivot=quiet, dials_move=True).place_px == FOUND_PX


@pytest.mark.slow
@pytest.mark.parametrize(
    ("inner_px", "moves", "is_needle"),
    [(14, False, True), (40, True, True), (46, True, False)],
)
@pytest.mark.parametrize("ring_level", [dials.FACE_LEVEL, 220.0])
def test_what_is_cut_beyond_the_tip_and_stands_still_may_be_no_needle(
    *, inner_px: int, moves: bool, is_needle: bool, ring_level: float
) -> None:
    """The dial beyond a tip matches itself in each frame; a needle that stands still is known by where it came from."""

    def frame(angle_deg: float, seed: int) -> GreyPicture:
        def what(canvas: dials.Canvas) -> None:
            canvas.dial([130 + 28 * tick for tick in range(11)])
            canvas.disc(dials.CENTRE, 68.0, ring_level)
            canvas.disc(dials.CENTRE, 58.0, dials.FACE_LEVEL)
            canvas.hand(dials.Hand(tip=44.0), angle_deg)

        return dials.paint(what, seed=seed)

    needle = {"name": "speed_kt", "template": {"at": 250.0, "span": 14}}
    gauge = {"name": "dial", "radius": [inner_px, 70], "sweep": [120, 420], "scale": [[130, 0], [410, 100]]}
    turned_deg = np.random.default_rng(3).uniform(135.0, 405.0, 16) if moves else np.full(16, 250.0)
    reader = dials.reader_for([{**gauge, "needles": [needle]}], frame(250.0, 1))
    fitted = fit_to_flight(reader, lambda _: [frame(each, 10 + seed) for seed, each in enumerate(turned_deg.tolist())])

    assert (fitted.sigma_deg("speed_kt", np.array([250.0]))[0] < 2.0) == is_needle


def test_a_gauge_whose_columns_name_says_another_unit_is_told_so() -> None:
    """The health line names the column and both units, before anybody takes its values for knots."""

    def frame(angle_deg: float, seed: int) -> GreyPicture:
        def what(canvas: dials.Canvas) -> None:
            canvas.dial([130 + 28 * tick for tick in range(11)])
            canvas.hand(dials.Hand(tip=60.0), angle_deg)

        return dials.paint(what, seed=seed)

    needle = {"name": "speed_kt", "template": {"at": 250.0, "span": 16}}
    gauge = {"name": "dial", "unit": "fpm", "radius": [16, 70], "sweep": [120, 420], "scale": [[130, 0], [410, 100]]}
    reader = dials.reader_for([{**gauge, "needles": [needle]}], frame(250.0, 1))
    fitted = fit_to_flight(reader, lambda _: [frame(200.0, 2), frame(300.0, 3)])

    assert [each for each in fitted.findings["dial"] if "gives speed_kt in fpm, though that name says kt" in each]


@pytest.mark.slow
@pytest.mark.parametrize("missed_deg", [0.0, 1.2, -1.2])
def test_needle_drawn_beside_its_middle_is_said_and_allowed_for(missed_deg: float) -> None:
    """All its readings are off by what the hand missed it by, which its outline shows."""

    def frame(angle_deg: float, seed: int) -> GreyPicture:
        def what(canvas: dials.Canvas) -> None:
            canvas.dial([130 + 28 * tick for tick in range(11)])
            canvas.hand(dials.Hand(tip=60.0), angle_deg)

        return dials.paint(what, seed=seed)

    needle = {"name": "speed_kt", "template": {"at": 250.0 + missed_deg, "span": 16}}
    gauge = {"name": "dial", "radius": [16, 70], "sweep": [120, 420], "scale": [[130, 0], [410, 100]]}
    turned_deg = np.random.default_rng(3).uniform(135.0, 405.0, 16).tolist()
    reader = dials.reader_for([{**gauge, "needles": [needle]}], frame(250.0, 1))
    fitted = fit_to_flight(reader, lambda _: [frame(each, 10 + seed) for seed, each in enumerate(turned_deg)])
    drawn_deg = fitted.uncertainties["speed_kt"].parts_deg(AT_DEG)[Cause.DRAWN]

    assert 0.6 * abs(missed_deg) < drawn_deg[0] < 0.6 + abs(missed_deg)
    way = {0.0: None, 1.2: "1.2 degrees anticlockwise", -1.2: "1.2 degrees clockwise"}[missed_deg]
    said = [each for each in fitted.findings["dial"] if "where it is drawn" in each]
    assert [way in each for each in said] == ([] if way is None else [True])


def test_all_parts_add_in_squares() -> None:
    """Drawing, place and pivot are independent."""
    pivot = replace(KNOWN, covariance_px2=0.04 * np.eye(2))
    uncertainty = QuantityUncertainty(0.03, 0.04, 0.1, 50.0, pivot, (0.0, 0.0), 50.0, 20.0)
    drawn_deg = math.hypot(0.03, math.degrees(0.2 * 2.0 / 50.0))
    expected_deg = math.hypot(drawn_deg, 0.04, math.degrees(0.1 / 50.0))

    assert uncertainty.sigma_deg(AT_DEG) == pytest.approx([expected_deg])
    assert _drawn_sigma_deg(uncertainty, AT_DEG) == pytest.approx([drawn_deg])
    assert replace(uncertainty, zero_deg=None).sigma_deg(AT_DEG) < expected_deg


@pytest.mark.parametrize("view_deg", [0.0, 25.0])
def test_needles_of_unknown_height_are_doubted_by_how_obliquely_they_are_seen(view_deg: float) -> None:
    """A camera in front of the panel sees every dial slightly from the side, whether drawn so or not."""
    drawn = reader_of().source.with_planes()
    squeezed = DialPlane.of(np.diag([1.0, math.cos(math.radians(view_deg)), 1.0]))
    oblique = replace(drawn, planes=(squeezed,) * len(drawn.panel.gauges))
    found = uncertainties_of(oblique)["speed_kt"]
    beside_deg = math.degrees(
        NEEDLE_HEIGHT_PART * math.hypot(USUAL_VIEW, math.tan(math.radians(view_deg))) / math.sqrt(2)
    )

    assert found.seen_deg == pytest.approx(beside_deg, rel=1e-6)
    # Of a mark, and of where the needle was cut.
    assert found.drawn_deg == pytest.approx(math.sqrt(2) * math.degrees(HAND_PX / drawn.panel.gauges[0].arc_px))


@pytest.mark.parametrize("care_part", [0.0, 0.02])
def test_a_card_is_doubted_by_its_index_as_a_needle_is_by_where_it_was_cut(care_part: float) -> None:
    """The same hand drew the index and the card's marks, and what it missed the index by is in every reading."""

    def with_card(content: dict[str, Any]) -> None:
        first = content["gauges"][0]
        del first["needles"]
        turn = {"sweep": [0, 360], "scale": [[270, 0], [450, 180]], "wraps": 360}
        first |= turn | {"card": {"name": "card_deg", "index": 270}}

    needle = uncertainties_of(reader_of().source, care_part=care_part)["speed_kt"]
    card = uncertainties_of(reader_of(with_card).source, care_part=care_part)["card_deg"]
    missed_deg = math.degrees(care_part) if care_part else 0.0  # a pivot that was not moved may be off by as much

    assert math.sqrt(card.drawn_deg**2 - missed_deg**2) == pytest.approx(needle.drawn_deg)


def test_a_card_whose_index_nobody_drew_is_doubted_by_how_obliquely_it_is_seen() -> None:
    """Read straight up in the picture, it is off by as much as its dial's upright leans; a drawn index is not."""

    def with_card(card: dict[str, Any]) -> Callable[[dict[str, Any]], None]:
        def change(content: dict[str, Any]) -> None:
            first = content["gauges"][0]
            del first["needles"]
            turn = {"sweep": [0, 360], "scale": [[270, 0], [450, 180]], "wraps": 360}
            first |= turn | {"card": {"name": "card_deg", **card}}

        return change

    aside = Squeeze(0.0, 0.08, 0.01)

    def sigma_deg(card: dict[str, Any], squeeze: Squeeze | None) -> float:
        drawn = reader_of(with_card(card)).source
        squeezes = (squeeze,) * len(drawn.panel.gauges)
        return uncertainties_of(drawn, squeezes=squeezes, squared_up=squeezes)["card_deg"].drawn_deg

    drawn_deg, left_out_deg = sigma_deg({"index": 270}, aside), sigma_deg({}, aside)
    leans_deg = math.degrees(math.atan2(aside.matrix[0, 1], aside.matrix[1, 1]))
    assert math.sqrt(left_out_deg**2 - drawn_deg**2) > leans_deg / CONFIDENCE_SIGMAS
    assert sigma_deg({}, None) == pytest.approx(sigma_deg({"index": 270}, None))


def test_a_view_that_is_seen_but_not_corrected_is_no_mere_allowance() -> None:
    """From where dials usually are seen is one; what the picture shows of this one makes its values doubtful."""
    drawn = reader_of().source
    aside = (Squeeze(0.05, 0.0, 0.01),) * len(drawn.panel.gauges)
    usual, seen = (uncertainties_of(drawn, squeezes=each)["speed_kt"] for each in ((), aside))

    assert usual.allowed_deg == pytest.approx(usual.seen_deg)
    assert seen.seen_deg > usual.seen_deg
    assert seen.allowed_deg == pytest.approx(0.0)


@pytest.mark.parametrize("sag_px", [1.0, 12.0])
def test_a_tube_is_doubted_by_its_length_however_little_it_is_bent(sag_px: float) -> None:
    """The straighter it is, the further away is the centre of its bend, which nobody drew."""

    def with_ball(content: dict[str, Any]) -> None:
        tube = [[140.0, 110.0, -10.0], [180.0, 110.0 + sag_px, 0.0], [220.0, 110.0, 10.0]]
        content["gauges"][0] = {"name": "slip", "ball": {"name": "slip_deg", "tube": tube, "width": 20.0}}

    drawn = reader_of(with_ball).source
    found = uncertainties_of(drawn, care_part=0.03)["slip_deg"]

    assert 0.5 < math.radians(found.drawn_deg) * drawn.panel.gauges[0].radius[1] < 2.5


def test_marks_that_may_be_points_are_doubted_least_where_the_needle_was_cut() -> None:
    """Mark and needle are seen from the same wrong centre: there the errors cancel except for the different radii."""
    drawn = reader_of().source
    gauge = drawn.panel.gauges[0]
    (zero_deg,) = (needle.at_deg for needle in gauge.turning)
    assert zero_deg is not None
    across = math.radians(zero_deg + 90.0)
    path = PivotPath(far_px=(2.0 * math.cos(across), 2.0 * math.sin(across)))
    undecided, decided = (uncertainties_of(drawn, path=path, log_odds=odds)["speed_kt"] for odds in (0.0, 12.0))
    here, opposite = np.array([zero_deg]), np.array([zero_deg + 180.0])

    mark_deg, needle_deg = (math.degrees(2.0 / radius_px) for radius_px in (gauge.radius[1], gauge.arc_px))
    for angles_deg, beside_deg in ((here, needle_deg - mark_deg), (opposite, needle_deg + mark_deg)):
        expected_deg = math.hypot(undecided.drawn_deg, beside_deg)
        assert _drawn_sigma_deg(undecided, angles_deg) == pytest.approx([expected_deg])
    assert _drawn_sigma_deg(decided, opposite) < _drawn_sigma_deg(undecided, opposite) / 10


def test_height_of_needles_leaves_doubt_of_their_pivots() -> None:
    """By a part of the height, more with more pixels an inch; in all directions, since a shadow may fall anywhere."""
    folder = FIXTURES / "oblique" / "t1a_small"
    camera = parse_camera((folder / "camera.yaml").read_bytes(), source="camera.yaml")
    drawn = replace(panel_from_file(folder / "panel.yaml"), camera=camera)
    found = uncertainties_of(drawn)
    covariances = [found[name].pivot.covariance_px2 for name in ("n1_1_pct", "oil_temp_1_c")]
    first, *_, last = drawn.panel.reference_points
    px_an_inch = math.dist(first.at, last.at) / math.dist(first.inches, last.inches)

    for covariance in covariances:
        assert math.sqrt(covariance[0, 0]) == pytest.approx(HEIGHT_PART * 0.05 * px_an_inch, rel=0.1)
        assert covariance == pytest.approx(covariance[0, 0] * np.eye(2))


@pytest.mark.parametrize("part", [0.0, 0.05])
def test_marks_of_a_turn_that_are_uneven_are_doubted_by_as_much(part: float) -> None:
    """Seen from off its middle, a ring's marks are uneven by a wave; without a value for a turn they may really be."""
    drawn = reader_of().source
    angles_deg = np.arange(0.0, 360.0, 36.0)
    marks = tuple((seen_from((0.0, part), 1.0, angle_deg), angle_deg) for angle_deg in angles_deg.tolist())
    around, plain = (
        tuple(each.model_copy(update={"scale": marks, "wraps": wraps}) for each in drawn.panel.gauges)
        for wraps in (360.0, None)
    )
    wave_deg = math.degrees(part) / math.sqrt(2.0)
    careful_deg = uncertainties_of(drawn)["speed_kt"].drawn_deg
    cut_deg = careful_deg / math.sqrt(2)

    assert uneven_deg(around[0].quantities[0]) == pytest.approx(wave_deg * math.sqrt(10 / 9), rel=0.05, abs=1e-9)
    assert uneven_deg(plain[0].quantities[0]) == 0.0
    assert uncertainties_of(drawn, told=around)["speed_kt"].drawn_deg == pytest.approx(
        math.hypot(cut_deg, max(cut_deg, uneven_deg(around[0].quantities[0])))
    )
    assert uncertainties_of(drawn, told=plain)["speed_kt"].drawn_deg == careful_deg


EVEN = ((120.0, 40.0), (180.0, 60.0), (240.0, 80.0), (300.0, 100.0), (360.0, 120.0), (420.0, 140.0))


@pytest.mark.parametrize(
    "marks",
    [
        EVEN,
        [(-1.6, -2.0), (42.0, -1.5), (90.0, -1.0), (135.0, -0.5), (180.0, 0.0), (225.0, 0.5), (270.0, 1.0)],
        [(297, 35), (311, 40), (361, 60), (413, 80), (467, 100), (510, 120), (552, 140), (594, 160)],
        [(150, 0), (152, 300), (164, 500), (202, 1000), (240, 1500), (278, 2000)],
        [(100.0 * math.log10(value), value) for value in (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)],
        [(0.0, 0.0), (30.0, 10.0), (60.0, 20.0), (150.0, 30.0), (180.0, 40.0), (210.0, 50.0)],
        EVEN[:3],
    ],
    ids=["even", "grows both ways", "airspeed", "tachometer", "curve", "one wide part", "three marks"],
)
def test_marks_of_uneven_scales_fit_their_neighbours(marks: Sequence[tuple[float, float]]) -> None:
    """Nobody is told to check a scale whose spacing changes at a mark, or from mark to mark."""
    assert not slips_deg(Quantity("speed_kt", "dial", "kt", tuple(marks), None, None, None)).any()


@pytest.mark.parametrize("name", ["asi_kt", "altitude_ft", "vsi_fpm", "fuel_gal", "heading_deg"])
@pytest.mark.parametrize("falls", [False, True])
def test_an_aircrafts_speed_that_falls_clockwise_is_told(name: str, *, falls: bool) -> None:
    """No maker numbers such a dial that way round; a fuel gauge may well be numbered so."""
    gauge = reader_of().source.panel.gauges[0]
    marks = tuple((angle_deg, -value) for angle_deg, value in EVEN) if falls else EVEN
    needle = gauge.needles[0].model_copy(update={"name": name, "scale": None})
    drawn = gauge.model_copy(update={"scale": marks, "wraps": None, "needles": (needle,)})

    told = falls and name not in ("fuel_gal", "heading_deg")
    assert [f"values of {name} that fall clockwise" in each for each in backward_findings(drawn)] == [True] * told


@pytest.mark.parametrize(
    ("mark", "drawn", "true_deg"),
    [(2, (240.0, 98.0), 294.0), (3, (300.0, 110.0), 330.0), (3, (288.0, 100.0), 300.0), (1, (180.0, 50.0), 150.0)],
    ids=["mistyped", "a ten too many", "another mark clicked", "at the end"],
)
def test_a_mark_that_fits_none_of_its_neighbours_is_told_and_doubted(
    mark: int, drawn: tuple[float, float], true_deg: float
) -> None:
    """What is read next to it says how far it may be off, what is read elsewhere does not, and the mark is named."""
    panel = reader_of().source
    marks = (*EVEN[:mark], drawn, *EVEN[mark + 1 :])
    wrong = tuple(each.model_copy(update={"scale": marks, "wraps": None}) for each in panel.panel.gauges)
    at_deg = np.linspace(120.0, 420.0, 121)
    after = _drawn_sigma_deg(uncertainties_of(panel, told=wrong)["speed_kt"], at_deg)
    off = Scale.of(marks).values_at(at_deg) - Scale.of(EVEN).values_at(at_deg)
    elsewhere = (at_deg < EVEN[mark - 1][0]) | (at_deg > EVEN[mark + 1][0])

    slip_deg = slips_deg(wrong[0].quantities[0])
    assert np.flatnonzero(slip_deg).tolist() == [mark]
    assert slip_deg[mark] == pytest.approx(drawn[0] - true_deg, rel=0.01)
    assert (np.abs(off) <= CONFIDENCE_SIGMAS * Scale.of(marks).steepest_at(at_deg, after) * after).all()
    assert (after[elsewhere] < abs(slip_deg[mark]) / 2).all()
    (said,) = slip_findings(wrong[0])
    assert f"has a mark {drawn[1]:g} that stands {abs(slip_deg[mark]):.1f} degrees off" in said


def test_what_a_drawing_leaves_in_doubt_is_in_sigma() -> None:
    """One sigma for marks stated to be two degrees off as drawn; nothing for the other gauges."""
    drawn = panel_from_file(FIXTURES / "panel.yaml")
    first, *others = drawn.panel.gauges
    doubted = replace(
        drawn,
        panel=drawn.panel.model_copy(update={"gauges": (first.model_copy(update={"doubt_deg": 2.0}), *others)}),
    )

    before, after = uncertainties_of(drawn), uncertainties_of(doubted)

    for name, each in after.items():
        added = 2.0 if name in {quantity.name for quantity in first.quantities} else 0.0
        assert each.drawn_deg == pytest.approx(math.hypot(before[name].drawn_deg, added))


@pytest.mark.parametrize(("marks", "around_deg"), [(2, 360.0), (12, 360.0), (2, 240.0)])
def test_a_needle_is_doubted_between_marks_where_another_dial_is_seen_obliquely(marks: int, around_deg: float) -> None:
    """Its own dial may appear as the same ellipse: intervals hold then as well, whichever way that lies."""
    goes_round = around_deg == 360.0
    part, last_deg = 0.03, 150.0 + around_deg
    drawn_deg = np.linspace(150.0, last_deg, marks, endpoint=not goes_round).tolist()

    def with_rounds(content: dict[str, Any]) -> None:
        scale = [[angle_deg, (angle_deg - 150.0) / 6.0] for angle_deg in drawn_deg]
        content["gauges"][0] |= {"sweep": [150, last_deg], "scale": scale} | ({"wraps": 60} if goes_round else {})

    drawn = reader_of(with_rounds).source
    others = (Squeeze(part, 0.0),) * len(drawn.panel.gauges)
    before, after = (uncertainties_of(drawn, squared_up=each)["speed_kt"] for each in ((), (None, *others[1:])))
    ends_deg = [*drawn_deg, last_deg] if goes_round else drawn_deg
    off_deg = []
    for turn, needle_deg in np.random.default_rng(5).uniform((0.0, 150.0), (math.tau, last_deg), (500, 2)).tolist():
        own = Squeeze(part * math.cos(turn), part * math.sin(turn))
        true_deg = [own.square_on_deg(angle_deg) for angle_deg in ends_deg]
        off_deg.append(own.square_on_deg(needle_deg) - np.interp(needle_deg, ends_deg, true_deg))

    assert len(others) > 1
    beside_deg = math.sqrt(after.seen_deg**2 - before.seen_deg**2 - parallax_deg(others[0]) ** 2)
    assert beside_deg == pytest.approx(np.std(off_deg), rel=0.1)


def parallax_deg(squeeze: Squeeze) -> float:
    """Of a needle a twenty-fifth of the radius above its marks, seen from aside: its root mean square."""
    return math.degrees(0.04 * math.tan(math.radians(squeeze.aside_deg)) / math.sqrt(2.0))


def test_a_needle_above_its_marks_is_doubted_where_its_dial_was_squared_up() -> None:
    """Squaring a dial up does not bring its needle down to its marks."""
    drawn, squeeze = reader_of(lambda _: None).source, Squeeze(0.06, -0.05)
    dials = len(drawn.panel.gauges)

    before, after = (
        uncertainties_of(drawn, squared_up=(own,) * dials)["speed_kt"].seen_deg for own in (Squeeze(0.0, 0.0), squeeze)
    )

    assert math.sqrt(after**2 - before**2) == pytest.approx(parallax_deg(squeeze), rel=0.01)


def test_a_scale_is_less_sure_the_further_beyond_its_marks() -> None:
    """Extrapolated from the last two marks, each with its own error: by 1.6 times at half their distance beyond."""
    even = Scale.of([(0.0, 0.0), (40.0, 4.0), (100.0, 10.0)])
    uncertainty = QuantityUncertainty(0.1, 0.0, 0.0, 50.0, KNOWN, (0.0, 0.0), 50.0, 20.0, even)
    sigma_deg = _drawn_sigma_deg(uncertainty, np.array([-20.0, 0.0, 50.0, 100.0, 130.0]))

    assert sigma_deg == pytest.approx(0.1 * np.array([math.hypot(1.5, 0.5), 1.0, 1.0, 1.0, math.hypot(1.5, 0.5)]))


def test_a_scale_that_is_a_curve_is_doubted_between_its_marks() -> None:
    """A logarithmic scale's values lie within 95 % all along; a scale of two straight parts is no curve."""
    values, at_deg = np.array([1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0]), np.linspace(0.0, 200.0, 101)
    curve = Scale.of(list(zip(100.0 * np.log10(values), values, strict=True)))
    parts = Scale.of([(0.0, 0.0), (20.0, 30.0), (40.0, 60.0), (80.0, 70.0), (120.0, 80.0), (200.0, 100.0)])
    doubted, sure = (
        _drawn_sigma_deg(QuantityUncertainty(0.1, 0.0, 0.0, 50.0, KNOWN, (0.0, 0.0), 50.0, 20.0, scale), at_deg)
        for scale in (curve, parts)
    )
    off_deg = (curve.values_at(at_deg) - 10 ** (at_deg / 100.0)) / curve.slopes_at(at_deg)

    assert off_deg.max() > 4.0
    assert (np.abs(off_deg) <= CONFIDENCE_SIGMAS * doubted).all()
    assert doubted.max() < 1.5 * off_deg.max()
    assert sure == pytest.approx(0.1)


def test_an_uneven_scale_is_doubted_beyond_its_marks_by_its_own_paces() -> None:
    """An airspeed indicator without a mark below 40 kt, where its values are crowded; an even scale just goes on."""
    angles_deg = np.array([31.1, 71.7, 118.0, 165.3, 206.6, 238.3, 267.7, 293.1, 319.2])
    airspeed = Scale(angles_deg, np.arange(40.0, 201.0, 20.0))
    even = Scale(angles_deg, angles_deg)
    below_deg = np.array([10.0, 20.0, 25.0])
    below = np.interp(below_deg, [3.0, 31.1], [10.0, 40.0])
    doubted, sure = (
        _drawn_sigma_deg(QuantityUncertainty(0.0, 0.0, 0.0, 50.0, KNOWN, (0.0, 0.0), 50.0, 50.0, scale), below_deg)
        for scale in (airspeed, even)
    )
    sigma = doubted * np.abs(airspeed.slopes_at(below_deg))

    assert (np.abs(airspeed.values_at(below_deg) - below) <= 2.0 * sigma).all()
    assert (sigma[:2] > 0.01 * 160.0).all()  # so that they are not `read`
    assert sure == pytest.approx(0.0)


def test_a_scale_that_grows_both_ways_from_its_middle_is_doubted_beside_it() -> None:
    """As a vertical speed's: its slope hardly changes at 0, but on both sides of it."""
    marks_deg = np.array([-170.0, -127.0, -89.0, -59.0, 0.0, 57.0, 90.0, 128.0, 171.0])
    at_deg = np.linspace(-170.0, 170.0, 171)

    def values_at(angles_deg: Floats) -> Floats:
        values: Floats = np.sign(angles_deg) * np.expm1(np.abs(angles_deg) / 70.0)
        return values

    scale = Scale.of(list(zip(marks_deg, values_at(marks_deg), strict=True)))
    doubted = _drawn_sigma_deg(QuantityUncertainty(0.1, 0.0, 0.0, 50.0, KNOWN, (0.0, 0.0), 50.0, 20.0, scale), at_deg)
    off_deg = np.abs(scale.values_at(at_deg) - values_at(at_deg)) / scale.slopes_at(at_deg)

    assert off_deg[np.abs(at_deg) < 50.0].max() > 5.0
    assert (off_deg <= CONFIDENCE_SIGMAS * doubted).all()


def test_a_horizon_is_doubted_by_how_uneven_its_marks_of_bank_are() -> None:
    """They show how far from its middle the dial is drawn, and pitch is measured from there."""
    drawn = panel_from_file(FIXTURES / "borrowed" / "attitude_daylight" / "panel.yaml")
    (gauge,) = drawn.panel.gauges
    uneven = gauge.model_copy(
        update={"scale": tuple((seen_from((0.0, 0.08), 1.0, angle_deg), value) for angle_deg, value in gauge.scale)}
    )
    before, after = uncertainties_of(drawn), uncertainties_of(drawn, told=(uneven,))

    assert before["pitch_deg"].drawn_deg < 1.0
    assert after["pitch_deg"].drawn_deg == after["roll_deg"].drawn_deg > 2 * before["pitch_deg"].drawn_deg


def test_pitch_is_doubted_by_how_unsure_the_place_is_that_the_pivot_was_moved_to() -> None:
    """It is a shift from there, whoever drew the marks; of a bank, marks that are angles tell the same around it."""
    drawn = panel_from_file(FIXTURES / "borrowed" / "attitude_daylight" / "panel.yaml")
    moved, unsure_px = PivotPath(moved_px=(3.0, 0.0)), 2.0
    unsure = replace(KNOWN, covariance_px2=unsure_px**2 * np.eye(2))
    sure, doubted = (uncertainties_of(drawn, path=moved, pivot=each, log_odds=-100.0) for each in (KNOWN, unsure))
    (gauge,) = drawn.panel.gauges

    assert doubted["roll_deg"].drawn_deg == pytest.approx(sure["roll_deg"].drawn_deg, rel=1e-3)
    added_deg = math.sqrt(doubted["pitch_deg"].drawn_deg ** 2 - sure["pitch_deg"].drawn_deg ** 2)
    assert added_deg == pytest.approx(math.degrees(unsure_px / gauge.arc_px), rel=1e-3)


def test_pitch_is_doubted_by_how_much_longer_an_oblique_view_may_show_it() -> None:
    """Its ladder is drawn at one bank; at another the horizon shifts along another way across the ellipse."""
    drawn = panel_from_file(FIXTURES / "borrowed" / "attitude_daylight" / "panel.yaml")
    view, (gauge,) = Squeeze(0.05, 0.0), drawn.panel.gauges
    banks = np.random.default_rng(7).uniform(0.0, math.tau, (2, 500))
    at_one, at_other = np.linalg.norm(view.matrix @ np.stack([np.cos(banks), np.sin(banks)], axis=1), axis=1)
    shifts_deg = np.array([0.0, 20.0])

    def seen_deg(of_gauge: Squeeze | None) -> Floats:
        return uncertainties_of(drawn, squeezes=(of_gauge,))["pitch_deg"].parts_deg(shifts_deg)[Cause.VIEWED]

    (still, shifted), unknown = seen_deg(view), seen_deg(None)

    assert gauge.attitude is not None
    added_deg = math.sqrt(shifted**2 - still**2)
    assert added_deg == pytest.approx(shifts_deg[1] * np.std(at_one / at_other), rel=0.1)
    assert unknown[1] > unknown[0]


def scaled(drawn_deg: Sequence[Floats], values: Floats) -> list[Gauge]:
    """Gauges with these marks, degrees, for the same values."""
    (gauge, *_) = reader_of().source.panel.gauges
    return [
        gauge.model_copy(update={"scale": tuple(zip(own.tolist(), values.tolist(), strict=True)), "wraps": None})
        for own in drawn_deg
    ]


@pytest.mark.parametrize("missed_px", [0.7, 1.4])
def test_how_far_a_hand_misses_marks_is_told_by_how_smooth_its_scales_are(missed_px: float) -> None:
    """Within a third for eight scales of eight marks each, even or curved, two of which change their pace once."""
    random, values = np.random.default_rng(4), np.arange(8.0)
    radius_px = reader_of().source.panel.gauges[0].radius[1]
    exact = [120.0 + 30.0 * values] * 4 + [120.0 + 18.0 * values + 2.0 * values**2] * 2
    exact += [120.0 + 12.0 * values + 24.0 * np.maximum(values - 4.0, 0.0)] * 2
    missed = [own + np.degrees(random.normal(0.0, missed_px, 8) / radius_px) for own in exact]

    assert marks_missed_px(scaled(missed, values)) == pytest.approx(missed_px, rel=1 / 3)
    assert marks_missed_px(scaled(exact, values)) == 0.0


@pytest.mark.parametrize("angles_deg", [[120.0, 240.0, 420.0], [120.0, 420.0]])
def test_a_few_marks_tell_nothing_of_the_hand(angles_deg: list[float]) -> None:
    """A scale of three marks may be made uneven; it counts as drawn by an ordinary hand."""
    gauges = scaled([np.array(angles_deg)], np.arange(float(len(angles_deg))))

    assert marks_missed_px(gauges) == pytest.approx(0.0, abs=1e-6)


def test_a_scale_in_a_narrow_window_is_doubted_between_its_marks() -> None:
    """Its corners do not tell how much smaller its far half appears; at each mark there is no doubt of that."""
    window = [[46.5, 20.0], [53.5, 20.0], [53.5, 220.0], [46.5, 220.0]]
    marks = [[[50.0, 20.0], 0], [[50.0, 120.0], 5], [[50.0, 220.0], 10]]
    linear = {"name": "flap_deg", "at": [50.0, 40.0], "span": 12, "marks": marks}
    gauge = Gauge.model_validate({"name": "flaps", "window": window, "linear": linear})
    (quantity,) = gauge.quantities
    uncertainty = QuantityUncertainty(0.0, 0.0, 0.0, 57.3, KNOWN, (0.0, 0.0), 57.3, None, bowed=quantity)
    sigma_px = _drawn_sigma_deg(uncertainty, np.array([0.0, 50.0, 100.0, 150.0, 200.0]))

    assert sigma_px == pytest.approx([0.0, 0.6, 0.0, 0.6, 0.0], abs=0.1)
