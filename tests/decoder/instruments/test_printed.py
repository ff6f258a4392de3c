"""Printed digits on drums, wheels and dots: read with certainty as far as learned from pictures, or not at all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.unwrapping import WindowGrid
from decoder.instruments.kinds.windows.printed import PrintedKind, PrintedReader, print_of
from decoder.instruments.kinds.windows.printed_strips import Print
from decoder.instruments.reading import Reading, Status
from decoder.learning.fit import reader_from_panel
from decoder.panel.arrays import Floats
from decoder.panel.errors import PanelError
from decoder.panel.kinds.printed import Printed
from decoder.panel.panel import parse_panel
from decoder.panel.vocabulary import Method
from fixtures.borrowed import odometer
from tests.decoder.instruments.displays import sampled
from tests.decoder.instruments.printed_rows import PAD_PX, DrawnRow, Font, dotted, grotesque, plotted, texts_of

ALL_DIGITS = (1234, 5678, 9012, 3490)
CLIMB = tuple(np.round(np.arange(2988.1, 3012.0, 0.37), 2).tolist())
"""Through 2999 to 3000, with drums half way."""


def described(shows: Sequence[str], **keys: Any) -> Printed:  # noqa: ANN401 - as in YAML
    """A row of digits that several pictures teach."""
    also = [{"picture": "other.png", "shows": one} for one in shows[1:]]
    return Printed.model_validate({"name": "x", "pattern": "0000", "shows": shows[0], "also": also, **keys})


def reader_of(
    drawn: DrawnRow,
    taught: Sequence[float],
    grid: WindowGrid,
    off: float = 0.0,
    **keys: Any,  # noqa: ANN401
) -> PrintedReader:
    """A reader of drums that pictures have taught, which stood at counts this much higher than somebody wrote down."""
    own = described(texts_of(taught, drawn.drums), pattern="0" * drawn.drums, **keys)
    windows = [sampled(grid, drawn.picture(count + off)) for count in taught]
    return PrintedReader(own, print_of(own, grid, windows), grid.cell_px[1])


def read(reader: PrintedReader, windows: Sequence[Floats]) -> list[Reading]:
    """What windows show."""
    return [found["x"] for found in reader.read(np.stack(windows), np.zeros(len(windows)))]


def told(readings: Sequence[Reading]) -> list[float | None]:
    """Their values, None where there is none."""
    return [one.angle_deg if one.status is Status.READ else None for one in readings]


def wrong(values: Sequence[float | None], counts: Sequence[float]) -> list[tuple[float | None, float]]:
    """Those that are half a digit off or more."""
    return [
        (own, count) for own, count in zip(values, counts, strict=True) if own is not None and abs(own - count) > 0.5
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    "drawn",
    [DrawnRow(), DrawnRow(font=plotted, goes_down=True), DrawnRow(light=-110.0, ground=190.0, height=20.0, pitch=27.0)],
)
@pytest.mark.parametrize("off", [0.0, 0.05])
def test_drums_are_read_half_way_and_through_a_carry(drawn: DrawnRow, off: float) -> None:
    """Each higher drum moves while the next lower one turns from 9 to 0, and all of them count one value.

    Counts are written down to a tenth of the last digit, which sigma allows for.
    """
    grid = drawn.grid(hand_px=0.5)
    taught = (*ALL_DIGITS, 7905, 2061.0, 4350, 6127, 8543, 786)
    reader = reader_of(drawn, taught, grid, off, rolls="down" if drawn.goes_down else "up", pitch=drawn.pitch)

    found = read(reader, [sampled(grid, drawn.picture(count)) for count in CLIMB])

    values = told(found)
    assert wrong(values, CLIMB) == []
    assert values.count(None) <= 0.2 * len(CLIMB)
    sigmas_off = [
        (one.angle_deg - count) / one.sigma_deg
        for one, count in zip(found, CLIMB, strict=True)
        if one.status is Status.READ
    ]
    assert np.mean(np.abs(sigmas_off) < 1.96) >= 0.9


@pytest.mark.parametrize("goes_down", [False, True])
def test_drums_at_zero_are_not_at_their_highest_count(goes_down: bool) -> None:  # noqa: FBT001 - a case
    """An altimeter at sea level is not at its highest count: noise puts each drum slightly below or above 0."""
    drawn = DrawnRow(goes_down=goes_down)
    grid = drawn.grid(hand_px=0.5)
    taught = (*ALL_DIGITS, 7905, 2061.0, 4350, 6127, 8543, 786)
    reader = reader_of(drawn, taught, grid, rolls="down" if goes_down else "up", pitch=drawn.pitch)

    values = told(read(reader, [sampled(grid, drawn.picture(0.0)) for _ in range(8)]))

    assert [value for value in values if value is not None] == pytest.approx([0.0] * (8 - values.count(None)), abs=0.1)
    assert values.count(None) < 4


@pytest.mark.parametrize(("font", "height"), [(grotesque, 16.0), (plotted, 20.0), (dotted, 16.0)])
def test_a_digit_that_no_picture_showed_is_missing(font: Font, height: float) -> None:
    """However similar to a learned one: a 0 is not read as 6, nor an 8 as 3."""
    drawn = DrawnRow(font=font, height=height, pitch=1.4 * height, slot=1.4 * height)
    grid = drawn.grid()
    taught = ("1264", "7365")
    reader = reader_of(drawn, [int(text) for text in taught], grid)
    texts = [f"{number:04d}" for number in np.random.default_rng(1).integers(0, 10_000, 80).tolist()]
    texts += ["1364", "7264", "0264", "8365", "1204", "1284", "1294", "1960"]

    values = told(read(reader, [sampled(grid, drawn.picture(int(text))) for text in texts]))

    known = set("".join(taught))
    assert all(value in (None, float(text)) for value, text in zip(values, texts, strict=True))
    could = [value for value, text in zip(values, texts, strict=True) if set(text) <= known]
    assert could.count(None) <= 0.1 * len(could)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("height", "blur"), [(6.0, 0.5), (8.0, 1.6), (10.0, 1.0), (12.0, 0.5), (16.0, 1.0), (16.0, 1.6)]
)
def test_small_and_blurred_digits_are_right_or_missing(height: float, blur: float) -> None:
    """From twelve pixels on, and in a blur of a pixel from sixteen, most are read."""
    drawn = DrawnRow(height=height, pitch=1.4 * height, slot=1.4 * height, blur=blur)
    grid = drawn.grid(hand_px=0.5)
    taught, counts = (1264, 7365, 4127), [1264, 1264, 7365, 1367, 4124, 7236, 8264, 1204, 9365, 1268, 1265.4, 7384]

    stepping = told(read(reader_of(drawn, taught, grid), [sampled(grid, drawn.picture(int(n))) for n in counts * 3]))
    rolling = told(
        read(
            reader_of(drawn, taught, grid, rolls="up", pitch=drawn.pitch),
            [sampled(grid, drawn.picture(n)) for n in counts * 3],
        )
    )

    assert wrong(stepping, [int(n) for n in counts * 3]) == wrong(rolling, counts * 3) == []
    if (height >= 16 and blur <= 1.0) or (height >= 12 and blur <= 0.5):
        assert sum(value is not None for value in stepping) >= 15


def test_what_covers_a_digit_is_no_other_digit() -> None:
    """A reflection with a gradient is only light; hidden strokes make the value missing."""
    drawn = DrawnRow()
    grid = drawn.grid()
    reader = reader_of(drawn, ALL_DIGITS, grid, rolls="up", pitch=drawn.pitch)
    shown = sampled(grid, drawn.picture(3258.0))
    columns = np.arange(shown.shape[1])
    hidden = [np.where(np.abs(columns - at) < 4, 235.0, shown).astype(np.float32) for at in range(0, len(columns), 5)]
    dimmed = [(0.5 * shown + 0.6 * columns).astype(np.float32), (0.4 * shown).astype(np.float32)]

    values = told(read(reader, [*hidden, *dimmed, 0 * shown + 40.0]))

    assert wrong(values, [3258.0] * len(values)) == []
    assert None not in values[-3:-1]
    assert values[-1] is None


def test_a_last_drum_in_opposite_colours_between_dark_lines_has_the_digits_of_the_others() -> None:
    """Its ground is bright on both sides, but not where it ends: what it has not shown is known from the others."""
    drawn = DrawnRow(height=40.0, pitch=52.0, slot=56.0, off_px=0.1)
    grid, first = drawn.grid(), PAD_PX + (drawn.drums - 1) * drawn.width

    def seen(count: float) -> Floats:
        picture = drawn.picture(count)
        picture[:, first : first + drawn.width] = (
            2 * drawn.ground + drawn.light - picture[:, first : first + drawn.width]
        )
        picture[:, [first, first + drawn.width - 1]] = drawn.ground
        return sampled(grid, picture)

    taught = (1234, 5671, 9802, 3460)
    own = described(texts_of(taught, drawn.drums), rolls="up", pitch=drawn.pitch)
    reader = PrintedReader(own, print_of(own, grid, [seen(count) for count in taught]), grid.cell_px[1])
    counts = (9876.0, 1238.0, 4059.5, 6235.0)

    assert told(read(reader, [seen(count) for count in counts])) == pytest.approx(counts, abs=0.1)


def test_a_digit_in_bad_light_does_not_make_cells_differ() -> None:
    """One of five digits that two cells share has a bright edge behind it in one of them; the others are alike."""
    drawn = DrawnRow(drums=2)
    grid = drawn.grid()
    taught = (12, 24, 35, 53, 41, 61)
    windows = [sampled(grid, drawn.picture(count)) for count in taught]
    middle = 3 * windows[0].shape[1] // 4
    windows[2][:, middle:] += 100.0
    own = described(texts_of(taught, drawn.drums), pattern="00")
    reader = PrintedReader(own, print_of(own, grid, windows), grid.cell_px[1])
    counts = (16.0, 26.0, 46.0, 56.0)

    assert told(read(reader, [sampled(grid, drawn.picture(count)) for count in counts])) == list(counts)


def test_other_frames_change_nothing() -> None:
    """What is read of a frame is the same to the last bit, whatever is read along with it."""
    drawn = DrawnRow()
    grid = drawn.grid()
    reader = reader_of(drawn, ALL_DIGITS, grid, rolls="up", pitch=drawn.pitch)
    windows = [sampled(grid, drawn.picture(count)) for count in CLIMB[:12]]

    assert read(reader, windows) == [one for window in windows for one in read(reader, [window])]


@pytest.mark.slow
@pytest.mark.parametrize(("scale", "least", "blur_px"), [(0.5, 0, 1.0), (0.6, 25, 0.5), (0.8, 33, 1.0), (1.0, 38, 1.0)])
def test_a_strangers_odometer_is_right_or_missing(scale: float, least: int, blur_px: float) -> None:
    """Under a glass with a glint, one drum of another colour than the others; its digits are 10 to 20 pixels high."""
    rng = np.random.default_rng(3)
    corners = (np.array([(13, 15), (116, 15), (116, 41), (13, 41)]) * scale + rng.uniform(-0.5, 0.5, (4, 2))).tolist()
    grid = WindowGrid.of(tuple((x, y) for x, y in corners))  # type: ignore[arg-type] # four of them

    def filmed(value: float) -> Floats:
        levels = cv2.GaussianBlur(np.pad(odometer.drawn(value), 12, constant_values=70), (0, 0), blur_px / scale)
        move = np.array([[scale, 0, rng.uniform(-0.2, 0.2)], [0, scale, rng.uniform(-0.2, 0.2)]])
        small = cv2.warpAffine(levels, move, (round(131 * scale), round(58 * scale)))
        return sampled(grid, (15 + 0.8 * small + rng.normal(0, 2, small.shape)).astype(np.float32))

    shows = [f"{value:06.1f}" for value in odometer.TEACHING]
    own = described(shows, pattern="0000.0", rolls="up", pitch=odometer.PITCH_PX * scale)
    reader = PrintedReader(own, print_of(own, grid, [filmed(value) for value in odometer.TEACHING]), grid.cell_px[1])

    values = told(read(reader, [filmed(value) for value in odometer.VALUES]))

    assert wrong(values, [10 * value for value in odometer.VALUES]) == []
    assert sum(value is not None for value in values) >= least


def panel_of(printed: str) -> str:
    """A panel with printed digits."""
    return f"""
name: p
picture: p.png
anchors: [{{name: a, box: [0, 0, 16, 16]}}]
gauges:
- name: transponder
  window: [[8, 8], [63, 8], [63, 31], [8, 31]]
  printed: {{name: squawk, pattern: "0000", {printed}}}
"""


def test_another_picture_teaches_what_the_panel_picture_does_not_show() -> None:
    """`also` names it, and where its window lies if that is another place; its picture belongs to the panel."""
    drawn = DrawnRow(font=dotted)
    moved = np.roll(drawn.picture(3405), (3, 5), axis=(0, 1))
    own = 'shows: "1206", also: [{picture: other.png, shows: "3405", window: [[13, 11], [68, 11], [68, 34], [13, 34]]}]'
    panel = parse_panel(panel_of(f"{own}, text: true"))
    pictures = {"p.png": drawn.picture(1206).astype(np.uint8), "other.png": moved.astype(np.uint8)}
    reader = reader_from_panel(PanelPictures(panel, pictures, ""), Method.NORMXCORR)
    (grid,) = reader.grids
    look = reader.appearance.pictures["squawk"]
    assert isinstance(grid, WindowGrid)

    seen = PrintedReader(panel.gauges[0].printed or described(["0"]), look, 1.0).read(
        np.stack([sampled(grid, drawn.picture(count)) for count in (3206, 1405, 5634, 1207)]), np.zeros(4)
    )

    assert told([found["squawk"] for found in seen]) == [3206.0, 1405.0, 5634.0, None]
    assert panel.pictures == ("p.png", "other.png")
    assert PrintedKind().owns(panel.gauges[0])


def test_window_drawn_carelessly_in_another_picture_is_where_its_anchors_put_it() -> None:
    """A frame of the flight shows the panel, so what one hand drew in one picture is known in all."""
    drawn = DrawnRow(font=dotted)
    texture = cv2.resize(np.random.default_rng(4).integers(30, 220, (50, 40)).astype(np.uint8), (160, 200))

    def picture(count: float, right: int = 0, down: int = 0) -> NDArray[np.uint8]:
        row = drawn.picture(count).astype(np.uint8)
        scene = texture.copy()
        scene[: row.shape[0], : row.shape[1]] = row
        return np.roll(scene, (down, right), axis=(0, 1))

    pictures = {"p.png": picture(1206), "other.png": picture(3405, 5, 3)}

    def look(window: str) -> Print:
        own = f'shows: "1206", also: [{{picture: other.png, shows: "3405"{window}}}], text: true'
        anchored = panel_of(own).replace("[0, 0, 16, 16]", "[100, 80, 40, 40]")
        reader = reader_from_panel(PanelPictures(parse_panel(anchored), pictures, ""), Method.NORMXCORR)
        taught = reader.appearance.pictures["squawk"]
        assert isinstance(taught, Print)
        return taught

    careful, careless, left_out = (
        look(f", window: {corners}" if corners else "")
        for corners in ("[[13, 11], [68, 11], [68, 34], [13, 34]]", "[[15, 9], [70, 9], [70, 32], [15, 32]]", "")
    )

    assert np.array_equal(careful.levels, careless.levels)
    assert np.array_equal(careful.levels, left_out.levels)


def test_window_that_no_anchor_places_in_another_picture_is_said() -> None:
    """Its digits would be learned from wherever the panel picture has them: a warning asks for its window."""
    drawn = DrawnRow(font=dotted)
    shown = drawn.picture(1206).astype(np.uint8)
    pictures = {"p.png": shown, "same.png": shown, "other.png": np.full_like(shown, 90)}
    drawn_too = ", window: [[8, 8], [63, 8], [63, 31], [8, 31]]"

    def warnings(picture: str, window: str = "") -> tuple[str, ...]:
        own = f'shows: "1206", also: [{{picture: {picture}, shows: "3405"{window}}}], text: true'
        anchored = panel_of(own).replace("[0, 0, 16, 16]", "[20, 10, 30, 20]")
        named = {name: pictures[name] for name in ("p.png", picture)}
        return reader_from_panel(PanelPictures(parse_panel(anchored), named, ""), Method.NORMXCORR).warnings

    said = [each for each in warnings("other.png") if "also[0]" in each]
    assert [("other.png" in each, "give its `window`" in each) for each in said] == [(True, True)]
    assert not [each for each in (*warnings("same.png"), *warnings("other.png", drawn_too)) if "also[0]" in each]


@pytest.mark.parametrize(
    ("window", "sentence"),
    [
        ("", r"printed.also\[0\]: is a picture of another size"),
        (", window: [[8, 8], [63, 8], [63, 231], [8, 231]]", "a window outside its 90 x 200 picture"),
        (", window: [[8, 8], [8, 31], [63, 31], [63, 8]]", "clockwise from the top left"),
    ],
)
def test_a_picture_of_another_size_needs_its_own_window(window: str, sentence: str) -> None:
    """Its window's place would be unknown."""
    drawn = DrawnRow()
    panel = parse_panel(panel_of(f'shows: "1206", also: [{{picture: other.png, shows: "3405"{window}}}]'))
    pictures = {"p.png": drawn.picture(1206).astype(np.uint8), "other.png": np.zeros((200, 90), np.uint8)}

    with pytest.raises(PanelError, match=sentence):
        reader_from_panel(PanelPictures(panel, pictures, ""), Method.NORMXCORR)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ('shows: "120"', "is not written as 0000"),
        ('shows: "1206", also: [{picture: a.png, shows: "12"}]', "is not written as 0000"),
        ('shows: "1206", pitch: 20', "is of drums that roll"),
        ('shows: "1206", rolls: up, text: true', "do not roll"),
        ('shows: "1206", rolls: up, pitch: 2', "`pitch` of 4 pixels"),
        ('shows: "1206", rolls: up, pitch: 1000', "three times its `window`"),
        ('shows: "1206", also: [{picture: ../a.png, shows: "1206"}]', "panel's folder or below"),
    ],
)
def test_what_is_told_of_digits_must_fit(given: str, sentence: str) -> None:
    """One sentence says what does not."""
    with pytest.raises(PanelError, match=sentence):
        parse_panel(panel_of(given))
