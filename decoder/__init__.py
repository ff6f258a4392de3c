"""The desk: turns the pictures of a flight file into flight data, with a status and an uncertainty for every value."""
