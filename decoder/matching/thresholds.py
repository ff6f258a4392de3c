"""Thresholds of matching. "Drawn" was found by trial on our own renderings, and is held by tests there.

The score below which a needle is missing is `SCORE_THRESHOLD` in `registration/thresholds.py`: anchors share it.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| FACE_NOISE_LEVELS | 1.0 | grey levels | a face with less contrast explains only noise | a quiet sensor's noise |
| OUTLIER_SPREADS | 3.5 | standard deviations | anything further off is something else | 1 in 2,000 of normal noise |
| MIN_CONTRAST_PART | 0.05 | of a needle's contrast | with less it is not a needle, and covers nothing | drawn |
| FADED_PART | 0.06 | of a needle's contrast | at the end of its blurred edge | drawn |
| OUTLINE_PART | 0.35 | of a needle's contrast | at its outline | other people's moving cockpit: with 0.3 a third more grossly off |
| MIN_HALF_PART | 0.3 | of the other half's contrast | a half with less is the dial beside the needle | drawn: needles with a dark half |
| SHOWN_PART | 0.2 | of a pixel | must be covered by the lower needle for it to show there | drawn |
| MIN_LIGHT_GAIN | 0.2 | of the usual contrast | in less light nothing is read | drawn |
| MIN_VIEWS | 3 | frames | needed to show a pixel of the face without a needle, or where the camera is; also failures until whole frames are decoded | least number that has a middle |
| MIN_VISIBLE | 0.15 | of a needle's contrast | with less visible, a template matches too many things | drawn |
| WHOLE_VISIBLE | 0.97 | of a needle's contrast | with more visible it is whole; as NCC: touching needles explain everything | drawn |
| MAX_FRACTION_ROWS | 0.75 | rows | a fit that points further belongs to another window | half a row, and half of that |
| MAX_PEAK_ROWS | 3.0 | rows | how far a fit may end from the peak of the search | the search's step |
| MAX_STEPS | 4 | windows | after this many moves a window is lost | each moves a row or more |
| SETTLED_ROWS | 0.2 | rows | two needles that move less have converged | a fifth of what a sliver is read to |
| SHOWN_PIXELS | 3.0 | original pixels | a lower needle that shows this much can be read | drawn |
| MUCH_BETTER | 0.8 | of what another leaves | a pair may leave at most this part of its upper needle's, a card's turn of any other's | drawn; a stranger's radio compass has 0.72 |
| SLIVER_THRESHOLD | 0.85 | NCC | required of a sliver: with few pixels it must match better than a whole needle | drawn |
| MIN_PAIR_CORRELATION | 0.98 | NCC | required to read two needles, since it may be glare | drawn |
| REACH_PART | 0.12 | of the radius | how far from where they are drawn pivots are searched for | an ordinary hand |
| FAR_PART | 0.015 | of the radius | a pivot nearer to where it is drawn is left to tilts | half of what these can handle |
| FAR_GAIN | 0.95 | of what is unexplained | the most that a card's far pivot may leave, or the drawn one stays | other people's pictures, drawn by a careful hand |
| MOSTLY | 0.6 | 1 | of frames, in which a needle must be seen elsewhere; of the axes beside the drawn centre, that may pass beside another | more than half |
| MAX_CONDITION | 1e12 | - | beyond it a matrix has no inverse in double precision | its 16 digits |
"""  # noqa: E501 - a table

from __future__ import annotations

FACE_NOISE_LEVELS = 1.0
OUTLIER_SPREADS = 3.5
MIN_CONTRAST_PART = 0.05
FADED_PART = 0.06
OUTLINE_PART = 0.35
MIN_HALF_PART = 0.3
SHOWN_PART = 0.2
MIN_LIGHT_GAIN = 0.2
MIN_VIEWS = 3
MIN_VISIBLE = 0.15
WHOLE_VISIBLE = 0.97
MAX_FRACTION_ROWS = 0.75
MAX_PEAK_ROWS = 3.0
MAX_STEPS = 4
SETTLED_ROWS = 0.2
SHOWN_PIXELS = 3.0
MUCH_BETTER = 0.8
SLIVER_THRESHOLD = 0.85
MIN_PAIR_CORRELATION = 0.98
REACH_PART = 0.12
FAR_PART = 0.015
FAR_GAIN = 0.95
MOSTLY = 0.6
MAX_CONDITION = 1e12
