"""The mathematics of matching templates: correlation, coarse search, least squares, and layers that hide each other.

In come unwrapped gauges and templates as arrays; it knows of no instrument.
Out go rows, scores, shifts and their uncertainties.
"""
