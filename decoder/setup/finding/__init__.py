"""Dials found in the panel picture, for people to accept: what is printed and what moves, each with its evidence.

In come the panel picture and aligned frames of the flight.
Out go proposed gauges, as `panel.yaml` has them, and what was not found.
"""
