"""The panel picture in a real browser: how much of the screen it gets, how it is seen, and what clicks on it choose."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from playwright.sync_api import Page, Route, expect

from tests.setup.hand import Hand, OpenPage, Running

GONE = re.compile("no-details")


def box(page: Page, what: str = "#picture") -> dict[str, float]:
    """Where something is on the screen, pixels."""
    found = page.locator(what).bounding_box()
    assert found is not None
    return {"x": found["x"], "y": found["y"], "width": found["width"], "height": found["height"]}


def expect_part_of_screen(page: Page, at_least: float) -> None:
    """Wait until the picture has so much of the screen: a page lays itself out a frame after its size has changed."""
    screen = page.viewport_size
    assert screen is not None
    page.wait_for_function(
        """([width, height, atLeast]) => {
            const picture = document.querySelector("#picture").getBoundingClientRect();
            return innerWidth === width && innerHeight === height
                && picture.width * picture.height >= atLeast * width * height;
        }""",
        arg=[screen["width"], screen["height"], at_least],
        timeout=5000,
    )


def chosen(page: Page) -> str:
    """What is selected, as the outline has it."""
    return page.locator('#outline [aria-current="true"] .name').inner_text()


def test_picture_gets_the_screen_and_what_folds_gives_it_more(still: Running, open_page: OpenPage) -> None:
    """Nearly half of a usual screen; three quarters with all else folded, which a new page remembers."""
    page = open_page(still)
    page.set_viewport_size({"width": 1440, "height": 900})
    expect_part_of_screen(page, 0.45)
    for key in "1234":
        page.keyboard.press(key)
    expect_part_of_screen(page, 0.85)
    page.reload()
    page.wait_for_selector("body[data-ready]")
    expect_part_of_screen(page, 0.85)
    Hand(page).press("a")
    expect(page.locator("body")).to_have_class(GONE)
    page.keyboard.press("g")
    # What shows there is no dial's circles, so its hub is asked for; then its name is to be typed: its fields unfold.
    for right, down in ((0.4, 0.5), (0.5, 0.3), (0.6, 0.5), (0.5, 0.45)):
        here = box(page)
        if down == 0.45:
            expect(page.locator("#hint")).to_contain_text("Now click the hub")
        page.mouse.click(here["x"] + right * here["width"], here["y"] + down * here["height"])
    expect(page.locator("body")).not_to_have_class(GONE)


@pytest.mark.parametrize(("width", "height"), [(1024, 700), (720, 450), (480, 800)])
def test_small_screen_has_picture_tools_and_fields(
    still: Running, open_page: OpenPage, width: int, height: int
) -> None:
    """Also at twice the size nothing lies beside the screen: a gauge is chosen, and one of its fields is typed."""
    page = open_page(still)
    page.set_viewport_size({"width": width, "height": height})
    expect_part_of_screen(page, 0.35)
    assert page.evaluate("document.documentElement.scrollWidth") == width
    hand = Hand(page)
    x, y = still.session.document["gauges"][1]["centre"]
    hand.click((x + 10, y + 25))
    expect(page.locator("#inspector h2")).to_have_text("n2")
    for tool in page.locator("#tools button").all():
        edge = tool.bounding_box()
        assert edge is not None
        assert 0 <= edge["x"] <= edge["x"] + edge["width"] <= width
    hand.type_into("gauges[1].scale[8][1]", "110.5")
    expect(page.locator("#undo")).to_be_enabled()
    hand.type_into("gauges[1].sweep[0]", "460")
    hand.press("Control+s")
    expect(page.locator("#banner")).to_contain_text("Not saved")
    assert box(page, "#banner")["height"] < height / 8
    if page.locator("#outline").is_hidden():
        page.locator("#fold-outline").click()
    page.locator("#outline li button", has_text="fuel_flow").click()
    expect(page.locator("#inspector h2")).to_have_text("fuel_flow")


def test_light_and_loupe_are_kept_and_worked_by_keys(still: Running, open_page: OpenPage) -> None:
    """Only the picture is made brighter, as long as somebody wants it; the loupe goes with the cross and the mouse."""
    page = open_page(still)
    filtered = "getComputedStyle(document.querySelector('#picture image')).filter"
    assert page.evaluate(filtered) == "none"
    page.keyboard.press("b")
    expect(page.locator("#brightness")).to_be_focused()
    for _ in range(20):
        page.keyboard.press("ArrowRight")
    page.keyboard.press("Escape")
    expect(page.locator("#picture")).to_be_focused()
    assert page.evaluate(filtered).startswith("brightness(2.8")
    assert page.evaluate("getComputedStyle(document.querySelector('#film')).filter") == "none"
    page.reload()
    page.wait_for_selector("body[data-ready]")
    assert page.evaluate(filtered).startswith("brightness(2.8")
    page.locator("#uselight").click()
    page.locator("#plainlight").click()
    assert page.evaluate(filtered) == "none"

    hand = Hand(page)
    loupe = page.locator("#loupe")
    expect(loupe).to_be_hidden()
    hand.press("t")
    middle = """() => { const [x, y, across] = document.getElementById("loupe").getAttribute("viewBox").split(" ");
        return [Number(x) + across / 2, Number(y) + across / 2]; }"""
    expect(loupe).to_be_visible()
    x, y = page.evaluate(middle)
    hand.press("Shift+ArrowRight")
    hand.press("ArrowDown")
    assert page.evaluate(middle) == pytest.approx([x + 10, y + 1])
    here = box(page)
    page.mouse.move(here["x"] + 100, here["y"] + 100)
    assert page.evaluate(middle) != pytest.approx([x + 10, y + 1])
    beside = box(page, "#loupe")
    assert 0 < beside["x"] - here["x"] - 100 < 60
    hand.press("m")
    expect(loupe).to_be_hidden()


def test_a_click_within_another_dial_chooses_it(still: Running, open_page: OpenPage) -> None:
    """With the select tool, and with one that draws on the selected gauge: then nothing is drawn on the far one."""
    page = open_page(still)
    hand = Hand(page)
    centres = {gauge["name"]: gauge["centre"] for gauge in still.session.document["gauges"]}
    for name in ("n1", "fuel", "ftit"):
        x, y = centres[name]
        hand.click((x + 12, y + 30))
        assert chosen(page) == name
    hand.press("t")
    hand.click((centres["n2"][0] + 12, centres["n2"][1] + 30))
    assert chosen(page) == "n2"
    expect(page.locator("#undo")).to_be_disabled()
    expect(page.locator("#tool-mark")).to_have_attribute("aria-pressed", "true")


def test_what_was_wrong_before_a_change_is_not_shown_after_it(still: Running, open_page: OpenPage) -> None:
    """Neither where a change is undone as soon as saving was refused, nor where what is drawn now cannot be checked."""
    page = open_page(still, quiet=False)
    hand = Hand(page)
    page.locator("#outline li button", has_text="n2").click()
    hand.look()
    page.evaluate(
        """async () => {
            const field = document.getElementById("f:gauges[1].sweep[0]");
            field.value = "460";
            field.dispatchEvent(new Event("change"));
            document.getElementById("save").click();
            while (document.getElementById("banner").hidden) await new Promise((done) => setTimeout(done, 1));
            document.getElementById("undo").click();
        }"""
    )
    expect(page.locator('[id="f:gauges[1].sweep[0]"]')).to_have_value("110")
    expect(page.locator(".problem")).to_have_count(0)

    hand.type_into("gauges[1].sweep[0]", "460")
    expect(page.locator(".problem")).to_have_count(1)

    def fails(route: Route) -> None:
        route.fulfill(status=500, json={"error": "the program failed at this"})

    page.route("**/api/check", fails)
    hand.type_into("gauges[1].sweep[0]", "112")
    expect(page.locator("#banner")).to_contain_text("failed at this")
    expect(page.locator(".problem")).to_have_count(0)


def test_problems_are_said_in_the_words_of_the_page(start: Callable[..., Running], open_page: OpenPage) -> None:
    """What a whole panel lacks is said at its top; a key of the file is called as its field is."""
    page = open_page(start())
    expect(page.locator(".problem", has_text="Anchors: needs at least 1")).to_be_visible()
    expect(page.locator(".problem", has_text="Gauges: needs at least 1")).to_be_visible()
    page = open_page(start(panel=None, save_as=None))
    hand = Hand(page)
    page.locator("#outline li button", has_text="n2").click()
    hand.open("more")
    hand.type_into("gauges[1].stops[0]", "130")
    hand.type_into("gauges[1].stops[1]", "430")
    problem = page.locator("#inspector .problem").first
    expect(problem).to_contain_text("“Stops” must hold the “Sweep”")
    expect(problem).not_to_contain_text("`")
