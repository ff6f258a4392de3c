"""Proposals: dials searched for step by step, tried on the flight, and sent to the page or written as a draft.

In come a session, the draft so far, and whether anybody still waits.
Out go proposals one by one as they are found, a `panel.yaml` of those that are whole, and better ways to draw a gauge.
"""
