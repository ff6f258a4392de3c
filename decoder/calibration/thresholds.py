"""The limits of this room: what values are compared with, or clipped to.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| MIN_TICKS | 5 | ticks | on a line; also marks for fitting a tilt | chance makes fewer |
| MIN_PERIOD_PX | 2.5 | px | between ticks | the picture's own resolution |
| PERIODIC | 0.2 | - | autocorrelation of ticks, at least | noise, numerals and edges stay below |
| ALIKE | 0.85 | - | NCC of a tick with the mean tick, at least | ticks touching a numeral stay below |
| PER_PX | 4 | 1/px | samples along a line | finer gains nothing |
| MIN_PHOTOGRAPHS | 3 | - | of a board at a zoom; also zooms for a quadratic | as many unknowns |
| MIN_CORNERS | 12 | corners | of a ChArUco board in one photograph | fewer may be on a line |
| LEAST_TILT_DEG | 5.0 | deg | of the most tilted board | below, distance and focal length are inseparable |
| SEARCHED_SIDE_PX | 2048 | px | longer side in a chessboard search | 18 MP took 3 GB, so 0.6 |
| MOST_PIXELS | 2^25 | px | of a photograph | more than hand-held cameras make |
"""

from __future__ import annotations

MIN_TICKS = 5
MIN_PERIOD_PX = 2.5
PERIODIC = 0.2
ALIKE = 0.85
PER_PX = 4
MIN_PHOTOGRAPHS = 3
MIN_CORNERS = 12
LEAST_TILT_DEG = 5.0
SEARCHED_SIDE_PX = 2048
MOST_PIXELS = 2**25
