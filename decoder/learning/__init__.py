"""The fit of a whole reader to a flight: needles, faces, pivots, and how surely; each kind learns its own looks itself.

In come a panel and a sample of a flight's own frames.
Out goes a reader that is tuned to them.
"""
