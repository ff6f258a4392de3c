"""The outputs of a flight: tables, messages, layouts, logs, annotated pictures, and the report with its page.

In come flight data and, where pictures are shown, the flight's frames once more.
Out go files, whole or not at all, the same bytes for the same flight.
"""
