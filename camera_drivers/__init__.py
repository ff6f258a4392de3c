"""Camera drivers behind one protocol, `Camera`: the QX10 and its simulator, USB, Raspberry Pi and IP cameras, a replay.

In come a driver's settings, a clock, and a reporter for what is no picture.
Out go frames, each a picture as the camera sent it with its times and EXIF, or one sentence that says what to do.
"""
