"""The numbers that the fit to a flight compares values with.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| SAMPLE_FRAMES | 16 | frames | in a sample; if half are found, no other place is tried | more hardly change a face |
| LOOKED_AT | 6 | frames | tested for dials that move | each costs milliseconds per dial |
| IN_PLACE_PX | 0.05 | px | dials nearer to where the anchors put them do not move | the simulator's cockpit |
| STILL_PX | 6.0 | px | a camera that moved less at the corners shows no depth | the simulator's cockpit |
| DRAWN_PX | 0.1 | px | a pivot drawn nearer to where needles turn is not moved | by hand, enlarged |
| HAND_PX | 0.2 | px | how precisely a scale is drawn | other people's panels |
| MOST_MARK_PART | 0.01 | of the radius | error of marks by a hand that drew careless centres | by choice |
| SEARCHED_PART | 0.01 | of the radius | how precisely a search finds a pivot | its last steps |
| SETTLED_PX | 0.03 | px | convergence of a moved pivot, or a lift by pixels | a third of `DRAWN_PX` |
| NOISE_SPREADS | 6.0 | sigma | and these levels: the most that two pictures of the same differ by | beyond any chance |
| SEEN_PART | 0.4 | pixels | of a needle that is seen elsewhere in a frame | most, but for reflections |
"""

SAMPLE_FRAMES = 16
LOOKED_AT = 6
IN_PLACE_PX = 0.05
STILL_PX = 6.0
DRAWN_PX = 0.1
HAND_PX = 0.2
MOST_MARK_PART = 0.01
SEARCHED_PART = 0.01
SETTLED_PX = 0.03
NOISE_SPREADS = 6.0
SEEN_PART = 0.4
