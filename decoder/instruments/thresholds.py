"""Thresholds of the instruments. "Drawn" is what was found by trial on our own renderings, to be kept by tests there.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| CLEARLY_WORSE | 2.0 | of unexplained variance | a place that leaves no more than so many times the best may be the needle's | drawn: bugs, tails |
| SATURATED_LEVEL | 245.0 | grey levels | brighter pixels say nothing of what lies below | JPEG rings by some levels around 255 |
| SURE_SCORE | 0.95 | NCC | so well a sliver in a stack must match, and a needle that few frames show | drawn: altimeters |
| MISSING_SPREADS | 5.0 | sigma | what is further off is something else: a lamp from its states, a value from its neighbours, a clock | beyond any chance |
| DIMMEST_LEVELS | 25.0 | grey levels | a lamp that no frame taught adds so much light at least | a tenth of white |
| HALF_LIT | 0.45 | of a segment | a digit with more of another, or less of its own, is none | half, and what noise adds to it |
| STILL_ROWS | 0.01 | rows | a card that moves less has settled | a tenth of its sigma |
| FRAMES_TO_LEARN | 5 | frames | so many teach a face, a needle, a card or a pivot, or that a needle is missing | drawn |
| MIN_TURN_DEG | 20.0 | degrees | only a card that turned by so much tells itself from what stands still | drawn |
| HUBER_SPREADS | 2.0 | sigma | tilts that are further off count less | Huber: 1.5 to 2 |
| APART_DEG | 3.0 | degrees | needles further apart lie over other marks, and take no place from each other | a needle's width, the spacing of marks |
| MIN_PLACES | 3 | places | beyond one a needle that a pivot must be told by | two unknowns, one to spare |
| NEEDLE_PART | 0.015 | pixels | of its window that a needle fills at least | the thinnest of strangers' needles |
| CLEAR_PART | 0.2 | 1 | of the contrast around a needle that no glint changes it by | by choice |
| LEAST_SHARPNESS | 7.0 | blurs of an edge | as many high, printed digits that nobody taught are told from those that somebody did | drawn: five fonts |
| AT_HAND_PX | 2**18 | pixels | as many stay in a processor's cache until they are sampled | measured |
"""  # noqa: E501 - a table

from __future__ import annotations

CLEARLY_WORSE = 2.0
SATURATED_LEVEL = 245.0
SURE_SCORE = 0.95
MISSING_SPREADS = 5.0
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
AT_HAND_PX = 1 << 18
