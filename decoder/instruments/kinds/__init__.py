"""How each kind of instrument is learned and read: a module for each, or several where hands lie over each other.

In come unwrapped gauges and what a flight taught of them.
Out go readings with status, score and uncertainty.
"""
