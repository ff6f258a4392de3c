"""Kinds that are read in a window of four corners: lamps, displays of digits, pointers on straight scales, tapes.

In come windows sampled from corner to corner, with what is around them.
Out go readings that count pixels along the window, or the value itself.
"""
