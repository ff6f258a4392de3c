"""What a film brings into a flight file: packets that belong together, and positions beside the pictures.

In come frames in the order in which they are decoded, and messages of positions.
Out go groups of frames in the order of time, each frame with what it takes to decode it, and positions as values.
"""
