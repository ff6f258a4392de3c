"""The numbers that imaging compares values with.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| MIN_ROWS_PER_DEG | 2 | rows | of an unwrapped gauge; at most twice as many | more gained nothing at 104 px |
| COLUMN_PX | 1.5 | px | between columns | closer ones share their pixels |
| MIN_COLUMNS | 3 | 1 | of an unwrapped gauge | a needle needs a direction |
| MAX_COLUMNS | 64 | 1 | of an unwrapped gauge | more gain nothing |
| MAX_ENLARGEMENT | 30.0 | 1 | of frames relative to the panel picture, by size or zoom | the longest zoom lenses |
| MAX_BATCH_FRAMES | 40 | frames | in a batch | the cache |
| MAX_BATCH_PIXELS | 4 * 4896 * 3672 | px | in a batch, a byte each | four of the camera's largest pictures |
| LEAST_CONDITION | 2e-3 | 1 | of a map's equations; below it, several maps fit | points on one line |
| HAND_PART | 0.1 | 1 | error of hand-made marks (rim, ruler, line), as a part of the size | marked by hand |
| MAX_REFERENCE_MISS | 0.03 | spans | distance of reference points from one plane | measured by hand |
| AGREEMENT_INCHES | 1e-7 | inches | agreement required of three points, or the step with more | the thesis, 3.1.2 |
| LEAST_DAMPING | 1e-6 | 1 | of Levenberg's steps; below it there is none | by trial |
| TRUSTED_SIGMAS | 4.0 | sigma | distinguish two camera positions | one in 16,000 by chance |
| NEARLY_REAL | 0.3 | 1 | imaginary part of a root that still counts as a guess | a double root split by noise |
| MAX_SIDE_MISS | 0.05 | 1 | error of a guess in the triangle's third side | noise |
| THINNEST | 0.02 | 1 | width over length of points that are not a line | marked by hand |
| HALF | 0.5 | 1 | of a feature, a rim, a needle's contrast, of frames or ticks: half of them | by its meaning |
| SAME_POSE | 1e-5 | 1 | difference of two iterations that converged to one pose | they end at 1e-7 |
"""

MIN_ROWS_PER_DEG = 2
COLUMN_PX = 1.5
MIN_COLUMNS = 3
MAX_COLUMNS = 64
MAX_ENLARGEMENT = 30.0
MAX_BATCH_FRAMES = 40
MAX_BATCH_PIXELS = 4 * 4896 * 3672
LEAST_CONDITION = 2e-3
HAND_PART = 0.1
MAX_REFERENCE_MISS = 0.03
AGREEMENT_INCHES = 1e-7
LEAST_DAMPING = 1e-6
TRUSTED_SIGMAS = 4.0
NEARLY_REAL = 0.3
MAX_SIDE_MISS = 0.05
THINNEST = 0.02
HALF = 0.5
SAME_POSE = 1e-5
