"""The flight file: what an MCAP recording of a flight is, how it is written, and how it is read even when damaged."""
