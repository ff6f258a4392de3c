"""The recorder, the box's daemon and commands: capture, segments on a failing disk, retention, recovery and evidence.

In come recorder.yaml, the frames and reports of a camera driver, and the files of earlier recordings.
Out go flight files that survive a power cut, a log as JSON lines, and what the commands say about recordings.
"""
