"""Tuning: what is known of needles, dials and camera beyond the panel's description."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from decoder.alignment import Alignment
from decoder.needle_template import NeedleTemplate
from decoder.unwrapping import UnwrappedGauge


@dataclass(frozen=True, slots=True)
class Tuning:
    """First made from the panel picture alone (`panel_tuning`), then from the flight's own frames (`flight_tuning`).

    Attributes
    ----------
    templates
        By needle.
    faces
        For each gauge in the panel's order, the unwrapped dial without needles, (rows, columns) float32.
    usual
        Where the camera mostly was.
    evenly_lit_score
        What a needle in even light scores at least. One that matches less well may stand in a light that changes over
        the dial, which moves its reading.
    """

    templates: Mapping[str, NeedleTemplate]
    faces: tuple[UnwrappedGauge, ...]
    usual: Alignment
    evenly_lit_score: float
