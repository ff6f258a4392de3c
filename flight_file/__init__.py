"""The flight file, the contract of box and desk: writing, reading, salvage, signing and verification of MCAP segments.

In come frames and reports, or files that may be damaged, cut off or forged.
Out go segments that are safe on the disk, whole frames in their order, and every loss and misfit by its place.
"""
