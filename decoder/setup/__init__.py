"""The set-up page: a panel is drawn in the browser, tried on the flight meanwhile, and saved as `panel.yaml`."""
