"""Decoding on many processes and machines: one flight's batches with a journal, or a fleet of flights in an archive.

In come flights, by path or URL, and what they are decoded with.
Out go decoded flights in the order of their frames, and an index of what became of each.
"""
