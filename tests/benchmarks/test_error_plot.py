"""The plots of docs/accuracy.md show what they are made of."""

from __future__ import annotations

import re
from typing import Any
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

    inside: list[list[tuple[Any, Any]]] = paths(text, "in")
    outside: list[list[tuple[Any, Any]]] = paths(text, "out")
    assert inside == [[(LEFT, middle), (LEFT + step, pytest.approx(middle - HALF * 0.5 / 1.1, abs=0.06))]]
    assert outside == [
        [
            (pytest.approx(LEFT + 3 * step, abs=0.06), pytest.approx(middle + HALF / 1.1, abs=0.06)),
            (RIGHT, pytest.approx(middle - HALF * 0.2 / 1.1, abs=0.06)),
        ]
    ]
    assert "50.0% in it" in text
    assert "A &amp; B" in text
