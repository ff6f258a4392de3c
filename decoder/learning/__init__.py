"""The fit of a reader to a flight: what its needles and faces look like, where they turn, and how surely.

In come a panel and a sample of a flight's own frames.
Out goes a reader that is tuned to them.
"""
