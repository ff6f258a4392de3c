"""The set-up page: a panel is drawn in the browser, tried on the flight meanwhile, and saved.

In come a flight or a picture, and what somebody draws on it.
Out go `panel.yaml` and its pictures.
"""
