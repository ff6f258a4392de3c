"""Where the panel, and each dial of it, lies in a frame.

In come grey frames and a panel with its picture.
Out go each frame's alignment with its uncertainty, or the reason why there is none, and the gauges unwrapped by it.
"""
