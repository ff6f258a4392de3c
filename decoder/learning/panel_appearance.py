"""The first appearance: what the panel's pictures alone tell of its instruments."""

from __future__ import annotations

from decoder.instruments.appearance import Appearance, DrawnInstrument
from decoder.instruments.kinds import kind_of
from decoder.matching.thresholds import SCORE_THRESHOLD
from decoder.registration.frame_placer import UnwrappedPanel


def appearance_from_panel(drawn: UnwrappedPanel) -> Appearance:
    """Let each instrument's kind look at the panel's own pictures.

    Raises
    ------
    PanelError
        If a gauge or a template does not fit its picture.
    """
    looks = []
    parts = zip(drawn.source.panel.gauges, drawn.grids, drawn.rims, drawn.gauges, strict=True)
    for index, (gauge, grid, rim, strip) in enumerate(parts):
        drawn.source.check_shows(rim, f"gauges[{index}]")
        looks.append(kind_of(gauge).first_look(DrawnInstrument(drawn.source, index, gauge, grid, strip)))
    # a needle cut from one picture need not match others better than any match must, whatever the light
    return Appearance.of(looks, evenly_lit_score=SCORE_THRESHOLD)
