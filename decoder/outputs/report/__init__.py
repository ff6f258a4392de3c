"""The report: one HTML page with all data of a flight and the pictures that matter most.

In come flight data, the panel with its pictures, what was checked of the recording, and the flight's frames once more.
Out go the page, its texts, flags and drawings.
"""
