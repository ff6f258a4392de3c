"""The plots of docs/accuracy.md show what they are made of."""

from __future__ import annotations

import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from benchmarks.error_plot import HALF, LEFT, RIGHT, STRIP, TOP, Track, error_svg

NAN = float("nan")
SVG = "{http://www.w3.org/2000/svg}"


def track(name: str, error: list[float], band: list[float]) -> Track:
    """One from plain numbers."""
    return Track(name, np.array(error), np.array(band))


def paths(text: str, kind: str) -> list[list[tuple[float, float]]]:
    """The dots of every strip that has some of this kind."""
    found = ET.fromstring(text).iter(f"{SVG}path")  # noqa: S314 - our own
    return [
        [(float(x), float(y)) for x, y in re.findall(r"M([\d.]+) ([\d.-]+)h0", path.attrib["d"])]
        for path in found
        if path.get("class") == kind
    ]


def test_every_error_is_a_dot_in_its_place() -> None:
    """Frames from left to right, the largest error nearly at the strip's limit, blue in the band and red outside."""
    text = error_svg("A & B", [track("n1", [0.0, 0.5, NAN, -1.0, 0.2], [0.6, 0.6, NAN, 0.6, 0.1])])
    middle, step = TOP + STRIP / 2, (RIGHT - LEFT) / 4

    assert paths(text, "in") == [[(LEFT, middle), (LEFT + step, pytest.approx(middle - HALF * 0.5 / 1.1, abs=0.06))]]
    assert paths(text, "out") == [
        [
            (pytest.approx(LEFT + 3 * step, abs=0.06), pytest.approx(middle + HALF / 1.1, abs=0.06)),
            (RIGHT, pytest.approx(middle - HALF * 0.2 / 1.1, abs=0.06)),
        ]
    ]
    assert "50.0% in it" in text
    assert "A &amp; B" in text


def test_each_needle_has_a_strip_and_a_band_without_its_gaps() -> None:
    """A gap in the values is a gap in the band; a needle that was never read says so."""
    text = error_svg("F", [track("a", [0.1, NAN, 0.1], [0.2, NAN, 0.2]), track("b", [NAN] * 3, [NAN] * 3)])
    shapes = [path.attrib["d"] for path in ET.fromstring(text).iter(f"{SVG}path")]  # noqa: S314 - our own

    assert sum(shape.endswith("Z") for shape in shapes) == 2
    assert "no value" in text
    assert text == error_svg("F", [track("a", [0.1, NAN, 0.1], [0.2, NAN, 0.2]), track("b", [NAN] * 3, [NAN] * 3)])
