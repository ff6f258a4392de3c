"""The driver of a Raspberry Pi's own cameras, by the program that comes with them, `rpicam-vid`.

In come the settings that are wanted, a clock, and a reporter for what is no picture.
Out go frames, each a JPEG or an H.264 access unit as the program wrote it, at the time that the sensor's metadata tell.
"""
