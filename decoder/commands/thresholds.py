"""The limits of this room: what is compared with something, or clips it.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| WORST_PX | 5.0 | px | that reference points may miss by without a warning | a careful click is off by one |
"""

from __future__ import annotations

WORST_PX = 5.0
