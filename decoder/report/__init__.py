"""`flight.html`: the flight data, what they rest on, and what was and was not checked, as one page for a browser."""
