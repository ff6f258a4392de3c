"""The benchmark's newcomer counts a person's actions."""

from __future__ import annotations

from unittest.mock import MagicMock

from benchmarks.newcomer import Person


def test_every_press_counts() -> None:
    """A drag is one click, held keys count, a text counts by its letters and the key that ends it; sums are kept."""
    page = MagicMock()
    page.evaluate.return_value = (10.0, 20.0)
    button = MagicMock()
    button.evaluate.return_value = (5.0, 5.0, 40.0, 20.0)
    person = Person(page)
    for _ in range(2):
        with person.doing("anchors"):
            person.press("a")
            person.drag((1.0, 2.0), (30.0, 40.0))
    with person.doing("a dial"):
        person.press("g")
        for place in ((1.0, 1.0), (2.0, 2.0), (3.0, 1.0)):
            person.point(place)
        person.push(button)
        person.type("-40")
        person.press("Control+s")

    assert person.spent == {"anchors": (2, 2), "a dial": (4, 7)}
    assert (person.clicks, person.keys) == (6, 9)
