"""Calibration: what the lens and the place of a camera are, from photographs of things whose size is known."""
