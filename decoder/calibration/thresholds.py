"""The limits of this room: what is compared with something, or clips it.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| MIN_TICKS | 5 | ticks | on a line; marks before a tilt is fitted | chance makes fewer |
| MIN_PERIOD_PX | 2.5 | px | between ticks | the picture's own resolution |
| PERIODIC | 0.2 | - | autocorrelation of ticks | noise, numerals and edges stay below |
| ALIKE | 0.85 | - | NCC of a tick with the mean tick | numerals that touch it stay below |
| PER_PX | 4 | 1/px | samples along a line | finer gains nothing |
| MIN_PHOTOGRAPHS | 3 | - | of a board at a zoom; zooms for a quadratic | as many unknowns |
| MIN_CORNERS | 12 | corners | of a ChArUco board in one photograph | fewer lie on a line |
| LEAST_TILT_DEG | 5.0 | deg | of the most tilted board | distance and focal length look alike below |
| SEARCHED_SIDE_PX | 2048 | px | longer side, to look for a chessboard in | 18 MP took 3 GB, so 0.6 |
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
