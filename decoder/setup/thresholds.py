"""The limits of this room: what values are compared with, or clipped to.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| MIN_PART | 0.3 | - | of the clearest needle's change, for a second one | what moved on rendered flights |
| MAX_MOVE_PX | 5.0 | px | from a drawn ring to the fitted one | further off is another ring |
| MAX_FLATNESS | 0.66 | - | of a dial | seen from 70 degrees off its axis |
| CLEARLY_NEARER | 0.75 | - | of a circle's misfit: an ellipse is preferred | five parameters fit better than three |
| MOST_LEFT | 0.35 | - | of a pivot's displacement that a height may leave | more is a badly drawn centre |
| KEPT_BYTES | 450 Mi | bytes | of pictures in memory | twenty of 18 MP in grey, one in colour |
"""

from __future__ import annotations

MIN_PART = 0.3
MAX_MOVE_PX = 5.0
MAX_FLATNESS = 0.66
CLEARLY_NEARER = 0.75
MOST_LEFT = 0.35
KEPT_BYTES = 450 * 2**20
