"""The page in a real browser: what it says, what it keeps, and that it can be used without a pointer."""

from __future__ import annotations

import copy
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from playwright.sync_api import Response, Route, expect

from decoder.panel.panel import parse_content
from decoder.setup.saving import panel_text
from tests.programs import FIXTURES, write_yaml, yaml_of
from tests.setup.hand import Hand, OpenPage, Running, Start
from tests.windows import IN_WINDOWS, WINDOW

OBLIQUE = FIXTURES / "oblique" / "t1a_small"
PICTURE = re.compile("^data:image/jpeg")


@pytest.fixture
def of_picture(start: Start, tmp_path: Path) -> Running:
    """A page with that panel on its own picture alone, which is tried at once however often something changes."""
    return start(FIXTURES / "panel.jpg", FIXTURES / "panel.yaml", tmp_path / "saved" / "panel.yaml")


def drawn(running: Running) -> dict[str, Any]:
    """What was saved."""
    content: dict[str, Any] = yaml_of(running.session.target)
    return content


def test_opened_panel_is_read_at_once_and_a_wrong_setup_is_seen(server: Running, open_page: OpenPage) -> None:
    """Every gauge is tried on the flight, and shown with value and score; one that is spoilt is no longer read well."""
    page = open_page(server)
    expect(page.locator("#outline .of-gauge .dot.good")).to_have_count(6)
    page.locator("#outline li button", has_text="fuel_flow").click()
    expect(page.locator("#film .cell")).to_have_count(20)
    assert float(page.locator("#film .value").first.inner_text()) > 40_000
    assert page.locator("#film svg line.needle").count() == 20
    expect(page.locator("#unwrapped img")).to_have_attribute("src", PICTURE)

    page.locator("#outline li button", has_text="n1").click()
    Hand(page).type_into("gauges[0].needles[0].template.at", "150")
    expect(page.locator("#outline .of-gauge .dot.good")).to_have_count(5)
    page.locator("#undo").click()
    expect(page.locator("#outline .of-gauge .dot.good")).to_have_count(6)
    page.locator("#redo").click()
    expect(page.locator('[id="f:gauges[0].needles[0].template.at"]')).to_have_value("150")


def test_what_is_not_valid_is_said_beside_its_field(still: Running, open_page: OpenPage) -> None:
    """A value that cannot be saved is marked where it stands; saving leads to it and writes nothing."""
    page = open_page(still)
    hand = Hand(page)
    page.locator("#outline li button", has_text="n2").click()
    hand.type_into("gauges[1].sweep[0]", "460")
    problem = page.locator('[data-problem="gauges[1].sweep"]')
    expect(problem).to_contain_text("give it clockwise")
    hand.type_into("gauges[1].scale[2][1]", "forty")
    expect(page.locator('[id="f:gauges[1].scale[2][1]"]')).to_have_attribute("aria-invalid", "true")

    page.locator("#outline li button", has_text="ftit").click()
    page.locator("#save").click()
    expect(problem).to_be_visible()
    assert not still.session.target.exists()


@pytest.mark.slow
def test_what_is_no_number_is_drawn_nowhere(of_picture: Running, open_page: OpenPage) -> None:
    """Words in fields of numbers, one after the other: nothing is said on the console, and undo brings all back."""
    page = open_page(of_picture)
    fields = 0
    for item in ("knob", "level", "n1"):
        page.locator("#outline li button", has_text=item).first.click()
        expect(page.locator("#inspector h2")).to_have_text(re.compile(f"^{item}", re.IGNORECASE))
        for field in page.locator("#inspector input[inputmode=decimal]:visible").all():
            field.fill("wide")
            field.press("Tab")
            fields += 1
        expect(page.locator("#inspector .problem").first).to_be_visible()
    for _ in range(fields):
        page.locator("#undo").click()

    assert fields > 20
    expect(page.locator("#undo")).to_be_disabled()
    expect(page.locator("#picture .gauge")).to_have_count(6)


def test_two_tabs_do_not_overwrite_each_other(of_picture: Running, open_page: OpenPage) -> None:
    """The second tab to save is told, and may load the other's, or save over it when asked to."""
    one, other = open_page(of_picture), open_page(of_picture)
    Hand(one).type_into("name", "first")
    Hand(one).save()
    Hand(other).type_into("name", "second")
    other.locator("#save").click()
    expect(other.locator("#banner")).to_contain_text("saved from somewhere else")
    assert drawn(of_picture)["name"] == "first"

    other.locator("#loadtheirs").click()
    expect(other.locator('[id="f:name"]')).to_have_value("first")
    Hand(other).type_into("name", "third")
    Hand(other).save()
    assert drawn(of_picture)["name"] == "third"

    Hand(one).type_into("name", "fourth")
    one.locator("#save").click()
    one.locator("#saveover").click()
    expect(one.locator("#banner")).to_contain_text("Saved to")
    assert drawn(of_picture)["name"] == "fourth"


def test_panel_of_somebody_else_is_replaced_only_when_asked(start: Start, open_page: OpenPage, tmp_path: Path) -> None:
    """Where another panel lies already, the page asks before it saves over it; until then nothing changes."""
    target = tmp_path / "theirs" / "panel.yaml"
    target.parent.mkdir()
    target.write_text("name: theirs\n", encoding="utf-8")
    running = start(FIXTURES / "panel.jpg", FIXTURES / "panel.yaml", target)
    page = open_page(running)
    Hand(page).type_into("name", "mine")
    page.locator("#save").click()
    expect(page.locator("#banner")).to_contain_text("panel.yaml in")
    expect(page.locator("#banner")).to_contain_text("would be replaced")
    assert drawn(running) == {"name": "theirs"}
    assert [path.name for path in target.parent.glob("[!.]*")] == ["panel.yaml"]

    page.locator("#replace").click()
    expect(page.locator("#banner")).to_contain_text("Saved to")
    assert drawn(running)["name"] == "mine"
    Hand(page).type_into("name", "mine still")
    expect(page.locator("#state")).to_have_text("not saved")
    page.locator("#save").click()
    expect(page.locator("#state")).to_have_text("saved")
    assert drawn(running)["name"] == "mine still"


def test_lost_server_is_said_and_the_next_one_goes_on(start: Start, of_picture: Running, open_page: OpenPage) -> None:
    """When the program has ended the page says so; started again it has what was drawn, and saving drops the draft."""
    page = open_page(of_picture, quiet=False)
    before = page.locator('[id="f:name"]').input_value()
    with page.expect_response(
        lambda answer: answer.url.endswith("/check") and "not lost" in (answer.request.post_data or "")
    ):
        Hand(page).type_into("name", "not lost")
    of_picture.stop()

    expect(page.locator("#banner")).to_contain_text("The program has ended")
    expect(page.locator("#save")).to_be_disabled()
    Hand(page).press("d")
    expect(page.locator("#looking")).to_have_text("Not finished.")
    expect(page.locator("#banner")).to_contain_text("The program has ended")
    expect(page.locator('[id="f:name"]')).to_have_value("not lost")

    again = start(FIXTURES / "panel.jpg", FIXTURES / "panel.yaml", of_picture.session.target)
    page = open_page(again)
    expect(page.locator("#banner")).to_contain_text("Continuing with earlier work")
    expect(page.locator('[id="f:name"]')).to_have_value("not lost")
    page.locator("#undo").click()
    expect(page.locator('[id="f:name"]')).to_have_value(before)
    page.locator("#redo").click()
    Hand(page).save()
    assert [path.name for path in again.session.target.parent.glob(".*")] == []


def test_trials_go_on_once_the_program_answers_again(of_picture: Running, open_page: OpenPage) -> None:
    """A gauge whose trial was cut off by a broken connection is tried again when the page next gets an answer."""
    page = open_page(of_picture, quiet=False)
    broken: list[str] = []

    def break_once(route: Route) -> None:
        if broken or '"gauge":5' not in (route.request.post_data or ""):  # the last one
            route.continue_()
        else:
            broken.append(route.request.url)
            route.abort("connectionreset")

    page.route("**/api/trial", break_once)
    page.reload()
    expect(page.locator("#outline .of-gauge .dot.good")).to_have_count(6)
    expect(page.locator("#banner")).to_be_hidden()
    assert len(broken) == 1


def test_what_is_on_the_page_is_kept_whatever_was_judged(still: Running, open_page: OpenPage) -> None:
    """Also changes that saving refused before they were checked, and changes undone while later ones were checked."""

    def keeps(answer: Response) -> bool:
        return answer.url.endswith("/check") and "460" in (answer.request.post_data or "")

    page = open_page(still, quiet=False)
    page.locator("#outline li button", has_text="n2").click()
    with page.expect_response(keeps):
        page.evaluate(
            """() => {
                const field = document.getElementById("f:gauges[1].sweep[0]");
                field.value = "460";
                field.dispatchEvent(new Event("change"));
                document.getElementById("save").click();
            }"""
        )
    assert still.session.draft.document["gauges"][1]["sweep"][0] == 460
    expect(page.locator("#banner")).to_contain_text("Not saved")

    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    page.route("**/api/check", hold, times=1)
    with page.expect_request("**/api/check"):
        Hand(page).type_into("gauges[1].name", "other")
    page.locator("#undo").click()
    page.wait_for_timeout(300)  # until the check of what is there again is due
    with page.expect_response(keeps):
        held[0].continue_()
    assert still.session.draft.document["gauges"][1]["sweep"][0] == 460


def test_a_taken_offer_keeps_marks_without_values(still: Running, open_page: OpenPage) -> None:
    """Those of a needle's own scale too; all move along with the others."""
    session = still.session
    drawn = copy.deepcopy(session.document)
    own = drawn["gauges"][1]
    own["needles"][0]["scale"] = [*own["scale"], [300.5, None]]
    own["scale"] = [*own["scale"], [300.5, None]]
    session.keep(drawn, session.picture_key)
    offer = copy.deepcopy(session.document["gauges"][1])
    offer["scale"] = [[angle + 1.0, value] for angle, value in offer["scale"]]
    offer["needles"][0]["scale"] = offer["scale"]
    offer["centre"] = [offer["centre"][0], offer["centre"][1] - 1.0]

    def tried(route: Route) -> None:
        answer = route.fetch()
        more = {"json": answer.json() | {"moved": [0.0, -1.0]}} if answer.status == 200 else {}
        route.fulfill(response=answer, **more)

    said = {"key": "centre", "said": "It turns above", "does": "Move it", "gain": "more is read", "gauge": offer}
    page = open_page(still)
    page.route("**/api/trial", tried)
    page.route("**/api/advice", lambda route: route.fulfill(json={"offers": [said]}))
    page.reload()
    page.locator("#outline li button", has_text="n2").click()
    page.locator("#usepivot").click()
    expect(page.locator('[id="f:gauges[1].centre[1]"]')).to_have_value(f"{offer['centre'][1]:g}")
    with page.expect_request("**/api/check") as asked:
        Hand(page).type_into("gauges[1].name", "taken")
    question: Any = asked.value.post_data_json
    taken = question["drawn"]["gauges"][1]
    for place in (taken, taken["needles"][0]):
        ((angle, _),) = [mark for mark in place["scale"] if mark[1] is None]
        assert 301.0 < angle < 302.5
        assert [mark for mark in place["scale"] if mark[1] is not None] == offer["scale"]
    page.unroute_all(behavior="ignoreErrors")


@pytest.mark.slow
def test_a_mistyped_mark_and_a_wrong_unit_are_told_beside_what_is_offered(
    start: Start, open_page: OpenPage, tmp_path: Path
) -> None:
    """An offer mends where something is drawn; what was typed wrongly is told with it, and is gone once it is right."""
    page = open_page(start(panel=None, save_as=tmp_path / "panel.yaml"))
    hand = Hand(page)
    page.locator("#outline li button", has_text="ftit").click()
    hand.type_into("gauges[2].needles[0].template.at", "273.95")
    expect(page.locator("#useaxis")).to_be_visible()
    expect(page.locator("#health")).to_have_count(0)
    hand.type_into("gauges[2].scale[3][1]", "580")
    hand.type_into("gauges[2].unit", "deg F")
    told = page.locator("#health")
    expect(told).to_contain_text("The gauge has a mark 580 that stands")
    expect(told).to_contain_text("The gauge gives ftit_c in deg F, though that name says c")
    expect(page.locator("#useaxis")).to_be_visible()
    for path, text in (("scale[3][1]", "500"), ("unit", "deg C")):
        hand.type_into(f"gauges[2].{path}", text)
    expect(told).to_have_count(0)


def test_each_anchor_says_in_how_many_frames_it_is_found(start: Start, open_page: OpenPage, tmp_path: Path) -> None:
    """An anchor on a needle, which moves, is red in the outline beside those that are good."""
    running = start(panel=None, save_as=tmp_path / "panel.yaml")
    page = open_page(running)
    hand = Hand(page)
    anchors = running.session.document["anchors"]
    expect(page.locator("#outline li", has_text=anchors[0]["name"]).locator(".dot.good")).to_have_count(1)
    centre = running.session.document["gauges"][0]["centre"]

    hand.anchor("on a needle", [round(centre[0] - 30), round(centre[1] - 30), 60, 60])
    expect(page.locator("#outline li", has_text="on a needle").locator(".dot.bad, .dot.warn")).to_have_count(1)


def test_keyboard_alone_draws(start: Start, open_page: OpenPage) -> None:
    """Anchor, level and gauge are drawn without a pointer: keys choose the tool, move its cross and place."""
    running = start()
    page = open_page(running)
    for _ in range(40):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.id") == "picture":
            break
    page.keyboard.press("a")  # the cross begins in the middle of the picture, (512, 384)
    page.keyboard.press("Enter")
    for key in ["Shift+ArrowRight"] * 4 + ["ArrowRight"] * 4 + ["Shift+ArrowDown"] * 4:
        page.keyboard.press(key)
    page.keyboard.press("Enter")
    expect(page.locator('[id="f:anchors[0].box[2]"]')).to_have_value("44")
    page.locator("#picture").focus()
    for key in ["ArrowLeft", "Shift+ArrowUp"]:
        page.keyboard.press(key)
    expect(page.locator('[id="f:anchors[0].box[0]"]')).to_have_value("511")
    expect(page.locator('[id="f:anchors[0].box[1]"]')).to_have_value("374")
    page.keyboard.press("Control+z")
    page.keyboard.press("Delete")
    expect(page.locator(".anchor")).to_have_count(0)


def test_everything_has_a_name_for_screen_readers(still: Running, open_page: OpenPage) -> None:
    """No button, field or drawing is without a word that says what it is."""
    page = open_page(still)
    for name in ("n1", "knob", "level", "F-16 animation"):
        page.locator("#outline li button", has_text=name).first.click()
        nameless = page.evaluate(
            """() => [...document.querySelectorAll("button, input, select, svg[role], nav, aside, section")]
                .filter((each) => !each.closest("[hidden], dialog"))
                .filter((each) => !(each.getAttribute("aria-label") || each.textContent.trim()
                    || each.labels?.length || each.title))
                .map((each) => each.outerHTML.slice(0, 120))"""
        )
        assert nameless == []


def test_picture_stays_under_the_pointer_whatever_is_said(start: Start, open_page: OpenPage) -> None:
    """Neither a message nor the frame slider's buttons move the picture while somebody clicks on it."""
    page = open_page(start(FIXTURES / "thesis_a2.mcap", FIXTURES / "panel.yaml"))
    picture, banner = page.locator("#picture"), page.locator("#banner")
    before = picture.bounding_box()

    page.locator("#frame").press("ArrowRight")
    expect(page.locator("#useframe")).to_be_visible()
    assert picture.bounding_box() == before
    page.locator("#useframe").click()
    expect(banner).to_contain_text("Carried over: moved by")
    assert picture.bounding_box() == before
    said, undo = banner.bounding_box(), page.locator("#undo").bounding_box()
    assert said is not None
    assert undo is not None
    assert said["x"] + said["width"] <= undo["x"]
    banner.get_by_label("Close").click()
    expect(banner).to_be_hidden()
    assert picture.bounding_box() == before


def test_panel_is_pasted_onto_another_flight(start: Start, open_page: OpenPage, tmp_path: Path) -> None:
    """A panel opened on another flight of the cockpit is carried over to one of its frames and reads there."""
    running = start(FIXTURES / "thesis_a2.mcap", FIXTURES / "panel.yaml", tmp_path / "pasted" / "panel.yaml")
    page = open_page(running)
    page.locator("#frame").focus()
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    page.locator("#useframe").click()
    expect(page.locator("#banner")).to_contain_text("Carried over: moved by")
    expect(page.locator("#frames output")).to_have_text("3 of 20")
    Hand(page).save()

    saved = drawn(running)
    written = yaml_of(FIXTURES / "panel.yaml")
    assert [gauge["name"] for gauge in saved["gauges"]] == [gauge["name"] for gauge in written["gauges"]]
    assert saved["gauges"][0]["centre"] == pytest.approx(written["gauges"][0]["centre"], abs=1.0)
    frame = list(running.session.source.flight.frames())[3]
    assert (running.session.target.parent / saved["picture"]).read_bytes() == frame.encoded


def test_needle_is_proposed_and_accepted(start: Start, open_page: OpenPage) -> None:
    """What moves on a new gauge is offered as its needle."""
    page = open_page(start())
    hand = Hand(page)
    hand.press("g")
    for place in ((297.3, 117.4), (346.3, 168.4), (262.0, 205.0)):
        hand.click(place)
    page.locator("#accept-0").click()
    angle = float(page.locator('[id="f:gauges[0].needles[0].template.at"]').input_value())

    assert angle == pytest.approx(359.5, abs=0.5)


def test_needle_is_cropped_on_the_unwrapped_gauge(still: Running, open_page: OpenPage) -> None:
    """Dragging over the unwrapped gauge crops the selected needle there."""
    page = open_page(still)
    page.locator("#outline li button", has_text="n1").click()
    page.locator(".card b", has_text="n1_pct").wait_for()
    Hand(page).press("v")
    page.locator("#unwrapped svg .band").wait_for()
    box = page.locator("#unwrapped svg").bounding_box()
    assert box is not None
    start, end = 110.0 - 12.0, 440.0 + 12.0
    places = [box["x"] + (angle - start) / (end - start) * box["width"] for angle in (273.5, 295.5)]
    page.mouse.move(places[0], box["y"] + 60)
    page.mouse.down()
    page.mouse.move(places[1], box["y"] + 60, steps=4)
    page.mouse.up()

    expect(page.locator('[id="f:gauges[0].needles[1].template.span"]')).to_have_value(re.compile(r"^2"))
    angle = float(page.locator('[id="f:gauges[0].needles[1].template.at"]').input_value())
    assert angle == pytest.approx(284.4545, abs=0.1)


def test_oblique_rim_is_bent_by_clicks_and_keys(start: Start, open_page: OpenPage) -> None:
    """Three clicks on an oblique dial make an ellipse; keys move its points, more clicks bend it, and it goes away."""
    page = open_page(start(OBLIQUE / "panel.jpg"))
    hand = Hand(page)
    hand.press("g")
    for place in ((295.6, 119.6), (327.3, 47.1), (351.6, 122.0)):  # 0, 60 and 110 % on a dial
        hand.click(place)
    hand.type_into("gauges[0].name", "n1")
    points = page.locator("#picture .handle.rim")
    expect(points).to_have_count(8)
    page.locator("summary", has_text="8 points").click()
    page.get_by_role("button", name="Select rim point 3").press("Enter")
    before = float(page.locator('[id="f:gauges[0].rim[2][0]"]').input_value())
    hand.press("ArrowRight")
    expect(page.locator('[id="f:gauges[0].rim[2][0]"]')).to_have_value(f"{round(before + 1, 2):g}")

    hand.press("e")
    hand.click((286.5, 88.0))
    expect(page.locator('[id="f:gauges[0].rim[2][0]"]')).not_to_have_value(f"{round(before + 1, 2):g}")
    page.locator("#unbend").click()
    expect(points).to_have_count(0)
    page.locator("#undo").click()
    expect(points).to_have_count(8)


def test_redrawn_page_leaves_the_focus_on_a_button(start: Start, open_page: OpenPage) -> None:
    """A trial's answer redraws inspector and outline at any moment: Enter still presses the button that was chosen."""
    page = open_page(start(OBLIQUE / "panel.jpg"))
    hand = Hand(page)
    hand.press("g")
    for place in ((295.6, 119.6), (327.3, 47.1), (351.6, 122.0)):
        hand.click(place)
    hand.type_into("gauges[0].name", "n1")
    page.locator("summary", has_text="8 points").click()
    for unit, name in (("kt", "Select rim point 3"), ("lb", "Remove n1"), ("ft", "n1 !")):
        button = page.get_by_role("button", name=name, exact=True)
        button.focus()
        old = button.element_handle()
        page.locator('[id="f:gauges[0].unit"]').evaluate(
            "(each, unit) => { each.value = unit; each.dispatchEvent(new Event('change', { bubbles: true })); }", unit
        )
        page.wait_for_function("each => !each.isConnected", arg=old)
        expect(button).to_be_focused()


@pytest.mark.slow
def test_gauges_of_every_kind_are_kept_and_edited(start: Start, open_page: OpenPage, tmp_path: Path) -> None:
    """Cards, stops, combined values, tails, rates, own scales: opened, changed in their fields, and saved whole."""
    running = start(FIXTURES / "oblique" / "odd_small.mcap", None, tmp_path / "panel.yaml")
    page = open_page(running)
    hand = Hand(page)
    written = yaml.safe_load(running.session.source.flight.attachments["panel.yaml"])
    index = {gauge["name"]: place for place, gauge in enumerate(written["gauges"])}
    altimeter = next(name for name, place in index.items() if "combined" in written["gauges"][place])
    card = next(name for name, place in index.items() if "card" in written["gauges"][place])
    stops = next(name for name, place in index.items() if "stops" in written["gauges"][place])

    covered = written["gauges"][index[altimeter]]["needles"][0]["covered_by"]
    page.locator("#outline li button", has_text=altimeter).click()
    hand.type_into(f"gauges[{index[altimeter]}].combined.lowest", "-1000")
    hand.type_into(f"gauges[{index[altimeter]}].needles[0].max_rate", "99")
    cover = page.locator(f'[id="f:gauges[{index[altimeter]}].needles[0].covered_by"]')
    other = next(each["name"] for each in written["gauges"][index[altimeter]]["needles"][1:] if each["name"] != covered)
    cover.select_option(other)
    page.locator("#outline li button", has_text=card).click()
    hand.type_into(f"gauges[{index[card]}].card.max_rate", "30")
    page.locator("#outline li button", has_text=stops).click()
    hand.type_into(f"gauges[{index[stops]}].stops[1]", "10")
    expect(page.locator(f'[data-problem="gauges[{index[stops]}].stops"]')).to_contain_text("must hold the “Sweep”")
    hand.type_into(f"gauges[{index[stops]}].stops[1]", f"{written['gauges'][index[stops]]['stops'][1] + 1:g}")
    expect(page.locator(".problem")).to_have_count(0)
    hand.save()

    written["gauges"][index[altimeter]]["combined"]["lowest"] = -1000
    written["gauges"][index[altimeter]]["needles"][0] |= {"max_rate": 99, "covered_by": other}
    written["gauges"][index[card]]["card"]["max_rate"] = 30
    written["gauges"][index[stops]]["stops"][1] += 1
    assert parse_content(drawn(running)) == parse_content(yaml.safe_load(panel_text(written)))


def test_a_window_is_drawn_by_its_corners(of_picture: Running, open_page: OpenPage) -> None:
    """Four clicks make a lamp, which is read at once; its corners move by hand and by keys, and all of it is saved."""
    page = open_page(of_picture)
    hand = Hand(page)
    written = copy.deepcopy(of_picture.session.document)
    number = len(written["gauges"])
    corners = [[80.0, 60.0], [120.0, 60.0], [120.0, 84.0], [80.0, 84.0]]

    hand.press("w")
    for x, y in corners:
        hand.click((x, y))
    hand.type_into(f"gauges[{number}].name", "low fuel")
    hand.type_into(f"gauges[{number}].lamp.name", "low_fuel_on")
    expect(page.locator("#film .cell .value").first).to_have_text("false")
    hand.press("ArrowRight")
    expect(page.locator(f'[id="f:gauges[{number}].window[0][0]"]')).not_to_have_value("80")
    for corner, (x, y) in enumerate(corners):
        hand.type_into(f"gauges[{number}].window[{corner}][0]", f"{x:g}")
        hand.type_into(f"gauges[{number}].window[{corner}][1]", f"{y:g}")
    expect(page.locator(".problem")).to_have_count(0)
    hand.save()

    written["gauges"].append({"name": "low fuel", "window": corners, "unit": "", "lamp": {"name": "low_fuel_on"}})
    assert parse_content(drawn(of_picture)) == parse_content(yaml.safe_load(panel_text(written)))


@pytest.mark.slow
def test_every_kind_in_a_window_is_drawn_in_its_fields(of_picture: Running, open_page: OpenPage) -> None:
    """Words, states, choices, blanks and places as numbers or points are typed and ticked, shown again, and saved."""
    page = open_page(of_picture)
    hand = Hand(page)
    written = copy.deepcopy(of_picture.session.document)
    first = len(written["gauges"])
    typed = {
        "linear.marks": "90 0, 150 100",
        "linear.at": "120.5 70",
        "tape.marks": "85 72 310, 108 72 320, 130 72 330, 155 72 340",
    }
    for number, (key, content) in enumerate(IN_WINDOWS.items(), first):
        hand.press("w")
        for x, y in WINDOW:
            hand.click((x, y))
        hand.type_into(f"gauges[{number}].name", key)
        if key != "lamp":
            page.locator(f"#what-turns-{number}").select_option(key)
        for part, value in content.items():
            path = f"gauges[{number}].{key}.{part}"
            if value is True:
                page.locator(f'[id="f:{path}"]').check()
            elif part == "moves":
                page.locator(f'[id="f:{path}"]').select_option(value)
            else:
                hand.type_into(path, typed.get(f"{key}.{part}", str(value)))
                expect(page.locator(f'[id="f:{path}"]')).to_have_value(typed.get(f"{key}.{part}", str(value)))
        expect(page.locator(".problem")).to_have_count(0)
    hand.save()

    saved = drawn(of_picture)
    for gauge in saved["gauges"][first:]:
        assert np.array(gauge["window"]) == pytest.approx(np.array(WINDOW), abs=1.0)
        gauge["window"] = WINDOW
    written["gauges"] += [{"name": key, "window": WINDOW, key: content} for key, content in IN_WINDOWS.items()]
    assert parse_content(saved) == parse_content(yaml.safe_load(panel_text(written)))


def test_a_card_under_needles_has_its_fields(start: Start, open_page: OpenPage, tmp_path: Path) -> None:
    """A gauge with both shows the needles and the fields of the card below them."""
    home = tmp_path / "drawn"
    home.mkdir()
    written = yaml_of(FIXTURES / "panel.yaml")
    written["gauges"][0] |= {"card": {"name": "heading_deg", "index": 270}, "wraps": 360, "sweep": [90, 450]}
    written["gauges"][0]["scale"] = [[90, 0], [180, 90], [270, 180]]
    shutil.copyfile(FIXTURES / written["picture"], home / written["picture"])
    write_yaml(home / "panel.yaml", written)
    page = open_page(start(panel=home / "panel.yaml", save_as=tmp_path / "panel.yaml"), quiet=False)
    page.locator("#outline li button", has_text="n1").click()

    expect(page.locator('[id="f:gauges[0].card.index"]')).to_have_value("270")
    expect(page.locator('[id="f:gauges[0].card.ring"]')).to_be_visible()
    expect(page.locator('[id="f:gauges[0].needles[0].name"]')).to_be_visible()


def test_a_ball_is_drawn_by_its_way(of_picture: Running, open_page: OpenPage) -> None:
    """A dial that becomes a ball needs no marks: three places of its way are typed, shown again, and saved."""
    page = open_page(of_picture)
    hand = Hand(page)
    page.locator("#outline li button", has_text="n1").click()

    page.locator("#what-turns-0").select_option("ball")
    hand.type_into("gauges[0].ball.tube", "80 90 -1, 120 96 0, 160 90 1")
    hand.type_into("gauges[0].ball.width", "12")
    expect(page.locator('[id="f:gauges[0].ball.tube"]')).to_have_value("80 90 -1, 120 96 0, 160 90 1")
    expect(page.locator("#inspector .problem")).to_have_count(0)
    hand.save()

    ball = drawn(of_picture)["gauges"][0]["ball"]
    assert ball["tube"] == [[80, 90, -1], [120, 96, 0], [160, 90, 1]]
    assert ball["width"] == 12


def test_an_attitude_indicator_is_drawn_in_its_fields(start: Start, open_page: OpenPage, tmp_path: Path) -> None:
    """A card becomes a horizon with its own fields; pitch marks are typed as pairs, and all of it is saved whole."""
    home = FIXTURES / "borrowed" / "attitude_daylight"
    written = yaml_of(home / "panel.yaml")
    attitude = written["gauges"][0].pop("attitude")
    written["gauges"][0]["card"] = {"name": "bank_deg", "index": 270}
    drawn_on = tmp_path / "drawn"
    drawn_on.mkdir()
    shutil.copyfile(home / written["picture"], drawn_on / written["picture"])
    write_yaml(drawn_on / "panel.yaml", written)
    running = start(drawn_on / written["picture"], drawn_on / "panel.yaml", tmp_path / "panel.yaml")
    page = open_page(running)
    hand = Hand(page)
    page.locator("#outline li button", has_text=re.compile("^attitude")).click()

    page.locator("#what-turns-0").select_option("attitude")
    hand.type_into("gauges[0].attitude.window", f"{attitude['window']:g}")
    hand.type_into("gauges[0].attitude.ladder", "0 0, ten 10")
    expect(page.locator('[data-problem="gauges[0].attitude.ladder[1][0]"]')).to_contain_text("number")
    hand.type_into("gauges[0].attitude.ladder", ", ".join(f"{up:g} {deg}" for up, deg in attitude["ladder"]))
    expect(page.locator(".problem")).to_have_count(0)
    hand.save()

    written["gauges"][0].pop("card")
    written["gauges"][0]["attitude"] = attitude  # without an index, which nobody drew
    assert parse_content(drawn(running)) == parse_content(yaml.safe_load(panel_text(written)))
