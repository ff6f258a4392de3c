"""The limits of this room: what is compared with something, or clips it.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| MIN_LEVELS | 8.0 | levels | that a mark or a needle differs from the dial by | noise stays below |
| MIN_PART | 0.3 | - | of what the clearest needle changes, that a second one does | what moved on rendered flights |
| AWAY_PART | 0.5 | - | of the most that a frame differs, where a needle is away | half-way |
| MARGIN_DEG | 8.0 | deg | beyond the sweep that needles are looked for | a hand draws sweeps so well |
| FAINTEST | 0.45 | - | of a mark's light that counts as its outline | half, less the noise |
| REACH_PX | 3.0 | px | from a drawn ring to its edges on a small dial | a hand clicks to a pixel |
| REACH_PART | 0.04 | - | of the radius, on a large one | a hand is seldom nearer |
| MAX_MOVE_PX | 5.0 | px | from a drawn ring to the one fitted | further off is another ring |
| MAX_FLATNESS | 0.66 | - | of a dial | seen from 70 degrees beside its axis |
| CLEARLY_NEARER | 0.75 | - | of a circle's miss, that an ellipse misses by | five numbers fit better than three |
| MOST_LEFT | 0.35 | - | of a pivot's displacement that a height may leave | else it is a badly drawn centre |
| VIEW_PX | 2048 | px | width of a picture that the page shows | a screen |
| KEPT_BYTES | 450 Mi | bytes | of pictures in memory | twenty of 18 MP in grey, one in colour |
| MAX_BODY_BYTES | 2 Mi | bytes | of a request | a large panel takes a tenth |
"""

from __future__ import annotations

MIN_LEVELS = 8.0
MIN_PART = 0.3
AWAY_PART = 0.5
MARGIN_DEG = 8.0
FAINTEST = 0.45
REACH_PX = 3.0
REACH_PART = 0.04
MAX_MOVE_PX = 5.0
MAX_FLATNESS = 0.66
CLEARLY_NEARER = 0.75
MOST_LEFT = 0.35
VIEW_PX = 2048
KEPT_BYTES = 450 * 2**20
MAX_BODY_BYTES = 2 * 2**20
