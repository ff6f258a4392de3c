"""The limits of this room: what is compared with something, or clips it.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| STRAIGHT_DEG | 15.0 | deg | off level or plumb, of a line that is meant to be | instrument panels |
| WORST_PX | 5.0 | px | that reference points may miss by without a warning | a careful click is off by one |
"""

from __future__ import annotations

STRAIGHT_DEG = 15.0
WORST_PX = 5.0
