"""Kinds of instrument: a key that does not go with one is reported in a sentence, before anything is read."""

from __future__ import annotations

import pytest

from decoder.panel.errors import PanelError
from decoder.panel.panel import parse_panel

WINDOW = "window: [[0, 0], [9, 0], [9, 19], [0, 19]]"
ROUND = "centre: [80, 80], radius: [4, 70], sweep: [0, 360]"
WRONG = {
    f"{WINDOW}, %s": [
        ("centre: [4, 4], lamp: {name: a}", "then no `centre`"),
        ("lamp: {name: a, light: a}", "another name"),
        ("lamp: {name: a, light: b, lit: true}", "it is off"),
        ("card: {name: a, index: 270}", "no window's"),
    ],
    "lamp: {name: a}, %s": [
        ("window: [[0, 0], [0, 9], [9, 9], [9, 0]]", "clockwise from the top left"),
        ("window: [[0, 0], [9, 0], [9, 2], [0, 2]]", "at least 4 pixels apart"),
        (f"{ROUND}, scale: [[0, 0], [9, 1]]", "a `window`"),
    ],
    f"{WINDOW}, linear: {{name: a, %s}}": [
        ("at: 30, span: 4, marks: [[2, 0], [8, 1]]", "within its `window`"),
        ("at: 5, span: 0.5, marks: [[2, 0], [8, 1]]", "`span` of 4 pixels or more"),
        ("at: 5, span: 4, marks: [[2, 0], [[5, 5], 1]]", "not both"),
        ("at: 5, span: 4, marks: [[2, 0], [4, 1], [8, 0.5]]", "`marks` .* monotone"),
        ("at: 5, span: 4, marks: [[true, 0], [8, 1]]", r"linear.marks\[0\]\[0\]: is true or false"),
    ],
    f"{WINDOW}, tape: {{name: a, %s}}": [
        ("index: 5, marks: [[2, 0], [8, 10]], drum: true, turn: 360", "four `marks`"),
        ("index: 5, marks: [[1, 0], [3, 1], [6, 2], [8, 3]], drum: true", "needs its `turn`"),
        ("index: 30, marks: [[2, 0], [8, 10]]", "`index` within"),
        ("index: 5, marks: [[2, 0], [4, 10], [8, 5]]", "only rising or only falling"),
        ("index: 5, marks: [[2, 0], [[4, 4], 10]]", "not both"),
        ("index: 5, marks: [[2, 0], [8, 0.1]], turn: 360", "more than 50 times as long as its window"),
    ],
    "window: [[10, 10], [70, 10], [70, 25], [10, 25]], digits: {name: nav1_mhz, %s}": [
        ("pattern: '000.00', shows: '1 8.30'", "is not written as 000.00"),
        ("pattern: '...', shows: '...'", "needs a `pattern` of digits"),
        ("pattern: '##', shows: '  '", "draw it on a picture in which the display is on"),
        ("pattern: '118.00', shows: '118.30'", "needs `0` or `#` in its `pattern` for each digit"),
        ("pattern: '0000000000000000', shows: '1234567890123456'", "more digits .* than the 15 that"),
        ("pattern: '-00', shows: '-11'", "begins with -: signs are not read"),
        ("pattern: \"=cmd|'/c calc'!A0\", shows: \"=cmd|'/c calc'!A1\", text: true", "begins with ="),
        ('pattern: "0\\n0", shows: "1\\n1"', "not printable"),
    ],
    "ball: {name: a, %s}": [
        ("tube: [[1, 2, 3], [4, 5, 6]], width: 9", "three places"),
        ("tube: [[1, 2, 3], [1, 2, 3], [1, 2, 3]], width: 9", "elsewhere"),
        ("tube: [[10, 50, -1], [60, 60, 0], [110, 50, 1]], width: 1000", "radius of its bend"),
        ("tube: [[10, 50, -1], [60, 60, 0], [110, 50, 1]], width: x", "ball.width"),
        ("tube: [[.nan, 2, 3], [4, 5, 6], [7, 8, 9]], width: 9", r"ball.tube\[0\]\[0\]"),
    ],
    f"{ROUND}, scale: [[258, 0], [438, 180]], wraps: 360, attitude: {{roll: a, %s}}": [
        ("pitch: b, window: 49, ladder: [[0, 0]]", "attitude.ladder: needs two"),
        ("pitch: b, window: 49, ladder: [[0, 0], [10, 5], [20, 3]]", "attitude.ladder: must be monotone"),
        ("pitch: b, window: 90, ladder: [[0, 0], [10, 5]]", "`window` must lie within"),
        ("pitch: b, window: 49, ring: 20, ladder: [[0, 0], [10, 5]]", "`ring` must lie between"),
        ("pitch: b, window: 49, ring: 69.6, ladder: [[0, 0], [10, 5]]", "two pixels within the gauge's outer `radius`"),
        ("pitch: a, window: 49, ladder: [[0, 0], [10, 5]]", "two names"),
    ],
    f"{ROUND}, scale: [[258, 0], [438, 180]], wraps: 360, card: {{name: a, index: 270}}, needles: [{{name: b, %s}}]": [
        ("template: {at: 9, span: 16}, on_card: c, scale: [[0, 0], [90, 90]]", "its own `scale` needs `wraps`"),
        ("template: {at: 9, span: 16}, on_card: c", "`on_card` needs a `scale` of its own"),
    ],
    f"{ROUND}, scale: [[258, 0], [438, 180]], wraps: 360, card: {{name: a, index: 270, ring: %s}}, "
    "needles: [{name: b, template: {at: 9, span: 16}}]": [
        ("3", "`ring` must lie within"),
        ("69.6", "two pixels or more from the outer one"),
    ],
}


@pytest.mark.parametrize(
    ("gauge", "problem"), [(gauge % part, problem) for gauge, parts in WRONG.items() for part, problem in parts]
)
def test_what_does_not_go_with_its_kind_is_said(gauge: str, problem: str) -> None:
    """With the words of the panel format."""
    document = f"name: p\npicture: p.png\nanchors: [{{name: a, box: [0, 0, 20, 20]}}]\ngauges: [{{name: g, {gauge}}}]"

    with pytest.raises(PanelError, match=problem):
        parse_panel(document.encode(), source="panel.yaml")
