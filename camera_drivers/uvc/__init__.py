"""The driver of USB cameras, or whatever Linux shows as a Video4Linux device that sends JPEGs.

In come a device's path, the settings that are wanted, a clock, and a reporter for what is no picture.
Out go frames, each a JPEG as the camera sent it, at the kernel's time for it; and lost ones by the kernel's count.
"""
