"""Few clicks and keys make a gauge: what was clicked for its rim, usual instruments, and what follows from marks."""

from __future__ import annotations

import math

import pytest
from playwright.sync_api import Page, expect

from tests.programs import yaml_of
from tests.setup.hand import Hand, OpenPage, Start

CENTRE, RING_PX = (297.3, 168.4), 51.0
MARKS_DEG = {60: 150.0, 80: 255.4545, 100: 360.909}
VALUE = "#inspector input[aria-label^='value of the mark']"


def ends(page: Page, *angles_deg: float) -> Hand:
    """Clicks on the ring of the flight's first dial."""
    hand = Hand(page)
    hand.press("g")
    for angle_deg in angles_deg:
        turn = math.radians(angle_deg)
        hand.click((CENTRE[0] + RING_PX * math.cos(turn), CENTRE[1] + RING_PX * math.sin(turn)))
    return hand


def three_marks(page: Page, usual: str) -> Hand:
    """Three outer ends of marks of the flight's first dial, and the press that says which instrument it is."""
    hand = ends(page, *MARKS_DEG.values())
    page.locator(f"button[data-usual='{usual}']").click()
    expect(page.locator(f"{VALUE}:focus")).to_have_count(1)
    return hand


def typed(page: Page, text: str) -> None:
    """What is typed where the page has put the cursor."""
    page.keyboard.type(text)
    page.keyboard.press("Enter")
    Hand(page).look()


def values(page: Page) -> list[str]:
    """Of all marks, in their order."""
    return [field.input_value() for field in page.locator(VALUE).all()]


def test_three_clicks_and_two_numbers_make_a_gauge(start: Start, open_page: OpenPage) -> None:
    """The clicks are its marks, an even scale gives the third value, and the needle that moves is taken by itself."""
    running = start()
    page = open_page(running)
    hand = three_marks(page, "tachometer")
    typed(page, "60")
    typed(page, "80")
    typed(page, "")
    expect(page.locator("#picture:focus")).to_have_count(1)
    assert values(page) == ["60", "80", "100"]
    expect(page.locator('[id="f:gauges[0].needles[0].name"]')).to_have_value("tach_rpm")
    angle = float(page.locator('[id="f:gauges[0].needles[0].template.at"]').input_value())
    assert angle == pytest.approx(359.5, abs=0.5)
    first, last = (float(page.locator(f'[id="f:gauges[0].sweep[{end}]"]').input_value()) for end in (0, 1))
    assert first <= 100.0
    assert last >= 410.0

    hand.type_into(
        "gauges[0].scale[2][1]", ""
    )  # a mark without a value counts for nothing, and keeps nobody from saving
    hand.anchor("knob", [60, 60, 40, 40])
    hand.save()
    (gauge,) = yaml_of(running.session.target)["gauges"]
    assert [value for _, value in gauge["scale"]] == [60, 80]


def test_one_number_is_enough_all_the_way_round(start: Start, open_page: OpenPage) -> None:
    """A turn's value gives the other marks; the sweep is a whole turn; a second pointer's scale follows."""
    running = start()
    page = open_page(running)
    hand = three_marks(page, "altimeter")
    typed(page, "0")
    assert values(page) == ["0", "300", "600"]
    for end, angle in (("0", "0"), ("1", "360")):
        expect(page.locator(f'[id="f:gauges[0].sweep[{end}]"]')).to_have_value(angle)
    expect(page.locator('[id="f:gauges[0].needles[0].name"]')).to_have_value("hundreds_ft")

    hand.press("n")
    hand.click((CENTRE[0] - 30, CENTRE[1] + 10))
    page.locator("#tenfold-1").click()
    path = "gauges[0].needles[1]"
    expect(page.locator(f'[id="f:{path}.wraps"]')).to_have_value("10000")
    expect(page.locator('[id="f:gauges[0].combined.name"]')).to_be_visible()
    expect(page.locator(f'[id="f:{path}.scale[1][1]"]')).to_have_value("3000")
    hand.type_into("gauges[0].scale[1][1]", "290")
    expect(page.locator(f'[id="f:{path}.scale[1][1]"]')).to_have_value("2900")
    page.locator("#undo").click()
    expect(page.locator(f'[id="f:{path}.scale[1][1]"]')).to_have_value("3000")


def test_marks_that_stand_between_round_values_are_asked_for(start: Start, open_page: OpenPage) -> None:
    """As on a dial seen from aside: there a value is no more than likely, and nobody checks what was filled in."""
    page = open_page(start())
    ends(page, 150.0, 237.5, 359.5)
    page.locator("button[data-usual='heading']").click()
    expect(page.locator(f"{VALUE}:focus")).to_have_count(1)
    typed(page, "30")
    assert values(page) == ["30", "", "240"]
    expect(page.locator(f"{VALUE}:focus")).to_have_attribute("placeholder", "120?")
    typed(page, "")
    assert values(page) == ["30", "120", "240"]


def test_a_balls_way_is_clicked(start: Start, open_page: OpenPage) -> None:
    """Each click puts a place at the end of the list, and the keys that follow are its value."""
    page = open_page(start())
    three_marks(page, "tachometer")
    page.keyboard.press("Escape")
    page.locator("#what-turns-0").select_option("ball")
    Hand(page).press("p")
    for place, value in (((80.0, 90.0), "-1"), ((120.0, 96.0), "0"), ((160.0, 90.0), "1")):
        Hand(page).click(place)
        page.wait_for_selector('[id="f:gauges[0].ball.tube"]:focus')
        typed(page, value)
    expect(page.locator('[id="f:gauges[0].ball.tube"]')).to_have_value("80 90 -1, 120 96 0, 160 90 1")


def test_ends_too_near_each_other_to_tell_a_centre_ask_for_the_hub(start: Start, open_page: OpenPage) -> None:
    """The page says how far off the centre may be; the hub is clicked then, and what was clicked are its marks."""
    page = open_page(start())
    hand = ends(page, 150.0, 165.0, 180.0)
    expect(page.locator("#hint")).to_contain_text("Now click the hub")
    expect(page.locator("#outline .of-gauge")).to_have_count(0)
    hand.click(CENTRE)
    for axis in (0, 1):
        centre = float(page.locator(f'[id="f:gauges[0].centre[{axis}]"]').input_value())
        assert centre == pytest.approx(CENTRE[axis], abs=0.5)
    assert len(values(page)) == 3


def test_marks_at_both_ends_of_a_turn_coordinator_count_for_the_first(start: Start, open_page: OpenPage) -> None:
    """Its wings are one needle: a mark at the left one counts as the right one's angle then."""
    page = open_page(start())
    hand = ends(page, 0.0, 20.0, 160.0)
    expect(page.locator("#hint")).to_contain_text("Now click the hub")
    hand.click(CENTRE)
    page.locator("button[data-usual='turn coordinator']").click()
    expect(page.locator(f"{VALUE}:focus")).to_have_count(1)
    typed(page, "0")
    typed(page, "1")
    typed(page, "")
    assert values(page) == ["-1", "0", "1"]
