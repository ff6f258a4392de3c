"""How obliquely dials are seen, from their own marks in the panel picture.

On a dial that is read all the way round, marks are even. Seen obliquely it appears as an ellipse, along which they
crowd together and draw apart. Whoever draws such a dial gives two of them, often a half turn apart, where an ellipse
does not show; in between, a needle would be read as if the dial were seen square on.
"""

from __future__ import annotations

import math
from dataclasses import replace

from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.planes import Squeeze
from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import Unwrapper, polar
from decoder.learning.drawn_points import squeeze_of
from decoder.matching.pivot_search import even_marks_squeeze
from decoder.panel.gauge import Gauge


def squeezes_of_marks(source: PanelPictures) -> tuple[Squeeze | None, ...]:
    """For each gauge of a panel, return how the view squeezes it, if the panel does not say and its marks show it."""
    source = source.with_planes()
    return tuple(
        _squeeze(source, index) if plane is None and _goes_round(gauge) else None
        for index, (gauge, plane) in enumerate(zip(source.panel.gauges, source.planes or (), strict=True))
    )


def _goes_round(gauge: Gauge) -> bool:
    """Whether all that a gauge shows is read all the way round."""
    return gauge.window is None and all(quantity.wraps is not None for quantity in gauge.quantities)


def _squeeze(source: PanelPictures, index: int) -> Squeeze | None:
    """Estimate it for one gauge, whose marks may lie beyond its needles, or as somebody drew many of them."""
    own = polar(source.grid(index))
    outer_px = float(own.radii_px[-1])
    inner_px, beyond_px = HALF * outer_px, (1.0 + HALF) * outer_px
    columns = math.ceil((beyond_px - inner_px) / own.column_px)
    wide = replace(own, inner_px=inner_px, columns=columns, tail_columns=0, mixture=None)
    (marks,) = Unwrapper([wide]).unwrap(source.picture, source.optics.own)
    return even_marks_squeeze(wide, marks) or squeeze_of(source.panel.gauges[index])
