"""Two needles that nearly coincide: from where on they are read together, and what of the lower one is to be seen.

Too little of the lower needle shows for a search of its own, but what shows still pulls at the upper one.
"""

from __future__ import annotations

import math

import numpy as np

from decoder.lower_layer import LowerNeedle
from decoder.matching import Matcher

# A pixel shows the lower needle if that covers this much of it.
SHOWN_PART = 0.2
# What shows must be worth this many original pixels, or it may be anything.
MIN_SHOWN_PIXELS = 1.0
SURELY_SHOWN_PIXELS = 3.0
# A place for the lower needle must leave this much less unexplained than no lower needle, and than a mirrored pair.
MUCH_BETTER = 0.8
MIRROR_BETTER = 0.5
# A sliver is believed only where everything else is explained: a glare's edge beside a needle looks like one.
MIN_PAIR_CORRELATION = 0.98


def pair_reach_rows(upper: Matcher, lower: Matcher) -> int:
    """How far apart two needles' axes are tried."""
    return math.ceil((upper.half_width_rows + lower.half_width_rows) / 2) + 2


def hidden_reach_rows(upper: Matcher, lower: Matcher) -> float:
    """How far apart two needles' axes can be with too little of the lower one showing to tell."""
    apart = np.arange(upper.axis)
    layers = LowerNeedle(lower.template, upper.template.rows).at(upper.axis + np.stack([-apart, apart]).astype(float))
    shown = layers.shown(upper.template.transparency)
    pixels = shown.sum(axis=(2, 3), where=shown > SHOWN_PART) * upper.pixels_per_sample
    tells = (pixels >= SURELY_SHOWN_PIXELS).any(axis=0)
    return float(tells.argmax()) if tells.any() else float(upper.axis)
