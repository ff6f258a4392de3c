"""The limits of what is proposed to a person, who may take it or not: no reading goes by them.

Sources are pictures by others: simulators' cockpits, instruments of npm packages, photographs of gauges.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| ALIKE | 0.75 | - | letters of a word that a legend's word has in order | half of its letters hidden is no word |
| LEAST_LETTERS | 4 | letters | shorter words are compared whole | three letters are like many words |
| SAME_PLACE | 0.6 | of a text's height | two readings so near are of one text | its next neighbour is a height away |
| RING_PART | 0.17 | of their distance | numerals of one ring stand so near its middle | boxes of three digits around small dials |
| MOST_BEND | 1.65 | - | by which a unit's turn grows at most to the next numeral; the height of one on a ring too | an airspeed indicator bends by 1.3 |
| MOST_TURN_DEG | 200.0 | degrees | between two numerals of one scale | a half turn, and what is unread |
| NEAR_DEG | 7.0 | degrees | a numeral from its mark, or its place | wide numerals above small dials |
| OFF_DEG | 1.5 | degrees | a mark of an even scale from its place | half of what fine ticks are apart |
| LEAST_RUN | 3 | numerals | fewer are in order by chance | two always are |
| LEAST_WEIGHT | 2.5 | numerals | that look sure, for a place to be looked at | nearly three |
| ENOUGH | 4 | numerals | with a mark of their own tell a scale for sure | three in a row occur among radios' digits |
| LEAST_PX | 2.5 | px | a shorter stroke has no direction | a step in twice as many pixels is 10 degrees |
| MOST_PX | 60.0 | px | a longer one is a frame | the longest ticks of a large dial |
| FROM_LENGTHS | 1.2 | of a stroke's length | nearer it aims at nothing | ticks are far from their pivot |
| TO_LENGTHS | 22.0 | of a stroke's length | further its aim is lost | short ticks of wide dials |
| MISS_PART | 0.02 | of its distance | a stroke that aims at a pivot passes it so nearly | a degree |
| MISS_PX | 1.0 | px | and so much besides | half of a tick's breadth |
| NEAREST | 0.55 | of the numerals' distance | where ticks are looked for, from there | numerals within and without |
| FURTHEST | 1.5 | of the numerals' distance | and up to there | the same |
| LONGEST_PART | 0.4 | of its distance | a longer stroke is a hand's | ticks have a quarter |
| LEAST_STROKES | 8 | strokes | around a pivot | four ticks have as many edges |
| LEAST_TICKS | 5 | ticks | make a comb | five numbers of an ellipse |
| LEAST_APART_DEG | 0.6 | degrees | nearer are the two edges of one tick | 1 px on a dial of 200 |
| ALL_ROUND_DEG | 40.0 | degrees | a wider gap, and the comb tells no ellipse | an altimeter's window takes one tick in ten |
| RAGGED_PX | 0.8 | px | ends of ticks off their circle, by its place and shape | real dials had 0.7 at most, chance 1.1 |
| CLEAR_DIRECTIONS | 12.0 | of 18 | a place that is aimed at from so many is a dial's, whatever is printed | letters have fewer |
| CLEAR_TICKS | 11 | ticks | and has so many | bank marks of a horizon |
| MOST_HEIGHTS | 16.0 | of its height | a numeral is no further from its pivot | a compass numbered in tens has 12 |
| LEAST_RADIUS_PX | 12.0 | px | smaller dials show nothing | ticks of 2 px |
| LONG_PART | 0.25 | of the radius | a shorter edge of what moves is no hand's | hubs |
| NEAR_PART | 0.12 | of the radius | a hand's edges pass its pivot so nearly | parallax, and half its breadth |
| WORD_SHAPE | 2.5 | of its height | a longer text is a word whose line tells what is level | with 3 an index was a degree worse |
| MOST_ROLL_DEG | 20.0 | degrees | no camera is rolled further: what is, is printed so | words along rings |
| EDGE_PX | 2.0 | px | nearer to the edge of a part of the picture a text is cut | a box's own margin |
"""  # noqa: E501 - a table

from __future__ import annotations

ALIKE = 0.75
LEAST_LETTERS = 4
SAME_PLACE = 0.6
RING_PART = 0.17
MOST_BEND = 1.65
MOST_TURN_DEG = 200.0
NEAR_DEG = 7.0
OFF_DEG = 1.5
LEAST_RUN = 3
LEAST_WEIGHT = 2.5
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
