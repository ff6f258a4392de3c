"""The limits of this room.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| MAX_JOBS | 8 | processes | read a flight, if no number is asked for | more would wait for the main process |
| MIN_SHARED_BYTES | 48 Mi | bytes | of pictures worth sharing | loading the libraries again takes as long |
| BATCHES_HELD | 2 | batches | in a worker, and as many that wait for an older one | no one waits; memory stays flat |
| DEATHS | 2 | workers | that die over frames, or a flight, until it is given up | one may be an accident |
| PATIENCE_S | 300 | s | for one batch, until its worker counts as hanging | a batch takes a fraction of a second |
| PATIENCE_TIMES | 50 | - | and this many times the longest batch so far | on a slow machine all batches take longer |
"""

from __future__ import annotations

MAX_JOBS = 8
MIN_SHARED_BYTES = 48 * 2**20
BATCHES_HELD = 2
DEATHS = 2
PATIENCE_S = 300.0
PATIENCE_TIMES = 50
