"""The limits of this room: what values are compared with, or clipped to.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| STEP_S | 0.5 | s | between the clock offsets tried; a nearer one is the same | a quarter of a slow frame rate |
| MAX_COARSE_ROWS | 2000 | rows | of a flight used while offsets are tried | enough for the nearest step |
| MIN_ROWS | 12 | rows | that two curves must share to be compared | fewer fit by chance |
| MIN_OVERLAP | 0.3 | - | part of the flight's rows within the truth | with less, they fit by chance |
| NEEDED_PART | 0.95 | - | of a needle's values within a recorder's limit | a truth at 1 Hz is interpolated |
| SMALLEST_PART | 0.01 | - | of full scale; smaller outliers and drawing sigmas do not matter | rendered flights |
| BACK_PART | 1 / 3 | - | of how far an outlier went that may remain when it is back | steps stay above |
| SHORTER | 0.8 | - | ratio of lengths, either way, that counts as the same length | a few of each |
| MOST_STRETCHED | 4.0 | - | times the longest known stretch that a gap may be | other people's flights |
| MOST_TRIED | 400 | - | stretches used for one length | gives the scatter to a tenth |
| MAX_UNSTEADY_PART | 0.005 | - | of the engine's speed, 1 sigma; voices wander by more | drawn vowels |
| MIN_EVIDENCE | 50.0 | nats | by which a comb explains six seconds of sound better than chance | a distant fan had 43 |
| WINDOW_S | 10.0 | s | over which rates of two instruments are compared | three lags of a turn indicator |
| LEAST_KT | 40.0 | kt | at which an aircraft turns by its bank; below, it may taxi or hover | light aeroplanes stall |
| MIN_LEAD | 6.0 | nats | by which a speed explains them better than any other | 400 to 1 |
"""

from __future__ import annotations

STEP_S = 0.5
MAX_COARSE_ROWS = 2000
MIN_ROWS = 12
MIN_OVERLAP = 0.3
NEEDED_PART = 0.95
SMALLEST_PART = 0.01
BACK_PART = 1 / 3
SHORTER = 0.8
MOST_STRETCHED = 4.0
MOST_TRIED = 400
MAX_UNSTEADY_PART = 0.005
MIN_EVIDENCE = 50.0
WINDOW_S = 10.0
LEAST_KT = 40.0
MIN_LEAD = 6.0
