"""A camera whose pictures were taken before.

In come a folder of JPEGs, or the segments of a recorded flight.
Out go frames at their own pace, by whatever clock is passed in.
"""
