"""Video in a flight file: which packets belong together, so that a picture can be decoded without the whole film.

In come frames in the order in which they are decoded.
Out go groups of frames in the order of time, each frame with what it takes to decode it, or why it cannot be.
"""
