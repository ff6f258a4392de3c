"""The limits of this room: what values are compared with, or clipped to.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| WORST_PX | 5.0 | px | largest misfit of reference points without a warning | a careful click is off by one |
"""

from __future__ import annotations

WORST_PX = 5.0
