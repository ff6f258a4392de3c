"""A hand that draws on the set-up page, as unsteadily as a person does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from playwright.sync_api import Page, expect

DRAWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
XY = tuple[float, float]
Start = Callable[..., Any]
OpenPage = Callable[..., Page]
"""Of the fixtures `start` and `open_page`."""
Running = Any
OnRing = Callable[[float, float], XY]
"""Where in the picture an angle of a dial's ring of marks lies, and so many pixels further out."""
# How far beside what they mean a person's clicks land, in pixels of the picture.
UNSTEADY_PX = 0.6


@dataclass
class Hand:
    """Draws on a page; `seed` sets the error of each click."""

    page: Page
    seed: int = 5

    def __post_init__(self) -> None:
        self._chance = np.random.default_rng(self.seed)

    def unsteady(self, place: XY) -> XY:
        """A place as clicked by an unsteady hand."""
        right, down = self._chance.uniform(-UNSTEADY_PX, UNSTEADY_PX, 2)
        return place[0] + float(right), place[1] + float(down)

    def look(self) -> None:
        """Waits until what was last changed is drawn."""
        self.page.evaluate(DRAWN)

    def press(self, key: str) -> None:
        """A key, on the picture."""
        self.page.locator("#picture").press(key)

    def click(self, place: XY) -> None:
        """A click on a place of the panel picture, once everything is drawn: nobody clicks on what is not there yet."""
        self.look()
        x, y = self.page.evaluate(
            """([x, y]) => {
                const place = new DOMPoint(x, y).matrixTransform(document.getElementById("picture").getScreenCTM());
                return [place.x, place.y];
            }""",
            list(place),
        )
        self.page.mouse.click(x, y)

    def type_into(self, path: str, text: str) -> None:
        """A value, into the field of that path."""
        field = self.page.locator(f'[id="f:{path}"]')
        field.fill(text)
        field.press("Tab")

    def anchor(self, name: str, box: list[float]) -> None:
        """An anchor by two corners."""
        left, top, width, height = box
        self.press("a")
        self.click((left, top))
        self.click((left + width, top + height))
        index = int(self.page.evaluate("document.querySelectorAll('.anchor').length")) - 1
        self.type_into(f"anchors[{index}].name", name)

    def level(self, ends: list[list[float]]) -> None:
        """The level edge."""
        self.press("l")
        for end in ends:
            self.click((end[0], end[1]))

    def reference(self, index: int, at: XY, inches: XY) -> None:
        """A reference point, and where it is on the panel."""
        self.press("r")
        self.click(self.unsteady(at))
        self.page.wait_for_selector(f'[id="f:reference_points[{index}].inches[0]"]:focus')
        for axis in (0, 1):
            self.type_into(f"reference_points[{index}].inches[{axis}]", f"{inches[axis]:g}")
        self.press("Escape")

    def gauge(
        self, index: int, gauge: dict[str, Any], on_ring: OnRing, *, rim_deg: Sequence[float] = (150.0, 262.0, 390.0)
    ) -> None:
        """A gauge by clicks on the ring where its marks end, then its marks and their values."""
        self.press("0")
        self.press("g")
        for angle in rim_deg:
            self.click(self.unsteady(on_ring(angle, 0.0)))
        self.page.wait_for_selector(f'[id="f:gauges[{index}].name"]:focus')
        self.type_into(f"gauges[{index}].name", gauge["name"])
        self.type_into(f"gauges[{index}].unit", gauge["unit"])
        self.press("f")
        self.press("t")
        for angle, value in sorted(gauge["scale"]):
            self.click(self.unsteady(on_ring(angle, -2.0)))
            self.page.wait_for_selector("#inspector input[aria-label^='value of the mark']:focus")
            self.page.keyboard.type(f"{value:g}")
            self.page.keyboard.press("Enter")
            self.page.wait_for_selector("#picture:focus")
        self.press("Escape")

    def needle(self, index: int, needle: int, at: XY, name: str) -> None:
        """A needle by pointing at it, and its name."""
        self.press("n")
        self.click(self.unsteady(at))
        self.page.wait_for_selector(f'[id="f:gauges[{index}].needles[{needle}].name"]:focus')
        self.type_into(f"gauges[{index}].needles[{needle}].name", name)

    def open(self, name: str) -> None:
        """A part of the inspector that is shut."""
        part = self.page.locator(f'details[data-name="{name}"]')
        if part.get_attribute("open") is None:
            part.locator("summary").click()

    def save(self) -> None:
        """The panel."""
        self.press("Control+s")
        expect(self.page.locator("#banner")).to_contain_text("Saved to")
