"""How each kind of instrument is read: needles, pairs that touch or hide each other, stacks of three, and moving cards.

In come frames, and what is known of a panel's needles and faces.
Out goes a reading for each needle and frame: status, angle, score and uncertainty.
"""
