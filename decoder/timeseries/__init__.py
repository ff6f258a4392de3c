"""Readings over time: flight data made of a flight file, their gaps and outliers, and how they compare with a truth.

In come readings frame by frame, or tables that were written before.
Out go flight data, and how accurate they are.
"""
