"""The numbers that registration compares values with.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| MIN_GUESS_SCORE | 0.3 | NCC | of a feature used in a guess | before the last pixel is settled |
| MIN_FIRST_SCORE | 0.45 | NCC | of a rolled or blurred anchor, or a dial, that is found | by trial |
| LIKELY_SCORE | 0.6 | NCC | of a lone anchor, a needle below others, a card, a rival | by trial |
| SCORE_THRESHOLD | 0.8 | NCC | anything below is not found, or not read | the thesis, 3.2.1 and 3.2.3 |
| CLEAR_SCORE | 0.9 | NCC | needs no search, hides another, or shows the same over time | by trial |
| MAX_SCALE_CHANGE | 0.15 | 1 | from the usual scale, in a proposal by two anchors | a hand-held camera |
| MAX_ROLL_DEG | 14.0 | degrees | from the usual roll, in a proposal or of the level | a hand-held camera |
| MAX_PROPOSALS | 3 | 1 | motions that anchors agree on are tried | each costs a registration |
| CONSISTENT_PX | 2.5 | px | distance of a hit from the others' perspective | to the pixel, and blur |
| CERTAIN_SIGMAS | 1.5 | sigma | that a pivot's offset must exceed to be followed | 2.5 left one 0.9 px off |
| SIGNIFICANT_SIGMAS | 2.5 | sigma | that a motion or an offset must exceed to be accepted | one in eighty by chance |
| MAX_FEW_SHIFT_PX | 40.0 | px | from the usual place if only two of many anchors match | two may look like others |
| FEW_FAILED | 1 / 4 | 1 | of anchors; if more fail, they are at different depths | the simulator's cockpit |
| MOST_ANCHORED | 2 | 1 | times the panel picture that anchors may cover | each pixel is searched |
| FULL_STEPS | 4 | 1 | of least squares; later ones are halved | or two places alternate |
| SETTLED_PX | 0.01 | px | all further steps together | well below a sigma |
| MAX_STEP_PX | 6.0 | px | a longer step means that the frame is lost | half a patch's margin more |
| MAX_SHRINKAGE | 0.9 | 1 | ratio of steps; beyond it they are noise | by trial |
| MAX_SIGMA_PX | 0.25 | px | at a gauge, of a motion's model that may be used | a quarter of a pixel |
| MIN_SPREAD_LEVELS | 0.2 | levels | of contrast; less is rounding | whole grey levels have 0.29 |
| NOISE_LEVELS | 4.0 | levels | of noise in a sensor and a JPEG | measured at quality 75 to 90 |
| POINTS_ACROSS | 44 | 1 | of an anchor, or along the level edge | more share their noise |
| DIAL_POINTS_ACROSS | 48 | 1 | of a dial | by trial |
| MIN_REDUCED_PX | 14 | px | left of an anchor when the frame is reduced | by trial |
| MAX_REDUCTION | 3 | 1 | by which a frame is reduced | by trial |
| KEPT | 16 | 1 | zooms, registrations or levers are cached | memory |
| MAX_SIDE_PX | 1600 | px | of pictures for SIFT | finer detail only costs |
| RATIO | 0.75 | 1 | of the best to the second best match | Lowe 2004 |
| MIN_AGREEING | 16 | 1 | matches that agree on where the camera is | by trial |
| REACH | 1.25 | radii | around a dial that are used to locate it | its rim and case |
| BESIDE_PX | 20.0 | px | the same for a tiny one | its surroundings |
| BESIDE_SWEEP_DEG | 6.0 | degrees | beyond the sweep that belong to a dial | a needle's template |
| SEARCH_PX | 24 | px | around where the anchors put it that a dial is searched for | the simulator's cockpit |
| SPREADS_LEVELS | (25.0, 15.0, 10.0, 8.0, 6.0, 6.0) | levels | residual never an outlier, by step | by trial |
| TUKEY_SPREADS | 4.685 | spreads | of Tukey's biweight | 95 % efficient |
| MAX_BEND_PART | 0.06 | 1 | effect of another perspective at a dial's rim | at 35 degrees |
| MOST_SAMPLES | 8 * 10**6 | 1 | of a frame | forty gauges of 18 megapixels |
"""

MIN_GUESS_SCORE = 0.3
MIN_FIRST_SCORE = 0.45
LIKELY_SCORE = 0.6
SCORE_THRESHOLD = 0.8
CLEAR_SCORE = 0.9
MAX_SCALE_CHANGE = 0.15
MAX_ROLL_DEG = 14.0
MAX_PROPOSALS = 3
CONSISTENT_PX = 2.5
CERTAIN_SIGMAS = 1.5
SIGNIFICANT_SIGMAS = 2.5
MAX_FEW_SHIFT_PX = 40.0
FEW_FAILED = 1 / 4
MOST_ANCHORED = 2
FULL_STEPS = 4
SETTLED_PX = 0.01
MAX_STEP_PX = 6.0
MAX_SHRINKAGE = 0.9
MAX_SIGMA_PX = 0.25
MIN_SPREAD_LEVELS = 0.2
NOISE_LEVELS = 4.0
POINTS_ACROSS = 44
DIAL_POINTS_ACROSS = 48
MIN_REDUCED_PX = 14
MAX_REDUCTION = 3
KEPT = 16
MAX_SIDE_PX = 1600
RATIO = 0.75
MIN_AGREEING = 16
REACH = 1.25
BESIDE_PX = 20.0
BESIDE_SWEEP_DEG = 6.0
SEARCH_PX = 24
SPREADS_LEVELS = (25.0, 15.0, 10.0, 8.0, 6.0, 6.0)
TUKEY_SPREADS = 4.685
MAX_BEND_PART = 0.06
MOST_SAMPLES = 8 * 10**6
