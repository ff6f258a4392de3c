"""The driver of IP cameras, over RTSP.

In come a camera's address, who may look at it, a clock, and a reporter for what is no picture.
Out go frames, each an access unit of H.264 or H.265 as the camera sent it, at the time that its sender reports tell.
"""
