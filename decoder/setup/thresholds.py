"""The limits of this room: what is compared with something, or clips it.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| MIN_PART | 0.3 | - | of what the clearest needle changes, that a second one does | what moved on rendered flights |
| MAX_MOVE_PX | 5.0 | px | from a drawn ring to the one fitted | further off is another ring |
| MAX_FLATNESS | 0.66 | - | of a dial | seen from 70 degrees beside its axis |
| CLEARLY_NEARER | 0.75 | - | of a circle's miss, that an ellipse misses by | five numbers fit better than three |
| MOST_LEFT | 0.35 | - | of a pivot's displacement that a height may leave | else it is a badly drawn centre |
| KEPT_BYTES | 450 Mi | bytes | of pictures in memory | twenty of 18 MP in grey, one in colour |
"""

from __future__ import annotations

MIN_PART = 0.3
MAX_MOVE_PX = 5.0
MAX_FLATNESS = 0.66
CLEARLY_NEARER = 0.75
MOST_LEFT = 0.35
KEPT_BYTES = 450 * 2**20
