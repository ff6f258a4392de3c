"""Thresholds of the instruments. "Drawn" was found by trial on our own renderings, and is held by tests there.

The score below which a needle is missing is `SCORE_THRESHOLD` in `registration/thresholds.py`: anchors share it.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| CLEARLY_WORSE | 2.0 | of unexplained variance | a rival place that leaves no more than this times the best may be the right one | drawn: bugs, tails |
| SATURATED_LEVEL | 245.0 | grey levels | brighter pixels tell nothing of what lies below | JPEG rings by some levels around 255 |
| SURE_SCORE | 0.95 | NCC | required of a sliver in a stack, and of a needle that few frames show | drawn: altimeters |
| BEYOND_CHANCE_SPREADS | 5.0 | sigma | anything further off is something else: a lamp from its states, a value from its neighbours, a clock | beyond any chance |
| DIMMEST_LEVELS | 25.0 | grey levels | the least light that an untaught lamp adds | a tenth of white |
| HALF_LIT | 0.45 | of a segment | more of another segment, or less of an own one, and it is not the digit | half, minus noise |
| STILL_ROWS | 0.01 | rows | a card that moves less has converged | a tenth of its sigma |
| FRAMES_TO_LEARN | 5 | frames | needed to learn a face, a needle, a card or a pivot, or that a needle is missing | drawn |
| MIN_TURN_DEG | 20.0 | degrees | a card must turn by this to be separated from what stands still | drawn |
| HUBER_SPREADS | 2.0 | sigma | tilts that are further off have less weight | Huber: 1.5 to 2 |
| APART_DEG | 3.0 | degrees | needles further apart lie over other marks, and do not compete for a place | a needle's width, the spacing of marks |
| MIN_PLACES | 3 | places | a needle must be at more places than this to determine a pivot | two unknowns, one to spare |
| NEEDLE_PART | 0.015 | pixels | the least part of its window that a needle fills | the thinnest of other people's needles |
| CLEAR_PART | 0.2 | 1 | of the contrast around a needle, more than glints change it | by choice |
| LEAST_SHARPNESS | 7.0 | blurs of an edge | height of digits at which unknown ones are told from known ones | drawn: five fonts |
| MIDDLE_PART | 0.7 | of the way to its middle | that the hand missed a needle by; the rest is its form or height | about 1 on photographs, about 0 on simulators |
| AT_HAND_PX | 2**18 | pixels | stay in a processor's cache until they are sampled | measured |
"""  # noqa: E501 - a table

from __future__ import annotations

CLEARLY_WORSE = 2.0
SATURATED_LEVEL = 245.0
SURE_SCORE = 0.95
BEYOND_CHANCE_SPREADS = 5.0
DIMMEST_LEVELS = 25.0
HALF_LIT = 0.45
STILL_ROWS = 0.01
FRAMES_TO_LEARN = 5
MIN_TURN_DEG = 20.0
HUBER_SPREADS = 2.0
APART_DEG = 3.0
MIN_PLACES = 3
NEEDLE_PART = 0.015
CLEAR_PART = 0.2
LEAST_SHARPNESS = 7.0
MIDDLE_PART = 0.7
AT_HAND_PX = 1 << 18
