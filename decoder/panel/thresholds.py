"""The limits of this room: what values are compared with, or clipped to.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| FOCAL_TOLERANCE | 0.005 | - | beyond a calibration's range that still counts as within | EXIF rounds focal lengths |
| BEYOND_SWEEP_DEG | 4.0 | degrees | beyond the sweep where a needle may be | the stop behind the last mark |
| MOST_NEEDLES | 200 | needles | of a panel | no cockpit has half as many |
| CONFIDENCE_SIGMAS | 1.96 | sigma | hold 95 % of errors | normal distribution |
| LEAST_DEG | 1e-3 | deg | between two marks of a scale | nearer ones are one, or a slip |
| LEAST_WINDOW_PX | 4.0 | px | a side of a window | fewer show nothing to read |
| LEAST_VALUE | 1e-9 | unit | between two marks, and of any divisor | slopes stay finite |
"""

from __future__ import annotations

FOCAL_TOLERANCE = 0.005
BEYOND_SWEEP_DEG = 4.0
MOST_NEEDLES = 200
CONFIDENCE_SIGMAS = 1.96
LEAST_DEG = 1e-3
LEAST_WINDOW_PX = 4.0
LEAST_VALUE = 1e-9
