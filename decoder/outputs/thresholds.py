"""The limits of this room: what values are compared with, or clipped to.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| PICTURE_PX | 1600 | px | width to which small frames are enlarged, and large pictures shrunk | a screen |
| CROP_PX | 720 | px | longer side of a gauge drawn alone, at least | a needle can be judged by eye |
| LARGEST_BYTES | 24 M | bytes | of a report; half may be pictures | can be mailed |
| MOST_FLAGS | 2000 | rows | of flags in a report | a browser can scroll them |
| MOST_LISTED | 10 | lines | of one kind that are listed singly | a terminal |
"""

from __future__ import annotations

PICTURE_PX = 1600
CROP_PX = 720
LARGEST_BYTES = 24_000_000
MOST_FLAGS = 2000
MOST_LISTED = 10
