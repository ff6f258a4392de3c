"""The numbers that registration compares something with.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| MIN_GUESS_SCORE | 0.3 | NCC | a feature may count in a guess | before the last pixel is settled |
| MIN_FIRST_SCORE | 0.45 | NCC | a rolled or blurred anchor, or a dial, is found | by trial |
| LIKELY_SCORE | 0.6 | NCC | an anchor that no other holds, a needle below others, a card, a rival | by trial |
| SCORE_THRESHOLD | 0.8 | NCC | what matches less is not found, or not read | the thesis, 3.2.1 and 3.2.3 |
| CLEAR_SCORE | 0.9 | NCC | what needs no search, hides another, or shows the same over time | by trial |
| MAX_SCALE_CHANGE | 0.15 | 1 | against the usual scale, of two anchors' proposal | a camera that is held |
| MAX_ROLL_DEG | 14.0 | degrees | against the usual roll, of a proposal or the level | a camera that is held |
| MAX_PROPOSALS | 3 | 1 | motions that anchors agree on are tried | each costs a registration |
| CONSISTENT_PX | 2.5 | px | a hit may be off the others' perspective | to the pixel, and blur |
| CERTAIN_SIGMAS | 1.5 | sigma | a pivot's offset must exceed to be followed | 2.5 left one 0.9 px off |
| SIGNIFICANT_SIGMAS | 2.5 | sigma | a motion or an offset must exceed to be believed | one in eighty by chance |
| MAX_FEW_SHIFT_PX | 40.0 | px | two of many anchors may hold a panel no further off | two may look like others |
| FEW_FAILED | 1 / 4 | 1 | of anchors: if more fail they lie at other depths | the simulator's cockpit |
| MOST_ANCHORED | 2 | 1 | times the panel picture that anchors may cover | each pixel is searched |
| TURNS_DEG | (-5.0, 5.0) | degrees | to which anchors are turned; more is held against SIFT | at four one matches |
| FULL_STEPS | 4 | 1 | of least squares; further ones are halved | or two places alternate |
| SETTLED_PX | 0.01 | px | all further steps together | well below a sigma |
| MAX_STEP_PX | 6.0 | px | a longer step says that the frame is lost | half a patch's margin more |
| MAX_SHRINKAGE | 0.9 | 1 | steps that shrink by less are noise | by trial |
| MAX_SIGMA_PX | 0.25 | px | at a gauge, of a motion's model that is used | a quarter of a pixel |
| MIN_SPREAD_LEVELS | 0.2 | levels | of spread: less is rounding | whole grey levels have 0.29 |
| NOISE_LEVELS | 4.0 | levels | of spread are a sensor's and a JPEG's noise | measured at quality 75 to 90 |
| POINTS_ACROSS | 44 | 1 | of an anchor, or along the level edge | more share their noise |
| DIAL_POINTS_ACROSS | 48 | 1 | of a dial | by trial |
| MIN_REDUCED_PX | 14 | px | an anchor keeps when the frame is made smaller | by trial |
| MAX_REDUCTION | 3 | 1 | by which a frame is made smaller | by trial |
| KEPT | 16 | 1 | zooms, registrations or levers are remembered | memory |
| MAX_SIDE_PX | 1600 | px | of pictures that SIFT looks at | finer detail only costs |
| RATIO | 0.75 | 1 | of the best to the second best match | Lowe 2004 |
| MIN_AGREEING | 16 | 1 | matches that agree on where the camera stands | by trial |
| REACH | 1.25 | radii | around a dial that hold it in place | its rim and case |
| BESIDE_PX | 20.0 | px | the same of a tiny one | what is beside it |
| BESIDE_SWEEP_DEG | 6.0 | degrees | beyond the sweep that belong to a dial | a needle's template |
| SEARCH_PX | 24 | px | from where the anchors have it a dial is looked for | the simulator's cockpit |
| SPREADS_LEVELS | (25.0, 15.0, 10.0, 8.0, 6.0, 6.0) | levels | least spread of no outlier, by step | by trial |
| TUKEY_SPREADS | 4.685 | spreads | of Tukey's biweight | 95 % efficient |
| MAX_BEND_PART | 0.06 | 1 | that another perspective may do at a dial's rim | at 35 degrees |
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
TURNS_DEG = (-5.0, 5.0)
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
