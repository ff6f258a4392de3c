"""Kinds that turn on a dial: needles one by one, in pairs, stacks and gears; cards, needles over them, balls, horizons.

In come dials unwrapped around their centres.
Out go readings whose angles lie on the dial.
"""
