"""Limits of the proposals shown to a person, who may refuse them: no reading depends on these.

Sources are pictures by others: simulators' cockpits, instruments of npm packages, photographs of gauges.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| ALIKE | 0.75 | - | part of a word's letters found in order in a legend's word | with half of its letters hidden it is no word |
| LEAST_LETTERS | 4 | letters | shorter words are compared as a whole | words of three letters are often alike |
| SAME_PLACE | 0.6 | of a text's height | readings nearer together are of one text | its neighbour is a text's height away |
| SURE | 0.8 | - | least confidence in a number found by its glyphs | ticks read as 1 have less, most of them |
| RING_PART | 0.17 | of their distance | of the distance: spread of one ring's numerals around the middle one | boxes of three digits around small dials |
| MOST_BEND | 1.65 | - | largest ratio of the turns per unit from numeral to numeral; also of the heights of one ring's numerals | an airspeed indicator has 1.3 |
| MOST_TURN_DEG | 200.0 | degrees | largest turn between two numerals of one scale | a half turn, plus numerals not read |
| NEAR_DEG | 7.0 | degrees | largest distance of a numeral from its mark or its place | wide numerals above small dials |
| OFF_DEG | 1.5 | degrees | largest distance of a mark of an even scale from its place | half the spacing of fine ticks |
| LEAST_RUN | 3 | numerals | fewer may be in order by chance | two always are |
| ENOUGH | 4 | numerals | that have marks of their own establish a scale | three in a row occur among radios' digits |
| LEAST_PX | 2.5 | px | a shorter stroke has no direction | one pixel to the side, at twice the scale, is 10 degrees |
| MOST_PX | 60.0 | px | a longer stroke is a frame | the longest ticks of a large dial |
| FROM_LENGTHS | 1.2 | of a stroke's length | a stroke does not aim at anything nearer | ticks are far from their pivot |
| TO_LENGTHS | 22.0 | of a stroke's length | a stroke's aim is too uncertain beyond this | short ticks of wide dials |
| MISS_PART | 0.02 | of its distance | of the distance: how nearly a stroke that aims at a pivot passes it | a degree |
| MISS_PX | 1.0 | px | in addition to MISS_PART | half a tick's width |
| NEAREST | 0.55 | of the numerals' distance | ticks are looked for from here | numerals inside and outside the ticks |
| FURTHEST | 1.5 | of the numerals' distance | ticks are looked for up to here | the same |
| LONGEST_PART | 0.4 | of its distance | of the distance: a longer stroke belongs to a hand | ticks have a quarter |
| LEAST_STROKES | 8 | strokes | around a pivot | four ticks have as many edges |
| LEAST_TICKS | 5 | ticks | make a comb | an ellipse has five parameters |
| LEAST_APART_DEG | 0.6 | degrees | strokes nearer together are the two edges of one tick | 1 px on a dial of 200 |
| ALL_ROUND_DEG | 40.0 | degrees | with a wider gap a comb determines no ellipse | an altimeter's window covers one tick in ten |
| RAGGED_PX | 0.8 | px | largest misfit of the ticks' ends to their ellipse | real dials had at most 0.7, chance 1.1 |
| CLEAR_DIRECTIONS | 12.0 | of 18 | a place aimed at from this many is a dial's, whatever is printed | letters have fewer |
| CLEAR_TICKS | 11 | ticks | and has at least this many | bank marks of a horizon |
| MOST_HEIGHTS | 16.0 | of its height | largest distance of a numeral from its pivot | a compass numbered in tens has 12 |
| LEAST_RADIUS_PX | 12.0 | px | smaller dials show too little | ticks of 2 px |
| LONG_PART | 0.25 | of the radius | a moving edge shorter than this is not a hand's | hubs |
| NEAR_PART | 0.12 | of the radius | how nearly a hand's edges pass its pivot | parallax, and half its width |
| WORD_SHAPE | 2.5 | of its height | a longer text is a word, whose line shows what is level | with 3 an index was a degree worse |
| MOST_ROLL_DEG | 20.0 | degrees | a camera is rolled no further: such a text is printed so | words along rings |
| EDGE_PX | 2.0 | px | a text nearer to the edge of its part of the picture is cut | the margin of a box |
"""  # noqa: E501 - a table

from __future__ import annotations

ALIKE = 0.75
LEAST_LETTERS = 4
SAME_PLACE = 0.6
SURE = 0.8
RING_PART = 0.17
MOST_BEND = 1.65
MOST_TURN_DEG = 200.0
NEAR_DEG = 7.0
OFF_DEG = 1.5
LEAST_RUN = 3
ENOUGH = 4
LEAST_PX = 2.5
MOST_PX = 60.0
FROM_LENGTHS = 1.2
TO_LENGTHS = 22.0
MISS_PART = 0.02
MISS_PX = 1.0
NEAREST = 0.55
FURTHEST = 1.5
LONGEST_PART = 0.4
LEAST_STROKES = 8
LEAST_TICKS = 5
LEAST_APART_DEG = 0.6
ALL_ROUND_DEG = 40.0
RAGGED_PX = 0.8
CLEAR_DIRECTIONS = 12.0
CLEAR_TICKS = 11
MOST_HEIGHTS = 16.0
LEAST_RADIUS_PX = 12.0
LONG_PART = 0.25
NEAR_PART = 0.12
WORD_SHAPE = 2.5
MOST_ROLL_DEG = 20.0
EDGE_PX = 2.0
