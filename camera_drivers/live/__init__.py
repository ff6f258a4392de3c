"""A camera that gives pictures by itself, whatever it is connected by: what its drivers share.

In come pictures of a source, as they arrive, with what is known of when they were taken and what was lost before them.
Out go frames, at the pace that was asked for, and an error once pictures stay away or stop changing.
"""
