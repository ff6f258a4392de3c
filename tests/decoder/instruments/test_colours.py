"""What shows by its colour only: read in the mixture of colours that shows it, or in luma if that does."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, partial

import cv2
import numpy as np
import pytest
import yaml

from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.picture_block import PictureBlock
from decoder.imaging.pictures import ColourPicture, Extreme, FramePicture, Mixture, colour_picture, grey_picture
from decoder.imaging.unwrapping import row_of_angle
from decoder.instruments.colours import best_mixture, needle_rows
from decoder.instruments.frame_batch import RawFrame, read_batch
from decoder.instruments.reading import FrameReadings, Status
from decoder.learning.fit import FittedReader, fit_to_flight, reader_from_panel
from decoder.panel.panel import parse_panel
from decoder.panel.scale import Scale
from decoder.panel.vocabulary import Method
from decoder.setup.drafts import problems_of
from flight_file.reader import spread
from tests.decoder.instruments.dials import CENTRE, SCALE, WIDTH_PX, Canvas, Hand, apart, finished
from tests.decoder.instruments.displays import Drawn

Colour = tuple[float, float, float]
TEAL: Colour = (20.0, 90.0, 95.0)
RED: Colour = (200.0, 12.0, 22.0)  # as bright as the teal: 69 levels of luma each
GREY: Colour = (70.0, 70.0, 70.0)
WHITE: Colour = (230.0, 230.0, 230.0)
AT_DEG = 214.0
ANGLES_DEG = np.linspace(130.0, 410.0, 24)
GAUGES: list[dict[str, object]] = [
    {
        "name": "tach",
        "centre": list(CENTRE),
        "radius": [20, 60],
        "sweep": [120, 420],
        "scale": [[120, 0], [420, 300]],
        "needles": [{"name": "rpm", "template": {"at": AT_DEG, "span": 16}}],
    },
    {
        "name": "small",
        "centre": [214.0, 130.0],
        "radius": [5, 19],
        "sweep": [120, 420],
        "scale": [[120, 0], [420, 300]],
        "needles": [{"name": "oil", "template": {"at": AT_DEG, "span": 30}}],
    },
]
CONTENT = {
    "name": "dials",
    "picture": "panel.jpg",
    "anchors": [{"name": "texture", "box": [196, 22, 36, 36]}],
}


def jpeg_of(plane: Callable[[int], np.ndarray], quality: int = 95) -> bytes:
    """A JPEG of what a function draws for each place in a colour: red, green, blue."""
    picture = np.stack([plane(place) for place in (2, 1, 0)], axis=-1)
    return cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()


def draw(angle_deg: float, needle: Colour, face: Colour, seed: int) -> bytes:
    """A JPEG of a dial with such a needle, and of a small one with a white needle, with noise of its own each colour.

    Between the marks, every 30 degrees, lie rings of the same grey: by them the light is told.
    """

    def plane(place: int) -> np.ndarray:
        canvas = Canvas()
        canvas.disc(CENTRE, 76.0, face[place])
        for ring_px in (54.0, 34.0):
            canvas.disc(CENTRE, ring_px + 1.5, 130.0)
            canvas.disc(CENTRE, ring_px - 1.5, face[place])
        for mark_deg in range(0, 360, 30):
            canvas.bar(mark_deg, (56.0, 73.0), (1.2, 1.2), 190.0)
        canvas.hand(Hand(level=needle[place]), angle_deg)
        canvas.disc((214.0, 130.0), 22.0, 35.0)
        for mark_deg in range(0, 360, 45):
            canvas.bar(mark_deg, (15.0, 20.0), (0.8, 0.8), 150.0, (214.0, 130.0))
        canvas.bar(angle_deg, (0.0, 17.0), (1.4, 1.0), 230.0, (214.0, 130.0))
        return finished(canvas, noise=3.0, blur=0.7, quality=98, seed=3 * seed + place)

    return jpeg_of(plane, quality=90)


def panel_of(picture: bytes, gauges: Sequence[Mapping[str, object]]) -> PanelPictures:
    """The panel on a picture."""
    panel = parse_panel(yaml.safe_dump({**CONTENT, "gauges": list(gauges)}))
    return PanelPictures(panel, {"panel.jpg": grey_picture(picture)}, "0" * 64, encoded={"panel.jpg": picture})


@cache
def flight_of(needle: Colour, face: Colour) -> tuple[bytes, ...]:
    """A flight's frames."""
    return tuple(draw(angle_deg, needle, face, number) for number, angle_deg in enumerate(ANGLES_DEG, start=1))


@cache
def fitted_to(needle: Colour, face: Colour) -> FittedReader:
    """A reader fitted to such a flight."""
    return fitted_of(GAUGES, draw(AT_DEG, needle, face, 0), flight_of(needle, face))


def fitted_of(gauges: Sequence[Mapping[str, object]], picture: bytes, jpegs: Sequence[bytes]) -> FittedReader:
    """A reader of such gauges on a panel picture, fitted to a flight's frames."""
    frames = [PictureBlock().frame(each, 0, None, None, has_colour=True) for each in jpegs]

    def sample(count: int) -> Iterator[FramePicture]:
        return (frames[place] for place in sorted(spread(len(frames), count)))  # type: ignore[misc]

    return fit_to_flight(reader_from_panel(panel_of(picture, gauges), Method.NORMXCORR), sample)


def read_of(fitted: FittedReader, frames: Sequence[bytes]) -> list[FrameReadings]:
    """What is read of frames, as of a flight's."""
    raw = [RawFrame(number, number, encoded) for number, encoded in enumerate(frames)]
    read = [each for each in read_batch(fitted.reader, raw) if isinstance(each, FrameReadings)]
    assert len(read) == len(frames)
    return read


def test_red_needle_as_bright_as_its_dial_is_read_in_its_colour() -> None:
    """As well as any other, and its mixture is reported. The dial beside it is read in luma."""
    fitted = fitted_to(RED, TEAL)
    read = [each.readings for each in read_of(fitted, flight_of(RED, TEAL))]

    off_deg = [each["rpm"].angle_deg - truth for each, truth in zip(read, ANGLES_DEG, strict=True)]
    assert all(each["rpm"].status is Status.READ for each in read)
    assert float(np.abs(off_deg).max()) < 0.3
    assert [grid.mixture is None for grid in fitted.reader.grids] == [False, True]
    (said,) = fitted.findings["tach"]
    assert said.startswith("read in red")
    assert fitted.findings["small"] == ()


SKY: Colour = (20.0, 110.0, 190.0)
GROUND: Colour = (150.0, 72.0, 40.0)  # as bright as the sky: 92 levels of luma each
HORIZON = {
    "name": "attitude",
    "centre": list(CENTRE),
    "radius": [4, 70],
    "sweep": [0, 360],
    "scale": [[270, 0], [450, 180]],
    "wraps": 360,
    "attitude": {"roll": "roll_deg", "pitch": "pitch_deg", "window": 50, "ladder": [[-20, -10], [0, 0], [20, 10]]},
}


def horizon(roll_deg: float, pitch_deg: float, seed: int) -> bytes:
    """A JPEG of an attitude indicator with a ladder, two pixels a degree, behind a frame with white marks."""
    turn = math.radians(roll_deg)

    def plane(place: int) -> np.ndarray:
        canvas = Canvas()
        canvas.disc(CENTRE, 76.0, 35.0)
        for mark_deg in (180, 210, 225, 240, 260, 270, 280, 300, 315, 330, 360):
            canvas.bar(mark_deg, (54.0, 68.0), (1.2, 1.2), 220.0)
        y, x = ((np.indices(canvas.picture.shape) + 0.5) / SCALE - 0.5 - np.array(CENTRE[::-1])[:, None, None]).astype(
            np.float32
        )
        up = 2.0 * pitch_deg - (y * math.cos(turn) + x * math.sin(turn))
        along = np.abs(x * math.cos(turn) - y * math.sin(turn))
        is_line = ((np.abs(up) < 1.0) | ((np.abs(np.abs(up) - 20.0) < 0.8) & (along < 16.0))) & (np.hypot(x, y) < 50.0)
        in_window = np.hypot(x, y) < 50.0
        canvas.picture[in_window] = np.where(up > 0.0, SKY[place], GROUND[place])[in_window]
        canvas.picture[is_line] = 190
        return finished(canvas, noise=3.0, blur=0.7, quality=98, seed=3 * seed + place)

    return jpeg_of(plane)


@pytest.mark.slow
def test_horizon_as_bright_as_its_sky_is_read_in_its_colours() -> None:
    """Blue above brown is hardly seen in luma, nor any turn of it."""
    attitudes = [(38.0 * math.sin(frame), 14.0 * math.sin(0.7 * frame + 1.0)) for frame in range(1, 21)]
    jpegs = [horizon(*attitude, seed) for seed, attitude in enumerate(attitudes, start=1)]
    fitted = fitted_of([HORIZON], horizon(0.0, 0.0, 0), jpegs)
    read = [each.readings for each in read_of(fitted, jpegs)]

    pitch = Scale.of(fitted.panel.gauges[0].quantities[1].marks)

    assert fitted.findings["attitude"][0].startswith("read in ")
    for readings, (roll_deg, pitch_deg) in zip(read, attitudes, strict=True):
        assert readings["roll_deg"].status is Status.READ
        assert apart(readings["roll_deg"].angle_deg, 270.0 + roll_deg) < 0.5
        assert readings["pitch_deg"].status is Status.READ
        assert float(pitch.values_at(np.array([readings["pitch_deg"].angle_deg]))[0]) == pytest.approx(
            pitch_deg, abs=0.6
        )


LAMP = {"name": "gen", "window": [[150, 110], [174, 110], [174, 126], [150, 126]], "lamp": {"name": "gen_fail_on"}}
FLAPS = {
    "name": "flaps",
    "window": [[40, 20], [64, 20], [64, 160], [40, 160]],
    "unit": "deg",
    "linear": {"name": "flap_deg", "moves": "down", "at": 120, "span": 14, "marks": [[150, 0], [30, 40]]},
}
GREEN: Colour = (0.0, 120.0, 20.0)  # 73 levels of luma, and 74
RED_LIGHT: Colour = (200.0, 22.0, 10.0)


def windows(
    flap_deg: float,
    seed: int,
    *,
    is_red: bool,
    sun: float = 1.0,
    words: bool = False,
    pointer: Colour = RED,
    beside: float = 95.0,
    haze: float = 0.0,
    unlit: Colour = GREEN,
) -> bytes:
    """A JPEG of a pointer on a teal track as bright as red, and of a lamp that is green, or red and as bright.

    With words, each of the lamp's colours has its own on it. A white lamp may be `beside` it, and haze on it.
    """

    def plane(place: int) -> np.ndarray:
        canvas = Canvas()
        canvas.polygon([(34, 14), (70, 14), (70, 166), (34, 166)], 110.0)
        canvas.polygon([(40, 20), (64, 20), (64, 160), (40, 160)], TEAL[place])
        for mark in range(30, 160, 15):
            canvas.polygon([(40, mark - 0.6), (45, mark - 0.6), (45, mark + 0.6), (40, mark + 0.6)], 200.0)
        y = 150.0 - 3.0 * flap_deg
        canvas.polygon([(46, y), (58, y - 4.0), (58, y + 4.0)], pointer[place])
        canvas.polygon([(145, 105), (179, 105), (179, 131), (145, 131)], 95.0)
        canvas.polygon([(150, 110), (174, 110), (174, 126), (150, 126)], (RED_LIGHT if is_red else unlit)[place])
        for x in range(153 + 2 * is_red, 172, 4) if words else ():
            canvas.polygon([(x, 113), (x + 2, 113), (x + 2, 123), (x, 123)], 170.0)
        canvas.polygon([(179, 108), (190, 108), (190, 128), (179, 128)], beside)
        canvas.picture[110:126, 150:174] += (haze * (255.0 - canvas.picture[110:126, 150:174])).astype(np.uint8)
        canvas.picture[:] = (canvas.picture * sun).astype(np.uint8)
        return finished(canvas, noise=2.0, blur=0.7, quality=98, seed=3 * seed + place)

    return jpeg_of(plane)


@pytest.mark.parametrize("words", [False, True], ids=["plain", "words"])
def test_windows_in_which_luma_shows_no_change_are_read_in_their_colours(*, words: bool) -> None:
    """A lamp that turns from green to red was told to be off throughout, and a pointer to stay where it was drawn.

    So was a lamp with other words in each colour: luma showed a change, but not which.
    """
    flaps_deg = [20.0 + 18.0 * math.sin(0.4 * number) for number in range(24)]
    red = [number // 5 % 2 == 1 for number in range(24)]
    shown = zip(flaps_deg, red, strict=True)
    jpegs = [
        windows(flap, seed, is_red=is_red, sun=0.8 + 0.02 * (seed % 10), words=words)
        for seed, (flap, is_red) in enumerate(shown, start=1)
    ]
    fitted = fitted_of([LAMP, FLAPS], windows(10.0, 0, is_red=False, words=words), jpegs)
    read = [each.readings for each in read_of(fitted, jpegs)]
    scale = Scale.of(fitted.panel.gauges[1].quantities[0].marks)

    assert all(own.status is Status.READ for each in read for own in each.values())
    assert [each["gen_fail_on"].angle_deg == 1.0 for each in read] == red
    assert scale.values_at(np.array([each["flap_deg"].angle_deg for each in read])) == pytest.approx(flaps_deg, abs=0.3)
    assert fitted.findings["gen"][0].startswith("read in red")
    assert fitted.findings["flaps"][0].startswith("read in red")


def test_a_lamp_as_bright_in_both_colours_is_read_where_luma_shows_other_changes() -> None:
    """Another lamp beside it, and haze over it, had kept it from being read in a colour: it was off throughout."""
    red = [number // 5 % 2 == 1 for number in range(24)]
    jpegs = [
        windows(10.0, seed, is_red=each, beside=240.0 if seed % 7 < 3 else 95.0, haze=0.04 * (seed % 4))
        for seed, each in enumerate(red, start=1)
    ]
    fitted = fitted_of([LAMP], windows(10.0, 0, is_red=False), jpegs)
    read = [each.readings["gen_fail_on"] for each in read_of(fitted, jpegs)]

    assert all(own.status is Status.MISSING or bool(own.angle_deg) == each for own, each in zip(read, red, strict=True))
    assert sum(own.status is Status.READ for own in read) > len(read) / 2


def test_a_lamp_that_is_grey_in_the_panel_picture_and_lit_in_as_bright_a_colour_is_read_in_it() -> None:
    """A panel picture without colour in its window had kept the lamp in luma: it was told to be off throughout."""
    red = [number // 5 % 2 == 1 for number in range(24)]
    grey = partial(windows, 10.0, unlit=(74.0, 74.0, 74.0))
    jpegs = [grey(seed, is_red=each) for seed, each in enumerate(red, start=1)]
    fitted = fitted_of([LAMP], grey(0, is_red=False), jpegs)
    read = [each.readings["gen_fail_on"] for each in read_of(fitted, jpegs)]

    assert all(own.status is Status.READ for own in read)
    assert [own.angle_deg == 1.0 for own in read] == red


def test_pointer_that_luma_shows_is_read_in_luma() -> None:
    """It has one colour, unlike a bar, so no frame can show it in another that luma hides."""
    flaps_deg = [20.0 + 18.0 * math.sin(0.4 * number) for number in range(24)]
    jpegs = [windows(flap, seed, is_red=False, pointer=YELLOW) for seed, flap in enumerate(flaps_deg, start=1)]
    fitted = fitted_of([FLAPS], windows(10.0, 0, is_red=False, pointer=YELLOW), jpegs)
    read = [each.readings["flap_deg"] for each in read_of(fitted, jpegs)]

    assert all(own.status is Status.READ for own in read)
    assert not any(finding.startswith("read in") for finding in fitted.findings["flaps"])


@pytest.mark.parametrize("face", [TEAL, GREY], ids=["teal", "grey"])
def test_needle_that_shows_in_luma_is_read_in_luma(face: Colour) -> None:
    """Colours do not help with a white needle, and nothing is decompressed for them."""
    fitted = fitted_to(WHITE, face)
    block = fitted.reader.block

    assert not fitted.reader.source.has_colour
    assert all(grid.mixture is None for grid in fitted.reader.grids)
    assert block.frame(flight_of(WHITE, face)[0], 0, None, None, has_colour=False).coloured is None


def test_needle_that_luma_does_not_show_at_all_is_no_fault_of_the_panel() -> None:
    """The page accepts it, though its template is flat in luma; without its colours it objects."""
    document = {**CONTENT, "gauges": [{**GAUGES[0], "radius": [39, 49]}]}
    picture = draw(AT_DEG, RED, TEAL, 0)
    grey = {"panel.jpg": grey_picture(picture)}

    assert problems_of(document, grey, None, {"panel.jpg": picture}) == []
    assert [each.path for each in problems_of(document, grey)] == ["gauges[0].needles[0].template"]


def test_needle_drawn_beside_its_sweep_is_named_and_gives_no_warning() -> None:
    """It covers no row of its dial, so there is nothing that grey or colours could show of it."""
    needle = {"name": "rpm", "template": {"at": 360.0, "span": 16}}
    gauge = {**GAUGES[0], "sweep": [120, 240], "scale": [[120, 0], [240, 300]], "needles": [needle]}
    picture = draw(AT_DEG, RED, TEAL, 0)
    grey = {"panel.jpg": grey_picture(picture)}

    (problem,) = problems_of({**CONTENT, "gauges": [gauge]}, grey, None, {"panel.jpg": picture})
    assert problem.path.startswith("gauges[0].needles[0].template")


def test_first_rows_are_as_those_of_the_whole_picture() -> None:
    """A decoder that stops early gives the same colours, and the same as for people to look at."""
    (jpeg,) = [draw(AT_DEG, RED, TEAL, 1)]
    whole, top = PictureBlock().colour_picture(jpeg), PictureBlock().colour_picture(jpeg, 96)

    assert (whole == colour_picture(jpeg)).all()
    assert top.shape == (96, WIDTH_PX, 3)
    assert (top[:95] == whole[:95]).all()


def test_company_and_batches_change_no_bit() -> None:
    """A frame that was opened before, and one that is opened now, alone or among others, are read the same."""
    fitted, frames = fitted_to(RED, TEAL), flight_of(RED, TEAL)
    together = read_of(fitted, frames)
    alone = [read_of(fitted, [frame])[0] for frame in frames[::5]]
    opened = [FramePicture(grey_picture(frame), None, partial(colour_picture, frame)) for frame in frames[::5]]
    handed = read_batch(fitted.reader, [RawFrame(0, 0, b"", None, picture) for picture in opened])

    told = [repr(each.readings) for each in together[::5]]
    assert [repr(each.readings) for each in alone] == told
    assert [repr(each.readings) for each in handed if isinstance(each, FrameReadings)] == told


@pytest.mark.parametrize(
    ("mixture", "words", "grey"),
    [
        (Mixture(1, 0, 0), "red", 200),
        (Mixture(1, -1, 0), "red minus green", (200 + 255 - 10) / 2),
        (Mixture(1, -1, 1), "red and blue minus green", (200 + 255 - 10 + 40) / 3),
    ],
)
def test_mixture_says_what_it_is_and_never_leaves_the_levels(mixture: Mixture, words: str, grey: float) -> None:
    """In words; black and white stay within what a grey can be."""
    picture: ColourPicture = np.array([[[200, 10, 40], [0, 0, 0], [255, 255, 255]]], np.uint8)

    assert str(mixture) == words
    assert mixture.of(picture)[0, 0] == round(grey)
    assert (
        mixture.of(np.array([[[255 * (count > 0) for count in (mixture.red, mixture.green, mixture.blue)]]], np.uint8))
        == 255
    )


def test_extremes_say_what_they_are_and_show_whatever_is_lit_or_printed() -> None:
    """Lights of all colours are equally bright in one, and prints of all colours equally dark in the other."""
    picture = np.array([[[250, 10, 10], [10, 250, 10], [250, 250, 10], [10, 10, 250]]], np.uint8)

    assert [str(each) for each in Extreme] == ["each pixel's brightest colour", "each pixel's darkest colour"]
    assert Extreme.BRIGHTEST.of(picture).tolist() == [[250] * 4]
    assert Extreme.DARKEST.of(picture).tolist() == [[10] * 4]


CREAM: Colour = (214.0, 206.0, 184.0)
BLACK: Colour = (40.0, 40.0, 40.0)
MAROON: Colour = (108.0, 10.0, 16.0)  # as dark as the black: 40 levels of luma each


def twins(black_deg: float, maroon_deg: float, seed: int) -> bytes:
    """A JPEG of a dial with two hands of one form and one luma, the maroon one above."""

    def plane(place: int) -> np.ndarray:
        canvas = Canvas()
        canvas.disc(CENTRE, 76.0, CREAM[place])
        for mark_deg in range(120, 421, 25):
            canvas.bar(mark_deg, (64.0, 73.0), (1.2, 1.2), 60.0)
        canvas.hand(Hand(level=BLACK[place], tip=58.0), black_deg)
        canvas.hand(Hand(level=MAROON[place], tip=58.0), maroon_deg)
        return finished(canvas, noise=3.0, blur=0.7, quality=98, seed=3 * seed + place)

    return jpeg_of(plane)


def test_hands_that_differ_by_their_colour_only_are_read_where_it_tells_them_apart() -> None:
    """In luma each matches where the other is, so that none would be read; they cross each other twice."""
    needles = [
        {"name": "left", "template": {"at": 200.0, "span": 16}, "covered_by": "right"},
        {"name": "right", "template": {"at": 330.0, "span": 16}},
    ]
    gauge = {**GAUGES[0], "name": "manifold", "needles": needles}
    truth = [(260.0 + 130.0 * math.sin(0.55 * frame), 265.0 + 120.0 * math.cos(0.35 * frame)) for frame in range(24)]
    jpegs = [twins(*angles_deg, seed) for seed, angles_deg in enumerate(truth, start=1)]
    fitted = fitted_of([gauge], twins(200.0, 330.0, 0), jpegs)

    read = 0
    for frame, angles_deg in zip(read_of(fitted, jpegs), truth, strict=True):
        for name, angle_deg in zip(("left", "right"), angles_deg, strict=True):
            reading = frame.readings[name]
            read += reading.status is Status.READ
            assert reading.status is Status.MISSING or apart(reading.angle_deg, angle_deg) < max(
                1.0, 2.0 * reading.sigma_deg
            )
    assert fitted.findings["manifold"][0].startswith("read in red")
    assert read > 36


SLOT: Colour = (82.0, 82.0, 82.0)
LEVEL = {
    "name": "level",
    "window": [[44, 20], [60, 20], [60, 160], [44, 160]],
    "linear": {"name": "level_pct", "moves": "down", "at": 90, "span": 14, "marks": [[150, 0], [30, 100]]},
}


def graded(part: float) -> Colour:
    """From blue at the bottom to red at the top; somewhere it is as red as its slot."""
    return 230.0 * part, 10.0, 230.0 * (1.0 - part)


def warning(part: float) -> Colour:
    """Green as bright as its slot, and yellow above a level."""
    return (250.0, 245.0, 10.0) if part > 0.75 else (10.0, 130.0, 20.0)


def level_of(pct: float, seed: int, colour: Callable[[float], Colour]) -> bytes:
    """A JPEG of a bar in a grey slot, whose colour at a part of its scale a function gives."""

    def plane(place: int) -> np.ndarray:
        canvas = Canvas()
        canvas.polygon([(34, 10), (70, 10), (70, 170), (34, 170)], 50.0)
        canvas.polygon([(44, 20), (60, 20), (60, 160), (44, 160)], SLOT[place])
        for step in range(round(20.0 + 2.4 * pct)):
            y = 160.0 - step / 2
            canvas.polygon([(46, y), (58, y), (58, y - 0.5), (46, y - 0.5)], colour((150.0 - y) / 120.0)[place])
        return finished(canvas, noise=2.0, blur=0.7, quality=98, seed=3 * seed + place)

    return jpeg_of(plane)


@pytest.mark.parametrize("colour", [graded, warning])
def test_a_bar_is_read_in_the_colour_in_which_it_shows_everywhere(colour: Callable[[float], Colour]) -> None:
    """In another, which shows more contrast on the whole, a part of it is as bright as its slot.

    It fills half of its window in the panel picture, which alone does not show what is bar and what is slot.
    """
    shown_pct = [50.0 + 44.0 * math.sin(0.4 * number + 0.2) for number in range(24)]
    jpegs = [level_of(pct, seed, colour) for seed, pct in enumerate(shown_pct, start=1)]
    fitted = fitted_of([LEVEL], level_of(50.0, 0, colour), jpegs)
    read = [each.readings["level_pct"] for each in read_of(fitted, jpegs)]
    scale = Scale.of(fitted.panel.gauges[0].quantities[0].marks)

    assert [own.status for own in read] == [Status.READ] * len(read)
    assert scale.values_at(np.array([own.angle_deg for own in read])) == pytest.approx(shown_pct, abs=0.7)


def test_of_colours_as_clear_the_one_without_reflections_is_chosen() -> None:
    """Against blue a needle stands out most, but so does what a sky adds."""
    gauge = panel_of(draw(AT_DEG, RED, TEAL, 0), GAUGES[:1])
    grid, rng = gauge.grid(0), np.random.default_rng(4)
    dial = np.full((grid.rows, grid.columns, 3), (140.0, 105.0, 100.0), np.float32)
    dial[::20, -12:] = 20.0

    def shown(angle_deg: float) -> np.ndarray:
        rows = round(row_of_angle(grid, angle_deg)) + np.arange(-6, 7)
        strip = dial.copy()
        strip[rows] = (210.0, 68.0, 50.0)
        return (strip + rng.normal(0.0, 2.0, strip.shape)).astype(np.float32)

    def under_sky(strip: np.ndarray, first: int) -> np.ndarray:
        sky = np.zeros_like(strip)
        sky[first : first + grid.rows // 4, : grid.columns // 2, 2] = 60.0
        return strip + sky

    frames = [under_sky(shown(angle_deg), 9 * place) for place, angle_deg in enumerate(ANGLES_DEG)]
    against_blue, against_green = Mixture(1, 0, -1), Mixture(1, -1, 0)
    needles = needle_rows(gauge.panel.gauges[0], grid)

    assert best_mixture(grid, shown(AT_DEG), frames, needles, [against_blue, against_green]) == against_green


def test_a_bug_that_is_as_bright_as_the_print_it_covers_is_read_in_its_colour() -> None:
    """In luma, frames without it look as if it had stayed on its mark; blue shows it, a little above noise."""
    gauge = panel_of(draw(AT_DEG, RED, TEAL, 0), GAUGES[:1])
    grid, rng = gauge.grid(0), np.random.default_rng(3)
    home, wide = round(row_of_angle(grid, AT_DEG)), np.arange(-5, 6)

    def shown(row: int | None) -> np.ndarray:
        strip = np.full((grid.rows, grid.columns, 3), 150.0, np.float32)
        for mark in range(3):
            strip[home + 40 * mark + wide, -16:] = 60.0
        if row is not None:
            strip[row + wide, -16:] = (50.0, 60.0, 90.0)
        return (strip + rng.normal(0.0, 2.0, strip.shape)).astype(np.float32)

    needles = needle_rows(gauge.panel.gauges[0], grid)
    frames = [shown(None if number % 5 < 3 else home + 40 * (number // 3 % 3)) for number in range(16)]

    assert best_mixture(grid, shown(home), frames, needles, [Mixture(0, 0, 1), Mixture(0, 1, 0)]) == Mixture(0, 0, 1)


def test_needle_behind_which_digits_change_is_read_in_the_colour_that_shows_it_alone() -> None:
    """In luma white digits change by more than the dim red needle does, and it is not found again among them."""
    gauge = panel_of(draw(AT_DEG, RED, TEAL, 0), GAUGES[:1])
    grid, rng = gauge.grid(0), np.random.default_rng(8)
    digits = round(row_of_angle(grid, AT_DEG)) + np.arange(-20, 21)

    def shown(angle_deg: float) -> np.ndarray:
        strip = np.full((grid.rows, grid.columns, 3), 20.0, np.float32)
        strip[::20, -8:] = 190.0
        lit = rng.random((len(digits) // 5 + 1, 4)).repeat(5, axis=0).repeat(4, axis=1)[: len(digits)] > 0.5
        strip[digits, :16] = np.where(lit[..., None], np.float32(220.0), strip[digits, :16])
        strip[round(row_of_angle(grid, angle_deg)) + np.arange(-6, 7)] = (110.0, 14.0, 16.0)
        return (strip + rng.normal(0.0, 2.0, strip.shape)).astype(np.float32)

    frames = [shown(angle_deg) for angle_deg in ANGLES_DEG]
    needles = needle_rows(gauge.panel.gauges[0], grid)

    red, against_green = Mixture(1, 0, 0), Mixture(1, -1, 0)
    assert best_mixture(grid, shown(AT_DEG), frames, needles, [red, against_green]) == against_green


SQUAWK = Drawn(pattern="0000", width=11.0, height=22.0, pitch=18.0, stroke=3.0, slant=0.05)
DIM: Colour = (68.0, 68.0, 68.0)  # segments that are not lit
AMBER: Colour = (255.0, 100.0, 50.0)  # 141 levels of luma


def squawk(text: str, seed: int) -> bytes:
    """A JPEG of a display of amber digits on black, all of whose segments show in daylight."""

    def plane(place: int) -> np.ndarray:
        canvas, every, lit = Canvas(), SQUAWK.picture("8888"), SQUAWK.picture(text)
        shown = 5.0 + (DIM[place] - 5.0) * every + (AMBER[place] - DIM[place]) * lit
        fine = np.rint(shown).astype(np.uint8).repeat(SCALE, axis=0).repeat(SCALE, axis=1)
        top, left = 60 * SCALE, 100 * SCALE
        canvas.picture[top : top + len(fine), left : left + fine.shape[1]] = fine
        return finished(canvas, noise=2.0, blur=0.7, quality=98, seed=3 * seed + place)

    return jpeg_of(plane)


def test_a_display_that_luma_does_not_read_is_read_in_the_colour_in_which_it_is_clearer() -> None:
    """Its unlit segments are half as bright as its lit ones in luma, and in red the latter are not twice as clear."""
    texts = [f"{number * 1237 % 10000:04d}" for number in range(1, 25)]
    jpegs = [squawk(text, seed) for seed, text in enumerate(texts, start=1)]
    window = [[110.0, 66.0], [178.0, 66.0], [178.0, 92.0], [110.0, 92.0]]
    gauge = {"name": "xpdr", "window": window, "digits": {"name": "code", "pattern": "0000", "shows": "1234"}}
    read = [each.readings["code"] for each in read_of(fitted_of([gauge], squawk("1234", 0), jpegs), jpegs)]

    assert [own.angle_deg for own in read if own.status is Status.READ] == [
        float(text) for own, text in zip(read, texts, strict=True) if own.status is Status.READ
    ]
    assert sum(own.status is Status.READ for own in read) > len(read) / 2


NIGHT: Colour = (8.0, 8.0, 8.0)
DUSK: Colour = (82.0, 82.0, 82.0)  # as bright as the red: 82 levels of luma each
YELLOW: Colour = (235.0, 235.0, 20.0)
BAR = {
    "name": "power",
    "window": [[40, 20], [64, 20], [64, 160], [40, 160]],
    "linear": {"name": "power_pct", "moves": "down", "at": 124, "span": 14, "marks": [[155, 0], [25, 100]]},
}
RED_AT = 90.0
GREEN_BAND: Colour = (10.0, 230.0, 10.0)
RED_BAND: Colour = (250.0, 10.0, 10.0)


def banded(at: float, seed: int, slot: Colour) -> bytes:
    """A JPEG of a bar in its slot that rises from below to a height: green, yellow, and red above `RED_AT`."""

    def plane(place: int) -> np.ndarray:
        canvas = Canvas()
        canvas.polygon([(34, 14), (70, 14), (70, 166), (34, 166)], 110.0)
        canvas.polygon([(40, 20), (64, 20), (64, 160), (40, 160)], slot[place])
        canvas.polygon([(40, max(at, RED_AT)), (64, max(at, RED_AT)), (64, 160), (40, 160)], YELLOW[place])
        if at < RED_AT:
            canvas.polygon([(40, at), (64, at), (64, RED_AT), (40, RED_AT)], RED_BAND[place])
        canvas.polygon([(40, max(at, 120.0)), (64, max(at, 120.0)), (64, 160), (40, 160)], GREEN_BAND[place])
        return finished(canvas, noise=2.0, blur=0.7, quality=95, seed=3 * seed + place)

    return jpeg_of(plane)


@pytest.mark.slow
@pytest.mark.parametrize("slot", [NIGHT, DUSK])
@pytest.mark.parametrize("heights", [[45.0] * 10, []], ids=["often red", "once red"])
def test_bar_that_goes_on_in_red_is_read_at_its_end(slot: Colour, heights: list[float]) -> None:
    """Its yellow stands out most in green, which hides red; in luma the red is as bright as a grey slot.

    It had been told to end where its red begins. What a bar is read in must not depend on how often it was red.
    """
    heights = [*heights, 45.0, 124.0, 110.0, 132.0, 118.0, 140.0, 100.0, 128.0, 105.0, *heights]
    jpegs = [banded(at, seed, slot) for seed, at in enumerate(heights, start=1)]
    fitted = fitted_of([BAR], banded(124.0, 0, slot), jpegs)
    read = [each.readings["power_pct"] for each in read_of(fitted, jpegs)]
    scale = Scale.of(fitted.panel.gauges[0].quantities[0].marks)

    assert [own.status for own in read] == [Status.READ] * len(read)
    assert scale.values_at(np.array([own.angle_deg for own in read])) == pytest.approx(
        [(155.0 - at) / 1.3 for at in heights], abs=0.7
    )
